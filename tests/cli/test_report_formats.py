"""Formats of other packages: a real distribution on the path of real processes, the example of docs/guide/ci.md."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import COMMANDS, app
from foresee_dsl.report.formats import OURS, CommandReport, rendered
from tests.support.command import program

PAGE = (Path(__file__).parents[2] / "docs" / "guide" / "ci.md").read_text(encoding="utf-8")
BROKEN = """
def number(report):
    return 3


def fails(report):
    return report.nothing
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of packages, for PYTHONPATH: the page's example, and one whose formats are broken."""
    ((name, text),) = re.findall(r"`(\w+)\.py`[^`\n]*:\n\n```python\n(.*?)```", PAGE, re.S)
    (entries,) = re.findall(r"```toml\n.*?report_formats\"\]\n(.*?)```", PAGE, re.S)
    folder = tmp_path_factory.mktemp("site")
    more = "number = acme_broken:number\nfails = acme_broken:fails\ngone = acme_gone:gone\n"
    for package, module, code, lines in (
        ("acme-lines", name, text, entries.replace('"', "")),
        ("acme-broken", "acme_broken", BROKEN, more),
    ):
        (folder / f"{module}.py").write_text(code)
        info = folder / f"{package.replace('-', '_')}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[foresee_dsl.report_formats]\n{lines}")
    return folder


def foresee(site: Path, *words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(site), "NO_COLOR": "1", "COLUMNS": "200"}
    done = subprocess.run([program(), *map(str, words)], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{words}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_a_format_of_another_package_is_for_every_command_that_reports(site: Path, scenarios: Path) -> None:
    file = scenarios / "scenario7.foresee"
    wrong = site / "wrong.foresee"
    wrong.write_text("foresee 1\n\nscenario wrong {\n  end after 3 m\n}\n")
    mistakes = foresee(site, "check", wrong, "--no-places", "--format", "lines", code=1).stdout.splitlines()
    assert mistakes[0] == "check: FS010 at line 4: `3 m` is a length, but a time is needed here"
    for words, first in (
        (("diff", f"{file}::r01", f"{file}::r02"), "diff: old, new"),
        (("sample", file), "sample: file, scenario"),
        (("plan", file, "--store", site / "store"), "plan: stages"),
        (("run", f"{file}::r01", "--exit-zero"), "run: "),
        (("drivers",), "drivers: drivers"),
        (("explain", "FS012"), "explain: codes"),
    ):
        assert foresee(site, *words, "--format", "lines").stdout.startswith(first), words
    for words in (("sample", file), ("models",)):
        foresee(site, *words, "--format", "lines", "--output", site / "given.txt")
        assert (site / "given.txt").read_text().startswith(f"{words[0]}: ")


def test_every_command_that_has_formats_accepts_those_of_other_packages(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(site))
    offered = {}
    for _, name, _ in COMMANDS:
        refused = CliRunner().invoke(app, [name, "--format", "nonsense"], env={"COLUMNS": "400"}).output
        if "'nonsense' is not one of" in refused:
            offered[name] = set(re.findall(r"'(\w+)'", refused.partition("is not one of")[2]))
    assert all("lines" in formats for formats in offered.values()), offered
    assert {name for formats in offered.values() for name in formats} >= OURS.keys(), "no command offers one of ours"


def test_a_missing_or_broken_format_is_named_with_its_package(site: Path, scenarios: Path) -> None:
    file = scenarios / "scenario7.foresee"
    refused = foresee(site, "sample", file, "--format", "lins", code=2).stderr
    assert "'lins' is not one of 'table', 'json', 'cases', 'fails', 'gone', 'lines', 'number'." in refused
    for name, why in (
        ("number", "it returned int instead of a text"),
        ("fails", "has no attribute 'nothing'"),
        ("gone", "No module named 'acme_gone'"),
    ):
        failed = foresee(site, "sample", file, "--format", name, code=1).stderr
        assert f"report format '{name}' of package acme-broken cannot be loaded" in failed
        assert why in failed
    assert "acme-broken" in foresee(site, "doctor", code=1).stdout


@pytest.mark.parametrize(("form", "words"), [("markdown", ("diff", "::r01", "::r02")), ("cases", ("sample", ""))])
def test_a_command_s_own_form_goes_to_the_file_of_output(
    form: str, words: tuple[str, ...], scenarios: Path, tmp_path: Path, site: Path
) -> None:
    command, *cases = words
    file = tmp_path / "given.txt"
    paths = [f"{scenarios / 'scenario7.foresee'}{case}" for case in cases]
    printed = foresee(site, command, *paths, "--format", form).stdout
    assert printed
    assert foresee(site, command, *paths, "--format", form, "--output", file).stdout == ""
    assert file.read_text() == printed


def test_our_formats_read_the_same_report() -> None:
    report = CommandReport("sample", lambda: '{"schema": 1}\n')
    assert report.document() == {"schema": 1}
    texts = {name: rendered(name, report) for name in OURS}
    assert (texts["json"], texts["github"], texts["concise"]) == ('{"schema": 1}\n', "", "")
    assert json.loads(texts["sarif"])["runs"][0]["results"] == []
    assert 'tests="0"' in texts["junit"]
