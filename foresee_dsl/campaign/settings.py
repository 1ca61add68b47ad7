"""What a campaign does: one immutable record, shown in its report."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class CampaignSettings:
    """Settings of a campaign.

    The defaults are the paper's best configuration (section 4.6, RQ1): clips of 10 s, four risky points a seed, four
    children a risky point; the preset `focused` is ours.

    Attributes:
        before_s, after_s: o_b and o_a, seconds of a clip before and after its risky point.
        risky_points: n_rp, how many risky points of a run are studied at most.
        children: c, mutated children a clip.
        seed: every lot that is drawn comes from it.
        fidelity_limit_m: a clip whose unmutated run deviates further from its parent is not mutated (ours: half a
            lane's free width beside a car, 0.75 m; beyond it the clip is another situation).
        handover_s: for so long at a clip's beginning the ego follows its recorded states while the driver watches.
    """

    driver: str = "pdm"
    ranker: str = "foresee"
    preset: str = "focused"
    before_s: float = 5.0
    after_s: float = 5.0
    risky_points: int = 4
    children: int = 4
    seed: int = 0
    fidelity_limit_m: float = 0.75
    handover_s: float = 0.0

    def as_dict(self) -> dict[str, str | float | int]:
        """Return the settings by name."""
        return asdict(self)
