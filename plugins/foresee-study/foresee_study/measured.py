"""Measurements of one campaign that a study stores: a few values for each run, small enough to copy between machines.

The store has the complete results, but only for one version of the tool. The files of these measurements stay readable,
so that tables and figures can be made again later.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.halves import Half
from foresee_study.settings import EXHAUSTIVE


class Counted(StrEnum):
    """What is counted: collisions, their different stories (findings), or avoidable findings."""

    COLLISIONS = "collisions"
    FINDINGS = "findings"
    AVOIDABLE = "avoidable findings"


AVOIDERS: Mapping[str, str] = MappingProxyType(
    {"d": "another driver", "b": "R157's driver", "a": "the anticipating driver"}
)
"""The judges that may say that a failure is avoidable, by letter: a reference driver that also passes the unmutated
clip; UN R157's careful driver, which brakes; the anticipating driver."""


class Child(NamedTuple):
    """A mutant's run.

    `story`: for a failure, a hash that equal stories of a family share. `avoided_by`: the judges that avoid it, letters
    of `AVOIDERS`. `steered`: whether the mutation steered the actor into the ego (`story.contact`); None in files
    written before this was recorded.
    """

    verdict: Verdict
    simulated_s: float
    wall_s: float
    story: str = ""
    avoided_by: str = ""
    steered: bool | None = None


@dataclass(frozen=True)
class MeasuredClip:
    """A clip and its mutants.

    `simulated_s`, `wall_s`: times of its unmutated run (0 without one), and of mutants that do not count because this
    run fails or deviates. `position`: rank in its test case, from 0. `at_s`: its risky point in the test case's time,
    s; None in files written before this was recorded.
    """

    position: int
    verdict: Verdict
    simulated_s: float
    wall_s: float
    children: tuple[Child, ...] = ()
    at_s: float | None = None


@dataclass(frozen=True)
class MeasuredCase:
    """A test case's unmutated run, and its clips; it has clips only if it passed.

    `encounters_s`: times of all close encounters of this run, rising, s (step 1a of the forecaster: each least distance
    to an actor within its class's radius); None in files written before this was recorded, and for a run that did not
    pass.
    """

    name: str
    family: str
    half: Half
    verdict: Verdict
    simulated_s: float
    wall_s: float
    story: str = ""
    clips: tuple[MeasuredClip, ...] = ()
    encounters_s: tuple[float, ...] | None = None

    @property
    def passed(self) -> bool:
        """Return whether the test case is usable: like the paper, the study leaves out those that fail unmutated."""
        return self.verdict is Verdict.PASS

    @property
    def children(self) -> Iterator[Child]:
        """The mutants of all its clips."""
        return (child for clip in self.clips for child in clip.children)

    @property
    def derived(self) -> Iterator[MeasuredClip | Child]:
        """Its clips, each followed by its mutants."""
        for clip in self.clips:
            yield clip
            yield from clip.children

    @property
    def derived_s(self) -> float:
        """Return the simulated time of its clips and mutants, s."""
        return sum(run.simulated_s for run in self.derived)

    @property
    def fails(self) -> bool:
        """Return whether one of the mutants fails: it collides or gets stuck."""
        return any(child.verdict.is_failure for child in self.children)

    def count(self, what: Counted) -> int:
        """Return the number of collisions, findings or avoidable findings of its mutants."""
        return counted(self.children, what)

    def first_points(self, count: int) -> MeasuredCase:
        """Return the test case with at most `count` risky points."""
        return replace(self, clips=tuple(clip for clip in self.clips if clip.position < count))


@dataclass(frozen=True)
class MeasuredCampaign:
    """One campaign of a study.

    Attributes:
        group: the group of test cases: `bundled`, or the name of a town.
        driver, ranker, preset, before_s, after_s, risky_points, children: as in the campaign's settings.
        repetition: number of the repetition, from 0.
        seed: the campaign's seed.
        tool: the version that ran it.
        cases: the test cases.
        against: the reference drivers that drove each of its failures; None in files written before this was recorded.
        budget_s: simulated time of a search in each test case, s; None for a ranker's campaign.
        allocation: how mutants were divided among clips.
    """

    group: str
    driver: str
    ranker: str
    preset: str
    before_s: float
    after_s: float
    risky_points: int
    children: int
    repetition: int
    seed: int
    tool: str
    cases: tuple[MeasuredCase, ...]
    against: tuple[str, ...] | None = None
    budget_s: float | None = None
    allocation: str = "even"

    @property
    def driven_by_references(self) -> bool:
        """Whether reference drivers drove its failures, so that "another driver avoids it" can be counted.

        If the file does not record this, it is assumed, except for an exhaustive search in which no failure is avoided
        by another driver.
        """
        if self.against is not None:
            return bool(self.against)
        return self.ranker != EXHAUSTIVE or any("d" in child.avoided_by for child in self.children_run)

    @property
    def clip_s(self) -> float:
        """Return the length of the clips, s."""
        return self.before_s + self.after_s

    @cached_property
    def usable(self) -> tuple[MeasuredCase, ...]:
        """Return the test cases that passed unmutated."""
        return tuple(case for case in self.cases if case.passed)

    def first_points(self, count: int) -> MeasuredCampaign:
        """Return the results that the campaign would have had with at most `count` risky points per test case.

        With fewer points a test case has the first of the same clips; nothing else depends on the number.
        """
        return replace(self, risky_points=count, cases=tuple(case.first_points(count) for case in self.cases))

    def only(self, names: Iterable[str] | None = None, family: str | None = None) -> MeasuredCampaign:
        """Return the campaign with only these test cases, or with only the test cases of a family."""
        wanted = None if names is None else frozenset(names)
        kept = (c for c in self.cases if (wanted is None or c.name in wanted) and family in (None, c.family))
        return replace(self, cases=tuple(kept))

    @property
    def clips(self) -> int:
        """Return the number of risky points."""
        return sum(len(case.clips) for case in self.usable)

    @property
    def children_run(self) -> tuple[Child, ...]:
        """Return the mutants of all test cases."""
        return tuple(child for case in self.usable for child in case.children)

    def count(self, what: Counted) -> int:
        """Return the number of collisions, findings or avoidable findings."""
        return counted(self.children_run, what)

    def of_verdict(self, verdict: Verdict) -> int:
        """Return the number of mutants with a verdict."""
        return sum(child.verdict is verdict for child in self.children_run)

    @property
    def simulated_s(self) -> float:
        """Return the simulated time of clips and mutants, s, without the unmutated test cases, which are the same for
        each ranker.
        """
        return sum(case.derived_s for case in self.usable)

    @property
    def wall_s(self) -> float:
        """Return the wall time of clips and mutants on one core, s."""
        return sum(run.wall_s for case in self.usable for run in case.derived)


def avoided(measured: MeasuredCampaign, who: str) -> int:
    """Return the number of findings of which a judge (of `AVOIDERS`) avoids at least one failure."""
    children = measured.children_run
    return len({child.story for child in children if child.verdict.is_collision and who in child.avoided_by})


def counted(children: Iterable[Child], what: Counted) -> int:
    """Return the number of collisions among runs, or the number of their different stories."""
    collisions = [child for child in children if child.verdict.is_collision]
    if what is Counted.COLLISIONS:
        return len(collisions)
    return len({child.story for child in collisions if what is Counted.FINDINGS or child.avoided_by})
