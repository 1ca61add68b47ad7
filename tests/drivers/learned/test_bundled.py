"""The weights that come along: whole, and `fusion` arrives with them, in two workers with the same bits as here."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.learned.weights import FOLDER_VARIABLE, find_weights
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run

FILE = data_folder("scenarios") / "scenario3.foresee"


@pytest.fixture(autouse=True)
def _bundled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)


@pytest.mark.parametrize("name", ["fusion", "fusion_safe"])
def test_a_model_card_names_the_hash_of_its_weights(name: str) -> None:
    weights = find_weights(name)
    assert weights.file.stat().st_size < 16e6
    assert weights.sha256 in weights.file.with_suffix(".md").read_text(encoding="utf-8")


def test_fusion_arrives_in_two_plain_cases_the_same_in_two_workers() -> None:
    cases = load_test_cases([str(FILE)])[:2]
    results = [run(compile_test_case(case), load_driver("fusion")) for case in cases]
    assert [result.verdict for result in results] == [Verdict.PASS] * 2, [result.reason for result in results]
    command = [sys.executable, "-m", "foresee_dsl", "assess", str(FILE), "--first", "2", "--driver", "fusion"]
    done = subprocess.run([*command, "--jobs", "2", "--json"], capture_output=True, text=True, check=True)
    digests = {one["case"]: one["digest"] for one in json.loads(done.stdout)["runs"]}
    assert digests == {case.id: result.trace.digest for case, result in zip(cases, results, strict=True)}
