"""Answers the editor's requests about a place or a file, with one function per request, from the other modules of the
package."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType

from foresee_dsl.editor import navigate
from foresee_dsl.editor.answers.fixes import fixes, with_names_of
from foresee_dsl.editor.answers.marks import hints, lenses, tokens
from foresee_dsl.editor.completion import Suggestion, complete
from foresee_dsl.editor.files import Files
from foresee_dsl.editor.hover import hover as hover_of
from foresee_dsl.editor.hover import results
from foresee_dsl.editor.protocol.positions import Positions
from foresee_dsl.editor.protocol.rpc import Json, RequestError
from foresee_dsl.editor.protocol.tokens import TOKEN_TYPES
from foresee_dsl.editor.session import SOURCE, Session, is_file, path_of, with_help
from foresee_dsl.editor.symbols import Entry, Occurrence, folds, outline
from foresee_dsl.errors import Diagnostic, InputError, Span
from foresee_dsl.language.codes import NEED_THE_NETWORK
from foresee_dsl.language.parser import format_text, plain
from foresee_dsl.language.syntax.scan import Lines

# Numbers of the protocol (3.17): CompletionItemKind, SymbolKind.
_ITEMS = {"keyword": 14, "constant": 20, "unit": 11, "value": 12, "name": 6, "file": 17, "type": 25}
_PROPERTY = 7
_SYMBOLS = {
    "Scenario": 2,
    "Extension": 2,
    "Clip": 2,
    "Mutant": 2,
    "Network": 3,
    "Catalogue": 3,
    "Ego": 19,
    "Actor": 19,
    "Traffic": 18,
    "Junction": 5,
    "Road": 23,
    "Stage": 22,
    "Param": 13,
    "Case": 22,
    "VehicleModel": 5,
    "When": 24,
    "Expect": 17,
}


def _uri(params: Json) -> str:
    return str(params["textDocument"]["uri"])


# ---- at a place -----------------------------------------------------------------------------------------------------


def completion(session: Session, params: Json) -> Json:
    """Return the suggestions at a place."""
    uri = _uri(params)
    places = session.positions(uri)
    completed = complete(session.files(uri), path_of(uri), session.text(uri), places.offset(params["position"]))
    line, column = places.place(params["position"])
    where = {"start": places.position(line, column - completed.replaces), "end": params["position"]}
    items = [_item(suggestion, where, k) for k, suggestion in enumerate(completed.suggestions)]
    return {"isIncomplete": False, "items": items}


def _item(suggestion: Suggestion, where: Json, order: int) -> Json:
    item: Json = {
        "label": suggestion.text,
        "kind": _ITEMS[suggestion.kind],
        "sortText": f"{order:05}",
        "textEdit": {"range": where, "newText": suggestion.text},
    }
    if suggestion.detail:
        item["detail"] = suggestion.detail
    if suggestion.about:
        item["documentation"] = {"kind": "markdown", "value": suggestion.about}
    return item


def hover(session: Session, params: Json) -> Json | None:
    """Return the help text of a place; None if there is none."""
    uri = _uri(params)
    places = session.positions(uri)
    about = hover_of(session.files(uri), path_of(uri), *places.place(params["position"]))
    if about is None:
        return None
    return {"contents": {"kind": "markdown", "value": about.markdown}, "range": places.range(about.span)}


def _named(session: Session, params: Json) -> tuple[Files, Path, Occurrence | None]:
    uri = _uri(params)
    files, path = session.files(uri), path_of(uri)
    return files, path, navigate.at(files, path, *session.positions(uri).place(params["position"]))


def _location(session: Session, place: navigate.Place) -> Json:
    uri = session.uri(place.path)
    return {"uri": uri, "range": session.positions(uri).range(place.span)}


def definition(session: Session, params: Json) -> Json | None:
    """Return the place where a name is defined."""
    files, path, name = _named(session, params)
    place = navigate.definition(files, path, name) if name is not None else None
    return _location(session, place) if place is not None else None


def references(session: Session, params: Json) -> list[Json]:
    """Return the places where a name is used."""
    files, path, name = _named(session, params)
    if name is None:
        return []
    defined = navigate.definition(files, path, name)
    places = navigate.references(files, path, name)
    wanted = params["context"]["includeDeclaration"]
    return [_location(session, place) for place in places if wanted or place != defined]


def prepare_rename(session: Session, params: Json) -> Json | None:
    """Return the place that would be renamed."""
    files, path, name = _named(session, params)
    if name is None:
        return None
    try:
        return session.positions(_uri(params)).range(navigate.renamed_from(files, path, name))
    except navigate.RenameError as error:
        raise RequestError(str(error)) from None


def rename(session: Session, params: Json) -> Json:
    """Return the edits that rename a name everywhere."""
    files, path, name = _named(session, params)
    if name is None:
        raise RequestError("there is no name here")
    try:
        renaming = navigate.rename(files, path, name, params["newName"])
    except navigate.RenameError as error:
        raise RequestError(str(error)) from None
    changes: dict[str, list[Json]] = {}
    positions: dict[str, Positions] = {}
    for place in renaming.places:
        where = session.uri(place.path)
        places = positions.get(where) or positions.setdefault(where, session.positions(where))
        changes.setdefault(where, []).append({"range": places.range(place.span), "newText": renaming.name})
    if renaming.stale:
        names = ", ".join(path.name for path in renaming.stale[:5]) + (", ..." if len(renaming.stale) > 5 else "")
        message = f"{len(renaming.stale)} clips and mutants are stale now, as a file that they pin is edited: {names}"
        session.connection.notify("window/showMessage", {"type": 2, "message": message})
    return {"changes": changes}


# ---- of a whole file ------------------------------------------------------------------------------------------------


def formatting(session: Session, params: Json) -> list[Json] | None:
    """Return the edit that formats a text; None if the text has errors, which the editor shows already."""
    uri = _uri(params)
    text = session.text(uri)
    try:
        formatted = format_text(text, str(path_of(uri)))
    except InputError:
        return None
    return [] if formatted == text else [{"range": session.positions(uri).whole(), "newText": formatted}]


def document_symbols(session: Session, params: Json) -> list[Json]:
    """Return the outline of a text."""
    uri = _uri(params)
    places = session.positions(uri)
    return [_symbol(entry, places) for entry in outline(session.text(uri))]


def _symbol(entry: Entry, places: Positions) -> Json:
    symbol: Json = {
        "name": entry.name,
        "kind": _SYMBOLS.get(entry.kind, _PROPERTY),
        "range": places.range(entry.span),
        "selectionRange": places.range(entry.name_span),
        "children": [_symbol(child, places) for child in entry.children],
    }
    return {**symbol, "detail": entry.detail} if entry.detail else symbol


def folding_ranges(session: Session, params: Json) -> list[Json]:
    """Return the ranges of lines that can be folded."""
    return [{"startLine": a - 1, "endLine": b - 1, "kind": kind} for a, b, kind in folds(session.text(_uri(params)))]


def code_actions(session: Session, params: Json) -> list[Json]:
    """Return the quick fixes of the diagnostics at a place."""
    uri = _uri(params)
    text, places, path = session.text(uri), session.positions(uri), path_of(uri)

    @cache
    def check_text(text: str, placed: bool) -> tuple[Diagnostic, ...]:
        # actors are placed only for an error that needs it, as that is slow
        every = session.find(uri, text, places=placed)
        return tuple(diagnostic for diagnostic in every if diagnostic.path == str(path))

    adapt, lines = with_names_of(path, session.overlay()), Lines(plain(text))
    actions = []
    for diagnostic in params["context"]["diagnostics"]:
        if diagnostic.get("source") != SOURCE:
            continue
        span = places.span(diagnostic["range"])
        check = partial(check_text, placed=str(diagnostic.get("code", "")).startswith(NEED_THE_NETWORK))
        meant = _meant(diagnostic, span, check(text))
        offered = fixes(meant, span, text, check, adapt) if meant is not None else ()
        for k, fix in enumerate(offered):
            edit = {"changes": {uri: [{"range": places.range(lines.span(fix.start, fix.end)), "newText": fix.text}]}}
            action: Json = {"title": fix.title, "kind": "quickfix", "diagnostics": [diagnostic], "edit": edit}
            actions.append({**action, "isPreferred": k == 0 and len(offered) == 1})
    return actions


def _meant(sent: Json, span: Span, diagnostics: Iterable[Diagnostic]) -> Diagnostic | None:
    """Return the present diagnostic that corresponds to one that the editor has sent; None if there is none any more.

    Of several diagnostics with the same message, it is the nearest.
    """
    words = sent.get("code"), sent["message"]
    same = [diagnostic for diagnostic in diagnostics if (diagnostic.code, with_help(diagnostic)) == words]
    return min(
        same,
        key=lambda diagnostic: abs(diagnostic.span.line - span.line) if diagnostic.span is not None else 0,
        default=None,
    )


def semantic_tokens(session: Session, params: Json) -> Json:
    """Return the kinds of the words of a text in the protocol's encoding: each position is relative to the preceding
    one.
    """
    uri = _uri(params)
    places = session.positions(uri)
    data: list[int] = []
    line = start = 0
    for token in tokens(session.text(uri)):
        where = places.range(token.span)
        here, end = where["start"], where["end"]
        ahead = here["character"] - (start if here["line"] == line else 0)
        length = end["character"] - here["character"]
        data += [here["line"] - line, ahead, length, TOKEN_TYPES.index(token.type), int(token.defines)]
        line, start = here["line"], here["character"]
    return {"data": data}


def inlay_hints(session: Session, params: Json) -> list[Json]:
    """Return the hints of the visible lines."""
    uri = _uri(params)
    places = session.positions(uri)
    span = places.span(params["range"])
    texts = list(hints(session.text(uri), span.line, span.end_line))
    for where, result in results(session.files(uri), path_of(uri)):
        if span.line <= where.end_line <= span.end_line:
            texts.append((where.end_line, where.end_column, f"= {result}"))
    return [
        {"position": places.position(line, column), "label": text, "paddingLeft": True}
        for line, column, text in sorted(texts)
    ]


def code_lenses(session: Session, params: Json) -> list[Json]:
    """Return the commands above a file's definition and above its cases."""
    uri = _uri(params)
    if not is_file(uri):
        return []
    places = session.positions(uri)
    return [
        {
            "range": places.range(lens.span),
            "command": {"title": lens.command, "command": f"foresee.{lens.command}", "arguments": [lens.address]},
        }
        for lens in lenses(path_of(uri), session.text(uri))
    ]


ANSWERS: Mapping[str, Callable[[Session, Json], object]] = MappingProxyType(
    {
        "textDocument/completion": completion,
        "textDocument/hover": hover,
        "textDocument/definition": definition,
        "textDocument/references": references,
        "textDocument/prepareRename": prepare_rename,
        "textDocument/rename": rename,
        "textDocument/formatting": formatting,
        "textDocument/documentSymbol": document_symbols,
        "textDocument/foldingRange": folding_ranges,
        "textDocument/codeAction": code_actions,
        "textDocument/semanticTokens/full": semantic_tokens,
        "textDocument/inlayHint": inlay_hints,
        "textDocument/codeLens": code_lenses,
    }
)
"""The function that answers each request, by the method of the protocol."""
