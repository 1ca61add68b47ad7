"""What the language server offers beside mistakes: the picture, fixes, lenses, hints, tokens, more renaming."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from lsprotocol import types

from foresee_dsl.editor import navigate
from foresee_dsl.editor.answers.edits import applied as fixed
from foresee_dsl.editor.answers.fixes import fixes
from foresee_dsl.editor.answers.marks import hints, lenses, tokens
from foresee_dsl.editor.diagnosing import find
from foresee_dsl.editor.features import ANSWERS
from foresee_dsl.editor.files import Files
from foresee_dsl.editor.hover import results
from foresee_dsl.editor.server import ANSWERED
from tests.support.editor_client import Editor, applied, at, session

NET = """foresee 1

network n {
  junction a at (0 m, 0 m)
  junction b at (200 m, 0 m) signals {
    stage go for 25 s green [one, two]
    stage wait for 15 s green [three]
  }
  junction c at (400 m, 0 m) signals {
    stage go for 25 s green [two]
  }
  junction d at (200 m, 150 m)
  junction e at (600 m, 0 m)
  road one from a to b
  road two from b to c
  road three from d to b
  road four from c to e
}
"""
BASE = """foresee 1

scenario base {
  use network "n.foresee"

  param first: stage = go

  ego: car.sedan {
    route from one straight over b straight over c
    start speed 36 km/h
  }
  vehicle lead: car.compact {
    route from one straight over b
    start at 60 m along one
  }

  signal b stage first elapsed 0 s

  when signal(b) is go {
    lead changes speed to 5 m/s
  }
  when signal(c) is go {
    lead changes speed to 20 mph
  }

  expect never collision(ego)
  end after 10 s

  case early
  case late { first = wait }
}
"""
MORE = """foresee 1

scenario more extends "base.foresee" {
  drop case late
  add when signal(b) is wait { lead stops }
}
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in (("n", NET), ("base", BASE), ("more", MORE)):
        (tmp_path / f"{name}.foresee").write_text(text, encoding="utf-8")
    return tmp_path


def renamed(project: Path, file: str, word: str, name: str, *, nth: int = 0) -> dict[str, str]:
    """Rename what stands at the nth place of a word in a file; return the texts after it."""
    files = Files({}, [project])
    text = (project / file).read_text(encoding="utf-8")
    offset = [found.start() for found in re.finditer(rf"\b{word}\b", text)][nth]
    line = text.count("\n", 0, offset) + 1
    use = navigate.at(files, project / file, line, offset - text.rfind("\n", 0, offset))
    assert use is not None
    renaming = navigate.rename(files, project / file, use, name)
    assert renaming.stale == ()
    found = {}
    for path in dict.fromkeys(place.path for place in renaming.places):
        spans = [place.span for place in renaming.places if place.path == path]
        found[path.stem] = navigate.edited(path.read_text(encoding="utf-8"), spans, name)
        path.write_text(found[path.stem], encoding="utf-8")
    return found


def test_a_stage_is_renamed_everywhere_and_another_junctions_is_not(project: Path) -> None:
    found = renamed(project, "base.foresee", "go", "east_west", nth=1)  # in `signal(b) is go`
    assert set(found) == {"n", "base"}
    assert found["n"] == NET.replace("stage go for 25 s green [one", "stage east_west for 25 s green [one")
    assert found["base"] == BASE.replace("stage = go", "stage = east_west").replace(
        "signal(b) is go", "signal(b) is east_west"
    )
    assert find(project / "base.foresee", found["base"], {}, places=False) == ()
    renamed(project, "more.foresee", "wait", "hold")
    texts = {name: (project / f"{name}.foresee").read_text(encoding="utf-8") for name in ("n", "base", "more")}
    assert "stage hold for 15 s" in texts["n"] and "first = hold" in texts["base"] and "is hold" in texts["more"]
    for name, text in texts.items():
        assert find(project / f"{name}.foresee", text, {}, places=False) == ()
    with pytest.raises(navigate.RenameError, match="already"):
        renamed(project, "n.foresee", "hold", "east_west")


def test_a_case_is_renamed_in_every_file_that_names_it(project: Path) -> None:
    found = renamed(project, "base.foresee", "late", "evening")
    assert found == {
        "base": BASE.replace("case late", "case evening"),
        "more": MORE.replace("case late", "case evening"),
    }
    with pytest.raises(navigate.RenameError, match="already"):
        renamed(project, "base.foresee", "evening", "early")


# ---- what is between the letters ------------------------------------------------------------------------------------


def test_hints_say_speeds_in_metres_a_second() -> None:
    assert [(line, text) for line, _, text in hints(BASE, 1, 100)] == [(10, "= 10.00 m/s"), (23, "= 8.94 m/s")]
    assert list(hints(BASE, 11, 18)) == []


def test_hints_say_what_expressions_come_to(project: Path) -> None:
    file = project / "base.foresee"
    text = BASE.replace("start speed 36 km/h", "start speed 2 * pace").replace(
        "  ego:", "  param pace: speed = 5 m/s\n  ego:"
    )
    text = text.replace("end after 10 s", "end after 2 * 4 s + 1 s")
    found = [(span.line, result) for span, result in results(Files({file: text}, []), file)]
    assert found == [(11, "10 m/s"), (28, "9 s")]


def test_lenses_are_above_scenarios_and_cases() -> None:
    path = Path("/x/base.foresee")
    found = [(lens.span.line, lens.command, lens.address) for lens in lenses(path, BASE)]
    assert found[0] == (3, "draw", "/x/base.foresee")
    assert [(command, address) for _, command, address in found[1:]] == [
        (command, f"/x/base.foresee::{case}") for case in ("early", "late") for command in ("run", "forecast", "draw")
    ]
    assert [lens.command for lens in lenses(path, NET)] == ["draw"]
    alone = BASE[: BASE.index("  case early")] + "}\n"
    assert [lens.command for lens in lenses(path, alone)] == ["draw", "run", "forecast"]


def test_tokens_say_what_names_are() -> None:
    lines = BASE.split("\n")
    found = [
        (lines[t.span.line - 1][t.span.column - 1 : t.span.end_column - 1], t.type, t.defines) for t in tokens(BASE)
    ]
    for token in (
        ("first", "parameter", True),
        ("one", "struct", False),
        ("b", "class", False),
        ("36 km/h", "number", False),
    ):
        assert token in found
    places = [(t.span.line, t.span.column, t.span.end_column) for t in tokens(BASE)]
    assert places == sorted(places) and len(places) == len(set(places))


# ---- quick fixes ----------------------------------------------------------------------------------------------------


def test_help_that_names_a_text_offers_it_and_the_mistake_goes_away(project: Path) -> None:
    for wrong, right in (
        ("start speed 36 km/h", "start speed 36 kmh"),  # did you mean
        ("end after 10 s", "end after 10 m"),  # another dimension
        ("when signal(b) is go", "when signal(b) is goo"),
        ("case early\n", "case early { frist = wait }\n"),
    ):
        text = BASE.replace(wrong, right)
        path = project / "base.foresee"
        found = [one for one in find(path, text, {}, places=False) if one.severity == "error"] or list(
            find(path, text, {}, places=True)
        )
        mistake = found[0]
        assert mistake.span is not None
        offered = fixes(
            mistake, mistake.span, text,
            lambda text, path=path: find(path, text, {}, places=True),
        )  # fmt: skip
        assert offered, mistake
        after = find(path, fixed(text, offered[0]), {}, places=True)
        assert mistake.message not in [one.message for one in after]


# ---- over the protocol ----------------------------------------------------------------------------------------------


def test_the_picture_follows_the_unsaved_text(project: Path) -> None:
    async def steps(editor: Editor) -> None:
        client = editor.client
        capabilities = editor.capabilities
        assert capabilities is not None and capabilities.inlay_hint_provider and capabilities.code_lens_provider
        uri = editor.open("base.foresee")

        async def ask(**more: Any) -> Any:
            params = {"textDocument": {"uri": uri}, "width": 500, **more}
            return await client.protocol.send_request_async("foresee/draw", params)

        first = await ask(case="late")
        assert 'data-name="ego"' in first.svg and first.mistakes == []
        assert (list(first.cases), first.case) == (["early", "late"], "late")
        # the request's own text goes before the document's: a keystroke may be ahead of it
        added = BASE.replace(
            "  signal b", "  vehicle other: car.compact { route from three left over b }\n\n  signal b"
        )
        second = await ask(text=added)
        assert 'data-name="other"' in second.svg
        line = added[: added.index("vehicle other")].count("\n") + 1
        assert f'data-line="{line}" data-column="3"' in second.svg
        broken = await ask(text=BASE.replace("ego:", "eggo:"))
        assert broken.svg is None and broken.mistakes[0].line == 8
        page = await client.protocol.send_request_async("foresee/page", {"nonce": "abc"})
        assert 'nonce="abc"' in page.html

        document = types.TextDocumentIdentifier(uri)
        everything = types.Range(types.Position(0, 0), types.Position(99, 0))
        shown = await client.text_document_inlay_hint_async(types.InlayHintParams(document, everything))
        assert [hint.label for hint in shown or []] == ["= 10.00 m/s", "= 8.94 m/s"]
        above = await client.text_document_code_lens_async(types.CodeLensParams(document))
        commands = [lens.command.command for lens in above or [] if lens.command is not None]
        assert commands.count("foresee.run") == 2 and commands.count("foresee.draw") == 3
        edit = await client.text_document_rename_async(types.RenameParams(document, at(BASE, "late"), "evening"))
        assert edit is not None and edit.changes is not None
        assert applied(BASE, list(edit.changes[uri])) == BASE.replace("case late", "case evening")

    session(project, steps)


# ---- the extension --------------------------------------------------------------------------------------------------


@pytest.mark.skipif(shutil.which("node") is None, reason="no node is installed")
def test_the_extensions_logic(root: Path) -> None:
    folder = root / "editors" / "vscode"
    done = subprocess.run(["node", "--test", "test"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    for script in ("extension.js", "picture.js", "logic.js"):
        subprocess.run(["node", "--check", script], cwd=folder, check=True)


def test_every_request_that_the_server_passes_on_has_a_function() -> None:
    assert set(ANSWERS) == set(ANSWERED)
