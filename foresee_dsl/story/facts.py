"""The facts of one run from which its story is derived: trace, compiled scene, contact, and the mutation's changes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, wrap
from foresee_dsl.compile.roads.topology import Movement
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Change
from foresee_dsl.simulate.results.goal import GoalSeries
from foresee_dsl.simulate.results.infraction import Infraction, infractions_in
from foresee_dsl.simulate.results.outcome import contact_of
from foresee_dsl.simulate.results.verdict import Impact, Verdict
from foresee_dsl.simulate.signals import COLOURS, state_at
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, ActorInfo, Trace, X, Y
from foresee_dsl.simulate.waiting import WayAhead

NEAR_M = 10.0
"""In a run that passed, an actor that stayed farther from the ego than this is not an opponent, m. Ours: the length of
two cars."""
MOVED_M = 0.05
"""An actor that moved less than this between the two compared frames has no direction of travel, m. Ours: 0.1 m/s over
half a second."""


@dataclass(frozen=True, eq=False)
class Facts:
    """One run with its test case; each fact is computed when it is first used.

    Attributes:
        trace: the run. case: its test case. bundle: the compiled test case.
        named: column of the opponent if it is already chosen; None to choose it from the run.
    """

    trace: Trace
    case: TestCase
    bundle: SumoBundle
    named: int | None = None

    @classmethod
    def of(cls, trace: Trace, case: TestCase) -> Facts:
        """Compile the test case and return the facts of its run."""
        return cls(trace, case, compile_test_case(case))

    @property
    def network(self) -> RoadNetwork:
        """The road network of the scene."""
        return self.bundle.network

    @property
    def last(self) -> int:
        """Index of the last frame."""
        return self.trace.frames - 1

    @property
    def verdict(self) -> Verdict | None:
        """The run's verdict; None if the trace does not hold one."""
        value = str(self.trace.meta.get("verdict", ""))
        return next((verdict for verdict in Verdict if verdict.value == value), None)

    @property
    def end_s(self) -> float:
        """Time of the last frame, s."""
        return round(self.trace.duration_s, 6)

    @cached_property
    def impact(self) -> Impact | None:
        """The contact that ended the run, as the judge recorded it; None if the run ended without one."""
        return contact_of(self.trace)

    @cached_property
    def infraction(self) -> Infraction | None:
        """Return the first traffic rule that the ego broke, if the run failed because of it; None for other runs."""
        failing = (broken for broken in self.infractions if broken.rule.fails)
        return next(failing, None) if self.verdict is Verdict.RULE else None

    @cached_property
    def goal(self) -> GoalSeries | None:
        """Return the margins of the campaign's goal, if the run failed because it broke it; None for other runs."""
        return GoalSeries.in_meta(self.trace.meta) if self.verdict is Verdict.GOAL else None

    @cached_property
    def infractions(self) -> tuple[Infraction, ...]:
        """Return the traffic rules that the ego broke; none if the trace has no record of them."""
        return infractions_in(self.trace.meta)

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """Return the changes of the mutation; empty if the test case is not a mutant."""
        return self.case.mutant.changes if self.case.mutant else ()

    @cached_property
    def opponent(self) -> int | None:
        """Return the column of the actor that the story is about; None if it is about the ego alone.

        After a contact it is the actor that was touched; if the goal of a campaign was broken, the actor that the goal
        names. An ego that got stuck or left the road has no opponent.
        Otherwise it is the actor that the mutation changed or that is the clip's risk. If there is no such actor and
        the run passed, it is the moving actor that came nearest.
        """
        if self.named is not None:
            return self.named
        ids = {info.id: k for k, info in enumerate(self.trace.actors)}
        if self.impact is not None:
            return ids[self.impact.with_]
        if self.infraction is not None:
            return ids.get(self.infraction.other)
        if self.verdict in (Verdict.STUCK, Verdict.F1):
            return None
        risk = self.case.clip.risk if self.case.clip else None
        named = [self.goal.actor_in(self.trace)] if self.goal is not None else []
        named += [change.actor for change in self.changes] + ([risk.actor] if risk and risk.actor else [])
        column: int | None = next((ids[name] for name in named if ids.get(name)), None)
        if column is None and self.verdict is Verdict.PASS:
            return self._nearest()
        return column

    def at_nearest(self) -> Facts:
        """Return the facts of the run up to the frame at which the opponent was nearest to the ego."""
        if self.opponent is None:
            return self
        gaps_m = self.gaps_m(self.opponent)
        if np.isnan(gaps_m).all():
            return self
        end = int(np.nanargmin(gaps_m)) + 1
        return Facts(self.trace.part(0, end), self.case, self.bundle, self.opponent)

    def at_failure(self) -> Facts:
        """Return the facts of the run up to the frame at which the ego broke the rule, or was farthest from keeping the
        goal; if the run failed in another way, the facts of the whole run.
        """
        if self.infraction is not None:
            end = self.trace.frame_at(self.infraction.time_s) + 1
        elif self.goal is not None and self.goal.worst is not None:
            end = self.goal.worst + 1
        else:
            return self
        return Facts(self.trace.part(0, end), self.case, self.bundle, self.opponent)

    def _nearest(self) -> int | None:
        """Return the column of the moving actor that came nearest to the ego; None if it stayed beyond `NEAR_M`."""
        nearest: tuple[float, int | None] = (NEAR_M, None)
        for actor in range(1, len(self.trace.actors)):
            moving = self.speed(actor) >= STANDS_MPS
            if moving.any():
                least = float(np.min(np.where(moving, self.gaps_m(actor), np.inf)))
                nearest = min(nearest, (least, actor), key=lambda pair: pair[0])
        return nearest[1]

    def info(self, actor: int) -> ActorInfo:
        """Return the properties of an actor that are constant over a run, such as its size and route."""
        return self.trace.actors[actor]

    def placed(self, actor: int) -> PlacedActor | None:
        """Return an actor's entry in the scene; None for background traffic that appears after the first frame."""
        name = self.info(actor).id
        return next((placed for placed in self.bundle.scene.actors if placed.id == name), None)

    def speed(self, actor: int) -> FloatArray:
        """Return an actor's speed at every frame, [T], m/s."""
        return self.trace.states[:, actor, SPEED]

    def xy(self, actor: int, frame: int) -> XY:
        """Return the middle of an actor's footprint, m."""
        x, y = self.trace.states[frame, actor, [X, Y]].tolist()
        return x, y

    def heading(self, actor: int, frame: int) -> float:
        """Return an actor's heading, rad."""
        return float(self.trace.states[frame, actor, HEADING])

    def course(self, actor: int, frame: int) -> float:
        """Return the direction of an actor's movement over the last second, rad; its heading if it hardly moved."""
        before = max(0, frame - round(1 / STEP_S))
        (x0, y0), (x1, y1) = self.xy(actor, before), self.xy(actor, frame)
        if math.isnan(x0) or math.hypot(x1 - x0, y1 - y0) < MOVED_M:
            return self.heading(actor, frame)
        return math.atan2(y1 - y0, x1 - x0)

    def seen_from_ego(self, actor: int, frame: int) -> tuple[float, float]:
        """Return how far an actor's middle is ahead of the ego's and to its left, m."""
        (x, y), (ox, oy), heading = self.xy(0, frame), self.xy(actor, frame), self.heading(0, frame)
        cos, sin = math.cos(heading), math.sin(heading)
        return (ox - x) * cos + (oy - y) * sin, (oy - y) * cos - (ox - x) * sin

    def gaps_m(self, actor: int) -> FloatArray:
        """Return the distance between an actor's footprint and the ego's at every frame, [T] m; NaN if it is absent."""
        return box_distance(self.trace.boxes(0), self.trace.boxes(actor))

    def gap_m(self, actor: int, frame: int) -> float:
        """Return the distance between an actor's footprint and the ego's at a frame, m; NaN if the actor is absent."""
        return float(box_distance(self.trace.boxes(0)[frame], self.trace.boxes(actor)[frame]))

    def relative_course(self, actor: int, frame: int) -> float:
        """Return an actor's course minus the ego's heading, rad, from -pi to pi (left positive)."""
        return wrap(self.course(actor, frame) - self.heading(0, frame))

    def lane(self, actor: int, frame: int) -> str:
        """Return the id of the lane that an actor is on, "" for none."""
        index = int(self.trace.lanes[frame, actor])
        return self.trace.lane_ids[index] if index >= 0 else ""

    def nearest_lane(self, actor: int, frame: int) -> str:
        """Return the id of the lane that an actor is on, else of the nearest lane in its direction; "" for none."""
        nearest = self.network.nearest_lane(*self.xy(actor, frame), self.heading(actor, frame))
        return self.lane(actor, frame) or (nearest.lane.id if nearest is not None else "")

    def passages(self, actor: int) -> Iterator[tuple[int, int, Movement]]:
        """Yield each passage of an actor through a junction: first frame, last frame and movement.

        A joint, where an edge is only divided, is not a junction here.
        """
        lanes = self.trace.lanes[:, actor]
        starts = [0, *(np.flatnonzero(np.diff(lanes)) + 1).tolist()]
        ends = [*(start - 1 for start in starts[1:]), self.last]
        passage: tuple[int, int, Movement] | None = None
        for start, end in zip(starts, ends, strict=True):
            movement = self._movement(actor, self.lane(actor, start))
            movement = None if movement is not None and movement.junction in self.network.joints else movement
            if passage is not None and (movement is None or movement.junction != passage[2].junction):
                yield passage
                passage = None
            if movement is not None:
                passage = (passage[0] if passage else start, end, passage[2] if passage else movement)
        if passage is not None:
            yield passage

    def colour(self, movement: Movement, frame: int) -> str:
        """Return the colour of a movement's signal at a frame, "" if it has no signal."""
        signal = next((s for s in self.bundle.signals.values() if s.tls == movement.tls), None)
        if signal is None or movement.link < 0 or signal.junction not in self.trace.signals:
            return ""
        k = self.trace.signals.index(signal.junction)
        state = state_at(signal, self.trace, k, frame)
        return COLOURS.get(state[movement.link], "") if movement.link < len(state) else ""

    def way_ahead(self, frame: int) -> WayAhead:
        """Return what is ahead of the ego at a frame."""
        line, at = self.bundle.scene.ego.line, (math.nan, math.nan)
        if line is not None:
            at = line.project(*self.xy(0, 0))
            for k in range(1, frame + 1):  # a route may pass a place twice
                at = line.project(*self.xy(0, k), at[0])
        return WayAhead(self.bundle.scene, self.trace.states[frame], *at, partial(self.colour, frame=frame))

    def _movement(self, actor: int, lane: str) -> Movement | None:
        """Return the movement of an internal lane; if several movements share the lane, the movement on the actor's
        route.
        """
        movements = self.network.movements_through(lane) if lane else ()
        route = self.info(actor).route
        on_route = (m for m in movements if m.from_edge in route and m.to_edge in route)
        return next(on_route, movements[0] if movements else None)


def spans(mask: NDArray[np.bool_], least_s: float, bridged_s: float = 0.0) -> list[tuple[int, int]]:
    """Return the first and the last frame of each stretch in which a condition holds.

    Args:
        mask: [T], whether it holds at each frame. least_s: shorter stretches are left out, s.
        bridged_s: two stretches that are at most this far apart are joined, s.
    """
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(np.int8)))
    stretches: list[tuple[int, int]] = []
    for start, end in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        if stretches and (start - stretches[-1][1] - 1) * STEP_S <= bridged_s + 1e-9:
            stretches[-1] = stretches[-1][0], end
        else:
            stretches.append((start, end))
    return [(start, end) for start, end in stretches if (end - start) * STEP_S >= least_s - 1e-9]
