"""Decides when a run ends, and which kind of failure a collision is.

The kinds are the paper's (section 4.4): F1 elements beyond the road (pavements, poles), F2 pedestrians, F3 frontal,
F4 lateral and F5 rear collisions with other vehicles. The paper does not define the borders between the last three;
ours is the contact normal. Both vehicles are moved back to their first touch; there the line at right angles to the
touching sides is the *contact normal*. A body is hit in front, at a side or in the rear if the normal leaves it within
45 degrees of that direction. Then

- F3 frontal: the headings are opposite within 45 degrees, and both bodies are hit in front;
- F5 rear: the headings are equal within 45 degrees, one body is hit in front and the other in the rear (the ego may be
  either of them);
- F4 lateral: everything else (side swipes, T-bones, corners).

Bicycles and motorcycles are vehicles. The classification ignores which party is to blame, as in the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, floor, hypot, inf, pi, sin

import numpy as np
import shapely

from foresee_dsl.compile.bundle import ActorKind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.topology import per_network
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import WHOLE, Mover, all_whole, corner_points, hits
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState
from foresee_dsl.simulate.actors.target_selection import half_extent
from foresee_dsl.simulate.results.verdict import Impact, Side, Striker, Verdict
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

STUCK_AFTER_S = 20.0
"""Time after which a vehicle that stands without a reason to wait is stuck, s. Ours: longer than any pause for giving
way in the bundled scenarios. Time at a red signal or behind traffic does not count."""

WHEEL_INSET_M = 0.3
"""Distance of a tyre's inner edge from the vehicle's side, m; the ego is off the road when this edge of a tyre is off
the road. Ours: a tyre is 0.2 m wide and up to 0.1 m inside the body, so brushing a kerb is not a failure; a whole wheel
on the pavement is."""

FACING_RAD = pi / 4
"""Half the angle of the sector that counts as front, side or rear, rad. Ours: four equal sectors."""

CONTACT_WITHIN_S = 0.1
"""Time before the overlap within which the first touch is searched, s. Ours: two steps; if the bodies need longer to
separate, they met by turning and not by their speed, and the least penetration determines the touching sides."""

FLUSH_M = 0.05
"""If the distances of a side's two ends from the other body differ by less than this, m, the whole side counts as
touching; otherwise only one corner. Ours: smaller than the deviation of a car's outline from a rectangle."""


def classify(contact: Impact, kind: ActorKind) -> Verdict:
    """Return the kind of failure of a collision, one of F1 to F5; `kind`: class of the other party."""
    if kind == "obstacle":
        return Verdict.F1
    if kind == "pedestrian":
        return Verdict.F2
    sides, turned = (contact.side, contact.other_side), abs(contact.turned_rad)
    if turned >= pi - FACING_RAD and sides == ("front", "front"):
        return Verdict.F3
    if turned <= FACING_RAD and set(sides) == {"front", "rear"}:
        return Verdict.F5
    return Verdict.F4


def contact_of(trace: Trace) -> Impact | None:
    """Return the contact that ended a run, as its judge computed it; None if the run ended otherwise."""
    hit = next((event for event in reversed(trace.events) if event.what == "collision"), None)
    name = str(hit.detail.get("with", "")) if hit is not None else ""
    columns = [k for k, info in enumerate(trace.actors) if info.id == name and k]
    return impact(_mover(trace, 0), _mover(trace, columns[0]), name) if columns else None


def _mover(trace: Trace, actor: int) -> Mover:
    x, y, heading, speed = (float(trace.states[-1, actor, k]) for k in (X, Y, HEADING, SPEED))
    return Mover(x, y, heading, speed, trace.actors[actor].length_m, trace.actors[actor].width_m)


def touched_at(trace: Trace, contact: Impact) -> tuple[float, float]:
    """Return x and y (m) of the point of contact on the ego's outline at its last frame."""
    x, y, heading = (float(trace.states[-1, 0, k]) for k in (X, Y, HEADING))
    ahead, left = contact.ahead_m, contact.left_m
    return x + ahead * cos(heading) - left * sin(heading), y + ahead * sin(heading) + left * cos(heading)


def impact(ego: Mover, other: Mover, name: str) -> Impact:
    """Return how two bodies touched.

    The speeds are those at the overlap. Sides and place are those of the first touch, to which both bodies are moved
    back along their velocities.

    Args:
        ego: the ego, where it overlaps the other.
        other: the other body, at the same moment.
        name: the other's id.
    """
    since_s, normal = _first_touch(ego, other)
    (ax, ay), (bx, by) = ego.velocity, other.velocity
    nx, ny = cos(normal), sin(normal)
    ahead, left = _touched_at(_moved_back(ego, since_s), _moved_back(other, since_s), normal)
    return Impact(
        with_=name,
        side=_side(normal - ego.heading),
        other_side=_side(normal + pi - other.heading),
        ahead_m=ahead,
        left_m=left,
        turned_rad=wrap(other.heading - ego.heading),
        struck_by=_who_struck(ego, other, normal),
        relative_mps=hypot(ax - bx, ay - by),
        closing_mps=(ax - bx) * nx + (ay - by) * ny,
        ego_mps=ego.speed,
        other_mps=other.speed,
    )


def _who_struck(ego: Mover, other: Mover, normal: float) -> Striker:
    """Return which of two overlapping bodies moved towards the other along the contact normal.

    A body struck the other if it moved towards it faster than `STANDS_MPS`. In a head-on collision, or when two
    bodies drift together, both did; when a body turns into another while passing it, neither did.
    """
    ahead, against = (body.speed * cos(body.heading - normal) for body in (ego, other))
    strikes, struck = ahead > STANDS_MPS, -against > STANDS_MPS
    if strikes == struck:
        return "both" if strikes else "neither"
    return "ego" if strikes else "other"


def _first_touch(a: Mover, b: Mover) -> tuple[float, float]:
    """Return the time (s) since two overlapping bodies first touched, and the contact normal (rad, from `a` to `b`).

    Two boxes begin to overlap when the last of the four directions at right angles to their sides stops separating
    them. Moving back along the relative velocity, that is the direction that separates them first. If the speeds do not
    separate them in time, the time is 0 and the direction is that of the least penetration.
    """
    dx, dy = b.x - a.x, b.y - a.y
    (ax, ay), (bx, by) = a.velocity, b.velocity
    vx, vy = bx - ax, by - ay
    soonest, normal = CONTACT_WITHIN_S, None
    least, shallowest = inf, 0.0
    for angle in (a.heading, a.heading + pi / 2, b.heading, b.heading + pi / 2):
        nx, ny = cos(angle), sin(angle)
        reach = half_extent(a, angle) + half_extent(b, angle)
        apart, speed = dx * nx + dy * ny, -(vx * nx + vy * ny)
        depth = reach - abs(apart)
        if depth < least:
            least, shallowest = depth, angle if apart >= 0 else angle + pi
        if speed != 0.0:
            sign = 1.0 if speed > 0 else -1.0
            since = (reach - sign * apart) / abs(speed)
            if since < soonest:
                soonest, normal = since, angle if speed > 0 else angle + pi
    return (0.0, shallowest) if normal is None else (soonest, normal)


def _moved_back(body: Mover, time_s: float) -> Mover:
    east, north = body.velocity
    return body._replace(x=body.x - east * time_s, y=body.y - north * time_s)


def _touched_at(ego: Mover, other: Mover, normal: float) -> tuple[float, float]:
    """Return the point of contact of two bodies: distances ahead of the ego's centre and to its left, m.

    It is the middle of the part that the ego's outermost side (or corner) and the other's have in common.
    """
    nx, ny = cos(normal), sin(normal)
    (low, high), (theirs_low, theirs_high) = (
        _outermost(body, sign * nx, sign * ny, (-ny, nx)) for body, sign in ((ego, 1.0), (other, -1.0))
    )
    # The middle of the part that both sides have in common. If the speeds do not separate the bodies, that part may be
    # empty: then the nearer end.
    across = min(max((max(low, theirs_low) + min(high, theirs_high)) / 2, low), high)
    out = half_extent(ego, normal) + ego.x * nx + ego.y * ny
    dx, dy = out * nx - across * ny - ego.x, out * ny + across * nx - ego.y
    c, s = cos(ego.heading), sin(ego.heading)
    return dx * c + dy * s, dy * c - dx * s


def _outermost(body: Mover, nx: float, ny: float, tangent: tuple[float, float]) -> tuple[float, float]:
    """Return the ends, along the tangent, of the outermost side of a body in a direction, m."""
    points = corner_points(body.box)
    farthest = max(x * nx + y * ny for x, y in points)
    along = [x * tangent[0] + y * tangent[1] for x, y in points if x * nx + y * ny > farthest - FLUSH_M]
    return min(along), max(along)


def off_road_points(bicycle: Bicycle, state: BicycleState) -> FloatArray:
    """Return the four points ([4, 2] m) that must all lie on the drivable area: the inner edges of the tyres.

    The body may hang over the kerb, as it does in tight turns; a wheel may not stand beyond it.
    """
    return bicycle.wheels(state, WHEEL_INSET_M)


@dataclass(frozen=True, slots=True)
class RunEnd:
    """How a run ends.

    Attributes:
        verdict: the outcome. time_s: its time. with_: id of the other party, or "". reason: a sentence for people.
        impact: the contact, None without one.
    """

    verdict: Verdict
    time_s: float
    with_: str
    reason: str
    impact: Impact | None = None


class OutcomeJudge:
    """Watches a run and decides when and how it ends.

    Args:
        ids: [K] ids of the other actors. kinds: [K] their classes. sizes: [K, 2] their lengths and widths (m). All
            three are in the order of `look`'s poses.
        ego_size: length and width of the ego (m).
        end_s: time at which the run ends.
        must_arrive: whether the run is a timeout if the ego has not arrived at `end_s`; otherwise it is a pass.

    Raises:
        ValueError: ids, kinds and sizes differ in length.
    """

    def __init__(
        self,
        *,
        ids: Sequence[str],
        kinds: Sequence[ActorKind],
        sizes: FloatArray,
        ego_size: tuple[float, float],
        end_s: float,
        must_arrive: bool = False,
    ) -> None:
        if not len(ids) == len(kinds) == len(sizes):
            raise ValueError(f"{len(ids)} ids, {len(kinds)} kinds and {len(sizes)} sizes")
        self._ids, self._kinds = tuple(ids), tuple(kinds)
        self._sizes = np.asarray(sizes, dtype=np.float64).reshape(-1, 2)
        self._ego_size, self._end_s, self._must_arrive = ego_size, end_s, must_arrive
        self._standing_since: float | None = None

    def look(
        self,
        time_s: float,
        ego: BicycleState,
        poses: FloatArray,
        speeds: FloatArray,
        *,
        off_road: bool,
        arrived: bool,
        may_wait: bool,
    ) -> RunEnd | None:
        """Judge one frame; return None while the run goes on.

        Args:
            time_s: 0 at the first frame.
            ego: state of the ego.
            poses: [K, 3] x, y, heading of the others' footprints, NaN where absent. speeds: [K] m/s.
            off_road: whether one of `off_road_points` is not on the drivable area.
            arrived: whether the ego has reached its goal.
            may_wait: whether the ego has a reason to wait (a red signal, an actor close ahead).
        """
        overlaps = hits(np.array((*ego.pose, *self._ego_size)), poses, self._sizes)
        if overlaps.size:
            k = int(overlaps[0])
            x, y, heading = poses[k].tolist()
            other = Mover(x, y, heading, float(speeds[k]), *self._sizes[k].tolist())
            me = Mover(ego.x, ego.y, ego.heading, ego.speed, *self._ego_size)
            return self._collision(time_s, me, other, k)
        if off_road:
            if time_s <= 0:
                return RunEnd(Verdict.INVALID, time_s, "", "invalid: the ego begins off the drivable area")
            return RunEnd(Verdict.F1, time_s, "", f"F1 left the drivable area at {time_s:.2f} s")
        if arrived:
            return RunEnd(Verdict.PASS, time_s, "", f"arrived at {time_s:.2f} s")
        return self._stuck(time_s, ego.speed, may_wait) or self._time_is_up(time_s)

    def may_be_stuck(self, until_s: float) -> bool:
        """Return whether the ego, which stands now, has stood for `STUCK_AFTER_S` at a later time if it goes on so."""
        return self._standing_since is not None and until_s - self._standing_since >= STUCK_AFTER_S - 1e-9

    def moves(self) -> None:
        """Note that the ego moves at this frame, and that a cheap test has shown that the run goes on."""
        self._standing_since = None

    def _collision(self, time_s: float, ego: Mover, other: Mover, k: int) -> RunEnd:
        name, kind = self._ids[k], self._kinds[k]
        whom = f"{name} ({kind})"
        how = impact(ego, other, name)
        if time_s <= 0:
            return RunEnd(Verdict.INVALID, time_s, name, f"invalid: the ego touches {whom} at the first frame", how)
        verdict = classify(how, kind)
        what = verdict.contact.format(whom)
        # `campaign.regression.verify` ignores the text after the time when it compares two runs.
        return RunEnd(verdict, time_s, name, f"{verdict} {what} at {time_s:.2f} s, {how.relative_mps:.1f} m/s", how)

    def _stuck(self, time_s: float, speed: float, may_wait: bool) -> RunEnd | None:
        if speed >= STANDS_MPS or may_wait:
            self._standing_since = None
            return None
        if self._standing_since is None:
            self._standing_since = time_s
        standing = time_s - self._standing_since
        if standing < STUCK_AFTER_S - 1e-9:
            return None
        reason = f"stuck: stood for {standing:.0f} s with nothing to wait for, until {time_s:.2f} s"
        return RunEnd(Verdict.STUCK, time_s, "", reason)

    def _time_is_up(self, time_s: float) -> RunEnd | None:
        if time_s < self._end_s - 1e-9:
            return None
        if self._must_arrive:
            return RunEnd(Verdict.TIMEOUT, time_s, "", f"timeout: did not arrive within {time_s:.2f} s")
        return RunEnd(Verdict.PASS, time_s, "", f"drove to the end at {time_s:.2f} s")


def _side(angle: float) -> Side:
    """Return the side of a body whose outward direction is nearest to `angle`, which is relative to the heading."""
    angle = wrap(angle)
    # An angle on the border between two sectors counts as front or rear.
    if abs(angle) <= FACING_RAD:
        return "front"
    if abs(angle) >= pi - FACING_RAD:
        return "rear"
    return "left" if angle > 0 else "right"


# ---- the drivable area ---------------------------------------------------------------------------------------------


_CELL_M = 0.5
"""Side of a square, m. Ours: in a lane of 3.3 m a car's wheel is 0.6 m from the edge, so squares of this size fit
between wheel and edge; a wheel passes about 200 of them in a run."""
_MOST_CELLS = 4_000_000
"""Maximum number of squares of a network; in a larger network the squares are larger. Ours: 4 MB, or a square kilometre
of the smallest squares."""
_UNKNOWN, _PARTLY = 0, 2


class Squares:
    """Squares of a network that say whether points lie on the drivable area; each is tested when a point first falls
    into it.

    Attributes:
        left, bottom: the lower left corner of the first square, m. cell: side of a square, m.
        states: [columns, rows] 1 for a square that lies wholly on the drivable area, 2 for a square that does not, 0
            for a square that was not tested yet.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._area = network.drivable_around
        left, bottom, right, top = network.bounds
        self.left, self.bottom = left, bottom
        self.cell = max(_CELL_M, float(np.sqrt((right - left) * (top - bottom) / _MOST_CELLS)))
        shape = floor((right - left) / self.cell) + 1, floor((top - bottom) / self.cell) + 1
        self.states = np.zeros(shape, dtype=np.uint8)

    def hold(self, points: FloatArray) -> bool:
        """Return whether all points ([N, 2] m) lie on the drivable area."""
        return all_whole(points, self.left, self.bottom, self.cell, self.states) or all(
            self._holds(x, y) for x, y in points.tolist()
        )

    def hold_area(self, corners: Sequence[tuple[float, float]]) -> bool:
        """Return whether a convex area lies wholly on the drivable area; on a large map, only if it does not extend
        farther than 25 m beyond the tile of its first corner.

        `corners`: x and y, m.
        """
        return bool(shapely.contains_properly(self._area(*corners[0]), shapely.Polygon(corners)))

    def _holds(self, x: float, y: float) -> bool:
        column, row = floor((x - self.left) / self.cell), floor((y - self.bottom) / self.cell)
        if not (0 <= column < self.states.shape[0] and 0 <= row < self.states.shape[1]):
            return False
        if self.states[column, row] == _UNKNOWN:
            left, bottom = self.left + column * self.cell, self.bottom + row * self.cell
            square = shapely.box(left, bottom, left + self.cell, bottom + self.cell)
            self.states[column, row] = WHOLE if shapely.contains_properly(self._area(x, y), square) else _PARTLY
        return self.states[column, row] == WHOLE or bool(shapely.contains_xy(self._area(x, y), x, y))


squares_of = per_network(Squares)
"""Return the squares of a network."""
