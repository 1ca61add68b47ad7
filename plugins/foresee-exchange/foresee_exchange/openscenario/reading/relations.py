"""Actions that keep an actor at a lateral position or near another actor: offsets, distances, meeting at a place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.language import model as m
from foresee_dsl.language.model.actions import WIDEST_LINE_M
from foresee_exchange.naming import number, quantity
from foresee_exchange.openscenario.losses import Losses, NotExpressed
from foresee_exchange.openscenario.reading.entities import EntityState
from foresee_exchange.openscenario.reading.places import Places, point_of

RELATED = ("LaneOffsetAction", "LateralDistanceAction", "LongitudinalDistanceAction", "SynchronizeAction")
_ACCELERATIONS: Mapping[str, float] = {"cubic": 6.0, "sinusoidal": math.pi**2 / 2, "linear": 4.0}
"""Highest lateral acceleration of a move by 1 m in 1 s, m/s^2, by the shape of the move. A linear move has no
acceleration; its value is that of a move along two parabolas."""
_ONCE = "distances that are to be reached only once are kept to the end"


def offset_of(action: Element, state: EntityState, states: Mapping[str, EntityState], places: Places) -> m.ChangesLine:
    """Return a `<LaneOffsetAction>`; `NotExpressed` if the language cannot express it."""
    absolute = action.find("LaneOffsetTarget/AbsoluteTargetLaneOffset")
    relative = action.find("LaneOffsetTarget/RelativeTargetLaneOffset")
    if absolute is not None:
        offset = number(absolute, "value")
    elif relative is not None and relative.get("entityRef") in states:
        # Relative to the other actor, which is assumed to be in the middle of its lane.
        offset = number(relative, "value")
    else:
        raise NotExpressed("actions: LaneOffsetAction (without a target)")
    to = offset * _left(state, places)
    if abs(to) > WIDEST_LINE_M:
        raise NotExpressed(f"actions: LaneOffsetAction (over {WIDEST_LINE_M:g} m)")
    _on_lanes(state, "LaneOffsetAction")
    dynamics = action.find("LaneOffsetActionDynamics")
    shape = dynamics.get("dynamicsShape", "") if dynamics is not None else ""
    most = number(dynamics, "maxLateralAcc", 0.0) if dynamics is not None else 0.0
    over = None
    if shape in _ACCELERATIONS and most > 0 and to:
        over = quantity(round(math.sqrt(_ACCELERATIONS[shape] * abs(to) / most), 2), "time")
    return m.ChangesLine(actor=state.entity.name, to=quantity(to, "length"), over=over)


def lateral_of(
    action: Element, state: EntityState, states: Mapping[str, EntityState], places: Places, losses: Losses
) -> m.KeepsBeside:
    """Return a `<LateralDistanceAction>`; `NotExpressed` if the language cannot express it."""
    tag = "LateralDistanceAction"
    other = _other(states, action, tag)
    _on_lanes(state, tag)
    distance, displacement = number(action, "distance", 0.0), action.get("displacement", "any")
    left = _is_left(state, other, places)
    if displacement in ("leftToReferencedEntity", "rightToReferencedEntity"):
        left = displacement.startswith("left")
        if action.get("coordinateSystem") == "road" and not state.ahead:
            left = not left
    elif distance < 0:  # as in CARLA's scenario_runner
        left = _left(state, places) < 0
    room = abs(distance)
    if action.get("freespace") != "true":
        room -= (state.entity.spec.width_m + other.entity.spec.width_m) / 2
    if action.get("continuous") != "true":
        losses.note(_ONCE)
    side: Literal["left", "right"] = "left" if left else "right"
    return m.KeepsBeside(actor=state.entity.name, room=quantity(room, "length"), side=side, other=other.entity.name)


def longitudinal_of(
    action: Element, state: EntityState, states: Mapping[str, EntityState], places: Places, losses: Losses
) -> m.KeepsGap:
    """Return a `<LongitudinalDistanceAction>`; `NotExpressed` if the language cannot express it."""
    tag = "LongitudinalDistanceAction"
    other = _other(states, action, tag)
    displacement = action.get("displacement", "any")
    ahead = displacement == "leadingReferencedEntity"
    if displacement not in ("leadingReferencedEntity", "trailingReferencedEntity"):
        here, there = places.initial(state.entity.ref), places.initial(other.entity.ref)
        c, s = math.cos(here.heading_rad), math.sin(here.heading_rad)
        ahead = (here.x - there.x) * c + (here.y - there.y) * s > 0
    if action.get("timeGap"):
        gap = quantity(number(action, "timeGap"), "time")
    else:
        metres = number(action, "distance")
        if action.get("freespace") != "true":  # the distance is then between the reference points
            front, rear = (other, state) if ahead else (state, other)
            metres -= front.entity.centre_m + front.entity.spec.length_m / 2
            metres -= rear.entity.spec.length_m / 2 - rear.entity.centre_m
        gap = quantity(max(metres, 0.0), "length")
    if action.get("continuous") != "true":
        losses.note(_ONCE)
    way: Literal["follows", "leads"] = "leads" if ahead else "follows"
    return m.KeepsGap(actor=state.entity.name, way=way, other=other.entity.name, gap=gap)


def synchrony_of(
    action: Element, state: EntityState, states: Mapping[str, EntityState], places: Places, losses: Losses
) -> m.Synchronises:
    """Return a `<SynchronizeAction>`; `NotExpressed` if the language cannot express it."""
    tag = "SynchronizeAction"
    master = states.get(action.get("masterEntityRef", ""))
    own, theirs = action.find("TargetPosition"), action.find("TargetPositionMaster")
    if master is None or own is None or theirs is None:
        raise NotExpressed(f"actions: {tag} (without a target)")
    speed: m.Quantity | None = None
    final = action.find("FinalSpeed")
    absolute = final.find("AbsoluteSpeed") if final is not None else None
    relative = final.find("RelativeSpeedToMaster") if final is not None else None
    if absolute is not None:
        speed = quantity(max(number(absolute, "value"), 0.0), "speed")
    elif relative is not None:
        if master.speed_mps is None:
            raise NotExpressed(f"actions: {tag} (relative to a speed that is not known)")
        losses.note("final speeds relative to another's are relative to its speed at the beginning")
        value = number(relative, "value")
        factor = relative.get("speedTargetValueType") == "factor"
        speed = quantity(max(master.speed_mps * value if factor else master.speed_mps + value, 0.0), "speed")
    if speed is not None:
        state.speed_mps = speed.si
    if final is not None and any("SteadyState" in part.tag for part in final.iter()):
        losses.note("steady speeds before the places of a SynchronizeAction are left out")
    return m.Synchronises(
        actor=state.entity.name,
        place=point_of(places.later(own)),
        other=master.entity.name,
        there=point_of(places.later(theirs)),
        speed=speed,
    )


def _other(states: Mapping[str, EntityState], action: Element, tag: str) -> EntityState:
    other = states.get(action.get("entityRef", ""))
    if other is None:
        raise NotExpressed(f"actions: {tag} (to an entity that was left out)")
    return other


def _on_lanes(state: EntityState, tag: str) -> None:
    if not state.on_lanes:
        raise NotExpressed(f"actions: {tag} (of an actor that follows no lane)")


def _left(state: EntityState, places: Places) -> float:
    """Return 1 if offsets to the left of the road are to the actor's left, otherwise -1."""
    return (1.0 if state.ahead else -1.0) * (-1.0 if places.mirrored else 1.0)


def _is_left(state: EntityState, other: EntityState, places: Places) -> bool:
    """Return whether an actor begins to the left of another."""
    here, there = places.initial(state.entity.ref), places.initial(other.entity.ref)
    c, s = math.cos(there.heading_rad), math.sin(there.heading_rad)
    return (here.y - there.y) * c - (here.x - there.x) * s > 0
