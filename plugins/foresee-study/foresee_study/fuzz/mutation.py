"""Creates one mutation of a test case: the added and changed lines of its parent, and one more change."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Literal

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor, SumoBundle
from foresee_dsl.compile.catalogue import cruise_speed, spec_of
from foresee_dsl.compile.placement.statements import lane_kind
from foresee_dsl.compile.roads.polyline import XY, Points, distance
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.printer import print_item
from foresee_study.fuzz import settings as s
from foresee_study.fuzz.placement import Around, LanePlace

Line = m.Add | m.Replace
"""A line of a mutated test case: `add ...` or `change ...`."""
Manner = Literal["linear", "autonomous", "immobile"]
"""How an added actor moves: straight on regardless of others, along lanes (or sidewalks) like traffic, or not at
all."""
MANNERS: tuple[Manner, ...] = ("linear", "autonomous", "immobile")
DIGITS = 2
"""Decimals of random metres, m/s and degrees (ours: centimetres)."""
_NAME, _PATCH = "fuzz", "slick"
_Beginning = tuple[tuple[m.ActorItem, ...], m.State | None, PlacedActor]
"""The items of an actor's block, its state, and where it is placed."""


@dataclass(frozen=True)
class Mutated:
    """The lines of a mutated test case, and the mutation in words."""

    lines: tuple[Line, ...]
    what: str

    @property
    def added(self) -> frozenset[str]:
        """Names of the added actors."""
        return frozenset(line.item.name for line in self.lines if isinstance(line.item, m.Actor))


class Mutator:
    """Mutates one test case.

    Args:
        case: the parent, an original test case or a mutated one.
        original: the test case without mutations.
        lines: the parent's added and changed lines.
        bundle: the compiled parent.
        rng: source of all random choices.
    """

    def __init__(
        self, case: TestCase, original: TestCase, lines: Sequence[Line], bundle: SumoBundle, rng: np.random.Generator
    ) -> None:
        self._case, self._original, self._lines = case, original, tuple(lines)
        self._bundle, self._rng = bundle, rng
        self._specs = {name: spec_of(model) for name, model in sorted(case.models.items())}

    def one_change(self) -> Mutated | None:
        """Return the parent with a slippery patch, other weather, or an added or moved actor; None if the random choice
        is impossible.
        """
        draw = float(self._rng.random())
        if draw < s.PATCH_SHARE:
            return self._patch()
        return self._weather() if draw < s.PATCH_SHARE + s.WEATHER_SHARE else self._actor()

    def all_changes(self) -> Mutated | None:
        """Return the parent with an added or moved actor, other weather, and in one of four cases a patch; None as in
        `one_change`.
        """
        changes: list[Callable[[], Mutated | None]] = [self._actor, self._weather]
        if float(self._rng.random()) < s.PATCH_SHARE:
            changes.append(self._patch)
        descriptions: list[str] = []
        for change in changes:
            if (mutated := change()) is None:
                return None
            self._lines, descriptions = mutated.lines, [*descriptions, mutated.what]
        return Mutated(self._lines, "; ".join(descriptions))

    # ---- weather and ground ------------------------------------------------------------------------------------------

    def _weather(self) -> Mutated:
        rain, fog, wetness, sun = (_number(float(self._rng.random()), "ratio") for _ in range(4))
        weather = m.Weather(rain=rain, fog=fog, wetness=wetness, sun=sun)
        others = tuple(line for line in self._lines if not isinstance(line.item, m.Weather))
        line = m.Replace(item=weather) if self._original.scenario.first(m.Weather) is not None else m.Add(item=weather)
        return Mutated((*others, line), print_item(weather))

    def _patch(self) -> Mutated | None:
        at = Around(self._bundle, self._rng).on_ground()
        if at is None:
            return None
        taken = {patch.name for patch in self._case.scenario.all(m.Slippery)}
        radius, friction = (float(self._rng.uniform(*limits)) for limits in (s.RADIUS_M, s.FRICTION))
        patch = m.Slippery(
            name=_free(_PATCH, taken),
            place=_point(at),
            radius=_number(radius, "length"),
            friction=_number(friction, "ratio"),
        )
        ego = self._bundle.scene.ego
        away = f"{distance(at, (ego.x, ego.y)):.0f} m from the ego"
        what = f"slippery patch {patch.name}, friction {friction:.2f}, radius {radius:.1f} m, {away}"
        return Mutated((*self._lines, m.Add(item=patch)), what)

    # ---- actors ------------------------------------------------------------------------------------------------------

    def _actor(self) -> Mutated | None:
        added = [line for line in self._lines if isinstance(line.item, m.Actor)]
        if added and float(self._rng.random()) < s.MOVE_SHARE:
            line = added[int(self._rng.integers(len(added)))]
            assert isinstance(line.item, m.Actor)  # noqa: S101  (as chosen above)
            return self._moved(line, line.item)
        manner = MANNERS[int(self._rng.integers(len(MANNERS)))]
        names = [actor.id for actor in self._bundle.scene.actors]
        name = _free(_NAME, {*names, *(traffic.name for traffic in self._case.scenario.all(m.Traffic))})
        spec = self._drawn_model()
        actor = self._placed(name, spec, manner, Around(self._bundle, self._rng))
        if actor is None:
            return None
        return Mutated((*self._lines, m.Add(item=actor)), f"adds {self._description(actor, manner)}")

    def _moved(self, line: Line, old: m.Actor) -> Mutated | None:
        """Return the parent with an actor that was added earlier at another place; the actor's kind of motion stays."""
        manner: Manner = "immobile"
        if any(isinstance(item, m.EdgeRoute) for item in old.body):
            manner = "autonomous"
        elif any(isinstance(item, m.Path) and len(item.points) == 2 for item in old.body):
            manner = "linear"
        elif any(isinstance(item, m.Path) for item in old.body):
            manner = "autonomous"
        spec = self._specs[str(old.model)]
        actor = self._placed(old.name, spec, manner, Around(self._bundle, self._rng, gone=old.name))
        if actor is None:
            return None
        lines = tuple(m.Add(item=actor) if other is line else other for other in self._lines)
        return Mutated(lines, f"moves {self._description(actor, manner)}")

    def _drawn_model(self) -> ModelSpec:
        if float(self._rng.random()) < s.WALKER_SHARE:
            class_ = "pedestrian"
        else:
            class_ = str(self._rng.choice(list(s.CLASSES), p=list(s.CLASSES.values())))
        models = [spec for spec in self._specs.values() if spec.kind == class_]
        return models[int(self._rng.integers(len(models)))]

    def _placed(self, name: str, spec: ModelSpec, manner: Manner, around: Around) -> m.Actor | None:
        """Return the statement of an actor at the first free place in a random order; None if no place is free."""
        begin = self._on_foot if spec.kind == "pedestrian" else self._on_wheels
        for body, state, placed in begin(spec, manner, around):
            if around.is_free(placed):
                kind = spec.kind if spec.kind in ("pedestrian", "bicycle") else "vehicle"
                return m.Actor(kind=kind, name=name, model=spec.name, state=state, body=body)
        return None

    def _on_foot(self, spec: ModelSpec, manner: Manner, around: Around) -> Iterator[_Beginning]:
        top = min(spec.max_speed_mps, s.RUNS_MPS if manner == "linear" else cruise_speed(spec, spec.max_speed_mps))
        for start in around.on_foot(blocks=manner == "immobile"):
            placed = PlacedActor("", spec, "path", *start, 0.0, speed_mps=0.0)
            if manner == "immobile":
                yield (m.StartAt(place=_point(start)),), None, placed
                continue
            speed = float(self._rng.uniform(min(s.LEAST_MPS, top), top))
            way = around.walks_on(start) if manner == "linear" else around.walks_about(start, speed * s.ROAMS_S)
            if way is not None:
                x, y = way[0]
                yield _on_path(way, speed), None, PlacedActor("", spec, "path", x, y, 0.0, speed_mps=speed)

    def _on_wheels(self, spec: ModelSpec, manner: Manner, around: Around) -> Iterator[_Beginning]:
        for place in around.on_lanes(spec, blocks=manner == "immobile"):
            x, y, heading = place.pose
            speed = float(self._rng.uniform(s.LEAST_MPS, min(place.lane.speed_mps, spec.max_speed_mps)))
            if manner == "immobile":
                state = m.State(at=_point((x, y)), heading=_number(heading, "angle"), speed=_number(0.0, "speed"))
                yield (), state, PlacedActor("", spec, "sumo", x, y, heading, speed_mps=0.0)
            elif manner == "linear":
                heading += float(self._rng.uniform(-s.TURNED_RAD, s.TURNED_RAD))
                way = around.straight_on((x, y), heading, spec)
                if way is not None:
                    yield _on_path(way, speed), None, PlacedActor("", spec, "path", x, y, heading, speed_mps=speed)
            else:
                route = around.route(place, speed * s.ROAMS_S, lane_kind(spec))
                body = (m.EdgeRoute(edges=route), m.StartAt(place=_on_lane(place, around)), _cruise(speed))
                yield body, None, PlacedActor("", spec, "sumo", x, y, heading, speed_mps=speed)

    def _description(self, actor: m.Actor, manner: Manner) -> str:
        how = {"linear": "goes straight on", "immobile": "stands"}.get(manner, "goes along the lanes")
        if actor.kind == "pedestrian" and manner == "autonomous":
            how = "walks about"
        speed = next((item.speed for item in actor.body if isinstance(item, m.CruiseSpeed)), None)
        pace = f", {speed.si:.1f} m/s" if isinstance(speed, m.Quantity) else ""
        return f"{actor.name}: {actor.model}, {how}{pace}"


def _on_path(way: Points, speed_mps: float) -> tuple[m.ActorItem, ...]:
    return m.Path(points=tuple(_point(xy) for xy in way)), _cruise(speed_mps)


def _on_lane(place: LanePlace, around: Around) -> m.Place:
    """Return the place statement for a lane: a length along its edge, and an offset from the rightmost lane."""
    x, y, _ = place.pose
    first = around.network.edges[place.lane.edge].drivable[0]
    along, beside = (place.along_m, 0.0) if first is place.lane else first.line.project(x, y)
    offset = None if abs(beside) < 10.0**-DIGITS else _number(beside, "length")
    at = _number(along, "length")
    edge = place.lane.edge
    return m.AlongEdge(at=at, edge=edge) if offset is None else m.AlongEdge(at=at, edge=edge, offset=offset)


def _cruise(speed_mps: float) -> m.CruiseSpeed:
    return m.CruiseSpeed(speed=_number(speed_mps, "speed"))


def _point(at: XY) -> m.Point:
    return m.Point(x=_number(at[0], "length"), y=_number(at[1], "length"))


def _number(value: float, dimension: Literal["length", "speed", "angle", "ratio"]) -> m.Quantity:
    return m.Quantity.of(value, dimension, DIGITS)


def _free(begin: str, taken: set[str] | frozenset[str]) -> str:
    """Return the first free name of a series, such as `fuzz_01`."""
    names = (f"{begin}_{number:02d}" for number in count(1))
    return next(name for name in names if name not in taken)
