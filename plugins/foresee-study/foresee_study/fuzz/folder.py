"""Writes the results of a fuzzing run: `fuzz.json`, and `mutated/` with a folder of mutated test cases per seed."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

from foresee_dsl.files import write_whole
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
