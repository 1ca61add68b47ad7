"""The work of a worker process: it draws one mutation of a test case, writes it as a scenario, and runs it."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.deadlines import Deadlines
from foresee_dsl.errors import InputError
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import Project
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.fuzz import settings as s
from foresee_study.fuzz.mutation import Mutated, Mutator
from foresee_study.fuzz.quality import quality_of
from foresee_study.fuzz.records import MutatedRun
from foresee_study.fuzz.texts import Original, file_text, lines_of, text_of


@dataclass(frozen=True)
class Job:
    """One mutation to draw and run.

    Attributes:
        original: the unmutated test case.
        parent: lines of the mutated test case that is mutated again; "" for the original.
        cycle, number: cycle, and number of the mutation in it; cycle 0 is the run of the original.
        meaning: hash of the meaning of the original.
        settings: the settings of the fuzzing run.
        folder: folder of the mutated test cases, absolute.
        deadlines: wall times of the driver.
    """

    original: Original
    parent: str
    cycle: int
    number: int
    meaning: str
    settings: s.FuzzSettings
    folder: Path
    deadlines: Deadlines

    @property
    def name(self) -> str:
        """Return the name of the mutation in messages."""
        stem, case = self.original.file.stem, self.original.case
        return f"{stem}{'_' if case else ''}{case} {self.cycle}.{self.number}"


def run_job(job: Job) -> MutatedRun:
    """Draw mutations until one is possible; run it, and return the outcome."""
    started = time.perf_counter()
    original = _case(job.original, "", job.folder)
    if not job.cycle:
        return _run(job, original, "", "", started)
    parent = _case(job.original, job.parent, job.folder)
    refused, last_reason = 0, "no mutation was possible"
    while refused < s.TRIES:
        rng = _generator(job, refused)
        mutator = Mutator(parent, original, lines_of(job.parent), compile_test_case(parent), rng)
        mutated = mutator.all_changes() if job.settings.together else mutator.one_change()
        if mutated is not None:
            outcome = _run_or_refusal(job, mutated, started)
            if isinstance(outcome, MutatedRun):
                return replace(outcome, refused=refused)
            last_reason = outcome
        refused += 1
    wall_s, reason = time.perf_counter() - started, f"invalid: {last_reason}"
    return MutatedRun(what=last_reason, wall_s=wall_s, refused=refused, verdict=Verdict.INVALID, reason=reason)


def _run_or_refusal(job: Job, mutated: Mutated, started: float) -> MutatedRun | str:
    """Return the outcome of a mutation's run, or the reason why the mutation is refused."""
    text = text_of(mutated.lines)
    try:
        case = _case(job.original, text, job.folder)
        compile_test_case(case)
    except InputError as err:
        return err.diagnostics[0].message
    outcome = _run(job, case, text, mutated.what, started)
    if outcome.verdict is Verdict.INVALID:
        return outcome.reason
    if outcome.with_ in mutated.added and outcome.time_s < s.FIRST_S:
        return f"{outcome.with_} was hit after {outcome.time_s:.2f} s, which is too early for a driver to react"
    return outcome


def _run(job: Job, case: TestCase, text: str, what: str, started: float) -> MutatedRun:
    settings = job.settings
    result = run_test_case(case, settings.driver, settings.seed, deadlines=job.deadlines, rules=RulesMode.OFF)
    return MutatedRun.of(
        result,
        lines=text,
        what=what,
        wall_s=time.perf_counter() - started,
        quality=quality_of(result.trace),
        digest=result.trace.digest,
    )


def _generator(job: Job, again: int) -> np.random.Generator:
    """Return the random generator of a mutation.

    Its seed depends on the original, on the mutation's cycle and number, and on the number of refused draws.
    """
    parts = (job.meaning, job.settings.seed, job.cycle, job.number, again)
    return np.random.Generator(
        np.random.PCG64(int.from_bytes(hashlib.sha256("\n".join(map(str, parts)).encode()).digest()[:8], "big"))
    )


@lru_cache(maxsize=16)
def _case(original: Original, text: str, folder: Path) -> TestCase:
    """Return a mutated test case (without lines, the original), which is parsed from the text of its file like any
    other file.
    """
    if not text:
        return Project().test_case(f"{original.file}::{original.case}" if original.case else original.file)
    file = folder / "mutated.foresee"
    project = Project(overlay={file: file_text("mutated", original, file, text)})
    return project.test_case(f"{file}::{original.case}" if original.case else file)
