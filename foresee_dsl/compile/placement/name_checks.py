"""Checks the names of a scenario against its network: are its junctions, signals, stages and places there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.compile.codes import NO_MEETING, PLACE, UNKNOWN
from foresee_dsl.compile.placement.places import Spot
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.document import Problem, TestCase
from foresee_dsl.language.traversal import all_actions, parts, si_of, word_of


class NameChecks:
    """Goes through the statements of a scenario that name something of the network.

    Args:
        case: concrete.
        network: its network. signals: of it, by junction.
        spot: finds a place, or raises `RouteError`.
    """

    def __init__(
        self, case: TestCase, network: Topology, signals: Mapping[str, Signal], spot: Callable[[m.Place], Spot]
    ) -> None:
        self._case, self._network, self._signals, self._spot = case, network, signals, spot
        self._actors = {actor.name for actor in case.scenario.actors} | {
            f"{traffic.name}_{k:02d}"
            for traffic in case.scenario.all(m.Traffic)
            for k in range(1, int(si_of(traffic.count)) + 1)
        }
        self.places: dict[m.Place, XY] = {}
        """Where the places of conditions are, m; filled by `problems`."""

    def problems(self, placed: Iterable[PlacedActor]) -> Iterator[Problem]:
        """Yield what does not fit, given the actors that could be placed."""
        scenario, by_name = self._case.scenario, {actor.id: actor for actor in placed}
        for actor in scenario.actors:
            for item in actor.body:
                if isinstance(item, m.IgnoresRule | m.MeetsState) and item.junction is not None:
                    yield from self._junction(actor.name, item.kind, word_of(item.junction))
        for state in scenario.all(m.SignalState):
            yield from self._stage(state.kind, word_of(state.junction), word_of(state.stage))
        for kind, condition in self._conditions():
            for part in parts(condition):
                yield from self._part(kind, part, by_name)
        for when in scenario.all(m.When):
            for action in all_actions(when.actions):
                if isinstance(action, m.Meets | m.Ignores) and action.junction is not None:
                    yield from self._junction("", when.kind, word_of(action.junction))
        if not self._case.snapshot:  # a clip's routes do not show junctions that were passed before it begins
            yield from self._meetings(by_name)

    def _conditions(self) -> Iterator[tuple[str, m.Condition]]:
        """Yield every condition that a run evaluates, with the kind of its statement."""
        for when in self._case.scenario.all(m.When):
            yield when.kind, when.condition
            for action in all_actions(when.actions):
                if isinstance(action, m.Then) and action.condition is not None:
                    yield when.kind, action.condition
        for expect in self._case.scenario.all(m.Expect):
            yield expect.kind, expect.condition

    def _part(self, kind: str, part: m.Condition, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        if isinstance(part, m.Comparison) and isinstance(part.left, m.Measure) and part.left.other is not None:
            other = word_of(part.left.other)
            if other not in self._actors:
                yield from self._junction("", kind, other)
        elif isinstance(part, m.InJunction) and part.junction is not None:
            yield from self._junction("", kind, word_of(part.junction))
        elif isinstance(part, m.Within):
            yield from self._within(kind, part)
        elif isinstance(part, m.Shows):
            yield from self._shows(kind, part, placed)

    def _within(self, kind: str, part: m.Within) -> Iterator[Problem]:
        if isinstance(part.of, m.Named):
            name = word_of(part.of.name)
            if name not in self._actors and name not in self._network.junctions:
                known = (*self._actors, *self._network.junctions)
                message = f"there is no actor and no junction called {name}"
                yield Problem("", kind, UNKNOWN, message, did_you_mean(name, known), name)
        elif not isinstance(part.of, m.Point):
            try:
                spot = self._spot(part.of)
            except RouteError as err:
                yield Problem("", kind, PLACE, str(err), err.help)
            else:
                self.places[part.of] = (spot.x, spot.y)

    def _shows(self, kind: str, part: m.Shows, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        junction = word_of(part.junction)
        if part.actor is None or junction not in self._signals:
            yield from self._stage(kind, junction, word_of(part.state))
        elif not self._case.snapshot:  # in a clip it may have passed the junction
            actor = placed.get(part.actor)
            if actor is not None and (over := _misses(actor, junction)):
                message = f"the route of {part.actor} does not go over {junction}"
                yield Problem("", kind, PLACE, message, f"it goes over {over}", junction)

    def _stage(self, kind: str, junction: str, stage: str) -> Iterator[Problem]:
        signal = self._signals.get(junction)
        if signal is None:
            message = f"there is no signal at {junction}"
            yield Problem("", kind, UNKNOWN, message, did_you_mean(junction, self._signals), junction)
        elif stage not in signal.stages:
            message = f"the signal at {junction} has no stage called {stage}"
            yield Problem("", kind, UNKNOWN, message, f"its stages are {', '.join(signal.stages)}", stage)

    def _junction(self, actor: str, at: str, junction: str) -> Iterator[Problem]:
        if junction not in self._network.junctions:
            message = f"there is no junction called {junction}"
            yield Problem(actor, at, UNKNOWN, message, did_you_mean(junction, self._network.junctions), junction)

    def _meetings(self, placed: Mapping[str, PlacedActor]) -> Iterator[Problem]:
        """Yield the actors that are to meet at a junction that is not on both routes."""
        for actor in self._case.scenario.actors:
            for item in actor.body:
                if isinstance(item, m.MeetsState):
                    yield from _meeting(actor.name, item.kind, actor.name, item, placed)
        for when in self._case.scenario.all(m.When):
            for action in all_actions(when.actions):
                if isinstance(action, m.Meets):
                    yield from _meeting("", when.kind, action.actor, action, placed)


def _meeting(
    owner: str, at: str, name: str, item: m.Meets | m.MeetsState, placed: Mapping[str, PlacedActor]
) -> Iterator[Problem]:
    junction = word_of(item.junction)
    for one in (name, item.other):
        actor = placed.get(one)
        if actor is not None and (over := _misses(actor, junction)):
            message = f"{name} cannot meet {item.other} at {junction}: {one} does not go over it"
            yield Problem(owner, at, NO_MEETING, message, f"{one} goes over {over}", junction)


def _misses(actor: PlacedActor, junction: str) -> str:
    """Return the junctions that an actor's route goes over when this one is none of them; else, or off roads, ""."""
    if actor.line is None or actor.line.passage(junction) is not None:
        return ""
    return ", ".join(p.junction for p in actor.line.passages) or "no junction"
