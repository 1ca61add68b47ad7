"""The reason of a run that its driver broke names the last line of the driver's own code, or none of ours."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import new_driver
from foresee_dsl.drivers.consent import allowing
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.runner import run
from tests.support.scenes import Town

HELPER = """
def fail(*_):
    raise ValueError("no idea")

def deep(n):
    return deep(n + 1)
"""
MINE = """
from dataclasses import dataclass
import numpy as np
from foresee_dsl.drivers.protocol import Control, Trajectory
import failing_helper

class Mine:
    def reset(self, mission, vehicle, seed): pass
    def step(self, observation): return BODY

class Reset(Mine):
    def reset(self, mission, vehicle, seed): failing_helper.fail()

class Init(Mine):
    def __init__(self): failing_helper.fail()

class Name(Mine):
    @property
    def name(self): raise ValueError("no name")

@dataclass(frozen=True)
class Frozen(Mine):
    gain: float = 1.0

def generated():
    yield 0.0
    raise ValueError("no more")
"""


def broken(town: Town, folder: Path, body: str = "None", name: str = "Mine", before: str = "") -> RunResult:
    (folder / "failing_helper.py").write_text(HELPER)
    (folder / "mine.py").write_text(before + MINE.replace("BODY", body))
    address = f"python:{folder / 'mine.py'}:{name}"
    with allowing([address]):
        result = run(town.bundle([town.ego(("n01_n11", "n11_n21"), 30.0)]), new_driver(address))
    assert result.verdict is Verdict.CRASH
    return result


@pytest.mark.parametrize(
    ("body", "place"),
    [
        ("failing_helper.fail()", "failing_helper.py:3 (fail)"),
        ("np.apply_along_axis(failing_helper.fail, 0, np.eye(2))", "failing_helper.py:3 (fail)"),
        ("failing_helper.deep(0)", "failing_helper.py:6 (deep)"),
        ("Control(*generated())", "mine.py:27 (generated)"),
        ("np.linalg.inv(np.zeros((2, 2)))", "mine.py:9 (Mine.step)"),
        ("Control(0.0)", "mine.py:9 (Mine.step)"),
        ("exec('raise KeyError(3)')", "mine.py:9 (Mine.step)"),
        ("observation.nothing", "mine.py:9 (Mine.step)"),
    ],
)
def test_a_reason_names_the_last_line_of_the_drivers_code(town: Town, tmp_path: Path, body: str, place: str) -> None:
    assert broken(town, tmp_path, body).reason.endswith(f", at {place}")


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("Reset", "failing_helper.py:3 (fail)"),
        ("Init", "failing_helper.py:3 (fail)"),
        ("Name", "mine.py:19 (Name.name)"),
    ],
)
def test_also_before_its_first_step(town: Town, tmp_path: Path, name: str, place: str) -> None:
    result = broken(town, tmp_path, name=name)
    assert result.reason.endswith(f", at {place}")
    assert "foresee_dsl" not in result.notes.traceback


@pytest.mark.parametrize(
    "body",
    [
        "None", "(0.0, 0.0)", "'left'", "Control(float('nan'), 0.0, 0.0)", "Trajectory(np.zeros(3), np.zeros((3, 2)))",
        "Trajectory('a', 'b')",
    ],
)  # fmt: skip
def test_an_answer_that_is_none_has_no_line(town: Town, tmp_path: Path, body: str) -> None:
    result = broken(town, tmp_path, body)
    assert ".py" not in result.reason and result.notes.traceback == ""
    assert result.reason.startswith("the driver raised ValueError: the driver answered")


def test_neither_has_a_file_that_cannot_be_executed(town: Town, tmp_path: Path) -> None:
    reason = broken(town, tmp_path, before="def f(:\n").reason
    assert reason == "the driver raised SyntaxError: invalid syntax (mine.py, line 1)"
    assert broken(town, tmp_path, before="import no_such_module\n").reason.endswith(", at mine.py:1 (<module>)")
    assert broken(town, tmp_path, name="Frozen").reason.endswith("cannot assign to field 'name'")


def test_a_reason_has_no_place_in_memory(town: Town, tmp_path: Path) -> None:
    assert "answered <object object>; it must" in broken(town, tmp_path, "object()").reason
    assert broken(town, tmp_path, "1 / 0 if exec('raise ValueError(object())') else 0").reason.startswith(
        "the driver raised ValueError: <object object>, at mine.py"
    )
