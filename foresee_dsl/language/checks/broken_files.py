"""Finds errors of names and values in a file that also has grammar errors, and reports those that are certain.

Only statements without grammar errors are checked. A missing item may be in a statement that could not be read, so it
is not reported, and a name counts as unknown only if no unread statement has that word.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from foresee_dsl.errors import Diagnostic, InputError, Span, subject
from foresee_dsl.helps import Meant, meant_word
from foresee_dsl.language import model as m
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.document import Document
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import closest, did_you_mean
from foresee_dsl.language.model import Definition
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.syntax.builder import Builder
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.syntax.reading import Reading
from foresee_dsl.language.syntax.scan import MOST, Lines, Raw
from foresee_dsl.language.traversal import walk

UNKNOWN_ROAD = "FS250"
UNKNOWN_JUNCTION = "FS251"
_WHOLE_FILE = ("FS007", "FS008", "FS009")
"""Codes of errors after which it is unclear which statements belong to which block."""
_OF_NAMES = ("FS031", "FS037", "FS040", "FS041", UNKNOWN_ROAD, UNKNOWN_JUNCTION)
_OF_WHAT_IS_THERE = (
    *("FS010", "FS012", "FS013", "FS030", "FS032", "FS033", "FS034", "FS060", "FS061", "FS062"),
    *("FS038", "FS039", "FS043", "FS046", "FS047", "FS049", "FS050"),
)
"""Codes of errors that depend only on the statement at fault, so that they hold whatever the unread statements
contain."""
_TAKEN = "FS049"
_USES = 2
_OF_THE_NETWORK = tuple([word] for word in ("road", "junction", "roundabout", "on_ramp", "off_ramp", "zebra", "bump"))
"""First words of those statements of a network that are not read at all if their block has an error."""


def with_certain(
    diagnostics: tuple[Diagnostic, ...],
    nodes: Sequence[Node],
    reading: Reading,
    path: str,
    load: Callable[[Path], Document],
) -> tuple[Diagnostic, ...]:
    """Return grammar errors together with the certain errors of the statements that could be read, in the order of
    their places.

    `reading` is the file's text as it was read; `load` reads the network that the file uses.
    """
    if len(nodes) != 1 or len(diagnostics) >= MOST or any(d.code in _WHOLE_FILE for d in diagnostics):
        return diagnostics
    text, lines, statements = reading.cut.text, reading.cut.lines, list(_flat(reading.cut.statements))
    broken = [_around(d, statements, lines) for d in diagnostics]
    unread = frozenset(word for raw in broken if raw is not None for word in _definable(raw, text))
    unread |= {word for raw in broken if raw is not None for word in _around_it(raw, statements, text)}
    node = _whole(nodes[0])
    builder = Builder(partial=True)
    model = builder.build(node) if node is not None else None
    if None in broken or not isinstance(model, Definition):
        return diagnostics
    document = Document(path, text, model, builder.spans)
    more = [
        certain
        for d in (*check_document(document), *unknown_names(document, load))
        if not any(_around(d, statements, lines) is raw for raw in broken) and (certain := _certain(d, unread))
    ]
    # A name that is a word of the language causes further errors at or right behind it: those are dropped.
    taken = {name for d in more if d.code == _TAKEN for name in d.names}
    diagnostics = tuple(d for d in diagnostics if d.code == _TAKEN or not any(_is_at(d, name) for name in taken))
    first = Span(0, 0, 0, 0)
    return tuple(sorted((*diagnostics, *more), key=lambda d: ((d.span or first).line, (d.span or first).column)))


def _is_at(diagnostic: Diagnostic, name: str) -> bool:
    if diagnostic.span is None:
        return False
    at = diagnostic.span.column - 1
    before, here = diagnostic.source_line[:at], diagnostic.source_line[at:]
    return re.search(rf"\b{name}\s*$", before) is not None or re.match(rf"{name}\b", here) is not None


def _certain(diagnostic: Diagnostic, unread: frozenset[str]) -> Diagnostic | None:
    if diagnostic.code in _OF_WHAT_IS_THERE:
        return diagnostic
    name = next(iter(diagnostic.names), None)
    if diagnostic.code not in _OF_NAMES or name is None or {name, name.rpartition("_")[0]} & unread:
        return None
    guessed = any(isinstance(edit, Meant) for edit in diagnostic.fixes)
    meant = closest(name, sorted(unread - KEYWORDS.keys())) if not guessed else None
    if meant is None:
        return diagnostic
    helped = meant_word(meant, name)
    return replace(diagnostic, help=helped.text, fixes=helped.edits)


def _whole(node: Node) -> Node | None:
    """Return a node without the statements in its blocks that have errors; None if the node itself has errors."""
    if Builder(partial=True).build(node) is not None:
        return node
    blocks = {key[0] for key, _, inner in node.lines if inner is not None and len(key) == 2}
    fields = dict(node.fields)
    for name in blocks:
        parts = fields.get(str(name))
        if isinstance(parts, tuple):
            fields[str(name)] = tuple(w for part in parts if isinstance(part, Node) and (w := _whole(part)) is not None)
    trimmed = replace(node, fields=fields)
    return trimmed if Builder(partial=True).build(trimmed) is not None else None


def _around(diagnostic: Diagnostic, statements: Sequence[Raw], lines: Lines) -> Raw | None:
    """Return the innermost statement that contains an error; None if no statement does."""
    if diagnostic.span is None:
        return None
    at = lines.offset(diagnostic.span.line, diagnostic.span.column)
    around = (raw for raw in statements if raw.start <= at <= (raw.end if raw.block is None else raw.close))
    return max(around, key=lambda raw: raw.start, default=None)


def _definable(raw: Raw, text: str) -> Iterator[str]:
    """Yield the words that an unread statement could define: its first words, and those of the longer statements in
    its block.

    A defined name comes behind one keyword or two (`add vehicle runner: ...`). In a block a definition has at least
    three words (`param gap: time`), and a use has two (`speed gap`).
    """
    yield from _first_words(raw, text)
    for inner in _flat(raw.block or ()):
        words = _first_words(inner, text)
        if len(words) > _USES:
            yield from words


def _around_it(broken: Raw, statements: Sequence[Raw], text: str) -> Iterator[str]:
    """Yield the names that the statements around an unread one could define: a road with an error in its block is not
    read either, but its name is in use."""
    for raw in statements:
        words = _first_words(raw, text)
        if raw.block is not None and raw.start < broken.start < raw.close and words[:1] in _OF_THE_NETWORK:
            yield from words


def _first_words(raw: Raw, text: str) -> list[str]:
    return re.findall(r"[^\W\d]\w*", text[raw.start : raw.end].lower())[:3]


def _flat(statements: Iterable[Raw]) -> Iterator[Raw]:
    waiting = [*statements][::-1]  # no recursion: braces may be nested by the thousand
    while waiting:
        raw = waiting.pop()
        yield raw
        waiting += (raw.block or [])[::-1]


# ---- names that a network does not have ------------------------------------------------------------------------------


def unknown_names(document: Document, load: Callable[[Path], Document]) -> Iterator[Diagnostic]:
    """Yield errors about roads and junctions that the network does not have, for files whose other errors prevent the
    placement of actors.

    It yields none if the network has another format or cannot be read. `load` reads a file.
    """
    model = document.model
    network = _network(model, Path(document.path).parent, load) if isinstance(model, m.Scenario) else None
    if network is None or not isinstance(model, m.Scenario):
        return
    ramps = (m.OnRamp, m.OffRamp)
    crossed = (m.Junction, m.Roundabout, m.Zebra, m.Bump, *ramps)
    junctions = [item.name for item in network.body if isinstance(item, crossed)]
    roads = [item.name for item in network.body if isinstance(item, (m.Road, *ramps))]
    edges = {*roads, *(f"{road}_back" for road in roads)}
    # Names such as `circle_west`, a junction on the ring of a roundabout, begin with the name of the statement.
    parts = tuple(f"{item.name}_" for item in network.body if isinstance(item, crossed[1:]))
    collector = Collector(document)
    for statement in model.body:
        if isinstance(statement, m.Network | m.Param | m.Case):
            continue
        for item, field, kind, name in _named(statement):
            if kind == "junction" and name not in junctions and not name.startswith(parts):
                help = did_you_mean(name, junctions)
                collector.add(item, field, UNKNOWN_JUNCTION, "there is no junction called " + subject(name), help)
            elif kind == "road" and name.partition("#")[0] not in edges:
                help = did_you_mean(name, roads)
                collector.add(item, field, UNKNOWN_ROAD, "there is no road or edge called " + subject(name), help)
    yield from collector.sorted()


def _named(statement: m.Item) -> Iterator[tuple[m.Item, str, str, str]]:
    """Yield the names of roads and junctions in a statement: item, field, `road` or `junction`, name."""
    for item in walk(statement):
        for field in type(item).model_fields:
            names, value = form_of(type(item), field).names, getattr(item, field)
            if names is None or names.kind not in ("junction", "road") or names.defines:
                continue
            if isinstance(value, str):
                yield item, field, names.kind, value
            elif isinstance(value, tuple):
                yield from ((item, f"{field}.{k}", names.kind, v) for k, v in enumerate(value) if isinstance(v, str))


def _network(scenario: m.Scenario, folder: Path, load: Callable[[Path], Document]) -> m.Network | None:
    inline, used = scenario.first(m.Network), scenario.first(m.UseNetwork)
    if inline is not None or used is None or not used.path.endswith(".foresee"):
        return inline
    try:
        model = load(folder / used.path).model
    except InputError:  # the file may have errors or not exist
        return None
    return model if isinstance(model, m.Network) else None
