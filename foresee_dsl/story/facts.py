"""What a story is derived from: the run, its compiled scene, the contact, and what the mutation changed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, wrap
from foresee_dsl.compile.roads.topology import Movement
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import Box, gaps
from foresee_dsl.language.model import Change
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.outcome import STUCK_SPEED_MPS, contact_of
from foresee_dsl.simulate.results.verdict import Impact, Verdict
from foresee_dsl.simulate.signals import COLOURS
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, ActorInfo, Trace, X, Y

NEAR_M = 10.0
"""An actor that a passed run came no nearer to is no opponent. Ours: two cars' lengths."""
MOVED_M = 0.05
"""Who moves less between two frames that are compared has no direction (ours: 0.1 m/s over half a second)."""


@dataclass(frozen=True, eq=False)
class Facts:
    """One run, and all that is known of it.

    Attributes:
        trace: the run. case: what was run. bundle: it, compiled. named: the opponent's column where it is given.
    """

    trace: Trace
    case: TestCase
    bundle: SumoBundle
    named: int | None = None

    @classmethod
    def of(cls, trace: Trace, case: TestCase) -> Facts:
        """Compile the test case and look at its run."""
        return cls(trace, case, compile_test_case(case))

    @property
    def network(self) -> RoadNetwork:
        """The roads."""
        return self.bundle.network

    @property
    def last(self) -> int:
        """The last frame."""
        return self.trace.frames - 1

    @property
    def verdict(self) -> Verdict | None:
        """How it ended, where the trace says so."""
        value = str(self.trace.meta.get("verdict", ""))
        return next((verdict for verdict in Verdict if verdict.value == value), None)

    @property
    def end_s(self) -> float:
        """When it ended."""
        return round(self.trace.duration_s, 6)

    @cached_property
    def impact(self) -> Impact | None:
        """The contact that the run ended with, as its judge saw it; None where it ended otherwise."""
        return contact_of(self.trace)

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """What the mutation changed; nothing where it is no mutant."""
        return self.case.mutant.changes if self.case.mutant else ()

    @cached_property
    def opponent(self) -> int | None:
        """The column of the actor that the story is about: who was touched, else who was changed or is the risk.

        Of a run that passed it is otherwise the actor that came nearest; of one that failed by itself, nobody.
        """
        if self.named is not None:
            return self.named
        ids = {info.id: k for k, info in enumerate(self.trace.actors)}
        if self.impact is not None:
            return ids[self.impact.with_]
        if self.verdict in (Verdict.STUCK, Verdict.F1):
            return None
        risk = self.case.clip.risk if self.case.clip else None
        named = [change.actor for change in self.changes] + ([risk.actor] if risk and risk.actor else [])
        found: int | None = next((ids[name] for name in named if ids.get(name)), None)
        if found is None and self.verdict is Verdict.PASS:
            return self._nearest()
        return found

    def at_nearest(self) -> Facts:
        """Return the run up to the moment at which the opponent was nearest to the ego."""
        if self.opponent is None:
            return self
        gaps_m = self._apart()[:, self.opponent - 1]
        if np.isnan(gaps_m).all():
            return self
        end = int(np.nanargmin(gaps_m)) + 1
        return Facts(self.trace.part(0, end), self.case, self.bundle, self.opponent)

    def _nearest(self) -> int | None:
        """The column of the moving actor that came nearest to the ego, None where none came near."""
        moving = self.trace.states[:, 1:, SPEED] >= STUCK_SPEED_MPS
        apart = np.where(moving, self._apart(), np.nan)
        if not apart.size or np.isnan(apart).all() or np.nanmin(apart) > NEAR_M:
            return None
        return int(np.nanargmin(apart)) % len(self.trace.actors[1:]) + 1

    def _apart(self) -> FloatArray:
        """[T, A - 1] m between the middles of the ego and the others, less half of their lengths."""
        xy = self.trace.states[:, :, [X, Y]]
        between = np.hypot(*np.moveaxis(xy[:, 1:] - xy[:, :1], 2, 0))
        halves = np.array([info.front_m for info in self.trace.actors])
        return np.asarray(between - halves[0] - halves[1:], dtype=np.float64)

    def info(self, actor: int) -> ActorInfo:
        """What stays the same about an actor."""
        return self.trace.actors[actor]

    def placed(self, actor: int) -> PlacedActor | None:
        """Return an actor as the scene has it; one of the background traffic that appears later is in none."""
        name = self.info(actor).id
        return next((placed for placed in self.bundle.scene.actors if placed.id == name), None)

    def speed(self, actor: int) -> FloatArray:
        """[T] m/s."""
        return self.trace.states[:, actor, SPEED]

    def xy(self, actor: int, frame: int) -> XY:
        """The middle of a footprint."""
        x, y = self.trace.states[frame, actor, [X, Y]].tolist()
        return x, y

    def heading(self, actor: int, frame: int) -> float:
        """Where an actor points, rad."""
        return float(self.trace.states[frame, actor, HEADING])

    def course(self, actor: int, frame: int, over_s: float = 1.0) -> float:
        """Return the direction (rad) in which an actor has moved for a second; where it points if it has not."""
        before = max(0, frame - round(over_s / STEP_S))
        (x0, y0), (x1, y1) = self.xy(actor, before), self.xy(actor, frame)
        if math.isnan(x0) or math.hypot(x1 - x0, y1 - y0) < MOVED_M:
            return self.heading(actor, frame)
        return math.atan2(y1 - y0, x1 - x0)

    def seen_from_ego(self, actor: int, frame: int) -> tuple[float, float]:
        """Return how far an actor's middle is ahead of the ego's and to its left, m."""
        (x, y), (ox, oy), heading = self.xy(0, frame), self.xy(actor, frame), self.heading(0, frame)
        cos, sin = math.cos(heading), math.sin(heading)
        return (ox - x) * cos + (oy - y) * sin, (oy - y) * cos - (ox - x) * sin

    def gap_m(self, actor: int, frame: int) -> float:
        """Return how far an actor's footprint is from the ego's, m; NaN where it is absent."""
        rows = (self._box(0, frame), self._box(actor, frame))
        return float(gaps(*(np.array([row]) for row in rows))[0])

    def turned(self, actor: int, frame: int) -> float:
        """Return an actor's course less the ego's heading, -pi to pi (left positive)."""
        return wrap(self.course(actor, frame) - self.heading(0, frame))

    def lane(self, actor: int, frame: int) -> str:
        """Return the lane that an actor is on, "" for none."""
        index = int(self.trace.lanes[frame, actor])
        return self.trace.lane_ids[index] if index >= 0 else ""

    def nearest_lane(self, actor: int, frame: int) -> str:
        """Return the lane that an actor is on, or the nearest one that leads its way, "" for none."""
        found = self.network.nearest_lane(*self.xy(actor, frame), self.heading(actor, frame))
        return self.lane(actor, frame) or (found.lane.id if found is not None else "")

    def passages(self, actor: int) -> Iterator[tuple[int, int, Movement]]:
        """Yield the junctions that an actor drives through: first and last frame on its lanes, and the movement.

        A place at which an edge is only cut does not count.
        """
        lanes = self.trace.lanes[:, actor]
        starts = [0, *(np.flatnonzero(np.diff(lanes)) + 1).tolist()]
        ends = [*(start - 1 for start in starts[1:]), self.last]
        begun: tuple[int, int, Movement] | None = None
        for start, end in zip(starts, ends, strict=True):
            movement = self._movement(actor, self.lane(actor, start))
            movement = None if movement is not None and movement.junction in self.network.joints else movement
            if begun is not None and (movement is None or movement.junction != begun[2].junction):
                yield begun
                begun = None
            if movement is not None:
                begun = (begun[0] if begun else start, end, begun[2] if begun else movement)
        if begun is not None:
            yield begun

    def colour(self, movement: Movement, frame: int) -> str:
        """Return what a movement's signal shows at a frame, "" where it has none."""
        signal = next((s for s in self.bundle.signals.values() if s.tls == movement.tls), None)
        if signal is None or movement.link < 0 or signal.junction not in self.trace.signals:
            return ""
        k = self.trace.signals.index(signal.junction)
        stage = self.trace.signal_stages[k][int(self.trace.stages[frame, k])]
        phase = signal.phases[signal.phase_at(stage, float(self.trace.elapsed[frame, k]))[0]]
        return COLOURS.get(phase.state[movement.link], "") if movement.link < len(phase.state) else ""

    def _movement(self, actor: int, lane: str) -> Movement | None:
        """The movement of an internal lane; of several that share it, the one of the actor's route."""
        found = self.network.movements_through(lane) if lane else ()
        route = self.info(actor).route
        on_route = (m for m in found if m.from_edge in route and m.to_edge in route)
        return next(on_route, found[0] if found else None)

    def _box(self, actor: int, frame: int) -> Box:
        info = self.info(actor)
        return Box(*self.xy(actor, frame), self.heading(actor, frame), info.length_m, info.width_m)


def spans(mask: NDArray[np.bool_], least_s: float, bridged_s: float = 0.0) -> list[tuple[int, int]]:
    """Return the first and last frame of each stretch in which something holds.

    Args:
        mask: [T]. least_s: shorter ones are left out. bridged_s: shorter breaks in between do not count.
    """
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(np.int8)))
    found: list[tuple[int, int]] = []
    for start, end in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        if found and (start - found[-1][1] - 1) * STEP_S <= bridged_s + 1e-9:
            found[-1] = found[-1][0], end
        else:
            found.append((start, end))
    return [(start, end) for start, end in found if (end - start) * STEP_S >= least_s - 1e-9]
