"""Packs a parser's tables, so that one which is read from a file unpacks only the states and rules that a text needs.

Ours: a file of 45 lines needs a tenth of the states; reading the parser took 7 % of the work of its check, and takes
1 % packed (lark 1.3, which has no such thing).
"""

from __future__ import annotations

import pickle
from array import array
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any, overload

from lark import Lark
from lark.grammar import Rule
from lark.parsers.lalr_analysis import Reduce, Shift

PACKED = "1"
"""The version of what is stored."""
Row = Mapping[str, tuple[object, Any]]
"""What to do in a state, by the name of the next symbol: shift to a state, or reduce by a rule."""


class Rules(Sequence[Rule]):
    """Rules, each unpacked when it is first asked for; `callbacks` gets what makes its tree then."""

    def __init__(self, packed: Sequence[bytes], callbacks: dict[object, Any]) -> None:
        self._packed, self._callbacks = packed, callbacks
        self._known: dict[int, Rule] = {}

    def __reduce__(self) -> tuple[object, ...]:
        return Rules, (self._packed, self._callbacks)  # which the parser shares

    def __len__(self) -> int:
        return len(self._packed)

    @overload
    def __getitem__(self, number: int) -> Rule: ...
    @overload
    def __getitem__(self, number: slice) -> Sequence[Rule]: ...
    def __getitem__(self, number: int | slice) -> Rule | Sequence[Rule]:
        if isinstance(number, slice):
            return [self[k] for k in range(len(self))[number]]
        known = self._known.get(number)
        if known is None:
            known, make = pickle.loads(self._packed[number])  # noqa: S301 - packed below, and stored as a whole
            self._callbacks[known] = make
            self._known[number] = known
        return known


class States(dict[int, Row]):
    """Rows of a table by their state, each unpacked when it is first asked for."""

    def __init__(self, symbols: Sequence[str], begins: array[int], cells: array[int], rules: Rules) -> None:
        super().__init__()
        self._symbols, self._begins, self._cells, self._rules = symbols, begins, cells, rules

    def __reduce__(self) -> tuple[object, ...]:
        return States, (self._symbols, self._begins, self._cells, self._rules)

    def __missing__(self, state: int) -> Row:
        cells, symbols, rules = self._cells, self._symbols, self._rules
        row: dict[str, tuple[object, Any]] = {}
        for at in range(self._begins[state], self._begins[state + 1], 2):
            number, is_rule = divmod(cells[at + 1], 2)
            row[symbols[cells[at]]] = (Reduce, rules[number]) if is_rule else (Shift, number)
        self[state] = row
        return row


def pack(built: Lark, pickler: type[pickle.Pickler]) -> None:
    """Replace the tables, rules and callbacks of a parser by packed ones; it parses as before.

    These attributes are lark's own (tried with 1.3.1). Where one of them is missing, the parser is left as it is.
    """
    front = built.parser
    try:
        table, made = front.parser._parse_table, front.parser.parser.callbacks
        _ = built._callbacks, built.grammar, built._parse_tree_builder, front.parser_conf.rules, table.states
        _ = front.parser_conf.callbacks, front.parser.parser_conf.callbacks, front.parser.parser_conf.rules
    except AttributeError:
        return
    packed, numbers = [], {}
    for number, rule in enumerate(built.rules):
        data = BytesIO()
        pickler(data, pickle.HIGHEST_PROTOCOL).dump((rule, made[rule]))
        packed.append(data.getvalue())
        numbers[rule] = number
    symbols = sorted({symbol for row in table.states.values() for symbol in row})
    places = {symbol: place for place, symbol in enumerate(symbols)}
    begins, cells = array("I", [0]), array("H")
    for state in range(len(table.states)):
        for symbol, (action, to) in table.states[state].items():
            cells.extend((places[symbol], 2 * to if action is Shift else 2 * numbers[to] + 1))
        begins.append(len(cells))
    callbacks: dict[Any, Any] = {}
    rules = Rules(packed, callbacks)
    table.states = States(symbols, begins, cells, rules)
    built.rules = front.parser_conf.rules = rules  # type: ignore[assignment]  # lark only reads them
    built._callbacks = front.parser_conf.callbacks = front.parser.parser_conf.callbacks = callbacks
    front.parser.parser.callbacks, front.parser.parser_conf.rules = callbacks, rules
    del built.grammar, built._parse_tree_builder  # only what was made from them is used
