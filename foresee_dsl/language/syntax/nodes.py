"""From Lark's tree to positioned nodes: which rule makes which class of the model, and where each field stands."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from typing import cast

from lark import Token, Tree

from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import did_you_mean

_Tree = Tree[Token]
_Child = _Tree | Token | None
Key = tuple[str | int, ...]

MAX_DEPTH = 40
"""How deep conditions may nest (ours: far beyond what a person reads, far below Python's recursion limit)."""


@dataclass(slots=True)
class Node:
    """One item of the model to be: its class, and its fields with their places.

    Attributes:
        kind: the class of the model.
        span: the whole statement.
        fields: raw values by name: str, Decimal, bool, Node, or a tuple of these.
        places: where each field stands (`green`, and `green.1` for the second element).
        lines: the statements inside its braces: their key in the model's path, their place, their node if they are
            items themselves.
        block: where its braces are, if it has any.
    """

    kind: type[m.Item]
    span: Span
    fields: dict[str, object] = field(default_factory=dict)
    places: dict[str, Span] = field(default_factory=dict)
    lines: list[tuple[Key, Span, Node | None]] = field(default_factory=list)
    block: Span | None = None


class _AnyName(frozenset[str]):
    """A set that holds every name."""

    def __contains__(self, name: object) -> bool:
        return True


ANY_NAME: frozenset[str] = _AnyName()
"""The parameters of a scenario that extends another: a word may be one of the other's, which this file does not say.

A word that turns out to be none becomes a name again when the two are joined (`extend.extended`).
"""


@dataclass(frozen=True, slots=True)
class Mistake:
    """Something wrong that was seen on the way; the parser adds the file and the source line."""

    code: str
    message: str
    help: str
    span: Span


# The fields of each rule's children, in order. `name*` takes all that are left, `name?` may be a parameter's name,
# `name!` is one unless it has a dot.
_SHAPES: dict[str, tuple[type[m.Item], tuple[str, ...]]] = {
    "scenario": (m.Scenario, ("name", "body")),
    "extension": (m.Extension, ("name", "parent", "body")),
    "drop": (m.Drop, ("what", "name")),
    "doc": (m.Doc, ("text",)),
    "tags": (m.Tags, ("names",)),
    "use_network": (m.UseNetwork, ("path",)),
    "use_models": (m.UseModels, ("path",)),
    "range": (m.Range, ("low", "high", "step")),
    "uniform": (m.Uniform, ()),
    "normal": (m.Normal, ("mean", "deviation")),
    "choice": (m.Choice, ("weights*",)),
    "grid": (m.Grid, ()),
    "require": (m.Require, ("condition",)),
    "cases": (m.Cases, ("count", "seed")),
    "case": (m.Case, ("name", "values")),
    "assignment": (m.Assignment, ("name", "value")),
    "expect": (m.Expect, ("name", "mode", "within", "condition")),
    "end": (m.End, ("after",)),
    "signal": (m.SignalState, ("junction?", "stage?", "elapsed")),
    "ego": (m.Ego, ("model!", "state", "body")),
    "actor": (m.Actor, ("kind", "name", "model!", "state", "body")),
    "state": (m.State, ("at", "heading", "speed", "acceleration", "steer")),
    "route": (m.Route, ("start?", "legs*")),
    "path": (m.Path, ("points",)),
    "start_at": (m.StartAt, ("place",)),
    "start_speed": (m.StartSpeed, ("speed",)),
    "cruise_speed": (m.CruiseSpeed, ("speed",)),
    "goal_at": (m.GoalAt, ("place",)),
    "ignores_rule": (m.IgnoresRule, ("what", "junction?")),
    "meets_state": (m.MeetsState, ("other", "junction?", "order", "gap")),
    "walked": (m.Walked, ("along",)),
    "steers": (m.Steers, ("value", "start", "duration")),
    "timing": (m.Timing, ("factor",)),
    "delay": (m.Delay, ("time",)),
    "line": (m.Line, ("left",)),
    "recorded": (m.Recorded, ("time", "state")),
    "when": (m.When, ("repeat", "name", "condition", "actions")),
    "meets": (m.Meets, ("actor", "other", "junction?", "order", "gap")),
    "ignores": (m.Ignores, ("actor", "what", "junction?")),
    "starts": (m.Starts, ("actor",)),
    "changes_speed": (m.ChangesSpeed, ("actor", "to", "over")),
    "changes_lane": (m.ChangesLane, ("actor", "side?")),
    "stops": (m.Stops, ("actor", "duration")),
    "wait": (m.Wait, ("duration",)),
    "then": (m.Then, ("condition", "actions")),
    "either": (m.Either, ("conditions*",)),
    "both": (m.Both, ("conditions*",)),
    "negation": (m.Not, ("condition",)),
    "comparison": (m.Comparison, ("left", "op", "right")),
    "equals": (m.Equals, ("left?", "right")),
    "predicate": (m.Predicate, ("what", "actor")),
    "in_junction": (m.InJunction, ("actor", "junction?")),
    "within": (m.Within, ("actor", "distance", "of")),
    "named": (m.Named, ("name?",)),
    "sustained": (m.Sustained, ("condition", "duration", "since")),
    "stage": (m.Stage, ("name", "duration", "green")),
    "building": (m.Building, ("name", "outline")),
    "models": (m.Catalogue, ("name", "body")),
    "campaign": (m.Campaign, ("name", "body")),
    "seeds": (m.Seeds, ("path",)),
    "drivers": (m.Drivers, ("names",)),
    "rankers": (m.Rankers, ("names",)),
    "preset": (m.Preset, ("name",)),
    "clip_around": (m.ClipAround, ("before", "after")),
    "risky_points": (m.RiskyPoints, ("count",)),
    "children": (m.Children, ("count",)),
    "repeat_times": (m.Repeat, ("times",)),
    "first_seed": (m.FirstSeed, ("seed",)),
    "budget": (m.Budget, ("time",)),
    "clip": (m.Clip, ("name", "parent", "case", "pin", "body")),
    "window": (m.Window, ("start", "end")),
    "risk": (m.Risk, ("text", "at", "actor")),
    "clip_goal": (m.Goal, ("at",)),
    "mutant": (m.Mutant, ("name", "parent", "pin", "body")),
    "ref": (m.Ref, ("name",)),
    "point": (m.Point, ("x", "y")),
}

_TURNS = ("straight", "left", "right", "back")
RESERVED = frozenset((*_TURNS, *m.SIGNAL_COLOURS))
"""Words that mean themselves wherever they stand, so that no parameter may be called so."""

CHANGEABLE: dict[str, tuple[str, ...]] = {
    "ego": ("model", "steer", "timing", "speed", "delay", "line", "moving"),
    "weather": ("rain", "fog", "wetness", "sun"),
    "end": ("after",),
    "expect": (),
    "param": (),
}
"""What `change` may name behind the dot: of an actor (any name that is not below), and of the rest; empty: any name."""


def span_of(thing: _Tree | Token) -> Span:
    """Return where a tree or token stands."""
    at = thing.meta if isinstance(thing, Tree) else thing
    return Span(at.line or 1, at.column or 1, at.end_line or 1, at.end_column or 1)


class NodeMaker:
    """Turns one file's tree into nodes, and gathers the mistakes that the shapes show."""

    def __init__(self, tree: _Tree) -> None:
        self.mistakes: list[Mistake] = []
        extends = any(part.data == "extension" for part in _trees(tree.children))
        self._parameters = ANY_NAME if extends else frozenset(_parameter_names(tree))
        self._depth = 0
        self._special: dict[str, Callable[[_Tree], Node]] = {
            "quantity": self._quantity,
            "network": self._network,
            "param": self._param,
            "weather": self._weather,
            "edge_route": self._edge_route,
            "leg": self._leg,
            "traffic": lambda t: self._settings(t, m.Traffic, ("name",)),
            "junction": self._junction,
            "road": lambda t: self._settings(t, m.Road, ("name", "start", "end")),
            "model": lambda t: self._settings(t, m.VehicleModel, ("name",)),
            "origin": lambda t: self._settings(t, m.Origin, ()),
            "measure": self._measure,
            "along": self._along,
            "past": self._past,
            "change": self._change,
            "add": lambda t: self._holding(t, m.Add),
            "replace": lambda t: self._holding(t, m.Replace),
            "shows": self._shows,
            "fidelity": self._fidelity,
        }

    def make(self, tree: _Tree) -> Node:
        """Return the node of a statement or value."""
        special = self._special.get(tree.data)
        if special is not None:
            return special(tree)
        kind, names = _SHAPES[tree.data]
        node = Node(kind, span_of(tree))
        nested = tree.data in ("either", "both", "negation", "sustained", "then")
        self._depth += nested
        if self._depth > MAX_DEPTH:
            self._mistake("FS018", "this is nested too deeply", "split it into several statements", node.span)
        else:
            self._fill(node, tree.children, names)
        self._depth -= nested
        return node

    # ---- the general case -----------------------------------------------------------------------------------------

    def _fill(self, node: Node, children: Sequence[_Child], names: Sequence[str]) -> None:
        for k, name in enumerate(names):
            if name.endswith("*"):
                self._put_all(node, name[:-1], [c for c in children[k:] if c is not None])
                return
            child = children[k] if k < len(children) else None
            if child is None:
                continue
            if name.endswith("?"):
                self._put_word(node, name[:-1], child)
            elif name.endswith("!") and isinstance(child, Token) and child.type == "NAME":
                node.fields[name[:-1]] = Node(m.Ref, span_of(child), {"name": str(child)})
                node.places[name[:-1]] = span_of(child)
            elif isinstance(child, Tree) and child.data == "block":
                self._put_block(node, name, child)
            else:
                self._put(node, name.rstrip("!"), child)

    def _put(self, node: Node, name: str, child: _Tree | Token) -> None:
        node.places[name] = span_of(child)
        if isinstance(child, Token):
            node.fields[name] = _text(child)
        elif child.data == "list":
            node.fields[name] = ()
            self._put_all(node, name, [c for c in child.children if c is not None])
            node.places[name] = span_of(child)
        else:
            node.fields[name] = self.make(child)

    def _put_all(self, node: Node, name: str, children: Sequence[_Tree | Token]) -> None:
        node.fields[name] = tuple(_text(c) if isinstance(c, Token) else self.make(c) for c in children)
        for k, child in enumerate(children):
            node.places[f"{name}.{k}"] = span_of(child)
        if children:
            first, last = node.places[f"{name}.0"], node.places[f"{name}.{len(children) - 1}"]
            node.places[name] = Span(first.line, first.column, last.end_line, last.end_column)

    def _put_block(self, node: Node, name: str, block: _Tree) -> None:
        node.block = span_of(block)
        made = [self.make(child) for child in block.children if isinstance(child, Tree)]
        node.fields[name] = tuple(made)
        node.lines = [((name, k), child.span, child) for k, child in enumerate(made)]

    def _put_word(self, node: Node, name: str, child: _Tree | Token) -> None:
        """A word that is the name of a parameter, if there is one of that name, else an id."""
        child = _token(child)
        node.places[name] = span_of(child)
        node.fields[name] = self._word(child)

    def _word(self, token: Token) -> Node | str:
        is_parameter = token.type == "NAME" and str(token) in self._parameters and str(token) not in RESERVED
        return Node(m.Ref, span_of(token), {"name": str(token)}) if is_parameter else _text(token)

    def _mistake(self, code: str, message: str, help: str, span: Span) -> None:
        self.mistakes.append(Mistake(code, message, help, span))

    # ---- values ---------------------------------------------------------------------------------------------------

    def _quantity(self, tree: _Tree) -> Node:
        number, unit = tree.children
        node = Node(m.Quantity, span_of(tree), {"value": Decimal(str(number))}, {"value": span_of(_token(number))})
        if unit is not None:
            node.fields["unit"] = str(unit)
            node.places["unit"] = span_of(_token(unit))
        return node

    def _dotted(self, token: Token, node: Node, name: str, properties: tuple[str, ...]) -> str:
        """Split `ego.route`: put the actor into field `name`, return the property, which must be one of some."""
        actor, _, found = str(token).partition(".")
        node.fields[name] = actor
        whole = span_of(token)
        dot = whole.column + len(actor)
        node.places[name] = Span(whole.line, whole.column, whole.line, dot)
        if properties and found not in properties:
            place = Span(whole.line, dot + 1, whole.line, whole.end_column)
            self._mistake("FS006", f"unknown property '{found}' of '{actor}'", did_you_mean(found, properties), place)
        return found

    def _along(self, tree: _Tree) -> Node:
        at, where, offset = tree.children
        where = _token(where)
        on_route = where.type == "DOTTED"
        node = Node(m.AlongRoute if on_route else m.AlongEdge, span_of(tree))
        self._fill(node, (at, offset), ("at", "offset"))
        if on_route:
            self._dotted(where, node, "actor", ("route",))
        else:
            self._put_word(node, "edge", where)
        return node

    def _past(self, tree: _Tree) -> Node:
        at, side, junction, route, offset = tree.children
        node = Node(m.PastJunction, span_of(tree))
        self._fill(node, (at, side, junction, offset), ("at", "side", "junction?", "offset"))
        self._dotted(_token(route), node, "actor", ("route",))
        return node

    def _measure(self, tree: _Tree) -> Node:
        node = Node(m.Measure, span_of(tree))
        first = _token(tree.children[0])
        if first.type == "DOTTED":
            argument = tree.children[1]
            what = self._dotted(first, node, "actor", ("speed", "acceleration", "eta"))
            if argument is None and what == "eta":
                self._mistake("FS003", "'eta' needs a junction", "write it like `ego.eta(j4)`", node.span)
            elif argument is not None and what in ("speed", "acceleration"):
                self._mistake("FS003", f"'{what}' takes no argument", f"write it like `ego.{what}`", node.span)
            self._fill(node, (argument,), ("other?",))
            node.fields["what"] = what if what in ("speed", "acceleration", "eta") else "speed"
        else:
            self._fill(node, tree.children, ("what", "actor", "other?"))
        return node

    def _shows(self, tree: _Tree) -> Node:
        whose, junction, state = tree.children
        node = Node(m.Shows, span_of(tree))
        self._fill(node, (junction, state), ("junction?", "state?"))
        if _token(whose).type == "DOTTED":
            self._dotted(_token(whose), node, "actor", ("signal",))
        return node

    def _fidelity(self, tree: _Tree) -> Node:
        deviation, whose, ego = tree.children
        node = Node(m.Fidelity, span_of(tree))
        self._fill(node, (deviation, ego), ("deviation", "ego"))
        if whose is not None and str(whose) != "ego":
            help = "write it like `fidelity 0.00 m ego 0.12 m`"
            message = f"a clip's fidelity tells of the ego, not of '{whose}'"
            self._mistake("FS003", message, help, span_of(_token(whose)))
        return node

    def _holding(self, tree: _Tree, kind: type[m.Item]) -> Node:
        """A statement in front of which a word says what is done with it: its lines count as the holder's own."""
        held = self.make(next(_trees(tree.children)))
        node = Node(kind, span_of(tree), {"item": held}, {"item": held.span}, block=held.block)
        node.lines = [(("item", *key), span, inner) for key, span, inner in held.lines]
        return node

    def _leg(self, tree: _Tree) -> Node:
        node = Node(m.Leg, span_of(tree))
        turn = _token(tree.children[0])
        self._put_word(node, "junction", _token(tree.children[1]))
        self._put_word(node, "turn", turn)
        if str(turn) in _TURNS:
            node.fields["turn"] = str(turn)
        elif turn.type != "NAME" or str(turn) not in self._parameters:
            help = did_you_mean(str(turn), (*_TURNS, *sorted(self._parameters)))
            self._mistake("FS004", f"unknown turn '{turn}'", help or f"turns are {', '.join(_TURNS)}", span_of(turn))
        return node

    def _change(self, tree: _Tree) -> Node:
        what, *rest = tree.children
        node = Node(m.Change, span_of(tree))
        self._fill(node, rest, ("was", "now", "start", "duration"))
        token = _token(what)
        owner = str(token).partition(".")[0]
        known = CHANGEABLE.get(owner, CHANGEABLE["ego"])
        node.fields["property"] = self._dotted(token, node, "actor", known)
        node.places["property"] = span_of(token)
        return node

    # ---- statements that need more than a list of fields -------------------------------------------------------------

    def _network(self, tree: _Tree) -> Node:
        node = Node(m.Network, span_of(tree))
        self._fill(node, tree.children, ("name", "body"))
        node.fields.setdefault("name", "here")
        return node

    def _param(self, tree: _Tree) -> Node:
        node = Node(m.Param, span_of(tree))
        is_range = isinstance(tree.children[3], Tree) and tree.children[3].data == "range"
        names = ("name", "type", "default", "range" if is_range else "options", "distribution")
        self._fill(node, tree.children, names)
        return node

    def _weather(self, tree: _Tree) -> Node:
        node = Node(m.Weather, span_of(tree))
        for setting in _trees(tree.children):
            self._put_setting(node, setting)
        return node

    def _edge_route(self, tree: _Tree) -> Node:
        node = Node(m.EdgeRoute, span_of(tree))
        listed = next(_trees(tree.children))
        edges = [c for c in listed.children if isinstance(c, Token)]
        self._put_all(node, "edges", edges)
        node.fields["edges"] = tuple(self._word(edge) for edge in edges)
        node.fields["shortest"] = any(isinstance(c, Tree) for c in listed.children)
        node.places["edges"] = span_of(listed)
        return node

    def _junction(self, tree: _Tree) -> Node:
        name, at, control, block = tree.children
        node = Node(m.Junction, span_of(tree))
        self._fill(node, (name, at, control), ("name", "at", "control"))
        stages: list[Node] = []
        if isinstance(block, Tree):
            node.block = span_of(block)
            for child in _trees(block.children):
                if child.data == "stage":
                    made = self.make(child)
                    node.lines.append((("stages", len(stages)), made.span, made))
                    stages.append(made)
                else:
                    self._once(node, "crossings", span_of(child))
                    node.fields["crossings"] = ()
                    if child.children and child.children[0] is not None:
                        self._fill(node, child.children, ("crossings",))
                    node.lines.append((("crossings",), span_of(child), None))
        node.fields["stages"] = tuple(stages)
        return node

    def _settings(self, tree: _Tree, kind: type[m.Item], names: tuple[str, ...]) -> Node:
        """A statement whose block holds fields of its own: `road west from a to b { lanes 2; speed 50 km/h }`."""
        node = Node(kind, span_of(tree))
        *head, block = tree.children
        self._fill(node, head, names)
        if isinstance(block, Tree):
            node.block = span_of(block)
            for setting in _trees(block.children):
                self._put_setting(node, setting)
                node.lines.append(((str(setting.children[0]),), span_of(setting), None))
        return node

    def _put_setting(self, node: Node, setting: _Tree) -> None:
        word, value, *rest = setting.children
        name = str(word)
        self._once(node, name, span_of(setting))
        if value is not None:
            self._put(node, name, value)
        if rest and node.kind is m.Traffic and str(rest[0]) != "ego.route":
            help = "write it like `within 120 m of ego.route`"
            self._mistake("FS006", f"traffic cannot be around '{rest[0]}'", help, span_of(_token(rest[0])))

    def _once(self, node: Node, name: str, span: Span) -> None:
        if name in node.fields:
            self._mistake("FS013", f"'{name}' is said twice", "keep one of the two", span)


def _text(token: Token) -> str:
    return str(token)[1:-1] if token.type == "STRING" else str(token)


def _token(child: object) -> Token:
    """The same, for the type checker: the grammar puts a token there."""
    return cast(Token, child)


def _trees(children: Sequence[_Child]) -> Iterator[_Tree]:
    return (child for child in children if isinstance(child, Tree))


def _parameter_names(tree: _Tree) -> Iterator[str]:
    for definition in _trees(tree.children):
        for block in _trees(definition.children):
            for child in _trees(block.children):
                if child.data == "param":
                    yield str(child.children[0])
