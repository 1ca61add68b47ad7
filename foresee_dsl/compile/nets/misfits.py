"""Mistakes in a network's statements that show only when the network is built."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from foresee_dsl.errors import CompileError, Diagnostic, InputError
from foresee_dsl.helps import Help, HelpText
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Document

CODE = "FS270"


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


def _located(misfit: Misfit, network: m.Network, document: Document | None) -> Diagnostic:
    if document is None:
        return Diagnostic.of(CODE, misfit.message, Help.of(misfit.help))
    # calculations and parameters may have been replaced by their values, but statements keep their order
    k = next((k for k, item in enumerate(network.body) if item is misfit.item), None)
    definition = document.model
    if not isinstance(definition, m.Network):
        definition = next((item for item in definition.body if isinstance(item, m.Network)), network)
    item = definition.body[k] if k is not None and k < len(definition.body) else None
    return document.diagnostic(item, misfit.field, CODE, misfit.message, misfit.help)
