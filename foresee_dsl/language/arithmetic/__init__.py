"""Expressions of the language: computes their dimensions and their values in a test case, and finds expressions that
mean the same."""

from __future__ import annotations

from foresee_dsl.language import model as m


class ExpressionError(Exception):
    """Raised for an expression that has no value in a case; it holds the part at fault and the reason."""

    def __init__(self, item: m.Item, message: str) -> None:
        super().__init__(message)
        self.item, self.message = item, message
