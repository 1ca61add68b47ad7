"""The result of a campaign and its figures."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from foresee_dsl.avoidance.anticipating import Answer
from foresee_dsl.avoidance.r157.assessing import Preventable
from foresee_dsl.avoidance.responsibility import Whose
from foresee_dsl.campaign.goal import GoalCounts
from foresee_dsl.campaign.grouping import Finding, findings_of, in_order
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome, Minimised, Repeats
from foresee_dsl.campaign.settings import CampaignSettings, Shard
from foresee_dsl.derive.clipping.fidelity import share_within
from foresee_dsl.documents import or_null, rounded, where_set
from foresee_dsl.language.document import family_order
from foresee_dsl.simulate.results.verdict import FAILURES, Verdict


@dataclass(frozen=True)
class FamilyRow:
    """Figures of one scenario family, or of all."""

    family: str
    cases: int
    cases_failed: int
    risky_points: int
    clips: int
    children: int
    failures: dict[str, int]
    simulated_s: float
    wall_s: float
    fidelity_median_m: float
    fidelity_max_m: float

    @property
    def cases_passed(self) -> int:
        """Return the number of test cases that passed."""
        return self.cases - self.cases_failed

    @property
    def failed(self) -> int:
        """Return the number of failures."""
        return sum(self.failures.values())

    @property
    def per_risky_point(self) -> float:
        """Return the failures per clip that was used."""
        return self.failed / self.clips if self.clips else 0.0

    @property
    def per_simulated_hour(self) -> float:
        """Return the failures per simulated hour, including seeds and clips."""
        return self.failed / (self.simulated_s / 3600) if self.simulated_s else 0.0


@dataclass(frozen=True)
class FidelityFigures:
    """Deviations of unmutated clips from their parents' runs: largest deviation per actor, m.

    `others`: number of other actors in all clips; `others_within`: share of these that stayed within 0.1 m.
    """

    clips: int
    others: int
    others_median_m: float
    others_within: float
    others_max_m: float
    ego_median_m: float
    ego_max_m: float


@dataclass(frozen=True)
class CampaignResult:
    """The complete result of a campaign; seeds and clips are sorted by name, independent of the order of execution."""

    settings: CampaignSettings
    seeds: tuple[CaseRunOutcome, ...]
    clips: tuple[ClipOutcome, ...]
    wall_s: float
    interrupted: bool = False
    broken: tuple[str, ...] = field(default=())
    """The steps that could not be run, one line each."""
    minimised: tuple[Minimised, ...] = ()
    """The minimised representatives of the findings, sorted by name."""
    repeats: Mapping[str, Repeats] = field(default_factory=dict)
    """Runs of the findings in other processes, by name."""
    shard: Shard = field(default_factory=Shard)
    """The part of the campaign that was run."""

    def row(self, family: str | None = None) -> FamilyRow:
        """Return the figures of one family, or of all."""
        seeds = [s for s in self.seeds if family is None or s.family == family]
        clips = [c for c in self.clips if family is None or c.family == family]
        children = [child for c in clips for child in c.children]
        counts = Counter(child.verdict for child in children)
        deviations = [c.largest_m for c in clips if not c.not_run]
        return FamilyRow(
            family=family or "all",
            cases=len(seeds),
            cases_failed=sum(not s.passed for s in seeds),
            risky_points=sum(s.risky_points for s in seeds),
            clips=len(clips),
            children=len(children),
            failures={kind.value: counts[kind] for kind in self.kinds},
            simulated_s=sum(sum(run.duration_s for run in runs) for runs in (seeds, clips, children)),
            wall_s=sum(s.wall_s for s in seeds) + sum(c.wall_s for c in clips),
            fidelity_median_m=statistics.median(deviations) if deviations else 0.0,
            fidelity_max_m=max(deviations, default=0.0),
        )

    @property
    def kinds(self) -> tuple[Verdict, ...]:
        """Return the kinds of failures that tables list."""
        return (*FAILURES, Verdict.GOAL) if self.settings.goal else FAILURES

    @cached_property
    def children(self) -> tuple[ChildOutcome, ...]:
        """Return the mutants of all clips."""
        return tuple(child for clip in self.clips for child in clip.children)

    @property
    def failed(self) -> bool:
        """Return whether a test case or mutant failed, or a run crashed."""
        return (
            any(not seed.passed for seed in self.seeds)
            or any(is_problem(clip.verdict, hangs=clip.hangs) for clip in self.clips)
            or any(is_problem(child.verdict, hangs=child.hangs) for child in self.children)
            or any(self.breaking)
        )

    @property
    def breaking(self) -> tuple[CaseRunOutcome | ChildOutcome, ...]:
        """Return the test cases and mutants that passed but broke an expectation."""
        return breaking_only(self.seeds, self.children)

    @property
    def fidelity(self) -> FidelityFigures:
        """Return the deviations of the unmutated clips from their parents' runs, the ego separately."""
        run = [clip for clip in self.clips if not clip.not_run]
        others = [far for clip in run for far in clip.others_m]
        egos = [clip.ego_m for clip in run]
        return FidelityFigures(
            clips=len(run),
            others=len(others),
            others_median_m=statistics.median(others) if others else 0.0,
            others_within=share_within(others),
            others_max_m=max(others, default=0.0),
            ego_median_m=statistics.median(egos) if egos else 0.0,
            ego_max_m=max(egos, default=0.0),
        )

    @property
    def families(self) -> tuple[str, ...]:
        """Return the families that occur, in the order of the paper's table; the empty one (no tag) last."""
        return tuple(sorted({s.family for s in self.seeds}, key=family_order))

    def avoidable(self, kind: Verdict | None = None) -> dict[Preventable, int]:
        """Return the number of failures (of one kind or all) by whether a careful driver would have avoided them."""
        counts = Counter(c.preventable for clip in self.clips for c in clip.failing if kind in (None, c.verdict))
        return {answer: counts[answer] for answer in Preventable}

    def anticipated(self) -> dict[Answer, int]:
        """Return the number of failures by the answer of the anticipating driver."""
        answers = [c.anticipation for clip in self.clips for c in clip.failing]
        counts = Counter(anticipation.answer for anticipation in answers if anticipation is not None)
        return {answer: counts[answer] for answer in Answer}

    def to_open_first(self, count: int = 5) -> tuple[ChildOutcome, ...]:
        """Return the failing mutants to inspect first.

        The driver's failures come first (`avoidance.responsibility`). Among equals, neighbours steered into the ego
        come last, and late failures before early ones; at most one mutant per clip until every clip has had its turn.
        """
        turns = ((k, child) for clip in self.clips for k, child in enumerate(sorted(clip.failing, key=_interest)))
        ordered = sorted(
            turns, key=lambda turn: (not turn[1].breaks_goal, _avoidable(turn[1]), turn[0], _interest(turn[1]))
        )
        return tuple(child for _, child in ordered[:count])

    def as_document(self) -> dict[str, object]:
        """Return the content of `campaign.json`; all values except `wall_s` are the same for the same inputs."""
        return {
            "driver": self.settings.driver,
            "ranker": self.settings.ranker,
            "preset": self.settings.preset,
            "settings": self.settings,
            "seeds": {"total": self.total.cases, "passed": self.total.cases_passed, "failed": self.total.cases_failed},
            "risky_points": self.total.risky_points,
            "clips": self.total.clips,
            "children": self.total.children,
            "failures": self.total.failures,
            "preventability": self.avoidable(),
            "anticipation": self.anticipated(),
            "fidelity_m": {
                "median": rounded(self.total.fidelity_median_m, 4),
                "max": rounded(self.total.fidelity_max_m, 4),
            },
            "fidelity": {
                "driver": self.settings.driver,
                "clips": self.fidelity.clips,
                "others": {
                    "actors": self.fidelity.others,
                    "median_m": rounded(or_null(self.fidelity.others_median_m), 4),
                    "within_0.1_m": rounded(self.fidelity.others_within, 4),
                    "max_m": rounded(or_null(self.fidelity.others_max_m), 4),
                },
                "ego": {
                    "median_m": rounded(or_null(self.fidelity.ego_median_m), 4),
                    "max_m": rounded(or_null(self.fidelity.ego_max_m), 4),
                },
            },
            "simulated_s": rounded(self.total.simulated_s, 2),
            "wall_s": rounded(self.wall_s, 2),
            "interrupted": self.interrupted,
            "broken": self.broken,
            "deterministic": self.deterministic,
            "test_cases": self.seeds,
            "clip_runs": self.clips,
            "findings": self.findings,
            "open_first": self.open_first,
            "goal": where_set(self.goal),
        }

    @cached_property
    def goal(self) -> GoalCounts | None:
        """Return how many runs break the campaign's goal; None without one."""
        if not self.settings.goal:
            return None
        return GoalCounts(
            name=self.settings.goal,
            test_cases=sum(seed.breaks_goal for seed in self.seeds),
            children=sum(child.breaks_goal for child in self.children),
            findings=sum(finding.run.breaks_goal for finding in self.findings),
            others=sum(child.verdict.is_failure and not child.breaks_goal for child in self.children),
        )

    @cached_property
    def total(self) -> FamilyRow:
        """Return the figures of all families."""
        return self.row()

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Return the findings (failures with the same story), completed by their minimised representatives, in the
        order of reports.
        """
        small = {record.child.name: record for record in self.minimised}
        return in_order(
            replace(finding, minimised=small.get(finding.name), repeats=self.repeats.get(finding.name))
            for finding in findings_of(self.seeds, self.clips)
        )

    @property
    def deterministic(self) -> bool | None:
        """Whether each finding that was run in several processes ended alike in all of them; None if there is no such
        finding.
        """
        return all(repeats.same for repeats in self.repeats.values()) if self.repeats else None

    @property
    def open_first(self) -> tuple[str, ...]:
        """Return the files of the failing mutants to inspect first."""
        return tuple(child.file for child in self.to_open_first())


def breaking_only(
    seeds: Iterable[CaseRunOutcome], children: Iterable[ChildOutcome]
) -> tuple[CaseRunOutcome | ChildOutcome, ...]:
    """Return the runs that passed but broke an expectation, test cases before mutants."""
    runs: list[CaseRunOutcome | ChildOutcome] = [*seeds, *children]
    return tuple(run for run in runs if run.verdict is Verdict.PASS and run.broken_expectations)


def is_problem(verdict: Verdict, *, hangs: bool = False) -> bool:
    """Return whether a clip's or mutant's run needs attention: the driver failed, crashed or hung.

    A mutant that begins in a contact needs no attention, nor does one that does not arrive within a clip's few seconds.
    """
    return verdict.is_failure or verdict is Verdict.CRASH or hangs


def _avoidable(child: ChildOutcome) -> int:
    """Return the rank by whose failure it is, the driver's first; without a story by the judges' answers."""
    if (judgement := child.responsibility) is not None:
        return judgement.whose.rank
    return (Whose.DRIVER if child.avoidable else Whose.UNAVOIDABLE if child.preventable is Preventable.NO
            else Whose.ARGUABLE).rank  # fmt: skip


def _interest(child: ChildOutcome) -> tuple[bool, int, bool, bool, float, str]:
    return (
        not child.breaks_goal,
        _avoidable(child),
        "steer" in child.operators,
        child.verdict is Verdict.STUCK,
        -child.time_s,
        child.name,
    )


def sorted_outcomes(
    seeds: Iterable[CaseRunOutcome], clips: Iterable[ClipOutcome]
) -> tuple[tuple[CaseRunOutcome, ...], tuple[ClipOutcome, ...]]:
    """Return the test cases and the clips, each sorted independently of the order of execution."""
    return tuple(sorted(seeds, key=lambda s: s.id)), tuple(sorted(clips, key=lambda c: (c.seed, c.rank)))
