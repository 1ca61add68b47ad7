"""Measures how often the judgement of a failure is right (`avoidance.responsibility`), with seeded faults.

A mutant that the healthy driver passes and the faulty one fails is the fault's, and so the driver's fault. The failures
that the healthy driver has itself are the others. Chance may decide such a label, so each is tried with other seeds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from foresee_dsl.avoidance.comparison import compared
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.avoidance.responsibility import Whose
from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps.case_reference import drive_failure
from foresee_dsl.campaign.steps.child import run_child
from foresee_dsl.campaign.steps.inputs import clip_of, mutant_of
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_study.faults.measures import Confusion
from foresee_study.faults.plug_in_path import address
from foresee_study.faults.table import table_lines
from foresee_study.settings import POINTS

HEALTHY = "pdm"
"""The driver into which the faults are seeded."""
WITNESSES = ("idm", "frenetix")
"""The reference drivers of the judgement; the healthy driver is not among them, because it gives the label."""
SEEDS = (1, 2, 3, 4)
"""Further seeds of the sensors' noise with which a label has to hold. Ours: a label that holds with all four would hold
in more than half of all runs with a probability of 94 %."""
FAULTS_EACH = 6
"""Number of faults with which a mutant is driven at most, until one makes it fail. Ours: one in twelve runs fails."""
NEAR_M, NEAR_S = 3.0, 2.5
"""Mutants with a smaller distance or time to collision are driven with faults. Ours: in others hardly a fault shows."""


@dataclass(frozen=True)
class JudgedFailure:
    """A failure with its label and its judgement.

    Attributes:
        name: name of the mutant or test case. fault: the fault that causes it; "" if the healthy driver fails itself.
        word, reason: the judgement. steady: whether the label does not depend on chance: it holds with all `SEEDS`,
            and a healthy driver that passes meets the same situation.
    """

    name: str
    fault: str
    word: Whose
    reason: str
    steady: bool


def measure_judgement(
    cases: Sequence[TestCase],
    faults: Sequence[str],
    strengths: Sequence[float],
    *,
    out: Path,
    jobs: int,
    ends_s: float,
    say: Callable[[str], None],
) -> tuple[JudgedFailure, ...]:
    """Return judged failures of the healthy driver's campaign, and of faulty drivers in the mutants that it passes.

    Args:
        faults: names such as `pdm/late_objects`. strengths: their strengths; both are drawn at random for each mutant.
        out: folder of the campaign. ends_s: time, as of `time.time`, after which no further mutant is driven.
        say: function that is called with a line for each failure.
    """
    settings = CampaignSettings(
        driver=HEALTHY, ranker="foresee", preset="focused", risky_points=POINTS, against=WITNESSES, rules=RulesMode.OFF
    )
    with Store(out / "store") as store:
        result = run_campaign(cases, settings, out=out / "campaign", store=store, options=RunOptions(jobs=jobs))
    by_id = {case.id: case for case in cases}
    failures = []
    for failure in (*_own(result, by_id), *_of_faults(result, by_id, faults, strengths, ends_s)):
        failures.append(failure)
        say(f"{failure.fault or HEALTHY} in {failure.name}: {failure.word}, {failure.reason}")
    return tuple(failures)


def _own(result: CampaignResult, cases: dict[str, TestCase]) -> Iterator[JudgedFailure]:
    """Yield the failures of the healthy driver."""
    runs: list[tuple[TestCase, CaseRunOutcome | ChildOutcome, str]] = [
        (cases[seed.id], seed, seed.id) for seed in result.seeds if seed.verdict.is_failure
    ]
    for clip in result.clips:
        parent = _clip_case(clip, cases)
        runs += [(_mutant_case(child, parent), child, child.name) for child in clip.failing]
    for case, run, name in runs:
        judgement = run.responsibility
        if judgement is not None:
            steady = all(_healthy(case, seed).verdict.is_failure for seed in SEEDS)
            yield JudgedFailure(name, "", judgement.whose, judgement.reason, steady)


def _of_faults(
    result: CampaignResult, cases: dict[str, TestCase], faults: Sequence[str], strengths: Sequence[float], ends_s: float
) -> Iterator[JudgedFailure]:
    """Yield the failures of faulty drivers in near misses of the healthy driver."""
    draw = np.random.default_rng(0)
    near = [(clip, child) for clip in result.clips for child in clip.children if child.passed and _is_near(child)]
    for clip, child in (near[k] for k in draw.permutation(len(near))):
        parent = _clip_case(clip, cases)
        case = _mutant_case(child, parent)
        for k in draw.permutation(len(faults))[:FAULTS_EACH]:
            if time.time() > ends_s:
                return
            driver = address(faults[k], float(draw.choice(strengths)))
            if run_test_case(case, driver, 0, rules=RulesMode.OFF).verdict.is_failure:
                yield from _judged(child, case, parent, driver, faults[k])
                break


def _judged(child: ChildOutcome, case: TestCase, parent: TestCase, driver: str, fault: str) -> Iterator[JudgedFailure]:
    setup = DriverSetup(driver, rules=RulesMode.OFF)
    outcome, failed = run_child(mutant_of(child.text), parent, Path(child.file), setup)
    references = tuple(_reference(witness, case, parent, failed) for witness in WITNESSES)
    judgement = replace(outcome, references=references).responsibility
    if judgement is None:
        return
    healthy = _healthy(case, 0)
    comparison = compared(failed.trace, healthy.trace, compile_test_case(case))
    passes = all(run.verdict is Verdict.PASS for run in (healthy, *(_healthy(case, seed) for seed in SEEDS)))
    steady = passes and (comparison.met or not comparison.apart)
    yield JudgedFailure(child.name, fault, judgement.whose, judgement.reason, steady)


def _reference(witness: str, case: TestCase, parent: TestCase, failed: RunResult) -> ReferenceRun:
    """Return a reference driver's run of a failing mutant."""
    setup = DriverSetup(witness, rules=RulesMode.OFF)
    run, _ = drive_failure(setup, case, lambda: setup.run(parent).verdict, failed.trace)
    return run


def _is_near(child: ChildOutcome) -> bool:
    near = child.near
    if near is None:
        return False
    close = near.distance_m is not None and near.distance_m.value < NEAR_M
    return close or (near.ttc_s is not None and near.ttc_s.value < NEAR_S)


def _clip_case(clip: ClipOutcome, cases: dict[str, TestCase]) -> TestCase:
    return expand_clip(clip_of(clip.text), cases[clip.seed], source=Path(clip.file))


def _mutant_case(child: ChildOutcome, parent: TestCase) -> TestCase:
    return expand_mutant(mutant_of(child.text), parent, source=Path(child.file))


def _healthy(case: TestCase, seed: int) -> RunResult:
    return run_test_case(case, HEALTHY, seed, rules=RulesMode.OFF)


def judgement_table(failures: Sequence[JudgedFailure]) -> str:
    """Return the accuracy for all failures, and for those whose label does not depend on chance, as Markdown."""
    rows = []
    for words, part in (("all", failures), ("with steady labels", [each for each in failures if each.steady])):
        c = Confusion.of([(bool(each.fault), each.word is Whose.DRIVER) for each in part])
        own, others = f"{c.true_yes} of {c.true_yes + c.false_no}", f"{c.true_no} of {c.true_no + c.false_yes}"
        rows.append((words, own, others, "-" if c.balanced is None else f"{c.balanced:.0%}"))
    head = ("failures", "the fault's, called the driver's", "others, called something else", "balanced accuracy")
    return "\n".join(table_lines(head, rows))
