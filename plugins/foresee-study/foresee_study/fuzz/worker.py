"""What a worker does: it draws one mutation of a test case, writes it as a scenario, and runs that."""

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
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.loading import Project
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.fuzz import settings as s
from foresee_study.fuzz.mutation import Mutated, Mutator
from foresee_study.fuzz.quality import Quality, quality_of
from foresee_study.fuzz.records import Outcome
from foresee_study.fuzz.texts import Seed, file_text, lines_of, text_of


@dataclass(frozen=True)
class Job:
    """One mutation to be drawn and run.

    Attributes:
        parent: the lines of what is mutated ("": the seed itself). cycle, number: which mutation it is; cycle 0 is the
            seed, unmutated. folder: where mutated test cases will be, absolute.
    """

    seed: Seed
    parent: str
    cycle: int
    number: int
    meaning: str
    settings: s.FuzzSettings
    folder: Path
    deadlines: Deadlines

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.seed.file.stem}{'_' if self.seed.case else ''}{self.seed.case} {self.cycle}.{self.number}"


def run_job(job: Job) -> Outcome:
    """Draw a mutation until it is possible, and run it."""
    started = time.perf_counter()
    seed = _case(job.seed, "", job.folder)
    if not job.cycle:
        return _run(job, seed, "", "", started)
    parent = _case(job.seed, job.parent, job.folder)
    refused, last_reason = 0, "no mutation was possible"
    while refused < s.TRIES:
        rng = _generator(job, refused)
        mutator = Mutator(parent, seed, lines_of(job.parent), compile_test_case(parent), rng)
        mutated = mutator.all_changes() if job.settings.together else mutator.one_change()
        if mutated is not None:
            outcome = _run_or_refusal(job, mutated, started)
            if isinstance(outcome, Outcome):
                return replace(outcome, refused=refused)
            last_reason = outcome
        refused += 1
    wall_s, reason = time.perf_counter() - started, f"invalid: {last_reason}"
    return Outcome("", last_reason, Verdict.INVALID, "", reason, 0.0, 0.0, wall_s, Quality(), refused)


def _run_or_refusal(job: Job, mutated: Mutated, started: float) -> Outcome | str:
    """Return the run of a mutation, or why it is refused."""
    text = text_of(mutated.lines)
    try:
        case = _case(job.seed, text, job.folder)
        compile_test_case(case)
    except InputError as err:
        return err.diagnostics[0].message
    outcome = _run(job, case, text, mutated.what, started)
    if outcome.verdict is Verdict.INVALID:
        return outcome.reason
    if outcome.with_ in mutated.added and outcome.time_s < s.FIRST_S:
        return f"{outcome.with_} was hit after {outcome.time_s:.2f} s, too early to be avoided"
    return outcome


def _run(job: Job, case: TestCase, text: str, what: str, started: float) -> Outcome:
    result = run_test_case(case, job.settings.driver, job.settings.seed, deadlines=job.deadlines)
    return Outcome(
        lines=text,
        what=what,
        verdict=result.verdict,
        with_=result.with_,
        reason=result.reason,
        time_s=result.time_s,
        duration_s=result.duration_s,
        wall_s=time.perf_counter() - started,
        quality=quality_of(result.trace),
        digest=result.trace.digest,
    )


def _generator(job: Job, again: int) -> np.random.Generator:
    """Return a mutation's random generator, seeded by what is mutated, the mutation's place, and how often it was
    refused."""
    parts = (job.meaning, job.settings.seed, job.cycle, job.number, again)
    return np.random.Generator(
        np.random.PCG64(int.from_bytes(hashlib.sha256("\n".join(map(str, parts)).encode()).digest()[:8], "big"))
    )


@lru_cache(maxsize=16)
def _case(seed: Seed, text: str, folder: Path) -> TestCase:
    """Return a mutated test case (the seed itself for no text), read from its file's text as anybody will read it."""
    if not text:
        return Project().test_case(f"{seed.file}::{seed.case}" if seed.case else seed.file)
    file = folder / "mutated.foresee"
    project = Project(overlay={file: file_text("mutated", seed, file, text)})
    return project.test_case(f"{file}::{seed.case}" if seed.case else file)
