"""The forms in which `foresee check` reports, its options about warnings, and `foresee explain`."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from click.testing import Result
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import meant_word
from foresee_dsl.language.codes import every_code
from foresee_dsl.report.builds.github import render_github
from foresee_dsl.report.builds.sarif import to_sarif
from tests.support.code_frames import FRAMES, example
from tests.support.first_project import sarif_schema

CODES = every_code()
HEAD = FRAMES["scenario"].partition("@")[0]
TOWN = example(CODES["FS301"], "end after 60 s").files["town.foresee"]

SIX = {
    "unknown keyword": ("  vehcle box: car.compact { route [north] }", "FS004", "vehcle"),
    "wrong unit": ("  end after 50 seconds", "FS005", "seconds"),
    "wrong type": ("  end after 50 m", "FS010", "50 m"),
    "missing bracket": ("  expect always ttc(ego, runner > 1 s", "FS003", ">"),
    "unknown map": ("  use network \"twon.foresee\"", "FS130", '"twon.foresee"'),
    "actor off the road": (
        "  obstacle crate: obstacle.crate {\n    start at (60 m, 80 m)\n  }", "FS253", "start at (60 m, 80 m)",
    ),
    "misspelt property": ("  when ego.sped > 3 m/s {\n    runner stops\n  }", "FS006", "sped"),
}  # fmt: skip
"""The six mistakes (the second of two kinds): a statement, its code, what is underlined."""

MIXED = "  param unused: time = 1 s\n  when time > 99 s {\n    runer stops\n  }"


def foresee(*arguments: str, cwd: Path, expect: int) -> Result:
    """Call a command in this process, in a folder (starting it anew costs a second on a busy machine)."""
    with contextlib.chdir(cwd):
        done = CliRunner().invoke(app, list(arguments), env={"NO_COLOR": "1", "COLUMNS": "80"})
    assert done.exit_code == expect, f"{arguments}: {done.exit_code}\n{done.stdout}\n{done.stderr}"
    return done


@pytest.fixture
def write(tmp_path: Path):
    def write(lines: str) -> Path:
        (tmp_path / "town.foresee").write_text(TOWN)
        head = HEAD if "use network" not in lines else HEAD.replace('  use network "town.foresee"\n', "")
        (tmp_path / "main.foresee").write_text(f"{head}{lines}\n}}\n", encoding="utf-8")
        return tmp_path

    return write


@pytest.mark.parametrize("name", SIX)
def test_each_of_the_six_mistakes_takes_six_lines_at_most(write, name: str):
    lines, code, underlined = SIX[name]
    folder = write(lines)
    shown = foresee("check", "main.foresee", cwd=folder, expect=1).stderr
    mistake, _, count = shown.rstrip().rpartition("\n\n")
    assert count == "1 error"
    head, source, marks, *rest = mistake.split("\n")
    assert len(rest) + 3 <= 6
    assert f"error {code}" in head
    first, last = marks.index("^"), marks.rindex("^") + 1
    assert source[first:last] == underlined
    assert rest[0].startswith("  help: ")


# ---- formats --------------------------------------------------------------------------------------------------------


def test_concise_is_one_line_each(write):
    done = foresee("check", "--format", "concise", "main.foresee", cwd=write(MIXED), expect=1)
    assert done.stdout == "main.foresee:18:5: error FS037: unknown actor 'runer' (did you mean 'runner'?)\n"
    assert done.stderr == ""


def test_json_is_the_same_by_both_names(write):
    folder = write(MIXED)
    one = foresee("check", "--json", "main.foresee", cwd=folder, expect=1).stdout
    other = foresee("check", "--format", "json", "main.foresee", cwd=folder, expect=1).stdout
    assert one == other
    data = json.loads(one)
    assert (data["schema"], data["ok"], data["files"]) == (1, False, 1)
    assert [d["code"] for d in data["diagnostics"]] == ["FS037"]


def test_github_shows_errors_and_warnings(write):
    folder = write(MIXED.replace("runer", "runner"))
    done = foresee("check", "--format", "github", "main.foresee", cwd=folder, expect=0)
    first, second = done.stdout.splitlines()
    assert first.startswith("::warning file=main.foresee,line=16,endLine=16,col=9,endColumn=15,title=FS301 ")
    assert second.startswith("::warning file=main.foresee,line=17,endLine=17,col=8,endColumn=19,title=FS303 ")
    assert done.stderr == ""


def test_github_escapes():
    found = Diagnostic("FS003", "100 % wrong\r\n::", "so", "a,b:c%.foresee", Span(2, 3, 4, 1), "x")
    assert render_github([found], {}) == (
        "::error file=a%2Cb%3Ac%25.foresee,line=2,endLine=4,col=3,title=FS003::100 %25 wrong%0D%0A::%0Aso"
    )
    assert render_github([Diagnostic("FS001", "gone", path="a")], {}) == "::error file=a,title=FS001::gone"
    assert render_github([], CODES) == ""


def test_what_is_not_there_is_reported_in_the_same_form(write):
    folder = write(MIXED)
    done = foresee("check", "--format", "concise", "mian.foresee", cwd=folder, expect=1)
    message = "there is no file or folder 'mian.foresee' (did you mean 'main.foresee'?)"
    assert done.stdout == f"mian.foresee: error FS130: {message}\n"


@pytest.mark.parametrize("form", ["concise", "github"])
def test_nothing_found_is_nothing_said(write, form: str):
    done = foresee("check", "--format", form, "main.foresee", cwd=write("  end after 60 s"), expect=0)
    assert (done.stdout, done.stderr) == ("", "")


# ---- SARIF ----------------------------------------------------------------------------------------------------------


def test_sarif_is_valid(write):
    for lines in (MIXED, MIXED.replace("runer", "runner"), "  end after 60 s", SIX["unknown map"][0]):
        folder = write(lines)
        failed = lines in (MIXED, SIX["unknown map"][0])
        done = foresee("check", "--format", "sarif", "main.foresee", cwd=folder, expect=int(failed))
        log = json.loads(done.stdout)
        jsonschema.Draft7Validator(sarif_schema()).validate(log)
        assert log["version"] == "2.1.0"
        assert done.stderr == ""


def test_the_schema_refuses_what_is_no_sarif():
    log = to_sarif([Diagnostic("FS003", "wrong", "", "a", Span(1, 1, 1, 2), "x")], CODES)
    jsonschema.Draft7Validator(sarif_schema()).validate(log)
    log["runs"][0]["results"][0]["level"] = "terrible"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft7Validator(sarif_schema()).validate(log)


def test_sarif_of_every_code_is_valid():
    found = [Diagnostic(c, "m", "h", "a b.foresee", Span(1, 1, 1, 2), "xy", CODES[c].severity) for c in CODES]
    log = to_sarif(found, CODES)
    jsonschema.Draft7Validator(sarif_schema()).validate(log)
    (run,) = log["runs"]
    rules = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == list(CODES)
    assert all(rules[result["ruleIndex"]]["id"] == result["ruleId"] for result in run["results"])
    assert run["results"][0]["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == "a%20b.foresee"


def one_result(found: Diagnostic) -> dict[str, Any]:
    (result,) = to_sarif([found], CODES)["runs"][0]["results"]
    return result


def test_sarif_columns_are_utf16():
    line = '  doc "🚗🚗" kmh'
    at = line.index("kmh") + 1
    result = one_result(
        Diagnostic.of("FS005", "unknown unit 'kmh'", meant_word("km/h", "kmh"), "a", Span(3, at, 3, at + 3), line)
    )
    region = result["locations"][0]["physicalLocation"]["region"]
    assert region == {"startLine": 3, "startColumn": at + 2, "endLine": 3, "endColumn": at + 5}
    units = line.encode("utf-16-le")
    assert units[2 * (region["startColumn"] - 1) : 2 * (region["endColumn"] - 1)].decode("utf-16-le") == "kmh"


def test_sarif_offers_the_fix_that_the_help_spells_out():
    line = "    start at 20 m along ego.rout"
    span = Span(5, line.index("rout") + 1, 5, len(line) + 1)
    result = one_result(
        Diagnostic.of("FS006", "unknown property 'rout' of 'ego'", meant_word("route", "rout"), "a", span, line)
    )
    (change,) = result["fixes"][0]["artifactChanges"][0]["replacements"]
    assert change["insertedContent"] == {"text": "route"}
    assert change["deletedRegion"]["startColumn"] == span.column
    path = '  use network "maps/twon.foresee"'
    span = Span(4, path.index('"') + 1, 4, len(path) + 1)
    result = one_result(Diagnostic.of("FS130", "no file", meant_word("town.foresee", "twon.foresee"), "a", span, path))
    region = result["fixes"][0]["artifactChanges"][0]["replacements"][0]["deletedRegion"]
    assert path[region["startColumn"] - 1 : region["endColumn"] - 1] == "twon.foresee"
    assert "fixes" not in one_result(Diagnostic("FS003", "odd", "write it otherwise", "a", span, path))


def test_fingerprints_survive_lines_above_and_tell_twins_apart():
    def prints(*lines: int) -> list[str]:
        found = [Diagnostic("FS003", "m", "", "a", Span(line, 1, line, 2), "same") for line in lines]
        results = to_sarif(found, CODES)["runs"][0]["results"]
        return [next(iter(result["partialFingerprints"].values())) for result in results]

    assert prints(3, 9) == prints(5, 11)
    assert len(set(prints(3, 9))) == 2


# ---- warnings -------------------------------------------------------------------------------------------------------

WARNED = MIXED.replace("runer", "runner")


def codes(done: Result) -> list[str]:
    return [line.split(" FS")[1][:3] for line in done.stdout.splitlines()]


def test_warnings_fail_only_when_asked(write):
    folder = write(WARNED)
    done = foresee("check", "main.foresee", cwd=folder, expect=0)
    assert "2 warnings" in done.stderr
    assert "no errors" in done.stdout
    foresee("check", "--strict", "main.foresee", cwd=folder, expect=1)


def test_select_and_ignore(write):
    folder = write(WARNED)
    base = ("check", "--format", "concise", "--no-places", "main.foresee")
    assert codes(foresee(*base, "--select", "FS301", cwd=folder, expect=0)) == ["301"]
    assert codes(foresee(*base, "--ignore", "FS301", cwd=folder, expect=0)) == ["303"]
    assert codes(foresee(*base, "--select", "fs3", "--ignore", "FS303", cwd=folder, expect=0)) == ["301"]
    assert codes(foresee(*base, "--ignore", "FS301,FS303", "--strict", cwd=folder, expect=0)) == []
    foresee(*base, "--ignore", "FS9", cwd=folder, expect=2)


def test_errors_cannot_be_ignored(write):
    done = foresee("check", "--ignore", "FS0", "--format", "concise", "main.foresee", cwd=write(MIXED), expect=1)
    assert codes(done) == ["037"]


# ---- explain --------------------------------------------------------------------------------------------------------


def test_explain(tmp_path: Path):
    shown = foresee("explain", "fs037", cwd=tmp_path, expect=0).stdout
    assert shown.startswith("FS037 error: unknown actor\n")
    assert "runer stops" in shown
    assert "runner stops" in shown
    # what goes to a file or a pipe is not broken into lines
    assert "No actor has this name. Actors of the traffic are called `others_01`, `others_02`, ...\n" in shown
    data = json.loads(foresee("explain", "FS037", "--json", cwd=tmp_path, expect=0).stdout)
    assert [code["code"] for code in data["codes"]] == ["FS037"]


def test_explain_lists_all(tmp_path: Path):
    shown = foresee("explain", cwd=tmp_path, expect=0).stdout
    assert [line[:5] for line in shown.splitlines()] == list(CODES)
    data = json.loads(foresee("explain", "--json", cwd=tmp_path, expect=0).stdout)
    assert [code["code"] for code in data["codes"]] == list(CODES)


@pytest.mark.parametrize(("written", "meant"), [("FS38", "FS038"), ("38", "FS038"), ("fs 37", "FS037")])
def test_explain_suggests(tmp_path: Path, written: str, meant: str):
    done = foresee("explain", written, cwd=tmp_path, expect=1)
    assert done.stderr == f"error: there is no code {written}: did you mean {meant}?\n"
