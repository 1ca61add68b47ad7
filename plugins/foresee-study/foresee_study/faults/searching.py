"""Runs one search: a campaign of a faulty driver up to a limit of simulated time, and records its failures."""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from foresee_dsl.avoidance.r157.assessing import Preventable
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.avoidance.responsibility import Whose
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.execution.pool import RunOptions
from foresee_dsl.campaign.keys import driver_identity, step_code
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.project.document import TestCase
from foresee_study.faults import in_order
from foresee_study.faults.approaches import Approach
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

MOST_SEEDS = 50
"""Maximum number of seeds of the sensors' noise with which the plain test cases are driven. Ours."""


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
        base = CampaignSettings(driver=driver, against=against, seed=self.seed, rules=RulesMode.OFF)
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
    executor = in_order.InOrder(search.simulated_s)
    return tuple(_ran(_run(search.settings, cases, work, executor), executor, search))


def _plain(search: Search, cases: Sequence[TestCase], work: Path) -> tuple[ApproachRun, ...]:
    """Drive the unchanged test cases, with one seed of the sensors' noise after the other."""
    runs: list[ApproachRun] = []
    left_s = search.simulated_s
    for seed in range(search.seed, search.seed + MOST_SEEDS):
        executor = in_order.InOrder(left_s, in_order.PLAIN)
        result = _run(replace(search.settings, seed=seed), cases, work / str(seed), executor)
        runs += _ran(result, executor, search)
        left_s -= executor.simulated_s
        if left_s <= 0 or not executor.simulated_s:
            break
    return tuple(runs)


def _run(
    settings: CampaignSettings, cases: Sequence[TestCase], work: Path, executor: in_order.InOrder
) -> CampaignResult:
    with Store(work / "store") as store:
        options = RunOptions(executor=lambda _: executor)
        # An interrupted search begins from scratch, because the order of its runs is part of its result.
        store.execute("DELETE FROM runs")
        return run_campaign(cases, settings, out=work / "out", store=store, options=options)


def _ran(result: CampaignResult, executor: in_order.InOrder, search: Search) -> Iterator[ApproachRun]:
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
