"""Evaluation of OpenSCENARIO's parameters and expressions: `$speed`, `${$speed / 3.6}`, `${-pi / 2}`.

No code is executed: a small grammar of numbers, words, operators and functions is evaluated here.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from foresee_exchange.openscenario.losses import SourceError

_LONGEST = 500
_PARAMETER = re.compile(r"\$([A-Za-z_][\w.]*)")
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>\$?[A-Za-z_]\w*)"
    r"|(?P<text>'[^']*')"
    r"|(?P<op>&&|\|\||==|!=|<=|>=|[-+*/%(),<>!]))"
)
_CONSTANTS: Mapping[str, float | bool] = {"pi": math.pi, "PI": math.pi, "true": True, "false": False}
_COMPARED: Mapping[str, Callable[[object, object], bool]] = {"==": operator.eq, "!=": operator.ne}
_ORDERED: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_WORDS = {"or": "||", "and": "&&", "not": "!"}
_FUNCTIONS: Mapping[str, Callable[..., float]] = {
    "round": lambda value: math.floor(value + 0.5),
    "sign": lambda value: (value > 0) - (value < 0),
    **{f.__name__: f for f in (math.floor, math.ceil, math.sqrt, math.pow, abs, min, max)},
    **{f.__name__: f for f in (math.sin, math.cos, math.tan, math.asin, math.acos, math.atan)},
}
Value = float | bool | str


def value_of(text: str, values: Mapping[str, str], *, name: bool = False) -> str:
    """Return an attribute's text with its parameters and expressions replaced by their values.

    An undeclared parameter or an invalid expression raises `SourceError`; but in a `name`, which only labels something,
    the text is kept.
    """
    if text.startswith("${") and text.endswith("}"):
        try:
            return _written(_Expression(text[2:-1], values).value())
        except SourceError:
            if name:
                return text
            raise
        except (ValueError, ArithmeticError, TypeError, RecursionError) as err:
            if name:
                return text
            raise SourceError(f"the expression '{text[2:-1].strip()[:80]}' cannot be computed: {err}") from err
    return _PARAMETER.sub(lambda match: _parameter(match.group(1), values, name=name), text)


def _parameter(called: str, values: Mapping[str, str], *, name: bool) -> str:
    """Return a parameter's value; for `$road.xodr`, if only `road` is declared, its value followed by `.xodr`."""
    head = called
    while head not in values and "." in head:
        head = head.rpartition(".")[0]
    if head in values:
        return values[head] + called[len(head) :]
    if called in ("pi", "PI"):
        return repr(math.pi)
    if name:
        return f"${called}"
    raise SourceError(f"the parameter ${called} is not declared")


def _written(value: Value) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    if not math.isfinite(value):
        raise ValueError("the value is not a finite number")
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


def _read(text: str) -> Value:
    """Return a parameter's value as a number or truth value if it is one, otherwise as text."""
    plain = text.strip()
    if plain in ("true", "false"):
        return plain == "true"
    try:
        return float(plain)
    except ValueError:
        return text


@dataclass
class _Expression:
    """A parser that evaluates while it reads; from weak to strong: or, and, not, comparison, sum, product, sign."""

    text: str
    values: Mapping[str, str]
    _tokens: list[str] = field(default_factory=list)
    _at: int = 0

    def value(self) -> Value:
        if len(self.text) > _LONGEST:
            raise ValueError("the expression is too long")
        at = 0
        while self.text[at:].strip():
            match = _TOKEN.match(self.text, at)
            if match is None:
                raise ValueError(f"'{self.text[at:].strip()[:10]}' is not understood")
            self._tokens.append(match.group(0).strip())
            at = match.end()
        result = self._or()
        if self._at < len(self._tokens):
            raise ValueError(f"'{self._tokens[self._at]}' is in the wrong place")
        return result

    def _next(self, *wanted: str) -> str | None:
        """Consume and return the next token if it is one of `wanted`, otherwise None."""
        if self._at < len(self._tokens):
            token = self._tokens[self._at]
            token = _WORDS.get(token, token)
            if token in wanted:
                self._at += 1
                return token
        return None

    def _or(self) -> Value:
        result = self._and()
        while self._next("||"):
            right = self._and()
            result = bool(result) or bool(right)
        return result

    def _and(self) -> Value:
        result = self._not()
        while self._next("&&"):
            right = self._not()
            result = bool(result) and bool(right)
        return result

    def _not(self) -> Value:
        return not self._not() if self._next("!") else self._comparison()

    def _comparison(self) -> Value:
        result = self._sum()
        while (op := self._next(*_COMPARED, *_ORDERED)) is not None:
            right = self._sum()
            result = (
                _COMPARED[op](result, right) if op in _COMPARED else _ORDERED[op](_as_number(result), _as_number(right))
            )
        return result

    def _sum(self) -> Value:
        result = self._product()
        while (op := self._next("+", "-")) is not None:
            left, right = _as_number(result), _as_number(self._product())
            result = left + right if op == "+" else left - right
        return result

    def _product(self) -> Value:
        result = self._sign()
        while (op := self._next("*", "/", "%")) is not None:
            left, right = _as_number(result), _as_number(self._sign())
            result = left * right if op == "*" else left / right if op == "/" else math.fmod(left, right)
        return result

    def _sign(self) -> Value:
        if self._next("-"):
            return -_as_number(self._sign())
        return _as_number(self._sign()) if self._next("+") else self._primary()

    def _primary(self) -> Value:
        if self._at >= len(self._tokens):
            raise ValueError("its end is missing")
        if self._next("("):
            result = self._or()
            self._closed()
            return result
        token = self._tokens[self._at]
        self._at += 1
        if token[0].isdigit() or token[0] == ".":
            return float(token)
        if token[0] == "'":
            return token[1:-1]
        if token[0] == "$":
            return _read(_parameter(token[1:], self.values, name=False))
        if token in _FUNCTIONS and self._next("("):
            arguments = [_as_number(self._or())]
            while self._next(","):
                arguments.append(_as_number(self._or()))
            self._closed()
            return float(_FUNCTIONS[token](*arguments))
        if token in _CONSTANTS:
            return _CONSTANTS[token]
        raise ValueError(f"'{token}' is neither a number, a parameter, an operator nor a supported function")

    def _closed(self) -> None:
        if not self._next(")"):
            raise ValueError("a bracket is not closed")


def _as_number(value: Value) -> float:
    if isinstance(value, str):
        raise ValueError(f"'{value[:30]}' is not a number")
    return float(value)
