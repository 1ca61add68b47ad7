"""What the plug-in adds by entry points, what is said where it is missing, and what is in the keys of its results."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import typer
from foresee_study.fuzz import engine
from foresee_study.fuzz.settings import FuzzSettings
from foresee_study.settings import StudySettings

from foresee_dsl.campaign.import_closure import import_closure
from foresee_dsl.cli.added import ADDED
from foresee_dsl.cli.options.campaign_options import options_of_settings, settings_of
from foresee_dsl.cli.store import TITLES
from foresee_dsl.forecast.registry import RANKERS
from foresee_dsl.plugins import BESIDE, package_of
from tests.support.without_plug_ins import foresee_of, installed_without

MISSING = (
    "comes with the plug-in foresee-study, which is not installed: "
    "pip install ./plugins/foresee-study in a checkout of foresee-dsl"
)


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return installed_without(tmp_path_factory.mktemp("site"))


def test_what_the_plug_in_offers_is_what_is_said_to_come_with_it() -> None:
    for group in (ADDED, RANKERS):
        ours = tuple(entry.name for entry in group.entries() if package_of(entry) == "foresee-study")
        assert ours == BESIDE["study"][group.name]


@pytest.mark.parametrize("command", ["study", "fuzz"])
def test_a_missing_command_is_answered_with_what_installs_it(command: str, without: Path) -> None:
    stderr = " ".join(re.sub(r"[│\s]+", " ", foresee_of(without, command, "--help", code=2).stderr).split())
    assert f"The command '{command}' {MISSING}" in stderr


def test_without_the_plug_in_all_else_works(without: Path, scenarios: Path, tmp_path: Path) -> None:
    address = f"{scenarios / 'scenario9.foresee'}::r01"
    ran = json.loads(foresee_of(without, "run", address, "--out", str(tmp_path), "--json", code=0).stdout)
    assert ran["verdict"] == "pass"
    refused = foresee_of(without, "forecast", ran["trace"], "--ranker", "selforacle", code=1)
    assert refused.stderr == f"error: the ranker 'selforacle' {MISSING}\n"
    assert "Plug-ins" not in foresee_of(without, "--help", code=0).stdout


def test_the_key_of_a_mutated_test_case_has_the_code_that_mutates_it() -> None:
    closure = import_closure([engine._WORKER])
    assert {"foresee_study.fuzz.mutation", "foresee_study.fuzz.quality", "foresee_dsl.simulate.runner"} <= set(closure)
    assert "foresee_study.report" not in closure


def test_a_store_calls_its_results_as_before() -> None:
    assert TITLES == {engine.KIND: "mutated whole (foresee fuzz)"}


@pytest.mark.parametrize("settings", [StudySettings, FuzzSettings])
def test_the_defaults_of_the_options_are_those_of_the_settings(settings: type) -> None:
    options = options_of_settings(settings)
    assert settings_of(settings, {name: option.default for name, option in options.items()}) == settings()
    assert {"seed", "cycles" if settings is FuzzSettings else "rankers"} < set(options)


def test_what_an_option_names_is_read() -> None:
    chosen = settings_of(StudySettings, {"drivers": 'pdm, "external:python a.py, b"', "allocation": "adaptive"})
    assert chosen.drivers == ("pdm", "external:python a.py, b") and chosen.allocation == "adaptive"
    for name, text in {"rankers": " , ", "allocation": "odd"}.items():
        with pytest.raises(typer.BadParameter):
            settings_of(StudySettings, {name: text})
