"""What a campaign does, shown in its report; and how it is done, which changes no result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from foresee_dsl.drivers.deadlines import Deadlines

Allocation = Literal["even", "adaptive"]
ALLOCATION: Allocation = "even"
"""How a campaign allocates its children to clips where it is not told."""
FIRST = 1
"""Children that each clip gets in the first round, with each seed."""


@dataclass(frozen=True)
class CampaignSettings:
    """Settings of a campaign.

    The defaults are the paper's best configuration (section 4.5, RQ1): clips of 10 s, four risky points a seed, four
    children a risky point; the preset `focused` is ours. Several drivers or rankers are several settings: with one
    store they share the runs that they have in common.

    Attributes:
        before_s, after_s: o_b and o_a, seconds of a clip before and after its risky point.
        risky_points: n_rp, how many risky points of a run are studied at most; points with the same clip are one.
        children: c, mutated children a clip.
        seed: of all random choices.
        fidelity_limit_m: a clip whose unmutated run deviates further from its parent is not mutated (ours: half a
            lane's free width beside a car, 0.75 m; beyond it the clip is another situation).
        handover_s: for so long at a clip's beginning the ego follows its recorded states while the driver watches. The
            command line takes what the driver asks for (`drivers.registry.handover_of`) where it is given none.
        repeat: clips are mutated so often, with `seed` and the seeds that follow it.
        against: the reference drivers, which drive every failing child as well.
        allocation: `even`: each clip gets `children`. `adaptive`: they get as many together, in rounds, each round
            where those before it found most.
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
    repeat: int = 1
    against: tuple[str, ...] = ()
    allocation: Allocation = ALLOCATION

    @property
    def first_children(self) -> int:
        """How many children a clip gets with each seed before anything is known of it: with `even`, all."""
        return self.children if self.allocation == "even" else min(self.children, FIRST)


@dataclass(frozen=True)
class Shard:
    """Part `number` (from 1) of `of` parts of a campaign, by a hash of each test case's key; 0: all of these parts.

    Where children are allocated in rounds, each part has rounds of its own, also where all parts are run together.
    """

    number: int = 0
    of: int = 1

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Read `2/8`, or `all/8`.

        Raises:
            ValueError: it is not two whole numbers, the first of them between 1 and the second.
        """
        first, slash, second = text.partition("/")
        number = "0" if first == "all" else first
        if not (slash and number.isascii() and number.isdigit() and second.isascii() and second.isdigit()):
            raise ValueError(f"{text!r} is no part of a campaign: write K/N, such as 2/8, or all/8")
        shard = cls(int(number), int(second))
        if not (1 <= shard.number <= shard.of or (first == "all" and shard.of)):
            raise ValueError(f"{text!r} is no part of a campaign: the parts of {shard.of} are 1 to {shard.of}")
        return shard

    def part(self, key: str) -> int:
        """Return the number of the part that a test case with this key belongs to."""
        return int(key[:12], 16) % self.of + 1

    def holds(self, key: str) -> bool:
        """Return whether a test case with this key is run."""
        return self.number in (0, self.part(key))


@dataclass(frozen=True)
class Limits:
    """What a run may take; a run that takes more is a result of its own (`timeout`, `crash`) and stops nothing else.

    Attributes:
        deadline_s: wall time of a run; None: `drivers.deadlines.STEADY_S` and `SLOWEST` times what is simulated.
        step_s: wall time of a driver's step; None: `drivers.deadlines.STEP_S`.
        memory_mb: memory of a worker.
        budget_s: wall time of the campaign, after which nothing more is begun; None: as long as it takes.
    """

    deadline_s: float | None = None
    memory_mb: float = 4096
    budget_s: float | None = None
    step_s: float | None = None

    @property
    def deadlines(self) -> Deadlines:
        """Those of a driver."""
        return Deadlines(self.step_s, self.deadline_s)

    def for_run(self, simulated_s: float) -> float:
        """Return the wall time that a run of so many simulated seconds may take."""
        return self.deadlines.for_run_s(simulated_s)
