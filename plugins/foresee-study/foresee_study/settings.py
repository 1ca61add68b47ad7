"""Settings of a study, and the campaigns that its questions need."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from foresee_dsl.campaign.settings import OPTION, Allocation, CampaignSettings, option
from foresee_dsl.derive.clipping.clip import DRIVES_S
from foresee_dsl.drivers.registry import handover_of, load_driver, reference_drivers
from foresee_dsl.language.campaign_values import CHILDREN_BOUNDS, DEFAULT_CHILDREN, RulesMode
from foresee_study.halves import Half
from foresee_study.search.searches import SEARCHES

BUNDLED = "bundled"
"""Name of the group of the study's own test cases; the group of a town has the town's name."""
DRIVERS = ("fusion_safe", "fusion", "pdm", "frenetix")
"""Drivers of a study. Ours: the two learned drivers stand for the paper's two; the two planners are additional."""
RANKERS = ("foresee", "random", "selforacle", "proximity", "careful")
REPETITIONS = 3
"""Number of repetitions (paper, section 4.4)."""
EXHAUSTIVE = "exhaustive"
EVERY_POINT = 1000
"""Number of risky points with which `exhaustive` uses all points of a test case: no test case has as many."""
POINTS = 4
"""Number of risky points, the paper's n_rp, in its best configuration (section 4.5, RQ1)."""
CHOSEN_S = 10.0
"""Length of clips in the paper's best configuration, s (section 4.5, RQ1)."""
SECOND_ITERATION = 1000
"""Difference between the seeds of rq4's two iterations. Ours: large enough that no seed is used twice."""
_APART = {OPTION: None}
"""Metadata of a setting without an option of its own."""


@dataclass(frozen=True)
class StudySettings:
    """Settings of a study. Each is declared once, with its option of `foresee study`; those without one are set from
    options that have other names or units.

    Attributes:
        drivers, rankers: the drivers and rankers under test.
        half: the half of the test cases.
        first: maximum number of test cases; None: all.
        repetitions: number of repetitions, each with its own seed.
        exhaustive_repetitions, exhaustive_drivers: repetitions of the exhaustive search, and how many of the first
            drivers it uses.
        seed: seed of the first repetition; each further repetition has the next seed.
        preset: preset of the mutations; results with `paper` are comparable with the paper's.
        readings: further presets with which rq2 is asked, other readings of what the paper does not state.
        children: number of mutants per clip.
        against: the reference drivers; None: the default ones.
        fuzz_repetitions, fuzz_cycles, fuzz_mutations: settings of DriveFuzz, for rq4; by default the paper's budget
            (section 4.5), about one mutated test case for each test case and iteration.
        towns: names of further groups of test cases, for rq5.
        searches: the searches from the literature, for the question `search`.
        budget_s: simulated time of a search's clips and mutants in each test case, s.
        allocation: how the rankers' campaigns of the question `search` divide mutants among clips.
    """

    drivers: tuple[str, ...] = field(default=DRIVERS, metadata=option("Drivers, separated by commas.", metavar="NAMES"))
    rankers: tuple[str, ...] = field(default=RANKERS, metadata=option("Rankers, separated by commas.", metavar="NAMES"))
    half: Half = field(default=Half.ODD, metadata=_APART)
    first: int | None = field(default=None, metadata=_APART)
    repetitions: int = field(
        default=REPETITIONS, metadata=option("Number of repetitions, each with its own seed.", (1, 100))
    )
    exhaustive_repetitions: int = field(default=1, metadata=_APART)
    exhaustive_drivers: int = field(default=1, metadata=_APART)
    seed: int = 0
    preset: str = "paper"
    children: int = field(
        default=DEFAULT_CHILDREN, metadata=option("Number of mutants per clip.", (1, CHILDREN_BOUNDS[1]))
    )
    against: tuple[str, ...] | None = field(
        default=None,
        metadata=option(
            "Reference drivers, separated by commas, or `none` for no driver; by default those of `campaign`.",
            metavar="DRIVERS",
        ),
    )
    fuzz_repetitions: int = field(default=1, metadata=_APART)
    fuzz_cycles: int = field(default=1, metadata=_APART)
    fuzz_mutations: int = field(default=1, metadata=_APART)
    towns: tuple[str, ...] = field(default=(), metadata=_APART)
    readings: tuple[str, ...] = field(
        default=(),
        metadata=option(
            "For rq2: further presets, other readings of the paper, such as paper_late,paper_brief.", metavar="PRESETS"
        ),
    )
    searches: tuple[str, ...] = field(
        default=tuple(SEARCHES), metadata=option("For search: the searches, separated by commas.", metavar="NAMES")
    )
    budget_s: float = field(default=POINTS * (1 + DEFAULT_CHILDREN) * CHOSEN_S, metadata=_APART)
    allocation: Allocation = field(
        default="even",
        metadata=option("For search: how rankers divide mutants among clips, even or adaptive.", metavar="NAME"),
    )

    @property
    def searched(self) -> tuple[str, ...]:
        """Return the drivers with which the exhaustive search is done."""
        return self.drivers[: self.exhaustive_drivers]


@dataclass(frozen=True)
class StudyCampaign:
    """One campaign that a question needs. Questions that need equal campaigns share one.

    Attributes:
        group: the group of test cases.
        clip_s: length of a clip, s (the paper's o_b + o_a).
        repetition: number of the repetition, from 0.
        seed: seed of all random choices.
        budget_s: simulated time of a search in each test case, s; None for a ranker's campaign.
        allocation: how mutants are divided among clips. Ours: `even`, so that a campaign with more risky points
            contains the clips of one with fewer.
    """

    group: str
    driver: str
    ranker: str
    clip_s: float
    repetition: int
    seed: int
    preset: str
    risky_points: int = POINTS
    children: int = DEFAULT_CHILDREN
    against: tuple[str, ...] | None = None
    budget_s: float | None = None
    allocation: Allocation = "even"

    @property
    def name(self) -> str:
        """Return the name of the campaign's file."""
        parts = [self.group, self.driver, self.ranker, f"{self.clip_s:g}s", self.preset, f"seed{self.seed}"]
        parts += [] if self.budget_s is None else [f"{self.budget_s:g}s"]
        parts += [] if self.allocation == "even" else [self.allocation]
        return re.sub(r"[^\w.+-]+", "_", "-".join(parts))

    def campaign(self) -> CampaignSettings:
        """Return the settings of the campaign; the driver is created once to read its hand-over time.

        Raises:
            ForeseeError: there is no such driver.
        """
        half_s = self.clip_s / 2
        return CampaignSettings(
            driver=self.driver,
            ranker=self.ranker if self.budget_s is None else EXHAUSTIVE,  # a search may begin at every second
            preset=self.preset,
            before_s=half_s,
            after_s=half_s,
            risky_points=self.risky_points,
            children=self.children,
            seed=self.seed,
            handover_s=handover_of(load_driver(self.driver), max(half_s - DRIVES_S, 0.0)),
            against=self._references,
            rules=RulesMode.OFF,  # the paper counts F1 to F5 and an ego that does not drive on as failures
            allocation=self.allocation,
        )

    @property
    def _references(self) -> tuple[str, ...]:
        if self.against is None:
            return reference_drivers(self.driver)
        return tuple(name for name in self.against if name != self.driver)
