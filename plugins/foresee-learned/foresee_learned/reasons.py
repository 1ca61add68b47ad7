"""Computes the reasons for the decisions of a learned driver.

`fusion_safe` computes which object or stop line limits its speed. `fusion` does not: its network is queried again with
one object, or the stop lines, painted out of both pictures. If that makes the driver faster, the object is a reason.
Training pictures have no such holes, so small differences mean nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from foresee_dsl.drivers.protocol import Observation, Reason, SeenActor, VehicleLimits
from foresee_learned import settings as cfg
from foresee_learned.inputs import AHEAD_M, CHANNELS, SIDE_M, LearnedInputs, Picture
from foresee_learned.rasters.layout import BIRDS_EYE, CAMERA_AHEAD_M, FORWARD, FORWARD_CHANNELS

if TYPE_CHECKING:
    from foresee_learned.decisions import Decision
    from foresee_learned.free_way import Basis
    from foresee_learned.outputs import Occupied

LEAST_MPS = 0.3
"""An object is a reason if the target speed without it is higher by at least this, m/s. Ours: the change of speed at 2
m/s^2 during one and a half decisions."""
NEAREST = 12
"""Maximum number of objects that are painted out, the nearest ones. Ours: they take 60 ms per step."""
SAME_M = 4.0
"""Distance within which the nearest object of the list is taken for an object of the density map, m. Ours: a car's
length."""
_AROUND_M = 0.75
"""Margin around an object that is painted out, m. Ours: one and a half pixels, because boxes are drawn larger than they
are."""
_ROAD_USERS = [CHANNELS.index(n) for n in CHANNELS if n in {"vehicle", "two_wheeler", "pedestrian", "obstacle"}]
_ROAD_USERS += [CHANNELS.index(n) for n in CHANNELS if n.startswith(("velocity", "past"))]
_STOP_LINES = [CHANNELS.index(n) for n in CHANNELS if n.startswith("stop_")]
_SEEN = [FORWARD_CHANNELS.index(n) for n in ("vehicle", "two_wheeler", "pedestrian", "obstacle", "inverse_depth")]
_LAMPS = [FORWARD_CHANNELS.index(n) for n in ("red", "amber", "green")]


def reasons_by_erasing(
    observation: Observation, inputs: LearnedInputs, decision: Decision, decide: Callable[[LearnedInputs], Decision]
) -> tuple[Reason, ...]:
    """Return the objects without which the driver is faster, the strongest first; then its plan."""
    erased = sorted(_erased(observation, inputs, decision, decide), key=lambda pair: -pair[0])
    now_mps = observation.ego.speed_mps
    wish = (decision.target_mps - now_mps) / decision.within_s
    text = f"its network wants {decision.target_mps * 3.6:.0f} km/h in {decision.within_s:.1f} s"
    return (*(reason for _, reason in erased), Reason("plan", text, acceleration_mps2=wish))


def _erased(
    observation: Observation, inputs: LearnedInputs, decision: Decision, decide: Callable[[LearnedInputs], Decision]
) -> Iterator[tuple[float, Reason]]:
    """Yield for each object the increase of the driver's speed without it, m/s, and the object as a reason."""
    for seen in observation.actors[:NEAREST]:
        faster = decide(_without(observation, inputs, seen)).target_mps - decision.target_mps
        if faster >= LEAST_MPS:
            text = f"without it in its pictures it would want {faster * 3.6:.0f} km/h more"
            yield faster, Reason("object", text, seen.track, distance_m=_away(observation, seen))
    birds_eye, forward = inputs.birds_eye.copy(), inputs.forward.copy()
    birds_eye[_STOP_LINES] = 0
    forward[_LAMPS] = 0
    faster = decide(replace(inputs, birds_eye=birds_eye, forward=forward)).target_mps - decision.target_mps
    if faster >= LEAST_MPS:
        text = f"without stop lines and signals in its pictures it would want {faster * 3.6:.0f} km/h more"
        signal = next(iter(observation.signals), None)
        yield faster, Reason("signal", text, signal=signal if len(observation.signals) == 1 else None)


def _without(observation: Observation, inputs: LearnedInputs, seen: SeenActor) -> LearnedInputs:
    """Return the inputs with one object painted out of both pictures."""
    ahead, left, turned = _seen_from(observation, seen)
    birds_eye, forward = inputs.birds_eye.copy(), inputs.forward.copy()
    rows, columns = birds_eye.shape[1:]
    ahead_m = AHEAD_M - (np.arange(rows)[:, None] + 0.5) * BIRDS_EYE.m_per_px
    left_m = SIDE_M - (np.arange(columns)[None, :] + 0.5) * BIRDS_EYE.m_per_px
    dx, dy, cos, sin = ahead_m - ahead, left_m - left, math.cos(turned), math.sin(turned)
    inside = (abs(dx * cos + dy * sin) <= seen.length_m / 2 + _AROUND_M) & (
        abs(dy * cos - dx * sin) <= seen.width_m / 2 + _AROUND_M
    )
    birds_eye[np.ix_(_ROAD_USERS)] *= ~inside
    _paint_out_ahead(forward, (ahead, left, turned), seen)
    return replace(inputs, birds_eye=birds_eye, forward=forward)


def _paint_out_ahead(forward: Picture, place: tuple[float, float, float], seen: SeenActor) -> None:
    """Clear the road users in those columns of the view ahead in which an object's box is."""
    ahead, left, turned = place
    cos, sin = math.cos(turned), math.sin(turned)
    corners = [(i * seen.length_m / 2, k * seen.width_m / 2) for i in (-1, 1) for k in (-1, 1)]
    slopes = [
        (left + sin * i + cos * k) / (ahead + cos * i - sin * k - CAMERA_AHEAD_M)
        for i, k in corners
        if ahead + cos * i - sin * k - CAMERA_AHEAD_M > 1.0
    ]
    if not slopes:
        return
    middle, focal = FORWARD.columns / 2, FORWARD.focal_px
    first = max(math.floor(middle - focal * max(slopes)), 0)
    last = max(math.ceil(middle - focal * min(slopes)), 0)
    road_user = forward[_SEEN[:-1], :, first:last].any(axis=0)
    forward[np.array(_SEEN), :, first:last] *= ~road_user


def reasons_of_basis(observation: Observation, basis: Basis, vehicle: VehicleLimits) -> tuple[Reason, ...]:
    """Return the reasons for a decision of `fusion_safe`: the strictest limit of its speed first."""
    now_mps = observation.ego.speed_mps
    wish = (basis.planned_mps - now_mps) / cfg.PLANNED_S
    plan = Reason("plan", f"its waypoints are for {basis.planned_mps * 3.6:.0f} km/h", acceleration_mps2=wish)
    safe, text = -vehicle.emergency_braking_mps2, "no speed is safe"
    if basis.safe_mps is not None:
        safe, text = (
            (basis.safe_mps - now_mps) / cfg.DECISION_S,
            f"the fastest safe speed is {basis.safe_mps * 3.6:.0f} km/h",
        )
    bound: list[Reason] = []
    if basis.way.first is not None:
        seen = _nearest(observation, basis.way.first)
        room, what = basis.way.first_m, f"in the way of its waypoints; {text}"
        bound.append(Reason("object", what, None if seen is None else seen.track, None, safe, room))
    if basis.stop is not None:
        passage, room = basis.stop
        bound.append(Reason("signal", f"has to stop at {passage.junction}; {text}", None, passage.signal, safe, room))
    return (*bound, plan) if safe < wish else (plan, *bound)


def _nearest(observation: Observation, other: Occupied) -> SeenActor | None:
    """Return the object of the list that corresponds to an object of the density map."""
    away = []
    for seen in observation.actors:
        ahead, left, _ = _seen_from(observation, seen)
        away.append((math.hypot(ahead - other.ahead_m, left - other.left_m), seen))
    best = min(away, key=lambda pair: pair[0], default=None)
    return best[1] if best is not None and best[0] <= SAME_M else None


def _seen_from(observation: Observation, seen: SeenActor) -> tuple[float, float, float]:
    """Return an object's distance ahead of the ego and to its left (m), and its relative heading (rad)."""
    ego = observation.ego
    dx, dy, cos, sin = seen.x - ego.x, seen.y - ego.y, math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    return dx * cos + dy * sin, dy * cos - dx * sin, seen.heading_rad - ego.heading_rad


def _away(observation: Observation, seen: SeenActor) -> float:
    return math.hypot(seen.x - observation.ego.x, seen.y - observation.ego.y)
