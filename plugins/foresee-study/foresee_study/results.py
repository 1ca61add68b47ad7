"""The results of a study's campaigns, read from its folder, for tables and figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from foresee_study.folder import StudyFolder
from foresee_study.fuzzed import Fuzzed
from foresee_study.halves import Half
from foresee_study.measured import Counted, MeasuredCampaign, MeasuredCase
from foresee_study.questions import HEAVY_WEATHER
from foresee_study.settings import BUNDLED, CHOSEN_S, DRIVERS, EXHAUSTIVE, POINTS, RANKERS, SECOND_ITERATION
from foresee_study.statistics import Pair
from foresee_study.statistics.bootstrap import Counts

TOGETHER = "all"
"""The name that stands for all drivers together."""


@dataclass(frozen=True)
class Results:
    """The campaigns of a study, for one half of the test cases.

    Attributes:
        preset: the preset of the questions' campaigns; campaigns with another preset (heavy weather) are selected by
            the name of that preset.
        fuzzings: DriveFuzz's results, for rq4.
        beside: campaigns of other studies, whose rankers and exhaustive searches the question `search` uses, too.
    """

    campaigns: tuple[MeasuredCampaign, ...]
    preset: str
    half: Half = Half.ALL
    fuzzings: tuple[Fuzzed, ...] = ()
    beside: tuple[MeasuredCampaign, ...] = ()

    @classmethod
    def of(cls, folder: StudyFolder, half: Half | None = None, beside: Sequence[StudyFolder] = ()) -> Results:
        """Read a study's results; by default for the half in its settings. `beside`: other studies' folders.

        Raises:
            ForeseeError: there are none.
        """
        settings = folder.read().settings
        half = half or settings.half
        return cls(
            tuple(_of_half(m, half) for m in folder.campaigns()),
            settings.preset,
            half,
            tuple(replace(f, seeds=tuple(s for s in f.seeds if half in (Half.ALL, s.half))) for f in folder.fuzzings()),
            tuple(_of_half(m, half) for other in beside for m in other.campaigns()),
        )

    def exhaustive(self, driver: str) -> tuple[MeasuredCampaign, ...]:
        """Return the exhaustive searches; see `with_beside`."""
        return tuple(m for m in self.with_beside(driver) if m.ranker == EXHAUSTIVE)

    def with_beside(self, driver: str) -> tuple[MeasuredCampaign, ...]:
        """Return the campaigns with a driver, the study's preset and clips of the chosen length, of this study and of
        those beside it; of two that are alike, this study's."""
        campaigns: dict[tuple[object, ...], MeasuredCampaign] = {}
        for m in (*self.campaigns, *self.beside):
            own = (m.driver, m.group, m.preset, m.clip_s) == (driver, BUNDLED, self.preset, CHOSEN_S)
            if own and m.seed - m.repetition < SECOND_ITERATION:
                campaigns.setdefault((m.ranker, m.seed, m.allocation, m.budget_s), m)
        return tuple(campaigns.values())

    @cached_property
    def drivers(self) -> tuple[str, ...]:
        """The drivers with results, those of `DRIVERS` first."""
        return _ordered({m.driver for m in self.campaigns}, DRIVERS)

    @cached_property
    def rankers(self) -> tuple[str, ...]:
        """The rankers with results, without the exhaustive search."""
        return _ordered({m.ranker for m in self.campaigns if m.budget_s is None} - {EXHAUSTIVE}, RANKERS)

    @cached_property
    def families(self) -> tuple[str, ...]:
        """The families of the bundled test cases, in the paper's order."""
        names = {case.family for m in self.campaigns if m.group == BUNDLED for case in m.cases}
        return tuple(sorted(names, key=lambda f: (not f.isdigit(), int(f) if f.isdigit() else 0, f)))

    @cached_property
    def readings(self) -> tuple[str, ...]:
        """The presets of the question rq2, the study's own first; without heavy weather, which is rq5's."""
        presets = {m.preset for m in self.campaigns} - {HEAVY_WEATHER}
        return _ordered(presets, (self.preset,))

    @cached_property
    def towns(self) -> tuple[str, ...]:
        """The other groups of test cases."""
        return tuple(sorted({m.group for m in self.campaigns} - {BUNDLED}))

    def of_campaign(
        self,
        driver: str,
        ranker: str,
        clip_s: float = CHOSEN_S,
        *,
        points: int = POINTS,
        family: str | None = None,
        group: str = BUNDLED,
        preset: str = "",
        second: bool = False,
    ) -> tuple[MeasuredCampaign, ...]:
        """Return a campaign's repetitions, with at most `points` risky points, of one family or of all.

        `preset`: by default the study's. `second`: whether to return those of rq4's second iteration.
        """
        campaigns = (
            m.only(family=family) if ranker == EXHAUSTIVE else m.only(family=family).first_points(points)
            for m in self.campaigns
            if (m.driver, m.ranker, m.clip_s, m.group) == (driver, ranker, clip_s, group)
            and m.preset == (preset or self.preset)
            and (m.seed - m.repetition >= SECOND_ITERATION) == second
        )
        return tuple(sorted(campaigns, key=lambda m: m.repetition))

    def pairs(self, driver: str, first: str, second: str, what: Counted, clip_s: float = CHOSEN_S,
              points: int = POINTS) -> list[Pair]:  # fmt: skip
        """Return the units on which two rankers are compared, with one driver or with all drivers; a unit is a usable
        test case in one repetition."""
        names = self.drivers if driver == TOGETHER else (driver,)
        own, other = (
            {
                (name, m.repetition, case.name): case.count(what)
                for name in names
                for m in self.of_campaign(name, ranker, clip_s, points=points)
                for case in m.usable
            }
            for ranker in (first, second)
        )
        units = sorted(own.keys() & other.keys(), key=lambda unit: (names.index(unit[0]), *unit[1:]))
        return [Pair(unit[2], unit[1], own[unit], other[unit], unit[0]) for unit in units]


def paired(
    first: Sequence[MeasuredCampaign], second: Sequence[MeasuredCampaign]
) -> tuple[list[MeasuredCampaign], list[MeasuredCampaign]]:
    """Return the campaigns of two rankers that are compared with each other, of one driver.

    Campaigns of equal repetition form a pair. The exhaustive search does not choose risky points at random: its single
    repetition is compared with each repetition of the other ranker, so that the comparison does not depend on one seed.
    """
    pairs = [
        (a, b)
        for a in first
        for b in second
        if a.repetition == b.repetition or (b.ranker == EXHAUSTIVE and len(second) == 1)
    ]
    return [a for a, _ in pairs], [b for _, b in pairs]


def _of_half(measured: MeasuredCampaign, half: Half) -> MeasuredCampaign:
    """Return the part of a campaign that lies in a half.

    Test cases of other towns belong to both halves, because no setting was chosen on them.
    """
    if half is Half.ALL or measured.group != BUNDLED:
        return measured
    return replace(measured, cases=tuple(case for case in measured.cases if case.half is half))


def counts_of(
    campaigns: Iterable[MeasuredCampaign], value: Callable[[MeasuredCase], float], *, divided_by: int = 1
) -> Counts:
    """Return a value of each usable test case, by driver and repetition, divided by a number."""
    return {
        (measured.driver, measured.repetition): {case.name: value(case) / divided_by for case in measured.usable}
        for measured in campaigns
    }


def mean(values: Iterable[float]) -> float | None:
    """Return the mean; None for no values."""
    numbers = list(values)
    return sum(numbers) / len(numbers) if numbers else None


def mean_count(campaigns: Sequence[MeasuredCampaign], what: Counted) -> float | None:
    """Return the mean number of collisions, findings or avoidable findings of a campaign's repetitions.

    None without repetitions, and for avoidable findings also if no reference driver drove the failures.
    """
    if what is Counted.AVOIDABLE and not all(m.driven_by_references for m in campaigns):
        return None
    return mean(m.count(what) for m in campaigns)


def total(values: Iterable[float | None]) -> float | None:
    """Return the sum of the values that are not None; None if there is no such value."""
    present = [value for value in values if value is not None]
    return sum(present) if present else None


def _ordered(names: Iterable[str], first: Sequence[str]) -> tuple[str, ...]:
    return tuple(sorted(names, key=lambda name: (first.index(name) if name in first else len(first), name)))
