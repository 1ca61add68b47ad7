"""What the plug-in adds by entry points, what is said where it is missing, and what is in the keys of its results."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from foresee_study.fuzz import engine

from foresee_dsl.campaign.import_closure import import_closure
from foresee_dsl.cli.added import ADDED
from foresee_dsl.cli.store import TITLES
from foresee_dsl.forecast.registry import RANKERS
from foresee_dsl.plugins import BESIDE, package_of
from tests.support.command import foresee

MISSING = "comes with the plug-in foresee-study, which is not installed: pip install 'foresee-dsl[study]'"


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Everything that is installed here but the plug-ins of the repository."""
    site = tmp_path_factory.mktemp("site")
    for place in Path(sysconfig.get_paths()["purelib"]).iterdir():
        if place.name.startswith("foresee_dsl") or not place.name.startswith("foresee_"):
            (site / place.name).symlink_to(place)
    return site


def asked(site: Path, root: Path, *words: str, code: int) -> subprocess.CompletedProcess[str]:
    start = f"import sys; sys.path += [{str(root)!r}, {str(site)!r}]; from foresee_dsl.cli import main; main()"
    environment = {**os.environ, "COLUMNS": "200", "NO_COLOR": "1"}
    command = [sys.executable, "-S", "-c", start, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == code, done.stdout + done.stderr
    return done


def test_what_the_plug_in_offers_is_what_is_said_to_come_with_it() -> None:
    for group in (ADDED, RANKERS):
        ours = tuple(entry.name for entry in group.entries() if package_of(entry) == "foresee-study")
        assert ours == BESIDE["study"][group.name]


@pytest.mark.parametrize("command", ["study", "fuzz"])
def test_a_missing_command_is_answered_with_what_installs_it(command: str, without: Path, root: Path) -> None:
    assert f"The command '{command}' {MISSING}" in asked(without, root, command, "--help", code=2).stderr


def test_without_the_plug_in_all_else_works(without: Path, root: Path, scenarios: Path, tmp_path: Path) -> None:
    address = f"{scenarios / 'scenario9.foresee'}::r01"
    ran = json.loads(asked(without, root, "run", address, "--out", str(tmp_path), "--json", code=0).stdout)
    assert ran["verdict"] == "pass"
    refused = asked(without, root, "forecast", ran["trace"], "--ranker", "selforacle", code=1)
    assert refused.stderr == f"error: the ranker 'selforacle' {MISSING}\n"
    assert "Plug-ins" not in asked(without, root, "--help", code=0).stdout


def test_doctor_names_it_where_it_is_missing_and_where_it_is_not(without: Path, root: Path) -> None:
    def said(text: str) -> dict[str, str]:
        return {found["what"]: found["detail"] for found in json.loads(text)["findings"]}

    found = said(asked(without, root, "doctor", "--json", code=0).stdout)
    assert "foresee-study is not installed: pip install 'foresee-dsl[study]'" in found["plug-ins"]
    found = said(foresee("doctor", "--json").stdout)
    assert "foresee-study 0.1.0" in found["plug-ins"]
    assert found["commands of plug-ins"] == "fuzz (foresee-study), study (foresee-study)"


def test_the_key_of_a_mutated_test_case_has_the_code_that_mutates_it() -> None:
    closure = import_closure([engine._WORKER])
    assert {"foresee_study.fuzz.mutation", "foresee_study.fuzz.quality", "foresee_dsl.simulate.runner"} <= set(closure)
    assert "foresee_study.report" not in closure


def test_a_store_calls_its_results_as_before() -> None:
    assert TITLES == {engine.KIND: "mutated whole (foresee fuzz)"}
