"""Runs one search: a campaign of a faulty driver up to a limit of simulated time, and records its failures.

The approaches that are compared (`APPROACHES`) differ in the settings of the campaign. Its tasks run in this process,
one after the other (`InOrder`).
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from foresee_dsl.avoidance.r157.assessing import Preventable
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.avoidance.responsibility import Whose
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.keys import driver_identity, step_code
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps.step import StepResult, Work, run_steps
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import BrokenTask, Executor, RunOptions, TaskPart, Update
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.document import TestCase
from foresee_study.faults.evidence import (
    AHEAD,
    ANY,
    DIFFERENTIAL,
    DRIVERS,
    NOT_EXCUSED,
    R157,
    ApproachRun,
    Evidence,
    Failure,
)
from foresee_study.faults.evidence import load as load_evidence
from foresee_study.faults.evidence import save as save_evidence
from foresee_study.faults.plug_in_path import address, healthy
from foresee_study.settings import POINTS

MOST_SEEDS = 50
"""Maximum number of seeds of the sensors' noise with which the plain test cases are driven. Ours."""
MANY_POINTS = 1000
REFERENCES = frozenset({"reference", "case_reference"})
"""Steps that judge failures; the time that they simulate does not count."""
SEARCH_STEPS = frozenset({"seed", "forecast", "clip", "mutants", "child", "check"})
PLAIN_STEPS = frozenset({"seed"})


@dataclass(frozen=True)
class Approach:
    """A search approach.

    Attributes:
        name: its name. settings: campaign settings beside the ranker `foresee` and the preset `focused`; None: the test
            cases are driven unchanged, with one seed of the sensors' noise after the other.
    """

    name: str
    settings: Mapping[str, Any] | None = field(default_factory=dict)


APPROACHES = {
    approach.name: approach
    for approach in (
        Approach("plain", None),
        Approach("random", {"ranker": "random"}),
        Approach("proximity", {"ranker": "proximity"}),
        Approach("foresee", {"ranker": "foresee"}),
        Approach("paper", {"ranker": "foresee", "preset": "paper"}),
        Approach("careful", {"ranker": "careful", "preset": "avoidable"}),
        Approach("reach", {"ranker": "reach", "preset": "avoidable"}),
        Approach("adaptive", {"ranker": "foresee", "allocation": "adaptive"}),
        Approach("careful-adaptive", {"ranker": "careful", "preset": "avoidable", "allocation": "adaptive"}),
        Approach("exhaustive", {"ranker": "exhaustive", "risky_points": MANY_POINTS}),
    )
}
DEFAULT_APPROACHES = ("plain", "random", "proximity", "foresee", "careful", "exhaustive")


@dataclass(frozen=True)
class Search:
    """A fault at a strength, an approach, and its limit of simulated time.

    Attributes:
        judges: the drivers that drive each failure, in addition to the healthy driver.
    """

    fault: str
    strength: float
    approach: Approach
    simulated_s: float
    judges: tuple[str, ...] = ()
    seed: int = 0

    @property
    def settings(self) -> CampaignSettings:
        """Return the settings of the search's campaign."""
        driver, twin = address(self.fault, self.strength), healthy(self.fault)
        against = (twin, *(judge for judge in self.judges if judge != twin))
        base = CampaignSettings(
            driver=driver, ranker="foresee", preset="focused", risky_points=POINTS, against=against, seed=self.seed,
            rules=RulesMode.OFF,
        )  # fmt: skip
        return replace(base, **(self.approach.settings or {}))

    def key(self, cases: Sequence[TestCase]) -> str:
        """Return a hash of everything on which the result of the search depends: settings, drivers, test
        cases, code.
        """
        settings = self.settings
        drivers = [driver_identity(driver) for driver in (settings.driver, *settings.against)]
        code = step_code("foresee_dsl.campaign.execution.engine")
        parts = [asdict(settings), self.approach.name, self.simulated_s, drivers, [c.meaning for c in cases], code]
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


class InOrder(Executor):
    """Executes the tasks of a campaign in the order in which it would pass them to its workers.

    Attributes:
        simulated_s: simulated time of the search so far. order: kind, name and simulated time of each run.
    """

    def __init__(self, limit_s: float, kinds: frozenset[str] = SEARCH_STEPS) -> None:
        """Run steps of these kinds up to `limit_s` of simulated time, and afterwards only steps that judge failures."""
        super().__init__()
        self._limit_s, self._kinds = limit_s, kinds
        self.simulated_s = 0.0
        self.order: list[tuple[str, str, float]] = []

    def updates(self, stop: Callable[[], bool] = lambda: False) -> Iterator[list[Update]]:
        """See `Executor`; tasks that are not run are dropped, so that the campaign counts as stopped."""
        while self._queue and not stop():
            (number,) = self._queue.take()
            task = self._tasks.pop(number)
            work = task.argument
            if not isinstance(work, Work):
                raise TypeError(f"the task {task.name} is not a step of a campaign")
            kind = work.steps[0].kind
            if kind not in REFERENCES and (kind not in self._kinds or self.simulated_s >= self._limit_s):
                continue
            try:
                for step in run_steps(work):
                    self._count(step, task.name)
                    yield [Update(task, TaskPart(step))]
            except Exception as err:  # a step that fails has an outcome of its own
                yield [Update(task, BrokenTask(task, f"{type(err).__name__}: {err}", "raised"))]
            else:
                yield [Update(task, None)]

    def close(self) -> None:
        """Drop the remaining tasks."""
        self._queue.clear()
        self._tasks.clear()

    def _count(self, step: StepResult, task: str) -> None:
        record = step.record
        if not isinstance(record, CaseRunOutcome | ClipOutcome | ChildOutcome):
            return
        duration_s = record.duration_s if math.isfinite(record.duration_s) else 0.0
        self.simulated_s += duration_s
        self.order.append((step.kind, task if step.kind == "seed" else step.name, duration_s))


def searched(search: Search, cases: Sequence[TestCase], out: Path) -> Evidence:
    """Return the evidence of a search; an earlier result with the same code is read from `out`."""
    place = out / search.fault.replace("/", "_") / f"{search.strength:g}"
    file, key = place / f"{search.approach.name}.json", search.key(cases)
    stored = load_evidence(file, key)
    if stored is not None:
        return stored
    started = time.perf_counter()
    work = place / f"{search.approach.name}.work"
    runs = _plain(search, cases, work) if search.approach.settings is None else _campaign(search, cases, work)
    evidence = Evidence(
        search.fault, search.strength, search.approach.name, runs, round(time.perf_counter() - started, 2)
    )
    save_evidence(evidence, file, key)
    shutil.rmtree(work, ignore_errors=True)
    return evidence


def _campaign(search: Search, cases: Sequence[TestCase], work: Path) -> tuple[ApproachRun, ...]:
    """Run the search's campaign."""
    executor = InOrder(search.simulated_s)
    return tuple(_ran(_run(search.settings, cases, work, executor), executor, search))


def _plain(search: Search, cases: Sequence[TestCase], work: Path) -> tuple[ApproachRun, ...]:
    """Drive the unchanged test cases, with one seed of the sensors' noise after the other."""
    runs: list[ApproachRun] = []
    left_s = search.simulated_s
    for seed in range(search.seed, search.seed + MOST_SEEDS):
        executor = InOrder(left_s, PLAIN_STEPS)
        result = _run(replace(search.settings, seed=seed), cases, work / str(seed), executor)
        runs += _ran(result, executor, search)
        left_s -= executor.simulated_s
        if left_s <= 0 or not executor.simulated_s:
            break
    return tuple(runs)


def _run(settings: CampaignSettings, cases: Sequence[TestCase], work: Path, executor: InOrder) -> CampaignResult:
    with Store(work / "store") as store:
        options = RunOptions(executor=lambda _: executor)
        # An interrupted search begins from scratch, because the order of its runs is part of its result.
        store.execute("DELETE FROM runs")
        return run_campaign(cases, settings, out=work / "out", store=store, options=options)


def _ran(result: CampaignResult, executor: InOrder, search: Search) -> Iterator[ApproachRun]:
    """Yield the runs of a campaign in their order, with their failures."""
    failures = dict(_failures(result, search))
    for kind, name, duration_s in executor.order:
        yield ApproachRun(kind, duration_s, failures.get((kind, name)))


def _failures(result: CampaignResult, search: Search) -> Iterator[tuple[tuple[str, str], Failure]]:
    """Yield kind and name of each failing run, with its failure."""
    for seed in result.seeds:
        if seed.verdict.is_failure:
            yield ("seed", seed.id), _failure(seed, seed.family, seed.id, search)
    for clip in result.clips:
        for child in clip.failing:
            yield ("child", child.name), _failure(child, clip.family, clip.seed, search)


def _failure(run: CaseRunOutcome | ChildOutcome, family: str, case: str, search: Search) -> Failure:
    story, twin = run.story, healthy(search.fault)
    finding = (family, *story.signature) if story is not None else (family, run.verdict.value)
    references = {reference.driver: reference for reference in run.references}
    return Failure(
        finding=finding,
        sentence=story.sentence if story is not None else run.reason,
        case=case.rpartition("/")[2],
        healthy=references[twin].verdict.value if twin in references else "",
        verdicts=_verdicts(run, {name: ref for name, ref in references.items() if name != twin}),
    )


def _verdicts(run: CaseRunOutcome | ChildOutcome, others: Mapping[str, ReferenceRun]) -> dict[str, bool | None]:
    """Return, for each judge, whether the failure was avoidable."""
    r157 = run.preventability.verdict if run.preventability is not None else Preventable.UNKNOWN
    verdicts: dict[str, bool | None] = {R157: {Preventable.YES: True, Preventable.NO: False}.get(r157)}
    ahead = getattr(run, "anticipation", None)
    if ahead is not None:
        verdicts[AHEAD] = None if ahead.answer.origin == "undecided" else ahead.answer.preventable
    verdicts |= {name: reference.avoids for name, reference in others.items()}
    if others:
        verdicts[DIFFERENTIAL] = any(reference.avoids for reference in others.values())
    verdicts[ANY] = any(verdicts.values())
    # The healthy driver's run must not influence the judgement.
    judgement = replace(run, references=tuple(others.values())).responsibility
    if judgement is not None:
        verdicts[DRIVERS] = judgement.whose is Whose.DRIVER
        verdicts[NOT_EXCUSED] = judgement.whose in (Whose.DRIVER, Whose.ARGUABLE)
    return verdicts
