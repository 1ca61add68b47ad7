"""Street sketches: a short list of nodes and streets between them becomes a network, optionally with a scenario.

a 0 0
b 200 0 signals
a-b lanes 2 speed 50
"""

from __future__ import annotations

import itertools
import math
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

from foresee_dsl.errors import CompileError, Diagnostic, InputError, Span
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.streets.lines import wrapped
from foresee_dsl.language.units import UNITS

CODE = "FS272"
_CONTROLS = ("signals", "priority", "right_before_left", "stop", "roundabout")
_GREEN_S = 25
"""Green time of a stage, s (ours: as in the project of `foresee init`)."""
_OPPOSITE_RAD = math.radians(45)
"""Two streets at a node share their green if the angle between them differs from a straight line by at most this, rad
(ours).
"""
_RADIUS_M = 18
_SIDEWALK_M = "2"
_NUMBERS: Mapping[str, str] = {
    "lanes": "",
    "back": "",
    "speed": "km/h",
    "sidewalk": "m",
    "parking": "m",
    "median": "m",
    "bus_lane": "m",
    "cycle_lane": "m",
    "cycle_track": "m",
    "shoulder": "m",
    "lane_width": "m",
}
"""Settings of a street, each with the unit that a number has if none is written."""
_WORDS = (*_NUMBERS, "oneway", "name", "via")
_NODE = "`a 0 0`, or `a 0 0 signals`"
_STREET = "`a-b`, or `a-b lanes 2 speed 50`"
_NUMBER = re.compile(r"(-?[0-9]+(?:\.[0-9]+)?)([a-z/]*)")


@dataclass
class _Street:
    name: str
    ends: tuple[str, str]
    line: int
    settings: dict[str, tuple[str, str]] = field(default_factory=dict)
    via: list[tuple[str, str]] = field(default_factory=list)


class _SketchReader:
    """Reads a sketch line by line and collects its errors."""

    def __init__(self, text: str, path: str) -> None:
        self._lines, self._path = text.splitlines(), path
        self.diagnostics: list[Diagnostic] = []
        self.nodes: dict[str, tuple[str, str, str]] = {}
        self.streets: dict[str, _Street] = {}
        for number, line in enumerate(self._lines, start=1):
            words = [(w[0], w.start() + 1) for w in re.finditer(r"[^\s,;]+", line.partition("#")[0])]
            if words and re.fullmatch(r"\w+-\w+", words[0][0]):
                self._street(number, words)
            elif words:
                self._node(number, words)
        for street in self.streets.values():
            self._ends(street)
        if not self.streets and not self.diagnostics:
            self._wrong(1, 1, "", "this sketch has no streets", f"write one such as {_STREET}")

    def _wrong(self, line: int, column: int, word: str, message: str, help: str) -> None:
        source = self._lines[line - 1] if self._lines else ""
        span = Span(line, column, line, column + max(len(word), 1))
        self.diagnostics.append(Diagnostic(CODE, message, help, self._path, span, source[:200]))

    def _node(self, line: int, words: Sequence[tuple[str, int]]) -> None:
        (name, column), *rest = words
        plain = plain_name(name)
        if not plain:
            help = f"a line is a node, {_NODE}, or a street, {_STREET}"
            self._wrong(line, column, name, f"`{name}` is not a name for a node", help)
            return
        if plain in self.nodes:
            self._wrong(line, column, name, f"there are two nodes called '{plain}'", "give one of them another name")
        numbers = [_NUMBER.fullmatch(word) for word, _ in rest[:2]]
        bad = next(((word, at) for (word, at), number in zip(rest, numbers, strict=False) if number is None), None)
        if bad is not None or len(rest) < 2:
            word, at = bad or words[-1]
            message = f"`{word}` is not a coordinate" if bad else f"node '{plain}' has no position"
            self._wrong(line, at, word, message, f"write metres east and north: {_NODE}")
            self.nodes.setdefault(plain, ("0", "0", ""))
            return
        control = ""
        for word, at in rest[2:]:
            if word.lower() not in _CONTROLS:
                meant = closest(word.lower(), _CONTROLS)
                help = f"did you mean '{meant}'?" if meant else f"a node may be {', '.join(_CONTROLS)}"
                self._wrong(line, at, word, f"unknown control '{word}'", help)
            elif control:
                self._wrong(line, at, word, f"node '{plain}' has two controls", "keep one of the two")
            control = control or word.lower()
        x, y = (number[1] for number in numbers if number is not None)
        self.nodes[plain] = (x, y, control)

    def _street(self, line: int, words: Sequence[tuple[str, int]]) -> None:
        (ends, column), *rest = words
        start, end = (plain_name(name) for name in ends.split("-"))
        street = _Street(f"{start}_{end}", (start, end), line)
        if start == end:
            self._wrong(line, column, ends, "this street ends where it begins", "a street joins two nodes")
        waiting = list(rest)
        while waiting:
            word, at = waiting.pop(0)
            key = word.lower()
            if key == "oneway":
                street.settings["back"] = ("0", "")
            elif key == "name" and waiting:
                street.name = plain_name(waiting.pop(0)[0])
            elif key == "via":
                self._via(street, line, (word, at), waiting)
            elif key in _NUMBERS:
                self._setting(street, line, (key, at), waiting)
            else:
                meant = closest(key, _WORDS)
                help = f"did you mean '{meant}'?" if meant else f"a street may have {', '.join(_WORDS)}"
                self._wrong(line, at, word, f"unknown word '{word}'", help)
                return
        if street.name in self.streets:
            message = f"there are two streets called '{street.name}'"
            self._wrong(line, column, ends, message, f"give one another name: `{ends} name {street.name}_2`")
        self.streets[street.name] = street

    def _setting(self, street: _Street, line: int, key: tuple[str, int], waiting: list[tuple[str, int]]) -> None:
        word, at = waiting.pop(0) if waiting else ("", key[1])
        number = _NUMBER.fullmatch(word)
        if number is None:
            problem = f"`{word}` is not a number" if word else "a number is missing"
            usual = "30" if key[0] == "speed" else "2"
            self._wrong(line, at, word or key[0], f"{problem} for `{key[0]}`", f"write it like `{key[0]} {usual}`")
        elif (number[2] or _NUMBERS[key[0]]) not in _same_units(_NUMBERS[key[0]]):
            units = " or ".join(f"`{unit}`" for unit in _same_units(_NUMBERS[key[0]]) if unit) or "no unit"
            self._wrong(line, at, word, f"`{word}` has no unit that fits `{key[0]}`", f"it takes {units}")
        elif key[0] in street.settings and key[0] != "back":
            self._wrong(line, at, word, f"'{key[0]}' is given twice", "keep one of the two")
        else:
            street.settings[key[0]] = (number[1], number[2] or _NUMBERS[key[0]])

    def _via(self, street: _Street, line: int, word: tuple[str, int], waiting: list[tuple[str, int]]) -> None:
        begin = len(street.via)
        while len(waiting) >= 2 and (x := _NUMBER.fullmatch(waiting[0][0])) and (y := _NUMBER.fullmatch(waiting[1][0])):
            street.via.append((x[1], y[1]))
            del waiting[:2]
        if len(street.via) == begin:
            self._wrong(line, word[1], word[0], "`via` needs a point", "write it like `via 120 30`")

    def _ends(self, street: _Street) -> None:
        for name in street.ends:
            if name not in self.nodes:
                meant = closest(name, list(self.nodes))
                help = f"did you mean '{meant}'?" if meant else f"add a line such as `{name} 100 0`"
                column = self._lines[street.line - 1].lower().find(name) + 1
                self._wrong(street.line, max(column, 1), name, f"unknown node '{name}'", help)


def network_of_sketch(text: str, name: str, path: str) -> m.Network:
    """Return the network of a sketch; `InputError` with every faulty line."""
    sketch = _SketchReader(text, path)
    if sketch.diagnostics:
        raise InputError(
            tuple(sorted(sketch.diagnostics, key=lambda d: (d.span.line, d.span.column) if d.span else (0, 0)))
        )
    streets = tuple(sketch.streets.values())
    body = [_junction(node, sketch, streets) for node in sketch.nodes]
    return m.Network(name=name, body=(*body, *map(_road, streets)))


def checked_text(network: m.Network, path: str) -> str:
    """Return the text of a sketch's network after a check and a build; `InputError` with what cannot be built."""
    from foresee_dsl.compile.nets.network_builder import build_network
    from foresee_dsl.language.checks.documents import check_document
    from foresee_dsl.language.document import Document
    from foresee_dsl.language.printer import print_model

    text = print_model(network)
    diagnostics = check_document(Document(path, text, network, {}))
    errors = tuple(Diagnostic(d.code, d.message, d.help, path) for d in diagnostics if d.severity == "error")
    if errors:
        raise InputError(errors)
    with tempfile.TemporaryDirectory(prefix="foresee-sketch-") as folder:
        try:
            build_network(network, Path(folder) / "net.net.xml")
        except CompileError as err:
            help = "move nodes apart, or lead a street through points with `via`"
            raise InputError((Diagnostic(CODE, f"these streets cannot be built: {err}", help, path),)) from err
    return text


def starter_of(network: m.Network, name: str, file: str) -> m.Scenario:
    """Return a first scenario on a network that is used as `file`; `ExchangeError` if no route is long enough."""
    from foresee_dsl.compile.nets.network_builder import build_network
    from foresee_dsl.exchange.outcome import ExchangeError
    from foresee_dsl.exchange.starter import Ground, starter
    from foresee_dsl.language.streets.layout import rings_of

    with tempfile.TemporaryDirectory(prefix="foresee-sketch-") as folder:
        net = Path(folder) / f"{name}.net.xml"
        build_network(network, net)
        ground = Ground.of(net)
        on_rings = [edge for ring in rings_of(network).values() for edge in ring.edges]
        doc = "A first drive on the streets of a sketch."
        try:  # a route that begins and ends on a street, not on a roundabout
            scenario, _ = starter(ground, name=name, network=file, doc=doc, without=on_rings)
        except ExchangeError:
            scenario, _ = starter(ground, name=name, network=file, doc=doc)
    return scenario


def _same_units(unit: str) -> tuple[str, ...]:
    """Return the units of the same dimension as one; only "" for a count."""
    return tuple(other for other, what in UNITS.items() if what.dimension == UNITS[unit].dimension) if unit else ("",)


def plain_name(name: str) -> str:
    """Return a name in the form of the language; "" if that is impossible."""
    plain = re.sub(r"\W+", "_", name.lower(), flags=re.ASCII).strip("_")
    return plain if re.match(r"[a-z]", plain) else ""


def _quantity(number: str, unit: str) -> m.Quantity:
    return m.Quantity(value=Decimal(number), unit=unit)


def _point(x: str, y: str) -> m.Point:
    return m.Point(x=_quantity(x, "m"), y=_quantity(y, "m"))


def _road(street: _Street) -> m.Road:
    settings = {"sidewalk": (_SIDEWALK_M, "m")} | street.settings
    values = {key: _quantity(*value) for key, value in settings.items() if key != "sidewalk" or float(value[0])}
    fields = {"name": street.name, "start": street.ends[0], "end": street.ends[1], **values}
    return m.Road.model_validate(fields | {"via": tuple(_point(x, y) for x, y in street.via)})


def _junction(node: str, sketch: _SketchReader, streets: Sequence[_Street]) -> m.Junction | m.Roundabout:
    x, y, control = sketch.nodes[node]
    at = _point(x, y)
    touching = [street for street in streets if node in street.ends]
    walked = any(float(street.settings.get("sidewalk", (_SIDEWALK_M, ""))[0]) for street in touching)
    crossings = () if walked and len(touching) > 2 else None
    if control == "roundabout":
        sidewalk = _quantity(_SIDEWALK_M, "m") if walked else None
        return m.Roundabout(name=node, at=at, radius=_quantity(str(_RADIUS_M), "m"), sidewalk=sidewalk,
                            crossings=crossings)  # fmt: skip
    if control == "signals":
        stages = tuple(_stages(node, sketch, touching))
        return m.Junction(name=node, at=at, control="signals", crossings=crossings, stages=stages)
    control_field = {"control": control} if control else {}
    return m.Junction.model_validate({"name": node, "at": at, "crossings": crossings, **control_field})


def _stages(node: str, sketch: _SketchReader, touching: Sequence[_Street]) -> Iterator[m.Stage]:
    """Yield a stage for each pair of opposite streets, and for each single street; one-way streets that lead away get
    none."""
    x, y = (float(value) for value in sketch.nodes[node][:2])
    angles: dict[str, float] = {}
    for street in touching:
        if street.ends[0] == node and street.settings.get("back", ("1", ""))[0] == "0":
            continue
        other = street.ends[1] if street.ends[0] == node else street.ends[0]
        east, north, _ = sketch.nodes[other]
        points = [(float(a), float(b)) for a, b in street.via or [(east, north)]]
        near = points[0] if street.ends[0] == node else points[-1]
        angles[street.name] = math.atan2(near[1] - y, near[0] - x)
    left = dict(angles)
    numbers = itertools.count(1)
    while left:
        name, angle = next(iter(left.items()))
        del left[name]
        off = {other: abs(wrapped(a - angle - math.pi)) for other, a in left.items()}
        opposite = min(off, key=lambda other: off[other], default="")
        green: tuple[str, ...] = (name,)
        if opposite and off[opposite] <= _OPPOSITE_RAD:
            green = (name, opposite)
            del left[opposite]
        yield m.Stage(name=f"stage_{next(numbers)}", green=green, duration=_quantity(str(_GREEN_S), "s"))
