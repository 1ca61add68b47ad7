"""Lints about actors: actions that an actor cannot do, speeds above its model's maximum, and routes with gaps."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import get_args

from foresee_dsl.helps import HelpText, in_block, one_of, remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.lints.roads import Roads, passed_by
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import all_actions, walk

_MOVE_OR_LEAVE: tuple[type[m.Item], ...] = (*get_args(m.Moves), m.LeavesTrack)
"""Actions that only an actor which can move can do; a lint knows nothing against the others."""
_SLACK = 1.01
"""Speeds up to this multiple of the model's maximum are attributed to rounding (ours; the compiler's check uses the
same)."""


def actor_lints(lints: Collector, case: TestCase) -> None:
    """Report actions that an actor of one concrete scenario cannot do, and speeds that it cannot reach."""
    actors: dict[str, m.Ego | m.Actor] = {actor.name: actor for actor in case.scenario.actors}
    for actor in actors.values():
        for item in actor.body:
            if isinstance(item, m.StartSpeed | m.CruiseSpeed):
                _too_fast(lints, item, "speed", item.speed, actor, case.models)
    for when in case.scenario.all(m.When):
        for action in walk(when):
            actor_ = actors.get(getattr(action, "actor", ""))
            if actor_ is None or not isinstance(action, _MOVE_OR_LEAVE):
                continue  # any car may open a door, also the ego and a parked one
            reason = _cannot(action, actor_)
            if reason:
                lints.add(action, "", "FS305", *reason)
            elif isinstance(action, m.ChangesSpeed):
                _too_fast(lints, action, "to", action.to, actor_, case.models)


def _cannot(action: m.Item, actor: m.Ego | m.Actor) -> tuple[str, HelpText] | None:
    """Return why an actor cannot do an action, with the help; None if it can."""
    if isinstance(actor, m.Ego):
        return (
            "a trigger cannot control the ego: the driver under test drives it",
            "name another actor, or " + remove("remove this"),
        )
    statements = {type(item) for item in actor.body}
    if isinstance(action, m.LeavesTrack) or (m.Track in statements and not isinstance(action, m.Leaves)):
        return _cannot_leave(action, actor.name, statements)
    if actor.kind == "obstacle" and not isinstance(action, m.Leaves):
        return f"'{actor.name}' is an obstacle, which never moves", "name another actor, or " + remove("remove this")
    ways = statements & {m.Route, m.EdgeRoute, m.Path, m.PathAlong}
    if not ways and actor.state is None and not isinstance(action, m.Leaves):
        help = in_block("path [(0 m, 0 m), (20 m, 0 m)]", actor.name) + ", or " + remove("remove this")
        return f"'{actor.name}' has no route or path, so it cannot move", help
    if isinstance(action, m.ChangesLane | m.ChangesLine | m.KeepsBeside | m.Reverses) and (
        actor.kind == "pedestrian" or ways & {m.Path, m.PathAlong}
    ):
        help = "lead its " + write("path") + " there instead, or " + remove("remove this")
        return f"'{actor.name}' moves without lanes, so it cannot do this", help
    return None


def _cannot_leave(action: m.Item, name: str, statements: Collection[type[m.Item]]) -> tuple[str, HelpText] | None:
    """Return why an actor cannot leave its track, and so cannot do what only an actor off its track does."""
    if m.Track not in statements:
        return f"'{name}' follows no track, so it cannot leave it", "name another actor, or " + remove("remove this")
    if m.Joins in statements:
        return None
    does = "leave it" if isinstance(action, m.LeavesTrack) else "do this"
    help = in_block("then joins [west, east]", name) + " with the edges along which it drives afterwards, or "
    return f"'{name}' follows its track to the end, so it cannot {does}", help + remove("remove this")


def _too_fast(
    lints: Collector,
    item: m.Item,
    field: str,
    speed: m.Value,
    actor: m.Ego | m.Actor,
    models: Mapping[str, m.VehicleModel],
) -> None:
    model = models.get(actor.model) if isinstance(actor.model, str) else None
    top = model.max_speed if model is not None else None
    if model is None or not isinstance(top, m.Quantity) or not isinstance(speed, m.Quantity):
        return
    if speed.si > top.si * _SLACK:
        message = f"'{actor.name}' cannot reach {written(speed)}: the maximum of {model.name} is {written(top)}"
        help = "use at most " + write(written(top)) + ", or a faster model"
        lints.add(item, field, "FS308", message, help)


def route_lints(lints: Collector, case: TestCase) -> None:
    """Report gaps in one concrete scenario's routes and measures beside them; none if the network is a foreign file."""
    if not isinstance(case.network, m.Network):
        return
    roads = Roads(case.network)
    passed: dict[str, set[str]] = {}
    actions = (action for when in case.scenario.all(m.When) for action in all_actions(when.actions))
    leave_their_route = {action.actor for action in actions if isinstance(action, m.FollowsPath)}
    for actor in case.scenario.actors:
        for item in actor.body:
            if not _has_gap(lints, item, roads) and (junctions := passed_by(item, roads)) is not None:
                passed[actor.name] = junctions
    for name in leave_their_route:
        passed.pop(name, None)
    for statement in case.scenario.body:
        if isinstance(statement, m.When | m.Expect):
            _off_the_way(lints, statement, roads, passed)


def _has_gap(lints: Collector, item: m.Item, roads: Roads) -> bool:
    """Report the first gap of a route; return whether it has one."""
    if isinstance(item, m.EdgeRoute) and not item.shortest:
        for first, second in zip(item.edges, item.edges[1:], strict=False):
            if first in roads.edges and second in roads.edges and roads.edges[first][1] != roads.edges[second][0]:
                message = (
                    f"'{first}' ends at {roads.edges[first][1]}, but '{second}' begins at {roads.edges[second][0]}"
                )
                help = "write " + write(f"[{first}, ..., {second}]") + " for the shortest way between them"
                lints.add(item, "edges", "FS309", message, help)
                return True
    if isinstance(item, m.Route) and isinstance(item.start, str):
        return _has_gap_between_legs(lints, item, roads)
    return False


def _has_gap_between_legs(lints: Collector, route: m.Route, roads: Roads) -> bool:
    edges = [edge for edge in (str(route.start), f"{route.start}_back") if edge in roads.edges]
    before = f"road '{route.start}'"
    for leg in route.legs:
        junction = leg.junction
        if not edges or junction not in roads.junctions or not isinstance(junction, str):
            return False  # an unknown name, which is reported elsewhere
        reached = roads.reached(edges)
        if junction not in reached:
            help = "write the turn first that goes over " + one_of(sorted(reached), " or ")
            lints.add(leg, "junction", "FS309", f"{before} does not lead to '{junction}'", help)
            return True
        edges = roads.leaving(junction)
        before = f"the way over '{junction}'"
    return False


def _off_the_way(lints: Collector, statement: m.When | m.Expect, roads: Roads, passed: dict[str, set[str]]) -> None:
    negated: set[int] = set()
    for part in walk(statement):
        if isinstance(part, m.Not):
            negated ^= {id(inner) for inner in walk(part)}
    for comparison in walk(statement):
        if not isinstance(comparison, m.Comparison) or not isinstance(part := comparison.left, m.Measure):
            continue
        if part.what not in ("eta", "distance") or part.actor not in passed:
            continue
        if part.what == "eta" and (comparison.op in (">", ">=")) != (id(comparison) in negated):
            continue  # an eta is infinite there, so this holds
        if part.other in roads.junctions and part.other not in passed[part.actor]:
            value = "is infinite" if part.what == "eta" else "never has a value"
            message = f"the route of '{part.actor}' does not go over '{part.other}', so `{written(part)}` {value}"
            help = "its route goes over " + (one_of(sorted(passed[part.actor])) or "no junction")
            lints.add(part, "other", "FS304", message, help)
