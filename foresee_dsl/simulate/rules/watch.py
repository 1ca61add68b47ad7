"""Follows one actor along its route and records each traffic rule that it breaks.

A rule counts only where the actor could keep it. A red light or a crossing for which it could no longer stop, when the
run began or when the light changed, does not count. So clips and mutants, which begin in the middle of a drive, are
judged by what happens in them.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import replace

from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.kernels.boxes import Box, corner_points
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.results.infraction import Infraction, Rule
from foresee_dsl.simulate.results.outcome import RunEnd
from foresee_dsl.simulate.rules.giving_way import Contender, YieldArea, blocks_others, contenders, yield_areas
from foresee_dsl.simulate.rules.stopping import ALL_WAY_STOP, STOPPED_MPS, LineAhead, can_stop
from foresee_dsl.simulate.trace import STEP_S

LOOKS_AHEAD_M = 150.0
"""Distance before a junction from which its signal is followed, m. Ours: at 100 km/h an actor needs 134 m to stop."""
FASTER_MPS = 3.0 / 3.6
"""Excess over the speed limit that is not reported, m/s. Ours: 3 km/h, the least allowance of German speed enforcement
(PTB requirements 18.11: 3 km/h up to 100 km/h)."""
FASTER_FOR_S = 1.0
"""An actor must be too fast for at least this long before that is reported, s. Ours: a controller may overshoot for a
moment."""
SLOWS_MPS2 = 1.0
"""An actor that is too fast when the run begins must slow down at least at this rate, m/s^2. Ours: a car that rolls
without accelerator."""
AGAINST_RAD = math.radians(120)
"""An actor whose lane leads in a direction that differs by more than this from its own is on the wrong side, rad:
`MAX_ALLOWED_ANGLE` of `WrongLaneTest` in CARLA's leaderboard."""
PASSES_M = 15.0
"""An actor that stands this near ahead or beside, in the lanes of the right direction, may be passed on the wrong side,
m (VCRT article 11). Ours: the length of a lorry and a gap."""
BLOCKS_AFTER_S = 5.0
"""An actor must stand in the way of others in a junction for at least this long before that is reported, s. Ours:
longer than any pause for a pedestrian on the junction's far side, a third of a green phase."""
_LONG_SPANS = {Rule.SPEED: FASTER_FOR_S, Rule.SIDE: 0.0, Rule.BLOCKED: BLOCKS_AFTER_S}


class RuleWatch:
    """The rules that one actor breaks; call `look` once at each frame.

    Attributes:
        infractions: those so far, in the order in which they were established.
        now: those that were established at this frame.
    """

    def __init__(self, simulation: Simulation, actor: SimulatedActor) -> None:
        self._simulation, self._actor = simulation, actor
        self.infractions: list[Infraction] = []
        self.now: list[Infraction] = []
        self._line: RouteLine | None = actor.placed.line
        self._frame = -1
        self._half = actor.length / 2
        self._stops: list[LineAhead] = []
        self._areas: list[YieldArea] = []
        self._inside: list[YieldArea] = []
        self._fronts: list[tuple[float, float]] = []
        self._open: dict[Rule, Infraction] = {}
        self._over_mps = 0.0
        # Up to this time a clip's ego follows recorded states, whatever its driver answers, so no rule is judged.
        self._from_s = actor.placed.recorded[-1].time_s if actor.placed.recorded else 0.0
        if self._line is not None:
            self._prepare(self._line)

    def _prepare(self, line: RouteLine) -> None:
        network = self._simulation.network
        side = line.rights if network.left_hand else line.lefts
        self._slowest_limit, self._least_side = min(line.limits), min(side)
        self._side, self._sign = side, -1.0 if network.left_hand else 1.0
        joints = network.joints
        passages = [p for p in line.passages if p.junction not in joints]
        self._passages = passages
        self._stops = [LineAhead(p, network.junctions[p.junction].type == ALL_WAY_STOP) for p in passages]

    def look(self) -> None:
        """Judge the current frame; a second call in the same frame does nothing."""
        simulation, actor, line = self._simulation, self._actor, self._line
        if line is None or self._frame == simulation.frame or simulation.time_s < self._from_s - STEP_S / 2:
            return
        first, self._frame = self._frame < 0, simulation.frame
        if self.now:
            self.now = []
        if not actor.present:
            return
        s, left_m = self._place(line)
        speed, front = actor.speed, s + self._half
        if first:
            self._begin(line, front, s, speed)
        self._fronts.append((front, speed))
        if self._stops and front >= self._stops[0].entry_s - LOOKS_AHEAD_M:
            self._approach(front, speed)
        while self._areas and front >= self._areas[0].begin_s:
            self._enter(self._areas.pop(0))
        if self._inside:
            self._leave(s - self._half, speed)
        self._follow(line, s, left_m, speed)

    def near_areas(self, within_m: float) -> Iterator[YieldArea]:
        """Yield the areas ahead of the actor, at most `within_m` away, at which it has to give way."""
        front = self._fronts[-1][0] if self._fronts else -math.inf
        for area in self._areas:
            if area.begin_s - front > within_m:
                break
            yield area

    def comes(self, area: YieldArea, other: str) -> bool:
        """Return whether another actor has priority at an area now, and has not passed it."""
        return any(contender.actor == other for contender in contenders(self._simulation, self._actor, area))

    def may_break(self, within_s: float, *, ahead_m: float, top_mps: float, place: Box) -> bool:
        """Return whether the actor could break a rule within a while if it touches no other actor.

        Args:
            within_s: the time, s. ahead_m: the farthest that it can get along its line, m. top_mps: the highest speed
                that it can reach. place: contains the middle of the actor at any time within the while.
        """
        line = self._line
        if line is None or not self._fronts:
            return False
        front = self._fronts[-1][0] + ahead_m
        if self._open or (self._stops and self._stops[0].entry_s <= front):
            return True
        areas = (*self._inside, *(area for area in self._areas if area.begin_s <= front))
        if any(area.end_s <= front - 2 * self._half for area in areas):
            return True
        if top_mps > self._slowest_limit + FASTER_MPS and within_s >= FASTER_FOR_S:
            return True
        return within_s >= BLOCKS_AFTER_S or self._may_cross_middle(line, place)

    def _may_cross_middle(self, line: RouteLine, place: Box) -> bool:
        """Return whether a box contains a point beyond the lanes of the right direction."""
        corners = corner_points(place)
        for (x, y), (to_x, to_y) in zip(corners, (*corners[1:], corners[0]), strict=True):
            parts = max(math.ceil(math.hypot(to_x - x, to_y - y)), 1)
            for k in range(parts):
                at = x + (to_x - x) * k / parts, y + (to_y - y) * k / parts
                # No point of the outline is more than 0.5 m from one of these.
                if line.project(*at, self._fronts[-1][0])[1] * self._sign > self._least_side - 0.5:
                    return True
        return False

    def end(self, run_end: RunEnd) -> tuple[Infraction, ...]:
        """Return all infractions of the run in the order of time, after the run has ended so.

        A contact with an actor that has priority is an infraction at this frame. A second call changes nothing.
        """
        self.look()
        for area in self._inside:
            if any(contender.actor == run_end.with_ for contender in area.contenders):
                self._take(area, run_end.with_)
        self._inside = []
        for rule in tuple(self._open):
            self._close(rule)
        return tuple(sorted(self.infractions, key=lambda infraction: infraction.time_s))

    def _place(self, line: RouteLine) -> tuple[float, float]:
        """Return the length along the actor's line, and the distance to the left of the line, m."""
        simulation, actor = self._simulation, self._actor
        if actor is simulation.ego:
            return simulation.progress.of(actor, simulation.frame)
        # `Progress` is not used here: it stores each projection, and its later projections begin at the stored place.
        near = self._fronts[-1][0] - self._half if self._fronts else None
        return line.project(actor.x, actor.y, near)

    def _begin(self, line: RouteLine, front: float, s: float, speed: float) -> None:
        """At the run's first frame, skip what the actor has already passed, and record for which lines it can still
        stop.
        """
        self._stops = [stop for stop in self._stops if stop.entry_s > front]
        for stop in self._stops[:1]:
            stop.could_stop = can_stop(stop.entry_s - front, speed)
        areas = (area for p in self._passages if p.exit_s > s for area in yield_areas(self._simulation, p))
        self._areas = sorted((w for w in areas if can_stop(w.begin_s - front, speed)), key=lambda area: area.begin_s)
        self._over_mps = max(speed - self._limit(line, s), 0.0)

    # --- lines and ways ---------------------------------------------------------------------------------------------

    def _approach(self, front: float, speed: float) -> None:
        stop = self._stops[0]
        passage, room = stop.passage, stop.entry_s - front
        tls, link = passage.movement.tls, passage.movement.link
        red = False
        if tls is not None and link >= 0:
            red = stop.see(self._simulation.world.signals.colour(tls, link), room, speed)
        if stop.must_stop:
            stop.slow(room, speed)
        if room > 0:
            return
        self._stops.pop(0)
        if not stop.could_stop:
            return
        if red:
            self._note(Rule.RED, passage.junction)
        if stop.must_stop and stop.slowest_mps > STOPPED_MPS:
            self._note(Rule.STOP, passage.junction, value=stop.slowest_mps)

    def _enter(self, area: YieldArea) -> None:
        area.entered_s = self._simulation.time_s
        coming = contenders(self._simulation, self._actor, area)
        area.contenders = [contender for contender in coming if self._could_yield(area, contender)]
        if area.contenders:
            self._inside.append(area)

    def _could_yield(self, area: YieldArea, contender: Contender) -> bool:
        """Return whether the actor could still stop when a pedestrian came to the crossing to use it."""
        if math.isinf(contender.since_s):
            return True
        front, speed = self._fronts[max(len(self._fronts) - 1 - round(contender.since_s / STEP_S), 0)]
        return can_stop(area.begin_s - front, speed)

    def _leave(self, rear: float, speed: float) -> None:
        left = [area for area in self._inside if rear >= area.end_s]
        for area in left:
            self._inside.remove(area)
            for other in area.taken_from(self._simulation.time_s, speed):
                self._take(area, other)

    def _take(self, area: YieldArea, other: str) -> None:
        self._note(area.rule, area.junction, other=other, time_s=area.entered_s)

    def _note(
        self, rule: Rule, place: str, *, other: str = "", value: float | None = None, time_s: float | None = None
    ) -> None:
        at_s = self._simulation.time_s if time_s is None else time_s
        infraction = Infraction(rule, self._actor.id, at_s, place, at_s, other, value)
        self.infractions.append(infraction)
        self.now.append(infraction)

    # --- what lasts -------------------------------------------------------------------------------------------------

    def _follow(self, line: RouteLine, s: float, left_m: float, speed: float) -> None:
        """Judge the rules that are broken for a time, such as a speed limit.

        Nearly always a comparison of two numbers shows that no such rule is broken.
        """
        rules = self._open
        if speed > self._slowest_limit + FASTER_MPS or Rule.SPEED in rules or self._over_mps > 0.0:
            self._speed(line, s, speed)
        if left_m * self._sign > self._least_side or Rule.SIDE in rules:
            self._span(Rule.SIDE, self._on_wrong_side(line, s, left_m), line, s)
        if speed < STOPPED_MPS or Rule.BLOCKED in rules:
            blocked = self._blocked(s) if speed < STOPPED_MPS else ""
            self._span(Rule.BLOCKED, bool(blocked), line, s, place=blocked)

    def _limit(self, line: RouteLine, s: float) -> float:
        """Return the speed limit at a length along a line, m/s."""
        return line.limits[max(bisect_right(line.marks, s) - 1, 0)]

    def _speed(self, line: RouteLine, s: float, speed: float) -> None:
        excess = speed - self._limit(line, s)
        self._over_mps = max(min(self._over_mps - SLOWS_MPS2 * STEP_S, excess), 0.0)
        faster = excess > FASTER_MPS + self._over_mps
        self._span(Rule.SPEED, faster, line, s, value=excess)

    def _on_wrong_side(self, line: RouteLine, s: float, left_m: float) -> bool:
        """Return whether the actor's middle is in a lane of the opposite direction, while there is nothing that it
        could be passing.
        """
        side = self._side[max(bisect_right(line.marks, s) - 1, 0)]
        if left_m * self._sign <= side or any(p.entry_s <= s <= p.exit_s for p in line.passages):
            return False
        actor, heading = self._actor, line.at(s)[2]
        near = self._simulation.network.nearest_lane(actor.x, actor.y)
        if near is None or near.lane.internal or abs(near.lateral_m) > near.lane.width_m / 2:
            return False
        if abs(wrap(near.lane.line.at(near.pos_m)[2] - heading)) < AGAINST_RAD:
            return False
        return not self._passes(line, s)

    def _passes(self, line: RouteLine, s: float) -> bool:
        """Return whether an actor stands in the lanes of the right direction, beside this actor or close before it."""
        for other in self._simulation.others(self._actor):
            if other.speed < STOPPED_MPS:
                at, left_m = line.project(other.x, other.y)
                near = PASSES_M + (self._actor.length + other.length) / 2
                if abs(at - s) <= near and left_m * self._sign < self._least_side + other.width:
                    return True
        return False

    def _blocked(self, s: float) -> str:
        """Return the junction in which the actor stands in the way of others; "" for none."""
        rear = s - self._half
        for passage in self._passages:
            inside = passage.entry_s < s + self._half and rear < passage.exit_s
            if inside and blocks_others(self._simulation, self._actor, passage, rear):
                return passage.junction
        return ""

    def _span(
        self, rule: Rule, holds: bool, line: RouteLine, s: float, *, place: str = "", value: float | None = None
    ) -> None:
        """Record that a rule is broken at this frame (`holds`), or that it is no longer broken."""
        begun, time_s = self._open.get(rule), self._simulation.time_s
        if not holds:
            if begun is not None:
                self._close(rule)
            return
        if begun is None:
            place = place or self._simulation.network.lanes[line.lane_at(s)].edge
            begun = Infraction(rule, self._actor.id, time_s, place, time_s, value=value)
        largest = None if value is None else max(value, begun.value or 0.0)
        self._open[rule] = replace(begun, until_s=time_s, value=largest)

    def _close(self, rule: Rule) -> None:
        begun = self._open.pop(rule)
        if begun.until_s - begun.time_s >= _LONG_SPANS[rule] - STEP_S / 2:
            self.infractions.append(begun)
