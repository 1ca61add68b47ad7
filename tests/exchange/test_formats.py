"""Formats of other packages: listed, run, named where they are broken; the example of docs/guide/import.md works."""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.parser import load

PAGE = (Path(__file__).parents[2] / "docs" / "guide" / "import.md").read_text(encoding="utf-8")

MORE = """
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.exchange.protocol import Option, Tell


class Colour(StrEnum):
    red = "red"
    green = "green"


@dataclass(frozen=True)
class Everything:
    file: Annotated[Path, Option("What.", metavar="FILE", positional=True)]
    speed: float
    colour: Colour = Colour.red
    names: Annotated[list[str], Option("Names.", ("--name", "-n"))] = field(default_factory=list)
    count: Annotated[int, Option(least=1, most=9)] = 3
    fast: Annotated[bool, Option("Fast or not.", ("--fast/--slow",))] = False
    driver: str = "idm"

    def __post_init__(self) -> None:
        if self.speed < 0:
            raise ValueError(f"the speed {self.speed} is negative: write 0 or more")


def every(options: Everything, tell: Tell) -> Imported:
    'Write nothing.'
    load_driver(options.driver if options.file.name != "sent" else "external:true")
    return Imported((options.file,), 2, {repr(options): 1}, notes=("said",))


def old(file: Path, out: Path) -> Imported:
    return Imported()


def undated(options: dict, tell: Tell) -> Imported:
    return Imported()


@dataclass(frozen=True)
class Taken:
    json: bool = False


def taken(options: Taken, tell: Tell) -> Imported:
    return Imported()
"""


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
    (tmp_path / "acme_more.py").write_text(MORE)
    broken = "[foresee_dsl.exporters]\nreplay = acme_formats_missing:replay\n"
    broken += "".join(f"{name} = acme_more:{name}\n" for name in ("old", "every", "undated", "taken"))
    (info / "entry_points.txt").write_text(entries.replace('"', "") + broken)
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    yield
    for module in ("acme_formats", "acme_more"):
        sys.modules.pop(module, None)
    importlib.invalidate_caches()


def foresee(*arguments: str | Path, code: int = 0) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.output


@pytest.mark.usefixtures("package")
def test_a_package_adds_an_importer(tmp_path: Path) -> None:
    listed = foresee("import", "--help")
    assert "Turn a table of vehicles (name, length, width)" in listed
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
    assert "every" in listed
    result = CliRunner().invoke(app, ["export", "replay"])
    assert isinstance(result.exception, ExchangeError)
    assert "'replay' of package acme-formats cannot be loaded: ModuleNotFoundError" in str(result.exception)


@pytest.mark.usefixtures("package")
def test_options_are_derived_from_the_fields_of_a_dataclass() -> None:
    shown = re.sub(r"[│\s]+", " ", foresee("export", "every", "--help"))
    for words in (
        "foresee export every [OPTIONS] {FILE}",
        "What. [required]",
        "--speed <float>",
        "--fast --slow",
        "-n",
    ):
        assert words in shown
    printed = foresee("export", "every", "x", "--speed", 2, "-n", "a", "--name", "b", "--colour", "green", "--fast")
    assert printed.splitlines() == [
        "wrote x",
        "2 test cases",
        "taken over:",
        "  1 Everything(file=PosixPath('x'), speed=2.0, colour=<Colour.green: 'green'>, names=['a', 'b'], count=3, "
        "fast=True, driver='idm')",
        "note: said",
    ]
    assert "names=[]" in foresee("export", "every", "x", "--speed", 2)


@pytest.mark.usefixtures("package")
def test_wrong_options_are_wrong_usage() -> None:
    assert "the speed -1.0 is negative: write 0 or more" in foresee("export", "every", "x", "--speed=-1", code=2)
    assert "less than or equal to 9" in foresee("export", "every", "x", "--speed", 1, "--count", 10, code=2)
    assert "Missing option '--speed'" in foresee("export", "every", "x", code=2)


@pytest.mark.usefixtures("package")
def test_a_program_starts_where_an_option_names_it_and_not_where_a_file_does() -> None:
    foresee("export", "every", "x", "--speed", 1, "--driver", "external:true")
    refused = CliRunner().invoke(app, ["export", "every", "sent", "--speed", "1"])
    assert "starts only with your consent" in str(refused.exception)


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(("name", "takes"), [("old", "(file, out)"), ("undated", "(options, tell)")])
def test_what_is_not_a_format_is_named_with_what_it_needs(name: str, takes: str) -> None:
    needs = f"{name} is not a format: it takes {takes}, but must take (options: A_DATACLASS, tell)"
    assert needs in re.sub(r"[│\s]+", " ", foresee("export", "--help"))
    assert needs in str(CliRunner().invoke(app, ["export", name]).exception)


@pytest.mark.usefixtures("package")
def test_a_field_that_is_called_like_an_option_of_every_format_is_refused() -> None:
    refused = CliRunner().invoke(app, ["export", "taken"]).exception
    assert str(refused) == "Taken: every format has the options json; rename the fields"
