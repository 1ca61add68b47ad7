"""One test case, compiled and simulated with a driver; how its files are named, and for how long it is simulated."""

from __future__ import annotations

import os
from pathlib import Path

from foresee_dsl import __version__
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.placement.scene import DEFAULT_END_S
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.language.model import End, Quantity
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run


def run_test_case(case: TestCase, driver: str, seed: int) -> RunResult:
    """Compile a test case and simulate it with a fresh driver."""
    meta = {"test_case": case.id, "meaning": case.meaning, "tool": __version__, "seed": seed, "driver": driver}
    return run(compile_test_case(case), load_driver(driver), seed=seed, meta=meta)


def case_name(case: TestCase) -> str:
    """Return the name that a test case's files begin with: `red_light_runner_r02`."""
    if case.mutant is not None:
        return case.mutant.name
    if case.clip is not None:
        return case.clip.name
    name = case.id.partition("::")[2]
    return f"{case.scenario.name}_{name}" if name else case.scenario.name


def longest_s(case: TestCase) -> float:
    """Return for how many seconds a test case is simulated at most."""
    end = case.scenario.one(End)
    return float(end.after.si) if end is not None and isinstance(end.after, Quantity) else DEFAULT_END_S


def relative_path(target: Path, folder: Path) -> str:
    """Return how a file in `folder` names `target`: relative, with forward slashes."""
    return Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix()
