"""What the plug-in adds by entry points, and what the command line says where it is not installed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from foresee_dsl.plugins import BESIDE, package_of
from tests.support.command import foresee
from tests.support.foreign_maps import HILL_ROAD
from tests.support.without_plug_ins import foresee_of, installed_without

MISSING = (
    "comes with the plug-in foresee-exchange, which is not installed: "
    "pip install ./plugins/foresee-exchange in a checkout of foresee-dsl"
)
GROUPS = {"import": "foresee_dsl.importers", "export": "foresee_dsl.exporters"}


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return installed_without(tmp_path_factory.mktemp("site"))


def listed(text: str) -> list[str]:
    return re.findall(r"^│ ([a-z][\w-]*) {2,}", text, re.M)


@pytest.mark.parametrize("command", GROUPS)
def test_the_core_names_every_format_that_the_plug_in_offers(command: str) -> None:
    offered = tuple(sorted(e.name for e in entry_points(group=GROUPS[command]) if package_of(e) == "foresee-exchange"))
    assert offered == BESIDE["exchange"][GROUPS[command]]
    assert set(offered) <= set(listed(foresee(command, "--help").stdout))


@pytest.mark.parametrize("group", GROUPS)
def test_the_help_of_a_format_imports_nothing_heavy(group: str) -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from foresee_dsl.cli import app\n"
        f"done = CliRunner().invoke(app, ['{group}', 'openscenario', '--help']); assert done.exit_code == 0\n"
        "print({'numpy', 'shapely', 'networkx', 'jinja2', 'libsumo', 'scenariogeneration'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("command", GROUPS)
def test_without_it_the_help_lists_each_format_with_what_installs_it(command: str, without: Path) -> None:
    shown = foresee_of(without, command, "--help", code=0).stdout
    formats = BESIDE["exchange"][GROUPS[command]]
    assert set(formats) <= set(listed(shown))
    assert " ".join(re.sub(r"[│\s]+", " ", shown).split()).count(MISSING) == len(formats)


def test_without_it_a_command_with_its_options_says_what_installs_it(without: Path, tmp_path: Path) -> None:
    routes = ("import", "carla", "--map", "town.xodr", "--routes", "s7.xml", "--out", tmp_path)
    refused = foresee_of(without, *routes, code=1)
    assert (refused.stdout, refused.stderr) == ("", f"error: the importer 'carla' {MISSING}\n")
    error = json.loads(foresee_of(without, *routes, "--json", code=1).stdout)
    assert MISSING in json.dumps(error)
    refused = foresee_of(without, "export", "openscenario", "a.foresee::r01", "--out", tmp_path, code=1)
    assert refused.stderr == f"error: the exporter 'openscenario' {MISSING}\n"
    assert MISSING in re.sub(r"\s+", " ", foresee_of(without, "import", "osm", "--help", code=0).stdout)
    assert "No such command 'skates'" in foresee_of(without, "import", "skates", code=2).stderr
    assert list(tmp_path.iterdir()) == []


def test_without_it_a_scenario_on_a_map_of_another_tool_compiles(without: Path, tmp_path: Path) -> None:
    """foresee-dsl itself compiles a net or a map that a scenario names, and makes networks of sketches."""
    foresee("import", "opendrive", str(HILL_ROAD), "--out", str(tmp_path))
    checked = json.loads(foresee_of(without, "check", tmp_path / "hill_road.foresee", "--json", code=0).stdout)
    assert checked["diagnostics"] == []
    (tmp_path / "streets.txt").write_text("a 0 0\nb 300 0\na-b lanes 1\n")
    sketched = foresee_of(
        without, "init", "network", tmp_path / "streets.txt", "--scenario", tmp_path / "first.foresee", code=0
    )
    assert "first.foresee" in sketched.stdout


def test_the_wheel_carries_the_templates_and_no_corpus(root: Path, tmp_path: Path) -> None:
    source = root / "plugins" / "foresee-exchange"
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path), str(source)]
    subprocess.run(command, check=True, capture_output=True)
    names = zipfile.ZipFile(next(tmp_path.glob("*.whl"))).namelist()
    templates = {file.name for file in (source / "foresee_exchange" / "templates").iterdir()}
    assert {name.rpartition("/")[2] for name in names if name.startswith("foresee_exchange/templates/")} == templates
    assert {name.partition("/")[0] for name in names} == {"foresee_exchange", "foresee_exchange-0.1.0.dist-info"}
