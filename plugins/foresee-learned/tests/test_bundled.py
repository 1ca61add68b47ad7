"""The weights that come along: whole, and `fusion` arrives with them, in a worker with the same bits as here."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from foresee_learned.weights import FOLDER_VARIABLE, find_weights

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run
from tests.support.command import program

FILE = data_folder("scenarios") / "scenario3.foresee"


@pytest.fixture(autouse=True)
def _bundled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)


@pytest.mark.parametrize("name", ["fusion", "fusion_safe"])
def test_a_model_card_names_the_hash_of_its_weights(name: str) -> None:
    weights = find_weights(name)
    assert weights.file.stat().st_size < 16e6
    assert weights.sha256 in weights.file.with_suffix(".md").read_text(encoding="utf-8")


def test_the_wheel_carries_the_weights_and_no_training(root: Path, tmp_path: Path) -> None:
    source = root / "plugins" / "foresee-learned"
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path), str(source)]
    subprocess.run(command, check=True, capture_output=True)
    names = zipfile.ZipFile(next(tmp_path.glob("*.whl"))).namelist()
    weights = {file.name for file in (source / "foresee_learned" / "weights").iterdir()}
    assert {name.rpartition("/")[2] for name in names if name.startswith("foresee_learned/weights/")} == weights
    assert {name.partition("/")[0] for name in names} == {"foresee_learned", "foresee_learned-0.1.0.dist-info"}


def test_fusion_arrives_in_a_plain_case_the_same_in_a_worker() -> None:
    """With two workers: `test_runs.py`, whose networks are small."""
    case = load_test_cases([str(FILE)])[0]
    result = run(compile_test_case(case), load_driver("fusion"))
    assert result.verdict is Verdict.PASS, result.reason
    command = [program(), "assess", str(FILE), "--first", "1", "--driver", "fusion"]
    done = subprocess.run([*command, "--jobs", "1", "--json"], capture_output=True, text=True, check=True)
    (found,) = json.loads(done.stdout)["runs"]
    assert (found["case"], found["digest"]) == (case.id, result.trace.digest)
