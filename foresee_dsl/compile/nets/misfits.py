"""Mistakes in a network's statements that show only when the network is built."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from foresee_dsl.errors import CompileError, Diagnostic, InputError
from foresee_dsl.helps import Help, HelpText
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Document

CODE = "FS270"
_QUOTED = re.compile(r"'([^'\n]+)'")


class Misfit(NamedTuple):
    """A mistake in one statement of a network: the statement, its field at fault, and what to say."""

    item: m.Item
    field: str
    message: str
    help: HelpText


class MisfitError(CompileError):
    """Statements of a network, at least one, contradict its roads."""

    def __init__(self, misfits: Iterable[Misfit]) -> None:
        self.misfits = tuple(misfits)
        super().__init__("; ".join(misfit.message for misfit in self.misfits))


def located(error: MisfitError, network: m.Network, document: Document | None) -> InputError:
    """Return the mistakes with their places in the file that holds the network; without a file, without places."""
    return InputError(tuple(_located(misfit, network, document) for misfit in error.misfits))


def placed(message: str, network: m.Network, document: Document | None) -> str:
    """Return a message of netconvert with the file and the network before it, and the statement that it quotes.

    An edge has the name of its road with more behind it (`west_back`), so the longest name of a statement with which
    the quoted one begins counts.
    """
    named = {item.name: item for item in network.body if isinstance(item, m.Junction | m.Roundabout | m.Road)}
    item = next(
        (named[name] for quoted in _QUOTED.findall(message) for name in _beginnings(quoted) if name in named), None
    )
    where = "the network" if network.name == "here" else f"network '{network.name}'"
    if item is not None:
        where = f"{item.kind} '{item.name}' of {where}"
    if document is None:
        return f"{where}: {message}"
    statement = _written(item, network, document)
    span = document.span(statement) if statement is not None else None
    line = f", line {span.line}" if span is not None else ""
    return f"'{document.path}'{line}: {where}: {message}"


def _beginnings(quoted: str) -> Iterator[str]:
    """Yield `west_back_1`, `west_back` and `west` of a name."""
    parts = quoted.split("_")
    yield from ("_".join(parts[:k]) for k in range(len(parts), 0, -1))


def _located(misfit: Misfit, network: m.Network, document: Document | None) -> Diagnostic:
    if document is None:
        return Diagnostic.of(CODE, misfit.message, Help.of(misfit.help))
    item = _written(misfit.item, network, document)
    return document.diagnostic(item, misfit.field, CODE, misfit.message, misfit.help)


def _written(item: m.Item | None, network: m.Network, document: Document) -> m.Item | None:
    """Return the statement in the file for a statement of the network; for None, the network."""
    definition = document.model
    if not isinstance(definition, m.Network):
        definition = next((part for part in definition.body if isinstance(part, m.Network)), network)
    if item is None:
        return definition
    # calculations and parameters may have been replaced by their values, but statements keep their order
    k = next((k for k, part in enumerate(network.body) if part is item), None)
    return definition.body[k] if k is not None and k < len(definition.body) else None
