"""Formats of other packages: listed, run, and named where they are broken; the example of docs/import.md works."""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.parser import load

PAGE = (Path(__file__).parents[2] / "docs" / "import.md").read_text(encoding="utf-8")


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An installed package with the page's importer and a broken exporter."""
    ((name, text),) = re.findall(r"`(\w+\.py)`,[^`\n]*:\n\n```python\n(.*?)```", PAGE, re.S)
    ((entries),) = re.findall(r"```toml\n(.*?)```", PAGE, re.S)
    (tmp_path / name).write_text(text)
    info = tmp_path / "acme_formats-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-formats\nVersion: 1.0\n")
    entries = entries.replace('[project.entry-points."foresee_dsl.importers"]', "[foresee_dsl.importers]")
    broken = "[foresee_dsl.exporters]\nreplay = acme_formats_missing:replay\n"
    (info / "entry_points.txt").write_text(entries.replace('"', "") + broken)
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    yield
    sys.modules.pop("acme_formats", None)
    importlib.invalidate_caches()


def foresee(*arguments: str | Path, code: int = 0) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.output


@pytest.mark.usefixtures("package")
def test_a_package_adds_an_importer(tmp_path: Path) -> None:
    listed = foresee("import", "--help")
    assert "Turn a table of vehicles (name, length, width)" in listed
    assert "OpenDRIVE" in listed
    table = tmp_path / "fleet.csv"
    table.write_text("small_van,4.40,1.80\npickup,5.35,1.90\n")
    done = json.loads(foresee("import", "fleet", table, "--out", tmp_path / "out", "--json"))
    assert done["files"] == [str(tmp_path / "out" / "fleet.foresee")]
    assert done["taken"] == {"vehicles": 2}
    assert "2 vehicles" in foresee("import", "fleet", table, "--out", tmp_path / "out")
    catalogue = load(tmp_path / "out" / "fleet.foresee").model
    assert [model.name for model in catalogue.body] == ["car.small_van", "car.pickup"]


@pytest.mark.usefixtures("package")
def test_a_broken_exporter_is_named_and_does_not_hide_the_others() -> None:
    listed = foresee("export", "--help")
    assert "replay" in listed
    assert "openscenario" in listed
    result = CliRunner().invoke(app, ["export", "replay"])
    assert isinstance(result.exception, ExchangeError)
    assert "'replay' of package acme-formats cannot be loaded: ModuleNotFoundError" in str(result.exception)


@pytest.mark.parametrize("group", ["import", "export"])
def test_the_help_of_a_format_imports_nothing_heavy(group: str) -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from foresee_dsl.cli import app\n"
        f"done = CliRunner().invoke(app, ['{group}', 'openscenario', '--help']); assert done.exit_code == 0\n"
        "print({'numpy', 'shapely', 'networkx', 'jinja2', 'libsumo', 'scenariogeneration'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_the_bundled_formats_are_registered() -> None:
    names = [line.split()[1] for line in foresee("import", "--help").splitlines() if re.match(r"│ \w+ {2,}", line)]
    assert names == ["carla", "opendrive", "openscenario", "osm", "sumo"]
