"""Collects the errors and warnings of a document, with their places."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from decimal import Decimal

from foresee_dsl.errors import Diagnostic, InputError, MessageText, Span
from foresee_dsl.helps import Help, HelpText, remove, rename, write
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Document
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.printer import print_item, written
from foresee_dsl.language.units import EXAMPLES, NOUNS, Dimension


class Collector:
    """The diagnostics of one document, which checks and lints add.

    Without a document (a model built in memory) they have a path but no places.
    """

    def __init__(self, document: Document | None, path: str = "") -> None:
        self._document = document
        self._path = path
        self._diagnostics: list[Diagnostic] = []

    def __iter__(self) -> Iterator[Diagnostic]:
        """Yield the diagnostics in the order in which they were added."""
        return iter(self._diagnostics)

    def add(
        self,
        item: m.Item | None,
        field: str,
        code: str,
        message: MessageText,
        help: HelpText = "",
        *,
        head_only: bool = False,
    ) -> None:
        """Add an error or, if the code says so, a warning about a field of an item.

        With the field "" the whole item is underlined, with `head_only` no more than its first line; without an item
        the error is about the file.
        """
        if self._document is None:
            self._diagnostics.append(Diagnostic.of(code, message, help, self._path))
            return
        diagnostic = self._document.diagnostic(item, field, code, message, help)
        if head_only and diagnostic.span is not None and diagnostic.span.end_line != diagnostic.span.line:
            start = diagnostic.span.column - 1
            end = start + len(diagnostic.source_line[start:].split("{")[0].rstrip()) + 1
            diagnostic = replace(
                diagnostic, span=Span(diagnostic.span.line, diagnostic.span.column, diagnostic.span.line, end)
            )
        self._diagnostics.append(diagnostic)

    def only_once(self, items: Sequence[m.Item]) -> None:
        """Report every statement of one kind after the first."""
        for item in items[1:]:
            word = re.match(r"\w+", print_item(item))
            message = f"`{word[0] if word else item}` is written twice"
            self.add(item, "", "FS047", message, remove("keep one of the two"), head_only=True)

    def unique(self, items: Iterable[m.Item], what: str) -> None:
        """Report names that two items have; `what` names the items in the plural. Items without a name are allowed."""
        seen: set[str | None] = set()
        for item in items:
            name: str | None = getattr(item, "name", None)
            if name is not None and name in seen:
                message = f"there are two {what} called '{name}'"
                self.add(item, "name", "FS030", message, rename("give one of them another name"))
            seen.add(name)

    def wrong_dimension(
        self, item: m.Item, field: str, value: m.Quantity, needed: Dimension, *, code: str = "FS010"
    ) -> None:
        """Report a quantity that should be of another dimension."""
        has = "has no unit" if not value.unit else f"is {NOUNS[value.dimension]}"
        message = f"`{written(value)}` {has}, but {NOUNS[needed]} is needed here"
        self.add(item, field, code, message, "write " + self.example(needed, item, field, value))

    @staticmethod
    def example(
        dimension: Dimension, item: m.Item | None = None, field: str = "", bare: m.Quantity | None = None
    ) -> Help:
        """Return the help `a time such as `2.5 s``, whose example fits the field of an item.

        If the author wrote a number without a unit (`bare`), the example has that number.
        """
        number, _, unit = EXAMPLES[dimension].partition(" ")
        if bare is not None and not bare.unit and unit:
            value = m.Quantity(value=bare.value, unit=unit)
        else:
            value = m.Quantity(value=Decimal(number), unit=unit)
        example = written(value)
        bounds = form_of(type(item), field.partition(".")[0]).bounds if item is not None else None
        if bounds is not None and not bounds.low <= value.si <= bounds.high:
            from foresee_dsl.language.arithmetic.results import nearest

            example = written(nearest(bounds, value))
        return f"{NOUNS[dimension]} such as " + write(example)

    def __len__(self) -> int:
        """Return the number of diagnostics."""
        return len(self._diagnostics)

    def sorted(self) -> tuple[Diagnostic, ...]:
        """Return the diagnostics in the order of their places, each once."""
        return tuple(sorted(dict.fromkeys(self._diagnostics), key=lambda d: (*d.start, d.code)))

    def raise_if_any(self) -> None:
        """Raise one `InputError` with all diagnostics, in the order in which they were added."""
        if self._diagnostics:
            raise InputError(tuple(self._diagnostics))
