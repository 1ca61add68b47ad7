"""The search approaches that are compared: each has a name and the settings of a campaign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.forecast.registry import RANKERS

PLAIN = "plain"
MANY_POINTS = 1000


@dataclass(frozen=True)
class Approach:
    """A search approach.

    Attributes:
        name: its name. settings: campaign settings that differ from the default; None: the test cases are driven
            unchanged, with one seed of the sensors' noise after the other.
    """

    name: str
    settings: Mapping[str, Any] | None = field(default_factory=dict)

    @property
    def missing(self) -> str:
        """Return, in words, why the approach is not available on this machine; "" if it is."""
        settings = {setting.name for setting in fields(CampaignSettings)}
        for name, value in (self.settings or {}).items():
            if name not in settings:
                return f"campaigns of this version have no setting {name!r}"
            if name == "ranker" and value not in RANKERS.names():
                return f"no ranker {value!r} is installed"
            if name == "preset" and value not in PRESETS:
                return f"there is no preset {value!r}"
        return ""


APPROACHES = {
    approach.name: approach
    for approach in (
        Approach(PLAIN, None),
        Approach("random", {"ranker": "random"}),
        Approach("proximity", {"ranker": "proximity"}),
        Approach("foresee", {"ranker": "foresee"}),
        Approach("paper", {"ranker": "foresee", "preset": "paper"}),
        Approach("careful", {"ranker": "careful", "preset": "avoidable"}),
        Approach("adaptive", {"ranker": "foresee", "allocation": "adaptive"}),
        Approach("careful-adaptive", {"ranker": "careful", "preset": "avoidable", "allocation": "adaptive"}),
        Approach("exhaustive", {"ranker": "exhaustive", "risky_points": MANY_POINTS}),
    )
}
DEFAULT = ("plain", "random", "proximity", "foresee", "careful", "exhaustive")
