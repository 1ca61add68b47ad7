"""Export of actions that keep an actor at a lateral position or near another actor."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping

from foresee_dsl.compile.bundle import Scene
from foresee_dsl.kernels.sumo_traffic import SIDEWAYS_MPS
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of, word_of
from foresee_exchange.openscenario.writing.library import Xosc, at_once, figure, osc, world

Related = m.ChangesLine | m.KeepsBeside | m.KeepsGap | m.MatchesSpeed | m.Synchronises


def related_action(action: Related, scene: Scene, left_out: Counter[str]) -> Xosc:
    """Return OpenSCENARIO's action for an action that keeps an actor at a lateral position or near another actor; None
    if its place depends on the actor's later position. Parts that OpenSCENARIO cannot express are counted in
    `left_out`."""
    duration = None if isinstance(action, m.ChangesLine | m.Synchronises) else action.duration
    left_out["ends of actions that keep to another actor"] += duration is not None
    match action:
        case m.ChangesLine():
            return _line(action)
        case m.KeepsBeside():
            left = word_of(action.side) == "left"
            side = (
                osc.LateralDisplacement.leftToReferencedEntity
                if left
                else osc.LateralDisplacement.rightToReferencedEntity
            )
            return osc.LateralDistanceAction(
                action.other, figure(max(si_of(action.room), 0.0)), freespace=True, continuous=True, displacement=side
            )
        case m.KeepsGap():
            ahead = action.way == "leads"
            where = (
                osc.LongitudinalDisplacement.leadingReferencedEntity
                if ahead
                else osc.LongitudinalDisplacement.trailingReferencedEntity
            )
            how: Mapping[str, float] = {"timeGap" if action.gap_is_time else "distance": figure(si_of(action.gap))}
            return osc.LongitudinalDistanceAction(
                action.other, freespace=True, continuous=True, displacement=where, **how
            )
        case m.MatchesSpeed():
            factor = 1.0 if action.factor is None else si_of(action.factor)
            more = 0.0 if action.more is None else si_of(action.more)
            by_factor = osc.SpeedTargetValueType.factor if factor != 1.0 else osc.SpeedTargetValueType.delta
            if factor != 1.0 and more:
                left_out[
                    "the difference of a speed that also has a ratio to another's (only the ratio is written)"
                ] += 1
            value = factor if factor != 1.0 else more
            return osc.RelativeSpeedAction(figure(value), action.other, at_once(), by_factor, continuous=True)
        case m.Synchronises():
            places = [_where(place, scene) for place in (action.there, action.place)]
            if any(place is None for place in places):
                return None
            final = None if action.speed is None else osc.AbsoluteSpeed(figure(si_of(action.speed)))
            return osc.SynchronizeAction(action.other, *places, final_speed=final)


def _line(action: m.ChangesLine) -> Xosc:
    """Return an offset; its duration is expressed by the peak acceleration of a sinusoidal curve."""
    to = si_of(action.to)
    over_s = abs(to) / SIDEWAYS_MPS if action.over is None else si_of(action.over)
    most = max(abs(to), 0.1) * math.pi**2 / (2 * over_s**2) if over_s > 0 else None
    shape = osc.DynamicsShapes.sinusoidal if most is not None else osc.DynamicsShapes.step
    return osc.AbsoluteLaneOffsetAction(figure(to), shape, None if most is None else figure(most), continuous=True)


def _where(place: m.Place, scene: Scene) -> Xosc:
    if isinstance(place, m.OfActor):
        return None
    at = (si_of(place.x), si_of(place.y)) if isinstance(place, m.Point) else scene.places[place]
    return world(*at)
