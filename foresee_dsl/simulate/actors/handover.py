"""The hand-over: the ego follows recorded states for a moment, while its driver watches, before the driver drives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import cos, remainder, sin, tan, tau

from foresee_dsl.compile.bundle import RecordedState
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState, centre_of_front
from foresee_dsl.simulate.trace import STEP_S


def handed_over(start: BicycleState, recorded: Sequence[RecordedState], motion: Bicycle) -> Iterator[BicycleState]:
    """Yield the ego's state at each frame after the first, up to the last recorded one.

    A frame between two recorded states lies on the curve of third degree that the rear axle takes from one to the
    other with their speeds and headings: the rear axle is the point that moves along the heading.

    Args:
        start: the first frame's. recorded: in the order of their times; what comes after less than a step is left out.
        motion: the ego's.
    """
    before, began_s, frame = replace(start, yaw_rate=_turning(start.speed, start.steer, motion)), 0.0, 1
    for state in recorded:
        after, ends_s = _state(state, motion), state.time_s
        while frame * STEP_S <= ends_s + 1e-6:
            yield _between(before, after, ends_s - began_s, frame * STEP_S - began_s, motion)
            frame += 1
        before, began_s = after, ends_s


def _state(recorded: RecordedState, motion: Bicycle) -> BicycleState:
    heading = recorded.heading_rad
    x, y = centre_of_front(recorded.x, recorded.y, heading, motion.limits.length_m)
    turning = _turning(recorded.speed_mps, recorded.steer_rad, motion)
    return BicycleState(x, y, heading, recorded.speed_mps, recorded.acceleration_mps2, turning, recorded.steer_rad)


def _turning(speed: float, steer: float, motion: Bicycle) -> float:
    """Return the yaw rate (rad/s) that the wheels give, as far as the tyres hold."""
    most = motion.grip_mps2 / max(speed, STEP_S)
    return max(-most, min(most, speed * tan(steer) / motion.limits.wheelbase_m))


def _between(a: BicycleState, b: BicycleState, span_s: float, since_s: float, motion: Bicycle) -> BicycleState:
    """Return the state `since_s` after `a`, of the `span_s` until `b`."""
    if since_s >= span_s - 1e-6:
        return b
    share = since_s / span_s
    turned = remainder(b.heading - a.heading, tau)
    heading = a.heading + _curve(0.0, a.yaw_rate, turned, b.yaw_rate, span_s, share)
    (ax, ay), (bx, by) = motion.rear_axle(a), motion.rear_axle(b)
    x = _curve(ax, a.speed * cos(a.heading), bx, b.speed * cos(b.heading), span_s, share)
    y = _curve(ay, a.speed * sin(a.heading), by, b.speed * sin(b.heading), span_s, share)
    return BicycleState(
        x=x + motion.rear_axle_m * cos(heading),
        y=y + motion.rear_axle_m * sin(heading),
        heading=heading,
        speed=a.speed + share * (b.speed - a.speed),
        acceleration=(b.speed - a.speed) / span_s,
        yaw_rate=turned / span_s,
        steer=a.steer + share * (b.steer - a.steer),
    )


def _curve(a: float, a_rate: float, b: float, b_rate: float, span_s: float, share: float) -> float:
    """Return the value of the cubic with these ends and rates of change (Hermite's form)."""
    t, rest = share, 1.0 - share
    ends = a * rest * rest * (1 + 2 * t) + b * t * t * (3 - 2 * t)
    return ends + span_s * t * rest * (a_rate * rest - b_rate * t)
