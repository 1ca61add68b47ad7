"""The language server's features, one function each: what the editor asks for, answered from the other modules."""

from __future__ import annotations

from pathlib import Path

from lsprotocol import types
from pygls.exceptions import JsonRpcException

from foresee_dsl.editor import navigate
from foresee_dsl.editor.completion import Suggestion, complete
from foresee_dsl.editor.files import Files
from foresee_dsl.editor.hover import hover as hover_of
from foresee_dsl.editor.session import SOURCE, ForeseeServer, Positions
from foresee_dsl.editor.symbols import Entry, Occurrence, folds, occurrences, outline
from foresee_dsl.errors import InputError
from foresee_dsl.language.messages.suggest import replacement
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.parser import format_text

_ITEMS = {
    "keyword": types.CompletionItemKind.Keyword,
    "constant": types.CompletionItemKind.EnumMember,
    "unit": types.CompletionItemKind.Unit,
    "value": types.CompletionItemKind.Value,
    "name": types.CompletionItemKind.Variable,
    "file": types.CompletionItemKind.File,
    "type": types.CompletionItemKind.TypeParameter,
}
_SYMBOLS = {
    "Scenario": types.SymbolKind.Module,
    "Extension": types.SymbolKind.Module,
    "Clip": types.SymbolKind.Module,
    "Mutant": types.SymbolKind.Module,
    "Network": types.SymbolKind.Namespace,
    "Catalogue": types.SymbolKind.Namespace,
    "Ego": types.SymbolKind.Object,
    "Actor": types.SymbolKind.Object,
    "Traffic": types.SymbolKind.Array,
    "Junction": types.SymbolKind.Class,
    "Road": types.SymbolKind.Struct,
    "Stage": types.SymbolKind.EnumMember,
    "Param": types.SymbolKind.Variable,
    "Case": types.SymbolKind.EnumMember,
    "VehicleModel": types.SymbolKind.Class,
    "When": types.SymbolKind.Event,
    "Expect": types.SymbolKind.Boolean,
}
_TOKENS: dict[SymbolKind, str] = {
    "actor": "variable",
    "junction": "class",
    "road": "struct",
    "stage": "enumMember",
    "parameter": "parameter",
    "case": "enumMember",
    "model": "type",
    "label": "event",
    "thing": "variable",
}
_LEGEND = types.SemanticTokensLegend(sorted(set(_TOKENS.values())), ["declaration"])

_At = types.DefinitionParams | types.ReferenceParams | types.PrepareRenameParams | types.RenameParams


def make_server() -> ForeseeServer:
    """Return a language server with all its features."""
    server = ForeseeServer()
    feature = server.feature
    feature(types.TEXT_DOCUMENT_DID_OPEN)(_opened_or_saved)
    feature(types.TEXT_DOCUMENT_DID_CHANGE)(_changed)
    feature(types.TEXT_DOCUMENT_DID_SAVE)(_opened_or_saved)
    feature(types.TEXT_DOCUMENT_DID_CLOSE)(_closed)
    feature(types.SHUTDOWN)(_shut_down)
    feature(types.TEXT_DOCUMENT_COMPLETION, types.CompletionOptions(trigger_characters=[" ", ".", '"', "(", "[", "/"]))(
        _completion
    )
    feature(types.TEXT_DOCUMENT_HOVER)(_hover)
    feature(types.TEXT_DOCUMENT_DEFINITION)(_definition)
    feature(types.TEXT_DOCUMENT_REFERENCES)(_references)
    feature(types.TEXT_DOCUMENT_PREPARE_RENAME)(_prepare_rename)
    feature(types.TEXT_DOCUMENT_RENAME, types.RenameOptions(prepare_provider=True))(_rename)
    feature(types.TEXT_DOCUMENT_FORMATTING)(_formatting)
    feature(types.TEXT_DOCUMENT_DOCUMENT_SYMBOL)(_document_symbols)
    feature(types.TEXT_DOCUMENT_FOLDING_RANGE)(_folding_ranges)
    feature(
        types.TEXT_DOCUMENT_CODE_ACTION, types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix])
    )(_code_actions)
    feature(types.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL, _LEGEND)(_semantic_tokens)
    return server


# ---- documents ------------------------------------------------------------------------------------------------------


def _opened_or_saved(
    server: ForeseeServer, params: types.DidOpenTextDocumentParams | types.DidSaveTextDocumentParams
) -> None:
    server.check_soon(params.text_document.uri, places=True)


def _changed(server: ForeseeServer, params: types.DidChangeTextDocumentParams) -> None:
    server.check_soon(params.text_document.uri, places=False)


def _closed(server: ForeseeServer, params: types.DidCloseTextDocumentParams) -> None:
    server.close(params.text_document.uri)


def _shut_down(server: ForeseeServer, params: None) -> None:
    del params
    server.stop()


# ---- at a place -----------------------------------------------------------------------------------------------------


def _completion(server: ForeseeServer, params: types.CompletionParams) -> types.CompletionList:
    uri = params.text_document.uri
    places = server.positions(uri)
    found = complete(server.files(uri), server.path(uri), server.text(uri), places.offset(params.position))
    line, column = places.place(params.position)
    where = types.Range(places.position(line, column - found.replaces), params.position)
    items = [_item(suggestion, where, k) for k, suggestion in enumerate(found.suggestions)]
    return types.CompletionList(is_incomplete=False, items=items)


def _item(suggestion: Suggestion, where: types.Range, order: int) -> types.CompletionItem:
    about = types.MarkupContent(types.MarkupKind.Markdown, suggestion.about) if suggestion.about else None
    return types.CompletionItem(
        label=suggestion.text,
        kind=_ITEMS[suggestion.kind],
        detail=suggestion.detail or None,
        documentation=about,
        sort_text=f"{order:05}",
        text_edit=types.TextEdit(where, suggestion.text),
    )


def _hover(server: ForeseeServer, params: types.HoverParams) -> types.Hover | None:
    uri = params.text_document.uri
    places = server.positions(uri)
    found = hover_of(server.files(uri), server.path(uri), *places.place(params.position))
    if found is None:
        return None
    return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, found.markdown), places.range(found.span))


def _named(server: ForeseeServer, params: _At) -> tuple[Files, Path, Occurrence | None]:
    uri = params.text_document.uri
    files, path = server.files(uri), server.path(uri)
    return files, path, navigate.at(files, path, *server.positions(uri).place(params.position))


def _location(server: ForeseeServer, place: navigate.Place) -> types.Location:
    uri = server.uri(place.path)
    return types.Location(uri, server.positions(uri).range(place.span))


def _definition(server: ForeseeServer, params: types.DefinitionParams) -> types.Location | None:
    files, path, found = _named(server, params)
    place = navigate.definition(files, path, found) if found is not None else None
    return _location(server, place) if place is not None else None


def _references(server: ForeseeServer, params: types.ReferenceParams) -> list[types.Location]:
    files, path, found = _named(server, params)
    if found is None:
        return []
    defined = navigate.definition(files, path, found)
    places = navigate.references(files, path, found)
    wanted = params.context.include_declaration
    return [_location(server, place) for place in places if wanted or place != defined]


def _prepare_rename(server: ForeseeServer, params: types.PrepareRenameParams) -> types.Range | None:
    files, path, found = _named(server, params)
    if found is None:
        return None
    try:
        return server.positions(params.text_document.uri).range(navigate.renamed_from(files, path, found))
    except navigate.RenameError as error:
        raise _refused(str(error)) from None


def _rename(server: ForeseeServer, params: types.RenameParams) -> types.WorkspaceEdit:
    files, path, found = _named(server, params)
    if found is None:
        raise _refused("there is no name here")
    try:
        renaming = navigate.rename(files, path, found, params.new_name)
    except navigate.RenameError as error:
        raise _refused(str(error)) from None
    changes: dict[str, list[types.TextEdit]] = {}
    positions: dict[str, Positions] = {}
    for place in renaming.places:
        where = server.uri(place.path)
        known = positions.setdefault(where, server.positions(where))
        changes.setdefault(where, []).append(types.TextEdit(known.range(place.span), renaming.name))
    if renaming.stale:
        names = ", ".join(path.name for path in renaming.stale[:5]) + (", ..." if len(renaming.stale) > 5 else "")
        message = f"{len(renaming.stale)} recorded children pin what was renamed and are stale now: {names}"
        server.window_show_message(types.ShowMessageParams(types.MessageType.Warning, message))
    return types.WorkspaceEdit(changes=changes)


def _refused(message: str) -> JsonRpcException:
    return JsonRpcException(message, code=types.LSPErrorCodes.RequestFailed)


# ---- of a whole file ------------------------------------------------------------------------------------------------


def _formatting(server: ForeseeServer, params: types.DocumentFormattingParams) -> list[types.TextEdit] | None:
    uri = params.text_document.uri
    text = server.text(uri)
    try:
        formatted = format_text(text, str(server.path(uri)))
    except InputError:
        return None  # its errors are shown already
    places = server.positions(uri)
    return [] if formatted == text else [types.TextEdit(places.whole(), formatted)]


def _document_symbols(server: ForeseeServer, params: types.DocumentSymbolParams) -> list[types.DocumentSymbol]:
    uri = params.text_document.uri
    places = server.positions(uri)
    return [_symbol(entry, places) for entry in outline(server.text(uri))]


def _symbol(entry: Entry, places: Positions) -> types.DocumentSymbol:
    return types.DocumentSymbol(
        name=entry.name,
        kind=_SYMBOLS.get(entry.kind, types.SymbolKind.Property),
        range=places.range(entry.span),
        selection_range=places.range(entry.name_span),
        detail=entry.detail or None,
        children=[_symbol(child, places) for child in entry.children],
    )


def _folding_ranges(server: ForeseeServer, params: types.FoldingRangeParams) -> list[types.FoldingRange]:
    found = folds(server.text(params.text_document.uri))
    return [types.FoldingRange(start_line=a - 1, end_line=b - 1, kind=kind) for a, b, kind in found]


def _code_actions(server: ForeseeServer, params: types.CodeActionParams) -> list[types.CodeAction]:
    uri = params.text_document.uri
    places = server.positions(uri)
    actions = []
    for diagnostic in params.context.diagnostics:
        if diagnostic.source != SOURCE or diagnostic.range.start.line != diagnostic.range.end.line:
            continue
        found = replacement(diagnostic.message, places.text(diagnostic.range))
        if found is None:
            continue
        start, end, right = found
        line, column = places.place(diagnostic.range.start)
        where = types.Range(places.position(line, column + start), places.position(line, column + end))
        edit = types.WorkspaceEdit(changes={uri: [types.TextEdit(where, right)]})
        actions.append(
            types.CodeAction(
                f"Write '{right}'", types.CodeActionKind.QuickFix, [diagnostic], is_preferred=True, edit=edit
            )
        )
    return actions


def _semantic_tokens(server: ForeseeServer, params: types.SemanticTokensParams) -> types.SemanticTokens:
    uri = params.text_document.uri
    places = server.positions(uri)
    data: list[int] = []
    line = start = 0
    for o in occurrences(server.text(uri)):
        where = places.range(o.span)
        token = _TOKENS.get(o.kind)
        if token is None or o.span.line != o.span.end_line or o.span.end_column - o.span.column != len(o.name):
            continue  # in quotes it stays a text
        here = where.start
        if (here.line, here.character) < (line, start):
            continue
        ahead = here.character - (start if here.line == line else 0)
        length = where.end.character - here.character
        data += [here.line - line, ahead, length, _LEGEND.token_types.index(token), int(o.defines)]
        line, start = here.line, here.character
    return types.SemanticTokens(data)
