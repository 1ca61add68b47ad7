"""Finds where a place of the language is on a network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError, check_junction
from foresee_dsl.language.model import AlongEdge, AlongRoute, PastJunction, Place, Point, Quantity, Ref
from foresee_dsl.language.traversal import si_of, word_of

_SLACK_M = 1e-3
"""A place may lie this far beyond an end, m (ours: roundings of files)."""


@dataclass(frozen=True, slots=True)
class Spot:
    """A place: m, rad; `heading_rad` is None for bare coordinates.

    `s` is the length along the line of `actor` where the place was given so.
    """

    x: float
    y: float
    heading_rad: float | None = None
    actor: str = ""
    s: float | None = None


class Lines(Protocol):
    """The routes and starts of the actors that places name."""

    def line_of(self, actor: str) -> RouteLine:
        """Return an actor's route line.

        Raises:
            RouteError: no such actor, or it has no route.
        """
        ...

    def start_of(self, actor: str) -> float:
        """Return the length along that line where the actor starts; for one whose start is being resolved, where its
        route begins.

        Raises:
            RouteError: as above, or two actors' starts depend on each other.
        """
        ...


def si(value: Quantity | Ref | None, default: float = 0.0) -> float:
    """Return a value of a concrete scenario in SI units, or the default for None."""
    return default if value is None else si_of(value)


def spot(place: Place, network: RoadNetwork, lines: Lines) -> Spot:
    """Return where a place is.

    Raises:
        RouteError: an unknown name, or a length beyond the end of an edge or route.
    """
    if isinstance(place, Point):
        return Spot(si(place.x), si(place.y))
    if isinstance(place, AlongEdge):
        return Spot(*network.locate(word_of(place.edge), si(place.at), si(place.offset)))
    if isinstance(place, AlongRoute):
        line = lines.line_of(place.actor)
        return _on(line, lines.start_of(place.actor) + si(place.at), si(place.offset), place)
    return _at_junction(place, network, lines)


def _at_junction(place: PastJunction, network: RoadNetwork, lines: Lines) -> Spot:
    junction = word_of(place.junction)
    check_junction(network, junction)
    line = lines.line_of(place.actor)
    passage = line.passage(junction)
    if passage is None or passage.entry_s >= line.end_s - _SLACK_M:
        over = ", ".join(p.junction for p in line.passages if p.entry_s < line.end_s - _SLACK_M)
        raise RouteError(
            f"the route of {place.actor} does not go over {junction}",
            f"it goes over {over}" if over else "it goes over no junction",
        )
    s = passage.exit_s + si(place.at) if place.side == "past" else passage.entry_s - si(place.at)
    return _on(line, s, si(place.offset), place)


def _on(line: RouteLine, s: float, offset: float, place: AlongRoute | PastJunction) -> Spot:
    if not line.origin_s - _SLACK_M <= s <= line.end_s + _SLACK_M:
        beyond = s - line.end_s if s > line.end_s else line.origin_s - s
        side = "after the end" if s > line.end_s else "before the beginning"
        raise RouteError(
            f"the place is {beyond:.1f} m {side} of the route of {place.actor}",
            f"the route is {line.end_s - line.origin_s:.1f} m long",
        )
    return Spot(*line.at(s, offset), actor=place.actor, s=s)
