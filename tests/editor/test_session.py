"""Whole sessions with a real `foresee lsp` process over its real protocol."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from lsprotocol import types
from pygls.exceptions import JsonRpcException

from tests.support.editor_client import Editor, applied, at, session

TOWN = "networks/town.foresee"
RUDE = """foresee 1

# 🚗 Somebody from the right ignores that he has to wait.
scenario rude {
  use network "networks/town.foresee"

  param room: length = 25 m in 10 m..60 m step 1 m

  ego: car.sedan {
    route from mill_west straight over mill_oak
    start at room along ego.route
    start speed 50 km/h
  }
  vehicle other: van.delivery {
    route from oak_south straight over mill_oak
    start at 110 m along other.route
  }

  when ego.eta(mill_oak) < 6 s {
    other ignores priority at mill_oak
  }

  expect never collision(ego)
  end after 8 s

  case near { room = 15 m }
}
"""
CLIP = """foresee 1

clip rude_p1 of "rude.foresee" case near pin sha256:f6b3399a9e86 {
  window 1.20 s..5.20 s
  ego: car.sedan at (-30.297 m, -1.900 m) heading 0.000 deg speed 11.790 m/s {
    route [mill_west, mill_mid]
  }
  goal (8.000 m, -1.900 m)
}
"""


@pytest.fixture
def work(tmp_path: Path, scenarios: Path) -> Path:
    shutil.copytree(scenarios / "networks", tmp_path / "networks")
    (tmp_path / "rude.foresee").write_text(RUDE, encoding="utf-8")
    return tmp_path


def document(uri: str) -> types.TextDocumentIdentifier:
    return types.TextDocumentIdentifier(uri)


async def rename(editor: Editor, uri: str, where: types.Position, name: str) -> types.WorkspaceEdit:
    found = await editor.client.text_document_rename_async(types.RenameParams(document(uri), where, name))
    assert found is not None
    return found


def test_a_session(work: Path) -> None:
    async def steps(editor: Editor) -> None:
        client = editor.client
        uri = editor.open("rude.foresee")
        assert await editor.until(uri, lambda found: not found) == []

        # Half a statement: it is underlined where it is, and what can follow is offered there.
        broken = RUDE.replace("start speed 50 km/h", "start speed 50 kmh")
        editor.edit(uri, broken)
        (mistake,) = await editor.until(uri, bool)
        assert (mistake.code, mistake.source) == ("FS005", "foresee")
        assert mistake.range.start == at(broken, "kmh")
        assert mistake.range.end == at(broken, "kmh", after=True)

        actions = await client.text_document_code_action_async(
            types.CodeActionParams(document(uri), mistake.range, types.CodeActionContext([mistake]))
        )
        assert actions is not None
        (action,) = actions
        assert isinstance(action, types.CodeAction)
        assert action.edit is not None and action.edit.changes is not None
        assert applied(broken, list(action.edit.changes[uri])) == RUDE

        unfinished = RUDE.replace("start speed 50 km/h", "start speed 50 ")
        editor.edit(uri, unfinished)
        await editor.until(uri, lambda found: [d.code for d in found] != ["FS005"])
        where = at(unfinished, "start speed 50 ", after=True)
        offered = await client.text_document_completion_async(types.CompletionParams(document(uri), where))
        assert isinstance(offered, types.CompletionList)
        assert [item.label for item in offered.items] == ["m/s", "km/h", "mph"]

        editor.edit(uri, RUDE)
        assert await editor.until(uri, lambda found: not found) == []

        said = await client.text_document_hover_async(types.HoverParams(document(uri), at(RUDE, "50 km/h")))
        assert said is not None and isinstance(said.contents, types.MarkupContent)
        assert "50 km/h = 13.89 m/s = 31.07 mph" in said.contents.value

        place = await client.text_document_definition_async(types.DefinitionParams(document(uri), at(RUDE, "mill_oak")))
        assert isinstance(place, types.Location)
        town = (work / TOWN).read_text(encoding="utf-8")
        assert place.uri == editor.uri(TOWN)
        assert place.range.start == at(town, "junction mill_oak") or town.split("\n")[
            place.range.start.line
        ].lstrip().startswith("junction mill_oak")

        messy = RUDE.replace("  param", "      param")
        editor.edit(uri, messy)
        edits = await client.text_document_formatting_async(
            types.DocumentFormattingParams(document(uri), types.FormattingOptions(2, True))
        )
        assert applied(messy, list(edits or [])) == RUDE
        editor.edit(uri, RUDE)

        outline = await client.text_document_document_symbol_async(types.DocumentSymbolParams(document(uri)))
        assert outline is not None and isinstance(outline[0], types.DocumentSymbol)
        assert [s.name for s in outline[0].children or []] == [
            "room",
            "ego",
            "other",
            "when ego.eta(mill_oak) < 6 s",
            "expect never collision(ego)",
            "near",
        ]
        folds = await client.text_document_folding_range_async(types.FoldingRangeParams(document(uri)))
        assert [(f.start_line, f.end_line) for f in folds or []][:2] == [(3, 25), (8, 11)]
        tokens = await client.text_document_semantic_tokens_full_async(types.SemanticTokensParams(document(uri)))
        assert tokens is not None and len(tokens.data) % 5 == 0 and len(tokens.data) > 20

    session(work, steps)


def test_rename_goes_across_files_and_names_stale_children(work: Path) -> None:
    (work / "rude_p1.foresee").write_text(CLIP, encoding="utf-8")

    async def steps(editor: Editor) -> None:
        uri = editor.open("rude.foresee")
        edit = await rename(editor, uri, at(RUDE, "mill_oak"), "crossroads")
        changes = edit.changes or {}
        assert set(changes) == {uri, editor.uri(TOWN)}
        new = applied(RUDE, list(changes[uri]))
        assert new == RUDE.replace("mill_oak", "crossroads")
        town = (work / TOWN).read_text(encoding="utf-8")
        kept = applied(town, list(changes[editor.uri(TOWN)])).split("\n")
        assert [line for line in kept if "mill_oak" in line and not line.startswith("#")] == []

        # An open, unsaved network counts as it is in the editor.
        net = editor.open(TOWN, applied(town, list(changes[editor.uri(TOWN)])))
        editor.edit(uri, new)
        assert await editor.until(uri, lambda found: not found) == []
        assert await editor.until(net, lambda found: not found) == []
        assert editor.messages and "rude_p1.foresee" in editor.messages[0] and "stale" in editor.messages[0]

        road = await rename(editor, uri, at(new, "mill_west"), "avenue")
        assert applied(new, list((road.changes or {})[uri])) == new.replace("mill_west", "avenue")
        for where, name, why in (
            (at(new, "other:"), "Other", "not a name"),
            (at(new, "other:"), "ego", "already"),
            (at(new, "ego:"), "me", "always called"),
            (at(new, "other:"), "mill_mid", "already"),
        ):
            with pytest.raises(JsonRpcException, match=why):
                await rename(editor, uri, where, name)
        child = editor.open("rude_p1.foresee")
        with pytest.raises(JsonRpcException, match="the names of its parent"):
            await rename(editor, child, at(CLIP, "mill_west"), "avenue")

        references = await editor.client.text_document_references_async(
            types.ReferenceParams(types.ReferenceContext(False), document(uri), at(new, "other:"))
        )
        assert [r.range.start.line for r in references or []] == [15, 19]

    session(work, steps)


def test_where_things_stand_is_checked_on_opening_and_saving(work: Path) -> None:
    async def steps(editor: Editor) -> None:
        far = RUDE.replace("start at 110 m along other.route", "start at 9000 m along other.route")
        uri = editor.open("rude.foresee", far)
        (mistake,) = await editor.until(uri, bool)
        assert mistake.range.start.line == 15
        editor.edit(uri, RUDE)
        assert await editor.until(uri, lambda found: not found) == []
        editor.edit(uri, far)
        await editor.until(uri, lambda found: not found)  # typing asks for less
        editor.save(uri)
        assert [d.code for d in await editor.until(uri, bool)] == [mistake.code]

    session(work, steps)


def test_a_mistake_in_another_file_is_shown_where_it_is_named(work: Path) -> None:
    async def steps(editor: Editor) -> None:
        uri = editor.open("rude.foresee")
        await editor.until(uri, lambda found: not found)
        town = (work / TOWN).read_text(encoding="utf-8")
        net = editor.open(TOWN, town)
        await editor.until(net, lambda found: not found)
        editor.edit(net, town.replace("junction mill_oak", "juncton mill_oak", 1))
        assert "FS004" in [d.code for d in await editor.until(net, bool)]
        # The open scenario is checked again although only its network was touched.
        (mistake,) = [d for d in await editor.until(uri, bool) if d.related_information]
        assert mistake.range.start == at(RUDE, '"networks/town.foresee"')
        assert mistake.related_information is not None
        assert mistake.related_information[0].location.uri == net
        editor.edit(net, town)
        assert await editor.until(uri, lambda found: not found) == []

    session(work, steps)


def test_names_in_a_campaign_are_checked(work: Path) -> None:
    text = 'foresee 1\n\ncampaign nightly {\n  seeds "rude.foresee"\n  drivers [pdn, idm]\n}\n'

    async def steps(editor: Editor) -> None:
        uri = editor.open("nightly.foresee", text)
        (mistake,) = await editor.until(uri, bool)
        assert (mistake.code, mistake.range) == ("FS058", types.Range(at(text, "pdn"), at(text, "pdn", after=True)))
        editor.edit(uri, text.replace("pdn", "pdm"))
        assert await editor.until(uri, lambda found: not found) == []

    session(work, steps)


def test_wide_characters_count_as_the_editor_counts_them(work: Path) -> None:
    text = RUDE.replace("  end after 8 s", '  end after 8 s; doc "🚗🚗 é"; end aftr 9 s')

    async def steps(editor: Editor) -> None:
        uri = editor.open("rude.foresee", text)
        found = await editor.until(uri, bool)
        mistake = next(d for d in found if d.code == "FS004")
        assert mistake.range == types.Range(at(text, "aftr"), at(text, "aftr", after=True))

    session(work, steps)


def test_a_text_that_was_never_saved(work: Path) -> None:
    async def steps(editor: Editor) -> None:
        uri = "untitled:Untitled-1"
        editor._versions[uri] = 1
        editor.client.text_document_did_open(
            types.DidOpenTextDocumentParams(types.TextDocumentItem(uri, "foresee", 1, "foresee 1\n\nscenaro a {\n}\n"))
        )
        assert "FS004" in [d.code for d in await editor.until(uri, bool)]

    session(work, steps)
