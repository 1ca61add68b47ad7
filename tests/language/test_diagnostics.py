"""What people see for their mistakes: one golden file each, and the renderers."""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path

import pytest

from foresee_dsl.compile import with_placements
from foresee_dsl.documents import plain
from foresee_dsl.errors import Diagnostic, InputError, Span
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.codes import every_code
from foresee_dsl.language.messages.diagnostics import render_all, render_concise, render_full
from foresee_dsl.language.parser import load, parse
from tests.support.examples_at_work import pin_by_hand
from tests.support.goldens import Golden

CASES = Path(__file__).parents[1] / "cases" / "language"
ERRORS = sorted((CASES / "errors").glob("*.foresee"))
FOLDERS = sorted(folder for folder in (CASES / "errors").iterdir() if folder.is_dir())


def mistakes(text: str, path: str = "bad.foresee") -> tuple[Diagnostic, ...]:
    try:
        return check_document(parse(text, path))
    except InputError as error:
        return error.diagnostics


@pytest.mark.parametrize("file", ERRORS, ids=lambda file: file.stem)
def test_golden(file: Path, golden: Golden):
    found = mistakes(file.read_text(encoding="utf-8"), file.name)
    assert found, "a file in errors/ has a mistake"
    shown = render_all(found) + "\n"
    golden(shown, file.with_suffix(".txt"))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_golden_of_a_folder(folder: Path, golden: Golden, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What `foresee check main.foresee` shows in a folder: files read, actors placed, lints."""
    shutil.copytree(folder, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    pin_by_hand("clip.foresee", "main.foresee")
    result = check_paths(["main.foresee"])
    found = with_placements(result.diagnostics, result.cases)
    written = (folder / "main.foresee").read_text(encoding="utf-8")
    shown = re.sub(r"sha256:[0-9a-f]{12}", lambda pin: pin[0] if pin[0] in written else "sha256:...", render_all(found))
    assert found, "a folder in errors/ has a mistake or a lint"
    for diagnostic in found:
        assert diagnostic.code in every_code()
        assert len(render_full(diagnostic).splitlines()) <= 6
        assert diagnostic.help
    golden(shown + "\n", folder.with_suffix(".txt"))


def test_there_are_enough_goldens():
    heads = [line for golden in (CASES / "errors").glob("*.txt") for line in golden.read_text("utf-8").splitlines()]
    assert len([line for line in heads if re.match(r"\S+: (error|warning) FS", line)]) >= 100
    assert len(ERRORS) + len(FOLDERS) >= 55


@pytest.mark.parametrize("file", ERRORS, ids=lambda file: file.stem)
def test_every_mistake_is_said_once_and_at_its_place(file: Path):
    text = file.read_text(encoding="utf-8")
    found = mistakes(text)
    places = [(d.span, d.message) for d in found]
    assert len(set(places)) == len(places)
    for diagnostic in found:
        assert diagnostic.code in every_code()
        assert diagnostic.help, "say what to write instead"
        assert len(render_full(diagnostic).splitlines()) <= 6
        assert diagnostic.span is not None
        assert diagnostic.source_line == text.split("\n")[diagnostic.span.line - 1]
        assert 1 <= diagnostic.span.column <= len(diagnostic.source_line) + 1


def test_no_names_of_the_grammar_are_shown():
    grammar = next((CASES.parents[2] / "grammars").glob("*.lark")).read_text(encoding="utf-8")
    terminals = re.findall(r"^_?([A-Z_]+)(?:\.\d+)?:", grammar, re.MULTILINE)
    assert {"NAME", "NUMBER", "STRING"} <= set(terminals)
    for file in (CASES / "errors").glob("*.txt"):
        text = file.read_text(encoding="utf-8")
        for name in (*terminals, "LBRACE", "RSQB", "$END", "__"):  # the latter are lark's own
            assert name not in text, file.name


# ---- files ----------------------------------------------------------------------------------------------------------


def refused(path: Path) -> Diagnostic:
    with pytest.raises(InputError) as caught:
        load(path, "shown.foresee")
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.path == "shown.foresee"
    return diagnostic


def test_files_that_cannot_be_read(tmp_path: Path):
    (tmp_path / "town.foresee").write_text("foresee 1\n")
    assert refused(tmp_path / "twon.foresee").help == "did you mean 'town.foresee'?"
    assert refused(tmp_path / "far" / "away.foresee").message == "there is no such file"
    assert refused(tmp_path).message == "this is a folder"
    os.mkfifo(tmp_path / "pipe")
    assert refused(tmp_path / "pipe").message == "this is not an ordinary file"
    assert refused(Path("a\0b")).code == "FS001"
    assert refused(tmp_path / ("x" * 300)).code == "FS001"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"  \n\t\r\n", "the file is empty"),
        (b"\xef\xbb\xbf", "the file is empty"),
        (b"\x7fELF\x02\x01\x01\0\0\0", "this is a binary file"),
        (b'foresee 1\n\nscenario a {\n  doc "caf\xe9"\n}\n', "the file is not UTF-8 text (line 4, byte 0xe9)"),
        (b"foresee 1\n" + b"# long\n" * 400_000, "the file is too large"),
    ],
    ids=["empty", "blank", "mark", "binary", "latin1", "large"],
)
def test_files_that_are_no_text(tmp_path: Path, content: bytes, message: str):
    path = tmp_path / "x.foresee"
    path.write_bytes(content)
    assert refused(path).message == message


@pytest.mark.parametrize(
    "text",
    [
        "a" * 1_000_000,
        "foresee 1\nscenario a { " + "x " * 500_000 + "}",
        "foresee 1\nscenario a { " + "lanes 2;" * 120_000 + "}",
        'foresee 1\nscenario a { doc "' + "x" * 1_000_000,
        "{" * 100_000,
        "}" * 100_000,
        "foresee 1\nscenario a {\n" + "ego: car.sedan {\n" * 10_000,
        "foresee 1\nscenario a { when " + "not " * 20_000 + "time > 1 s { a stops } }",
        "foresee 1\nscenario a { when " + "(" * 20_000 + "time > 1 s",
        "foresee 1\nscenario a { end after " + "9" * 1_000_000 + " s }",
        "foresee 1\nscenario a { tags " + "[" * 100_000 + "}",
        "foresee 1\nscenario a {\n" + "  speling 3 m\n" * 10_000 + "}",
    ],
    ids=[
        "word",
        "words",
        "semicolons",
        "text",
        "open",
        "close",
        "blocks",
        "nots",
        "brackets",
        "digits",
        "lists",
        "lines",
    ],
)
def test_monsters_are_refused_in_few_words(text: str):
    found = mistakes(text)
    assert found
    assert len(found) <= 110
    assert len(render_all(found)) < 60_000


# ---- renderers ------------------------------------------------------------------------------------------------------


def diagnostic(line: str, start: int, end: int) -> Diagnostic:
    return Diagnostic("FS003", "wrong", "right", "a.foresee", Span(7, start, 7, end), line)


def test_an_unresolved_merge_is_one_error():
    ours, theirs = "  end after 5 s\n  }\n", "  end after 6 s {\n"
    conflict = f"{'<' * 7} HEAD\n{ours}{'=' * 7}\n{theirs}{'>' * 7} other words\n"
    found = mistakes(f"foresee 1\n\nscenario s {{\n{conflict}  ego: nonsense\n{conflict}}}\n")
    assert [error.message for error in found] == [
        "an unresolved merge conflict, lines 4 to 9",
        "an unresolved merge conflict, lines 11 to 16",
    ]
    assert {error.code for error in found} == {"FS003"}
    assert not any("merge" in str(error.message) for error in mistakes(f"foresee 1\n{'<' * 7} a\n"))


def test_full():
    shown = render_full(diagnostic("  speed 50 kmh", 12, 15))
    assert shown.splitlines() == [
        "a.foresee:7:12: error FS003: wrong",
        "  7 |   speed 50 kmh",
        "    |            ^^^",
        "  help: right",
    ]


def test_tabs_and_wide_characters_line_up():
    _, source, marks, _ = render_full(diagnostic("\t日本 bad", 5, 8)).splitlines()
    assert source == "  7 |     日本 bad"
    assert marks == "    | " + " " * (4 + 4 + 1) + "^^^"  # a tab is four columns, each of the two signs is two


def test_long_lines_are_cut_around_the_place():
    line = "x" * 5000 + " bad " + "y" * 5000
    _, source, marks, _ = render_full(diagnostic(line, 5002, 5005)).splitlines()
    assert len(source) < 120
    assert source[marks.index("^") : marks.index("^") + 3] == "bad"
    assert marks.count("^") == 3


def test_places_beyond_the_line_and_over_several_lines():
    assert "^" in render_full(diagnostic("abc", 4, 4))
    several = Diagnostic("FS003", "m", "", "a", Span(1, 3, 4, 2), "  ego {")
    assert render_full(several).splitlines()[-1] == "    |   ^^^^^"


def test_nothing_moves_the_cursor():
    shown = render_full(Diagnostic("FS003", "m\x1b[2J", "", "a\x07", Span(1, 1, 1, 2), "\x1b[2J\x08 \u202ex"))
    assert not any(c in shown for c in "\x1b\x07\x08\u202e")


def test_colour_only_adds_colour():
    one = diagnostic("  speed 50 kmh", 12, 15)
    coloured = render_full(one, colour=True)
    for code in ("\x1b[31m", "\x1b[36m", "\x1b[1m", "\x1b[0m"):
        coloured = coloured.replace(code, "")
    assert coloured == render_full(one)


def test_concise_and_json():
    one = diagnostic("  speed 50 kmh", 12, 15)
    assert render_concise(one) == "a.foresee:7:12: error FS003: wrong (right)"
    assert json.loads(json.dumps(plain(one))) == {
        "code": "FS003",
        "severity": "error",
        "message": "wrong",
        "help": "right",
        "path": "a.foresee",
        "span": {"line": 7, "column": 12, "end_line": 7, "end_column": 15},
    }
    assert plain(Diagnostic("FS001", "gone", path="a"))["span"] is None
