"""The ego's part of a story: its moments during the run, and its manoeuvre and motion at the end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, STEP_S, YAW_RATE, X, Y
from foresee_dsl.story.facts import Facts, spans
from foresee_dsl.story.place import StoryPlace, entries, movement_near
from foresee_dsl.story.story import Moment
from foresee_dsl.story.wording import kmh, quoted

STANDS_FOR_S = 0.5
"""A stop shorter than this is not mentioned, s. Ours: a passenger does not notice it."""
EGO_CREEPS_MPS = 3.0
"""An ego that was slower than this for the last second creeps, m/s. Ours: 11 km/h, a little over a walking pace."""
EGO_BRAKES_MPS2 = 1.0
"""Braking weaker than this is not mentioned, m/s^2. Ours: releasing the accelerator slows a car by less than 1
m/s^2."""
BRAKES_HARD_MPS2 = 5.0
"""Braking at least this strong is hard, m/s^2: over 5 m/s^2 is an emergency manoeuvre in UN Regulation 157 (after
`avoidance.r157.risk`)."""
BRAKES_FOR_S = 0.15
"""Braking shorter than this is not mentioned, s. Ours: three frames, the delay of a brake."""
EASES_S = 0.3
"""Two brakings less than this apart count as one braking, s. Ours."""
ACCELERATES_MPS2, ACCELERATES_FOR_S = 0.8, 1.0
"""An acceleration at least this strong (m/s^2) for at least this long (s) is a moment of the story. Ours: half of the
strongest acceleration of SUMO's cars in town."""
STEERS_RAD, STEERS_WITHIN_S = math.radians(8), 2.0
"""An ego whose heading changes by more than this (rad) within that time (s), away from junctions, steers to that side.
Ours: a lane change at 50 km/h changes the heading by 4 degrees."""
SWERVES_MPS2, SWERVES_FOR_S = 2.0, 0.3
"""Lateral acceleration (m/s^2) and duration (s) from which on the ego swerves, outside junctions. Ours: a lane change
by `pdm` stays below 1.5 m/s^2."""


@dataclass(frozen=True)
class EgoMotion:
    """The manoeuvre and motion of the ego at the end of a run.

    Attributes:
        state: `stands`, `creeps`, `brakes`, `accelerates` or `drives on`.
        going: `turning left`, `changing lane`, ...; "" if it drives straight on.
        from_mps: its speed where its last braking or acceleration began; 0 if it did neither.
        speed_mps: its speed at the end. fastest_mps: its highest speed within the last second.
        braking_mps2: the strongest deceleration of that last braking; 0 if it did not brake.
        stood_s: how long it has stood at the end; 0 if it moves.
        braked_s: how long before the end that braking began; 0 if it did not brake.
    """

    state: str
    going: str
    from_mps: float
    speed_mps: float
    fastest_mps: float
    braking_mps2: float
    stood_s: float
    braked_s: float

    def manoeuvre(self, *, steered: bool) -> str:
        """Return the manoeuvre in words; two runs with equal stories have the same words.

        Args:
            steered: an actor was steered into the ego. The ego could not avoid that, so whether it stood or braked
                makes no difference between stories.
        """
        if steered:
            return self.going or "drives or waits"
        what = "stands" if self.state == "stands" else "brakes" if self.braking_mps2 else "does not brake"
        return f"{what}, {self.going}" if self.going else what


def ego_of(facts: Facts, place: StoryPlace, whole: Facts) -> EgoMotion:
    """Return the manoeuvre and motion of the ego at the end of a story.

    `facts` ends with the story; `whole` is the whole run, from which the brakings and accelerations are taken, because
    the story's moments name the same ones.
    """
    speed, last = facts.speed(0), facts.last
    stand = next((s for s in spans(speed < STANDS_MPS, 0.0) if s[1] == last), None)
    until = stand[0] if stand else last
    brakings = [span for span in _brakings(whole) if (last - span[0]) * STEP_S >= BRAKES_FOR_S - 1e-9]
    final = next((b for b in reversed(brakings) if (until - b[1]) * STEP_S <= EASES_S), None)
    pushed = next((s for s in _accelerations(whole, last) if s[0] <= last <= s[1]), None)
    began = final or pushed
    return EgoMotion(
        state=_state(facts, braking=final is not None, accelerating=pushed is not None),
        going=_going(facts, place),
        from_mps=float(speed[began[0]]) if began else 0.0,
        speed_mps=float(speed[last]),
        fastest_mps=float(speed[max(0, last - round(1 / STEP_S)) :].max()),
        braking_mps2=_strongest(whole, final) if final else 0.0,
        stood_s=(stand[1] - stand[0]) * STEP_S if stand else 0.0,
        braked_s=(last - final[0]) * STEP_S if final else 0.0,
    )


def ego_moments(facts: Facts, end: int) -> tuple[Moment, ...]:
    """Return the moments of the ego in the whole run, in the order of time; `end`: the last frame of the story."""
    return tuple(sorted(_moments(facts, _brakings(facts), end), key=lambda moment: moment.time_s))


def _state(facts: Facts, *, braking: bool, accelerating: bool) -> str:
    speed = facts.speed(0)[max(0, facts.last - round(1 / STEP_S)) :]
    if speed[-1] < STANDS_MPS:
        return "stands"
    if speed.max() < EGO_CREEPS_MPS:
        return "creeps"
    if braking:
        return "brakes"
    return "accelerates" if accelerating else "drives on"


def _going(facts: Facts, place: StoryPlace) -> str:
    movement = movement_near(facts, 0, facts.last, place) if place.kind != "road" else None
    if movement is not None:
        return "" if movement.turn == "straight" else f"turning {movement.turn}"
    if _changes_lane(facts, facts.last):
        return "changing lane"
    turned = wrap(facts.heading(0, facts.last) - facts.heading(0, max(0, facts.last - round(STEERS_WITHIN_S / STEP_S))))
    if place.kind == "road" and abs(turned) > STEERS_RAD:
        return f"steering to the {'left' if turned > 0 else 'right'}"
    return ""


def _changes_lane(facts: Facts, frame: int) -> bool:
    """Return whether the ego changed its lane within the 2 s before a frame."""
    network = facts.network
    ids = [facts.lane(0, k) for k in range(max(0, frame - round(2 / STEP_S)), frame + 1)]
    lanes = [network.lanes[name] for name in dict.fromkeys(ids) if name in network.lanes]
    return any(a.edge == b.edge and not a.internal for a, b in pairwise(lanes))


def _brakings(facts: Facts) -> list[tuple[int, int]]:
    states = facts.trace.states[:, 0]
    return spans((states[:, ACCELERATION] <= -EGO_BRAKES_MPS2) & (states[:, SPEED] > STANDS_MPS), BRAKES_FOR_S, EASES_S)


def _accelerations(facts: Facts, end: int) -> list[tuple[int, int]]:
    """Return the accelerations that last for `ACCELERATES_FOR_S`, and any acceleration at the frame `end`."""
    stretches = spans(facts.trace.states[:, 0, ACCELERATION] >= ACCELERATES_MPS2, 0.0, EASES_S)
    return [s for s in stretches if (s[1] - s[0]) * STEP_S >= ACCELERATES_FOR_S - 1e-9 or s[0] <= end <= s[1]]


def _strongest(facts: Facts, span: tuple[int, int]) -> float:
    return -float(facts.trace.states[span[0] : span[1] + 1, 0, ACCELERATION].min())


def _moments(facts: Facts, brakings: list[tuple[int, int]], story_end: int) -> Iterator[Moment]:
    speed = facts.speed(0)
    begins = f"the ego drives {kmh(speed[0])}" if speed[0] >= STANDS_MPS else "the ego stands"
    yield _moment(0, "begins", begins)
    yield from _braking_moments(facts, brakings)
    for start, end in spans(speed < STANDS_MPS, STANDS_FOR_S):
        if start > 0:
            yield _moment(start, "stops", "the ego stops")
        if end < facts.last:
            yield _moment(end + 1, "moves off", "the ego moves off")
    for start, _ in spans((speed >= STANDS_MPS) & (speed < EGO_CREEPS_MPS), 1.5):
        if start > 0:
            yield _moment(start, "creeps", f"the ego creeps, at under {kmh(EGO_CREEPS_MPS)}")
    for start, end in _accelerations(facts, story_end):
        if kmh(speed[start]) != kmh(speed[end]):
            yield _moment(start, "accelerates", f"the ego accelerates from {kmh(speed[start])} to {kmh(speed[end])}")
    yield from _route_moments(facts)
    yield from _slippery_moments(facts)


def _slippery_moments(facts: Facts) -> Iterator[Moment]:
    """Yield the moments at which the ego drives onto slippery ground: a patch within half its width of its middle."""
    states, half_m = facts.trace.states[:, 0], facts.trace.actors[0].width_m / 2
    for patch in facts.bundle.scene.slippery:
        on = np.hypot(states[:, X] - patch.x, states[:, Y] - patch.y) <= patch.radius_m + half_m
        for start, _ in spans(on, 0.0, EASES_S):
            text = f"the ego comes onto {quoted(patch.name)}, slippery ground with friction {patch.friction:g}"
            yield _moment(start, "slippery", text)


def _braking_moments(facts: Facts, brakings: list[tuple[int, int]]) -> Iterator[Moment]:
    speed, acceleration = facts.speed(0), facts.trace.states[:, 0, ACCELERATION]
    for start, end in brakings:
        strongest = _strongest(facts, (start, end))
        hard = next((k for k in range(start, end + 1) if acceleration[k] <= -BRAKES_HARD_MPS2), None)
        if hard is not None and (hard - start) * STEP_S > EASES_S:
            gentle = _strongest(facts, (start, hard - 1))
            yield _moment(start, "brakes", f"the ego brakes with {gentle:.1f} m/s^2, from {kmh(speed[start])}")
            yield _moment(hard, "brakes hard", f"the ego brakes hard, with up to {strongest:.1f} m/s^2")
        else:
            kind = "brakes" if hard is None else "brakes hard"
            yield _moment(start, kind, f"the ego {kind} with {strongest:.1f} m/s^2, from {kmh(speed[start])}")


def _route_moments(facts: Facts) -> Iterator[Moment]:
    """Yield the moments at which the ego enters a junction, changes its lane or swerves."""
    inside = np.zeros(facts.trace.frames, dtype=np.bool_)
    for start, end, _ in facts.passages(0):
        inside[start : end + 1] = True
    for start, where in entries(facts, 0):
        yield _moment(start, "enters", f"the ego enters {where}")
    network, previous = facts.network, facts.lane(0, 0)
    for frame in (np.flatnonzero(np.diff(facts.trace.lanes[:, 0])) + 1).tolist():
        lane, before = network.lanes.get(facts.lane(0, frame)), network.lanes.get(previous)
        previous = facts.lane(0, frame)
        if lane and before and lane.edge == before.edge and not lane.internal and lane.index != before.index:
            side = "left" if (lane.index > before.index) != network.left_hand else "right"
            yield _moment(frame, "changes lane", f"the ego changes to the lane on its {side}")
    states = facts.trace.states[:, 0]
    lateral = states[:, SPEED] * states[:, YAW_RATE]
    for start, end in spans((np.abs(lateral) >= SWERVES_MPS2) & ~inside, SWERVES_FOR_S):
        side = "left" if lateral[start : end + 1].mean() > 0 else "right"
        yield _moment(start, "swerves", f"the ego swerves to the {side}")


def _moment(frame: int, kind: str, text: str) -> Moment:
    return Moment(round(frame * STEP_S, 6), "ego", kind, text)
