"""What conditions and actions say of a network: are its junctions, signals, stages and places there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.compile.codes import PLACE, UNKNOWN
from foresee_dsl.compile.placement.places import Spot
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model import (
    Comparison,
    Condition,
    Expect,
    Ignores,
    InJunction,
    Measure,
    Meets,
    Named,
    Place,
    Point,
    Shows,
    Then,
    Traffic,
    When,
    Within,
)
from foresee_dsl.language.project.document import Problem, TestCase
from foresee_dsl.language.traversal import all_actions, parts, si_of, word_of


class Said:
    """Goes through all conditions of a scenario.

    Args:
        case: concrete.
        network: its network. signals: of it, by junction.
        spot: finds a place, or raises `RouteError`.
    """

    def __init__(
        self, case: TestCase, network: RoadNetwork, signals: Mapping[str, Signal], spot: Callable[[Place], Spot]
    ) -> None:
        self._case, self._network, self._signals, self._spot = case, network, signals, spot
        self._actors = {actor.name for actor in case.scenario.actors} | {
            f"{traffic.name}_{k:02d}" for traffic in case.scenario.all(Traffic) for k in range(1, _count(traffic) + 1)
        }
        self.places: dict[Place, XY] = {}
        """Where the places of conditions are; filled by `problems`."""

    def problems(self, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        """Yield what does not fit, given the actors that are placed, by id."""
        for kind, condition in _conditions(self._case):
            for part in parts(condition):
                yield from self._part(kind, part, placed)
        for when in self._case.scenario.all(When):
            for action in all_actions(when.actions):
                if isinstance(action, Meets | Ignores) and action.junction is not None:
                    yield from self._junction(when.kind, word_of(action.junction))

    def _part(self, kind: str, part: Condition, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        if isinstance(part, Comparison) and isinstance(part.left, Measure) and part.left.other is not None:
            other = word_of(part.left.other)
            if other not in self._actors:
                yield from self._junction(kind, other)
        elif isinstance(part, InJunction) and part.junction is not None:
            yield from self._junction(kind, word_of(part.junction))
        elif isinstance(part, Within):
            yield from self._within(kind, part)
        elif isinstance(part, Shows):
            yield from self._shows(kind, part, placed)

    def _within(self, kind: str, part: Within) -> Iterator[Problem]:
        if isinstance(part.of, Named):
            name = word_of(part.of.name)
            if name not in self._actors and name not in self._network.junctions:
                known = (*self._actors, *self._network.junctions)
                message = f"there is no actor and no junction called {name}"
                yield Problem("", kind, UNKNOWN, message, did_you_mean(name, known), name)
            return
        if isinstance(part.of, Point):
            return
        try:
            spot = self._spot(part.of)
        except RouteError as err:
            yield Problem("", kind, PLACE, str(err), err.help)
        else:
            self.places[part.of] = (spot.x, spot.y)

    def _shows(self, kind: str, part: Shows, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        junction, state = word_of(part.junction), word_of(part.state)
        signal = self._signals.get(junction)
        if signal is None:
            message = f"there is no signal at {junction}"
            yield Problem("", kind, UNKNOWN, message, did_you_mean(junction, self._signals), junction)
        elif part.actor is None:
            if state not in signal.stages:
                message = f"the signal at {junction} has no stage called {state}"
                yield Problem("", kind, UNKNOWN, message, f"its stages are {', '.join(signal.stages)}", state)
        elif not self._case.snapshot:  # in a clip it may have passed the junction
            actor = placed.get(part.actor)
            line = actor.line if actor is not None else None
            if line is not None and line.passage(junction) is None:
                over = ", ".join(p.junction for p in line.passages) or "no junction"
                message = f"the route of {part.actor} does not go over {junction}"
                yield Problem("", kind, PLACE, message, f"it goes over {over}", junction)

    def _junction(self, kind: str, junction: str) -> Iterator[Problem]:
        if junction not in self._network.junctions:
            message = f"there is no junction called {junction}"
            yield Problem("", kind, UNKNOWN, message, did_you_mean(junction, self._network.junctions), junction)


def _conditions(case: TestCase) -> Iterator[tuple[str, Condition]]:
    """Yield every condition that a run asks, with the kind of its statement."""
    for when in case.scenario.all(When):
        yield when.kind, when.condition
        for action in all_actions(when.actions):
            if isinstance(action, Then) and action.condition is not None:
                yield when.kind, action.condition
    for expect in case.scenario.all(Expect):
        yield expect.kind, expect.condition


def _count(traffic: Traffic) -> int:
    return int(si_of(traffic.count))
