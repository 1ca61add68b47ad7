"""Turns Lark's tree into nodes with places: the class of the model for each rule, and the place of each field."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal
from functools import cache
from types import MappingProxyType
from typing import cast

from lark import Token, Tree

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import HelpText, meant_code, one_of, remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model.pattern import FieldForm, Form, Slot, form_of, read_pattern
from foresee_dsl.language.syntax.node import Node, calculation, negative
from foresee_dsl.language.units import UNITS, dimension_of

_Tree = Tree[Token]
_Child = _Tree | Token | None

_BEHIND_SPEED = re.compile(r"(\w+)\.speed")
_BEHIND_DOT = re.compile(r"\{actor\}\.\]?(\w+)")
"""Matches a pattern's word behind an actor's name and a dot, such as `speed` in `ego.speed`."""
_MEANT_PROPERTIES = {
    **dict.fromkeys(("velocity", "v", "pace", "vel", "speed_mps"), "speed"),
    **dict.fromkeys(("accel", "deceleration", "decel", "a", "braking"), "acceleration"),
    **dict.fromkeys(("lateral_offset", "y_offset"), "offset"),
    **dict.fromkeys(("arrival", "time_to", "tta"), "eta"),
}
"""Names of properties in other languages, each with the name in this one."""
_PLACES_OF_ACTORS = ("x", "y", "position", "pos", "location", "place", "lane", "road", "edge", "junction")
_READ_OFF = ("speed", "acceleration", "offset", "deviation")
"""Measures of one actor that take no argument."""
MAX_DEPTH = 40
"""Maximum nesting of conditions (ours: far more than people write, far below Python's recursion limit)."""


_TURNS = form_of(m.Leg, "turn").words
RESERVED = frozenset((*_TURNS, *m.SIGNAL_COLOURS, "time"))
"""Words that are never read as a parameter's name, at any place; so no parameter can have such a name. In a comparison,
`time` is the time since the start."""

_KINDS = MappingProxyType({m.rule_of(kind): kind for kind in m.ITEMS})
"""The class of the model for each rule of the grammar."""
_CALCULATED = frozenset({"calculation", "negative", "extreme"})
_WORKED_OUT = _CALCULATED | {"ref"}
_NESTED = _CALCULATED | {"either", "both", "not", "sustained", "then"}
"""Rules that can contain themselves, directly or not."""


@cache
def _slots_of(pattern: str) -> tuple[Slot, ...]:
    return read_pattern(pattern).slots


def span_of(thing: _Tree | Token) -> Span:
    """Return the place of a tree or token."""
    at = thing.meta if isinstance(thing, Tree) else thing
    return Span(at.line or 1, at.column or 1, at.end_line or 1, at.end_column or 1)


class NodeMaker:
    """Turns the tree of one file into nodes, and collects the errors that the tree's form alone shows."""

    def __init__(self, tree: _Tree) -> None:
        self.errors: list[Diagnostic] = []
        self._tree = tree
        self.stated: list[Node] = []
        """The statements that define parameters or draw cases."""
        self.settles = False
        """True if these statements have expressions, which `parameters.settle` evaluates after all nodes are made."""
        extends = any(part.data == "extension" for part in _trees(tree.children))
        self._parameters = (
            m.ANY_NAME if extends else frozenset(str(param.children[0]) for param in _statements(tree, "param"))
        )
        self.calculates = False
        self._depth = 0
        self._special: Mapping[str, Callable[[_Tree], Node]] = {
            "quantity": self._quantity,
            "calculation": self._calculation,
            "negative": self._negative,
            "comparison": self._comparison,
            "assignment": self._assignment,
            "network": self._network,
            "param": self._param,
            "cases": self._cases,
            "weather": self._weather,
            "edge_route": self._edge_route,
            "leg": self._leg,
            "measure": self._measure,
            "change": self._change,
            "add": self._holding,
            "replace": self._holding,
            "shows": self._shows,
            "fidelity": self._fidelity,
        }

    def make(self, tree: _Tree) -> Node:
        """Return the node of a statement or value: its fields are those of the class's pattern, in that order."""
        rule = str(tree.data)  # comparing Lark's tokens would call a method in Python each time
        self._depth += rule in _NESTED
        self.calculates |= rule in _CALCULATED
        if self._depth > MAX_DEPTH:
            node = Node(_KINDS.get(rule, m.Sum), span_of(tree))
            self._error("FS018", "this is nested too deeply", "split it into several statements", node.span)
        elif (special := self._special.get(rule)) is not None:
            node = special(tree)
        else:
            node = self._built_node(tree, tree.children)
        self._depth -= rule in _NESTED
        return node

    # ---- the general case -----------------------------------------------------------------------------------------

    def _built_node(self, tree: _Tree, children: Sequence[_Child]) -> Node:
        """Return the node of a tree's class; None among the children stands for an absent field."""
        node = Node(_KINDS[str(tree.data)], span_of(tree))
        slots = _slots_of(node.kind.pattern)
        node.fields |= {slot.field: () for slot in slots[len(children) :] if slot.between is not None}
        for k, child in enumerate(children):
            if isinstance(child, Tree) and child.data == "block":
                self._put_block(node, child)
            elif k < len(slots) and slots[k].between is not None:
                self._put_all(node, slots[k].field, [c for c in children[k:] if c is not None])
                break
            elif child is not None:
                self._put(node, slots[k].field, child)
        return node

    def _put(self, node: Node, name: str, child: _Tree | Token) -> None:
        node.places[name] = span_of(child)
        form = form_of(node.kind, name)
        if isinstance(child, Tree) and child.data == "list":
            node.fields[name] = ()
            self._put_all(node, name, [c for c in child.children if c is not None])
            node.places[name] = span_of(child)
        elif isinstance(child, Token) and child.type == "DOTTED" and form.form is Form.NAME:
            match = _BEHIND_DOT.search(node.kind.pattern)
            self._dotted(child, node, name, (match[1],) if match is not None else ())
        else:
            node.fields[name] = self._value(form, child)

    def _put_all(self, node: Node, name: str, children: Sequence[_Tree | Token]) -> None:
        form = form_of(node.kind, name)
        node.fields[name] = tuple(self._value(form, child) for child in children)
        for k, child in enumerate(children):
            node.places[f"{name}.{k}"] = span_of(child)
        if children:
            first, last = node.places[f"{name}.0"], node.places[f"{name}.{len(children) - 1}"]
            node.places[name] = Span(first.line, first.column, last.end_line, last.end_column)

    def _put_block(self, node: Node, block: _Tree) -> None:
        """Put the lines of a block into a node: statements into the field that the pattern names, settings into their
        own fields."""
        node.block = span_of(block)
        statements: list[Node] = []
        body = read_pattern(node.kind.pattern).body
        for child in _trees(block.children):
            if child.data == "setting":
                self._put_setting(node, child)
                node.lines.append(((str(child.children[0]),), span_of(child), None))
            else:
                statements.append(self.make(child))
                node.lines.append(((body, len(statements) - 1), statements[-1].span, statements[-1]))
        if body:
            node.fields[body] = tuple(statements)

    def _put_setting(self, node: Node, setting: _Tree) -> None:
        word, value, *rest = setting.children
        name, place = str(word), span_of(setting)
        if name in node.fields:
            self._error("FS013", f"'{name}' is written twice", remove("keep one of the two"), place)
        if value is None:  # `crossings` may stand without a list
            node.fields[name], node.places[name] = (), place
        else:
            self._put(node, name, value)
        if rest and str(rest[0]) != "ego.route":
            help = "write it like " + write("within 120 m of ego.route")
            self._error("FS006", f"traffic cannot be around '{rest[0]}'", help, span_of(_token(rest[0])))

    def _value(self, form: FieldForm, child: _Tree | Token) -> Node | str:
        """Return the node of a tree, or the text of a token; a parameter's name, where allowed, becomes a reference."""
        if isinstance(child, Tree):
            return self.make(child)
        refers = form.form is Form.MODEL or (str(child) in self._parameters and str(child) not in RESERVED)
        if form.parameter and child.type == "NAME" and refers:
            return Node(m.Ref, span_of(child), {"name": str(child)})
        return _text(child)

    def _error(self, code: str, message: str, help: HelpText, span: Span) -> None:
        self.errors.append(Diagnostic.of(code, message, help, span=span))

    # ---- values ---------------------------------------------------------------------------------------------------

    def _quantity(self, tree: _Tree) -> Node:
        number, unit = tree.children
        node = Node(m.Quantity, span_of(tree), {"value": Decimal(str(number))}, {"value": span_of(_token(number))})
        if unit is None:
            return node
        if str(unit) == "%":
            written, share = f"{number} %", f"{Decimal(str(number)) / 100:f}"
            self._error("FS005", f"`{written}`: write a share as a plain number", meant_code(share), node.span)
            return Node(m.Quantity, node.span)
        if str(unit) not in UNITS and self._parameters is not m.ANY_NAME and str(unit) in self._parameters:
            message = f"the sign between `{number}` and '{unit}' is missing"
            self._error("FS060", message, meant_code(f"{number} * {unit}"), node.span)
            return Node(m.Quantity, node.span)
        node.fields["unit"] = str(unit)
        node.places["unit"] = span_of(_token(unit))
        return node

    def _calculation(self, tree: _Tree) -> Node:
        operands, signs = tree.children[::2], tree.children[1::2]
        if len(operands) > MAX_DEPTH:
            message = f"a calculation of {len(operands)} values"
            self._error("FS018", message, f"use at most {MAX_DEPTH} values: split it", span_of(tree))
            operands = operands[:1]
        nodes = [(self.make(operand), _with_brackets(operand)) for operand in operands if isinstance(operand, Tree)]
        return calculation(nodes, [(str(s), span_of(_token(s))) for s in signs[: len(nodes) - 1]])

    def _negative(self, tree: _Tree) -> Node:
        return negative(self.make(next(_trees(tree.children))), span_of(tree))

    def _comparison(self, tree: _Tree) -> Node:
        left, op, right = tree.children
        measured = isinstance(right, Tree) and right.data == "measure"
        if measured and isinstance(left, Tree) and left.data == "measure":
            help = "compare it with a value, such as " + write("ego.speed < 3 m/s")
            speeds = [_BEHIND_SPEED.fullmatch(_as_text(side)) for side in _trees(tree.children)]
            if speeds[0] is not None and speeds[1] is not None:
                help = meant_code(f"relative_speed({speeds[0][1]}, {speeds[1][1]}) {op} 0 m/s")
            self._error("FS061", "both sides of this comparison are measured in the run", help, span_of(tree))
        elif measured and isinstance(left, Tree) and isinstance(right, Tree):
            turned = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}[str(op)]
            help = meant_code(f"{_as_text(right)} {turned} {_as_text(left)}")
            self._error("FS061", "a quantity that is measured in the run belongs on the left", help, span_of(tree))
        else:
            return self._built_node(tree, tree.children)
        return Node(m.Comparison, span_of(tree))

    def _assignment(self, tree: _Tree) -> Node:
        return self._built_node(tree, [_word_of_ref(child) for child in tree.children])

    def _dotted(self, token: Token, node: Node, name: str, properties: tuple[str, ...], argument: str = "") -> str:
        """Put the actor of `ego.route` into the field `name` and return the property behind the dot.

        A property that is not in `properties` is reported; if these are empty, any is accepted.
        """
        actor, _, word = str(token).partition(".")
        node.fields[name] = actor
        whole = span_of(token)
        dot = whole.column + len(actor)
        node.places[name] = Span(whole.line, whole.column, whole.line, dot)
        if properties and word not in properties:
            self._unknown_property(
                actor, word, properties, Span(whole.line, dot + 1, whole.line, whole.end_column), argument
            )
        return word

    def _unknown_property(
        self, actor: str, word: str, properties: tuple[str, ...], place: Span, argument: str = ""
    ) -> None:
        if word in (*m.BETWEEN_ACTORS, "distance") and "speed" in properties:
            actors = (str(tree.children[1]) for tree in _statements(self._tree, "actor"))
            other = argument or next((name for name in (*actors, "ego") if name != actor), "lead")
            whole = Span(place.line, place.column - len(actor) - 1, place.line, place.end_column)
            help: HelpText = meant_code(f"{word}({actor}, {other})")
            self._error("FS006", f"`{actor}.{word}`: this is measured between two actors", help, whole)
            return
        if actor == "ego" and "steer" in properties:  # a `change`: the driver under test decides the others
            properties = tuple(name for name in properties if m.PROPERTIES[name].for_ego)
        help = did_you_mean(_MEANT_PROPERTIES.get(word, word), properties) or "write one of " + one_of(properties)
        if word in _PLACES_OF_ACTORS and "eta" in properties:
            places = (f"{actor} within 5 m of (20 m, 0 m)", f"{actor} in junction j4", f"{actor} in lane 1")
            help = "write a condition about a place, such as " + write("` or `".join(places))
        self._error("FS006", f"unknown property '{word}' of '{actor}'", help, place)

    def _measure(self, tree: _Tree) -> Node:
        node = Node(m.Measure, span_of(tree))
        first = _token(tree.children[0])
        if first.type == "DOTTED":
            argument = tree.children[1]
            named = str(argument) if isinstance(argument, Token) else ""
            what = self._dotted(first, node, "actor", (*_READ_OFF, "eta"), named)
            if argument is None and what == "eta":
                self._error("FS003", "'eta' needs a junction", "write it like " + write("ego.eta(j4)"), node.span)
            elif argument is not None and what in _READ_OFF:
                self._error("FS003", f"'{what}' takes no argument", "write it like " + write(f"ego.{what}"), node.span)
            if argument is not None:
                self._put(node, "other", argument)
            node.fields["what"] = what if what in (*_READ_OFF, "eta") else "speed"
        else:
            for name, child in zip(("what", "actor", "other"), tree.children, strict=False):
                if child is not None:
                    self._put(node, name, child)
        return node

    def _shows(self, tree: _Tree) -> Node:
        whose, *rest = tree.children
        return self._built_node(tree, (None if _token(whose).type == "SIGNAL" else whose, *rest))

    def _fidelity(self, tree: _Tree) -> Node:
        deviation, whose, ego = tree.children
        if whose is not None and str(whose) != "ego":
            help = "write it like " + write("fidelity 0.00 m ego 0.12 m")
            message = f"a clip's fidelity is that of the ego, not of '{whose}'"
            self._error("FS003", message, help, span_of(_token(whose)))
        return self._built_node(tree, (deviation, ego))

    def _holding(self, tree: _Tree) -> Node:
        """Return the node of `add` or `change`; it also has the lines of the statement that follows this word."""
        held = self.make(next(_trees(tree.children)))
        node = Node(_KINDS[tree.data], span_of(tree), {"item": held}, {"item": held.span}, block=held.block)
        node.lines = [(("item", *key), span, inner) for key, span, inner in held.lines]
        return node

    def _leg(self, tree: _Tree) -> Node:
        turn, junction = (_token(child) for child in tree.children)
        node = Node(m.Leg, span_of(tree))
        self._put(node, "junction", junction)
        self._put(node, "turn", turn)
        if str(turn) not in _TURNS and (turn.type != "NAME" or str(turn) not in self._parameters):
            help = did_you_mean(str(turn), (*_TURNS, *sorted(self._parameters)))
            self._error("FS004", f"unknown turn '{turn}'", help or "turns are " + one_of(_TURNS), span_of(turn))
        return node

    def _change(self, tree: _Tree) -> Node:
        what, *rest = tree.children  # the values are WAS, NOW, from and for; fewer while the author still types
        node = self._built_node(tree, (None, None, *map(_word_of_ref, rest[:2]), *rest[2:]))
        token = _token(what)
        properties = m.changeable_of(str(token).partition(".")[0])
        node.fields["property"] = self._dotted(token, node, "actor", properties)
        node.places["property"] = span_of(token)
        return node

    def _network(self, tree: _Tree) -> Node:
        node = self._built_node(tree, tree.children)
        node.fields.setdefault("name", "here")
        return node

    def _param(self, tree: _Tree) -> Node:
        name, type_, written, values, distribution = tree.children
        numbers = dimension_of(str(type_)) is not None
        default = self._word_or_ref(written, numbers=numbers)
        if isinstance(values, Tree) and values.data == "list":
            options = [self._word_or_ref(child, numbers=numbers) for child in values.children if child is not None]
            values = Tree("list", [option for option in options if option is not None], values.meta)
        inside = (part for part in (values, distribution) if isinstance(part, Tree))
        parts = [default, *(child for part in inside for child in part.children)]
        self.settles |= any(isinstance(part, Tree) and part.data in _WORKED_OUT for part in parts)
        is_range = isinstance(values, Tree) and values.data == "range"
        ranges = (values, None) if is_range else (None, values)
        node = self._built_node(tree, (name, type_, default, *ranges, distribution))
        self.stated.append(node)
        return node

    def _word_or_ref(self, child: _Child, *, numbers: bool) -> _Child:
        """Return a value of a parameter; in the place of a number, a bare name refers to another parameter."""
        if not isinstance(child, Tree) or child.data != "ref":
            return child
        return child if numbers and str(child.children[0]) in self._parameters else _word_of_ref(child)

    def _cases(self, tree: _Tree) -> Node:
        node = self._built_node(tree, tree.children)
        self.settles |= any(child.data in _WORKED_OUT for child in _trees(tree.children))
        self.stated.append(node)
        return node

    def _weather(self, tree: _Tree) -> Node:
        node = self._built_node(tree, ())
        for setting in _trees(tree.children):
            self._put_setting(node, setting)
        return node

    def _edge_route(self, tree: _Tree) -> Node:
        listed = next(_trees(tree.children))
        edges: list[_Tree | Token] = [child for child in listed.children if isinstance(child, Token)]
        node = self._built_node(tree, (Tree("list", edges, listed.meta),))
        node.fields["shortest"] = len(edges) < len([c for c in listed.children if c is not None])
        return node


def _with_brackets(tree: _Tree) -> Span:
    """Return the place of a value, with the brackets around it."""
    span = span_of(tree)
    ends = [getattr(tree.meta, f"container_{name}", None) for name in ("line", "column", "end_line", "end_column")]
    return Span(*(int(end) for end in ends if end is not None)) if None not in ends else span


def _text(token: Token) -> str:
    return str(token)[1:-1] if token.type == "STRING" else str(token)


def _token(child: object) -> Token:
    """Return a child that is always a token by the grammar; for the type checker."""
    return cast(Token, child)


def _word_of_ref(child: _Child) -> _Child:
    """Return a bare name as a token: whether it is a word or a parameter depends on the parameters' types, which are
    read later."""
    return child.children[0] if isinstance(child, Tree) and child.data == "ref" else child


def _as_text(tree: _Tree) -> str:
    """Return a value or a measure as the printer writes it."""
    text = " ".join(str(token) for token in tree.scan_values(lambda token: isinstance(token, Token)))
    if tree.data == "measure" and " " in text:
        what, *arguments = text.split()
        return f"{what}({', '.join(arguments)})"
    return text


def _trees(children: Sequence[_Child]) -> Iterator[_Tree]:
    return (child for child in children if isinstance(child, Tree))


def _statements(tree: _Tree, rule: str) -> Iterator[_Tree]:
    """Yield the statements of a file's definitions that a rule makes."""
    blocks = (block for definition in _trees(tree.children) for block in _trees(definition.children))
    return (child for block in blocks for child in _trees(block.children) if child.data == rule)
