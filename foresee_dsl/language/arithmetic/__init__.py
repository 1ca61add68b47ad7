"""Expressions: their dimensions, their values in a case, and which of them mean the same."""

from __future__ import annotations

from foresee_dsl.language import model as m


class ExpressionError(Exception):
    """An expression that has no value in a case: which part of it, and why."""

    def __init__(self, item: m.Item, message: str) -> None:
        super().__init__(message)
        self.item, self.message = item, message
