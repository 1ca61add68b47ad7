"""Writes the results of a fuzzing run: `fuzz.json`, and `mutated/` with a folder of mutated test cases per seed."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

from foresee_dsl.files import write_whole
from foresee_dsl.report.builds.case_results import CaseResult, of_record
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.fuzz.records import FuzzResult, document

FOLDER = "mutated"
"""Name of the folder of the mutated test cases."""


def publish(result: FuzzResult, out: Path) -> None:
    """Write a result beside an earlier one, and replace the earlier one when it is complete.

    Raises:
        OSError: the folder cannot be created or written.
    """
    out.mkdir(parents=True, exist_ok=True)
    for left in out.glob(".fuzz-*"):
        shutil.rmtree(left, ignore_errors=True)
    work = out / f".fuzz-{os.getpid()}"
    (work / FOLDER).mkdir(parents=True)
    for case in result.seeds:
        for run in case.every:
            if run.outcome.lines:
                file = work / run.file
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(run.text, encoding="utf-8", newline="\n")
    if (out / FOLDER).is_dir():
        (out / FOLDER).replace(work / "old")
    (work / FOLDER).replace(out / FOLDER)
    write_whole(out / "fuzz.json", as_text(result))
    shutil.rmtree(work, ignore_errors=True)


def as_text(result: FuzzResult) -> str:
    """Return the content of `fuzz.json`."""
    return json.dumps(document(result), indent=2) + "\n"


def case_results(result: FuzzResult, out: Path) -> tuple[CaseResult, ...]:
    """Return a result for each test case without mutations, and for each mutation that is possible on the road.

    As in the exit code, expectations do not count: DriveFuzz searches for collisions and other failures of the driver.
    """
    driver, seed = result.settings.driver, result.settings.seed
    results = []
    for case in result.seeds:
        if case.plain is not None:
            results.append(of_record(replace(case.plain, broken_expectations=()), case.test_case, driver, seed))
        results += [
            of_record(replace(run.outcome, broken_expectations=()), str(out / run.address), driver, seed,
                      suite=case.test_case, name=run.name, details=(run.outcome.what,))
            for run in case.every
            if run.outcome.verdict is not Verdict.INVALID
        ]  # fmt: skip
    return tuple(replace(run, reproduce=f"{run.reproduce} --rules off") for run in results)
