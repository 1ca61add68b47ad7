"""Kinematic roll-outs of a recorded run in which one actor behaves differently, as kernels.

A roll-out moves the changed actor along its own recorded track, at other times and with an offset, and the ego along
its recorded path, slower if it reacts or approaches more carefully. All other actors move as recorded. A roll-out takes
microseconds and selects, from hundreds of changes, those worth a simulation; it does not replace the simulation.

The ego predicts the changed actor with its current velocity and brakes if the prediction is in its way; a `PathStyle`
determines the delay and the braking.
"""

from __future__ import annotations

from math import cos, hypot, inf, sin
from typing import NamedTuple

from foresee_dsl.kernels.arrays import FloatArray, Record, Records
from foresee_dsl.kernels.boxes import Box, apart, overlap
from foresee_dsl.kernels.compiling import CUBE, TABLE, compiled, inner
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.kernels.records import array_of
from foresee_dsl.kernels.sumo_traffic import SIDEWAYS_SHARE

ROLLOUT_STEP_S = 0.1
"""Time step of the roll-out, s. Ours: a pedestrian moves 0.1 m in this time; with a step of a single frame the
computation would take twice as long."""
FRAMES = 2.0
"""Number of recorded frames per step."""
LEAST_PACE_MPS = 0.5
"""Lowest speed in the computation of braking, m/s. Ours: a pedestrian's slowest steps."""
SLACK_M = 0.3
"""Width that is added to the ego's body for the corridor that it keeps free, m. Ours: the distance that drivers leave
to standing people."""
LOOKS = 6
"""Number of moments within a style's horizon at which the ego compares both predicted positions. Ours: at 10 m/s and
with a horizon of 2.5 s, the positions at two moments are 4 m apart, about a car's length."""
BEFORE_M = 1.0
"""Free distance that the ego keeps before and behind its body, m. Ours."""
RECOVERS_S = 0.5
"""Time constant with which a steered vehicle turns towards its aim, s. Ours: about the time of turning the wheels
back."""
AHEAD_S = 1.0
AHEAD_M = 5.0
"""A steered vehicle aims at a point of its line that is ahead by this time, s, and at least by this length, m
(`simulate.actors.lane_recovery.RecoverySettings`)."""
GAINS_MPS2 = 1.5
"""Acceleration with which an actor or the ego returns to its recorded speed, m/s^2. Ours: a moderate one."""
SIDEWAYS_S = 1.5
"""Time in which the ego moves aside, s. Ours: 0.8 m at 0.5 m/s."""
RELEASES_S = 0.5
"""Time for which the ego continues to brake after its path has become free, s. Ours: a short hesitation."""
MISSES_M = 3.0
"""Smallest gap above which a change is useless with every style of driving, m. Ours: about a lane's width."""


class WhatIf(NamedTuple):
    """One actor with one changed behaviour; the fields of all other changes have their neutral values, the defaults.

    Attributes:
        actor: column of the actor. first, last: first and last frame of the window.
        length, width: size of its footprint, m. cruise: its speed where nothing hinders it, m/s.
        delay: additional time for which it stands at the beginning, s. ahead: its head start, m. pace: factor on its
            speed along its track.
        brakes_at, brakes_for: begin, since the window's beginning, and duration of braking, s; braking: m/s^2.
        left: offset to the left of its track, m, from left_at for left_for (s) at left_rate (m/s).
        turn: change of its heading per metre, rad/m, from turn_at for turn_for (s).
        goes_at: time from which it drives on with up to `cruise`, even if it stood in the recorded run, s.
    """

    actor: int
    first: int
    last: int
    length: float
    width: float
    cruise: float
    delay: float = 0.0
    ahead: float = 0.0
    pace: float = 1.0
    brakes_at: float = 0.0
    brakes_for: float = 0.0
    braking: float = 0.0
    left: float = 0.0
    left_at: float = 0.0
    left_for: float = 0.0
    left_rate: float = 0.0
    turn: float = 0.0
    turn_at: float = 0.0
    turn_for: float = 0.0
    goes_at: float = inf


class PathStyle(NamedTuple):
    """A style of driving along the recorded path.

    Attributes:
        delay: time from the moment at which the ego predicts an actor in its way until it brakes, s. horizon:
            prediction time, s. braking: m/s^2.
        pace: factor on the recorded speed, from the window's beginning. A slower ego starts earlier so that it meets
            the actor at the same place: only its speed differs.
        aside: its offset to the left (negative: right), m. room: additional free width on both sides, m.
    """

    delay: float
    horizon: float
    braking: float
    pace: float
    aside: float
    room: float


class RollOutEnding(NamedTuple):
    """How one roll-out ends.

    Attributes:
        contact: time of the contact since the window's beginning, s; inf without one. gap: smallest gap, m. at: time of
            the smallest gap, s. ego: the ego's speed then, m/s. brakes: time at which the ego first braked for the
            actor, s; inf if never. struck: whether the other was then in front of the ego's middle, or slower than the
            ego.
    """

    contact: float
    gap: float
    at: float
    ego: float
    brakes: float
    struck: bool


class _Moves(NamedTuple):
    """The state of a changed actor.

    It is its clock (frames of its track), its share of the recorded speed, its offset to the left of its track (m), and
    its angle to the track (rad).
    """

    clock: float
    share: float
    left: float
    turned: float


WHAT_IFS, STYLES, ENDINGS = array_of(WhatIf), array_of(PathStyle), array_of(RollOutEnding, 2)


@inner
def _pose(track: FloatArray, clock: float) -> tuple[float, float, float]:
    """Return x, y and heading of a track at a fractional frame; straight on beyond its end."""
    last = track.shape[0] - 1
    if clock >= last:
        x, y, heading, step = track[last]
        way = (clock - last) * step
        return x + way * cos(heading), y + way * sin(heading), heading
    k = max(int(clock), 0)
    share, a, b = clock - k, track[k], track[k + 1]
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


@inner
def _mps(track: FloatArray, clock: float) -> float:
    """Return the recorded speed at a clock (a fractional frame of the track), m/s."""
    k = min(max(int(clock), 0), track.shape[0] - 1)
    return float(track[k, 3] * FRAMES / ROLLOUT_STEP_S)


@inner
def _advanced(track: FloatArray, clock: float, way: float) -> float:
    """Return the clock at which the actor is `way` metres further along its track; times at which it stood are
    skipped."""
    last = track.shape[0] - 1
    while way > 0.0 and clock < last:
        k = int(clock)
        step = hypot(track[k + 1, 0] - track[k, 0], track[k + 1, 1] - track[k, 1])
        rest = step * (k + 1 - clock)
        if rest > way:
            return clock + way / step
        way -= rest
        clock = k + 1.0
    step = track[last, 3]
    return clock + way / step if way > 0.0 and step > 0.0 else clock


@inner
def _paced(pace: float, track: FloatArray, now: _Moves) -> float:
    """Return the share of the recorded speed one step later: an actor waits no shorter, and accelerates no faster, than
    in the recorded run."""
    mps, later = _mps(track, now.clock), _mps(track, now.clock + FRAMES)
    if later < STANDS_MPS:
        return 1.0
    reached = now.share * mps + max(GAINS_MPS2 * ROLLOUT_STEP_S, later - mps)
    return min(pace, max(1.0, reached / later))


@inner
def _acted(what: Record, track: FloatArray, now: _Moves, since: float) -> _Moves:
    """Return the state of the changed actor one step later; `since`: time since the window's beginning, s."""
    share, before = now.share, max(_mps(track, now.clock), LEAST_PACE_MPS)
    braked = what["braking"] > 0.0 and since >= what["brakes_at"]
    if since < what["delay"]:
        share = 0.0
    elif braked and since < what["brakes_at"] + what["brakes_for"]:
        share = max(0.0, share - what["braking"] * ROLLOUT_STEP_S / before)
    elif braked or what["delay"] > 0.0:
        share = min(what["pace"], share + GAINS_MPS2 * ROLLOUT_STEP_S / before)
    else:
        share = _paced(what["pace"], track, now)
    clock = now.clock + share * FRAMES
    if since >= what["goes_at"]:
        onset = _mps(track, what["first"] + what["goes_at"] / ROLLOUT_STEP_S * FRAMES)
        speed = min(onset + GAINS_MPS2 * (since - what["goes_at"]), max(what["cruise"], onset))
        clock = _advanced(track, now.clock, speed * ROLLOUT_STEP_S)
    x, y, _ = _pose(track, now.clock)
    to_x, to_y, _ = _pose(track, clock)
    way = hypot(to_x - x, to_y - y)
    left, turned = now.left, now.turned
    if what["turn_at"] <= since < what["turn_at"] + what["turn_for"]:
        turned += what["turn"] * way
    elif what["turn"] != 0.0 and since >= what["turn_at"]:
        wanted = -left / max(AHEAD_M, AHEAD_S * way / ROLLOUT_STEP_S)
        turned += (wanted - turned) * ROLLOUT_STEP_S / RECOVERS_S
    if what["left"] != 0.0 and since >= what["left_at"]:
        wanted = 0.0 if since >= what["left_at"] + what["left_for"] else what["left"]
        most = min(what["left_rate"] * ROLLOUT_STEP_S, SIDEWAYS_SHARE * way)
        left += max(-most, min(most, wanted - left))
    return _Moves(clock, share, left + way * sin(turned), turned)


@inner
def _placed(track: FloatArray, at: _Moves) -> tuple[float, float, float]:
    """Return x, y and heading of an actor with an offset to its track."""
    x, y, heading = _pose(track, at.clock)
    return x - at.left * sin(heading), y + at.left * cos(heading), heading + at.turned


@inner
def _hidden(
    x: float, y: float, to_x: float, to_y: float, actor: int, tracks: FloatArray, frame: int, sizes: FloatArray
) -> bool:
    """Return whether another body, at least as high as an actor, is between the ego and that actor's centre."""
    dx, dy = to_x - x, to_y - y
    squared = max(dx * dx + dy * dy, 1e-9)
    for k in range(1, sizes.shape[0]):
        if k == actor or sizes[k, 2] < sizes[actor, 2]:
            continue
        bx, by = tracks[k, frame, 0] - x, tracks[k, frame, 1] - y
        share = min(max((bx * dx + by * dy) / squared, 0.0), 1.0)
        # Written so that an absent actor (NaN) is skipped.
        if not hypot(bx - share * dx, by - share * dy) <= hypot(sizes[k, 0], sizes[k, 1]) / 2:
            continue
        c, s = cos(tracks[k, frame, 2]), sin(tracks[k, frame, 2])
        # The line of sight in the body's axes, clipped to the body's length and width.
        low, high = _cut(-bx * c - by * s, dx * c + dy * s, sizes[k, 0] / 2, 0.0, 1.0)
        low, high = _cut(bx * s - by * c, dy * c - dx * s, sizes[k, 1] / 2, low, high)
        if low <= high:
            return True
    return False


@inner
def _cut(begin: float, way: float, half: float, low: float, high: float) -> tuple[float, float]:
    """Return the range of shares of a line, within low..high, in which a coordinate is within `half` of 0."""
    if abs(way) < 1e-12:
        return (low, high) if abs(begin) <= half else (1.0, 0.0)
    first, second = (-half - begin) / way, (half - begin) / way
    return max(low, min(first, second)), min(high, max(first, second))


@inner
def _threatens(ego: FloatArray, clock: float, style: Record, size: tuple[float, float], other: Box, vx: float,
               vy: float) -> bool:  # fmt: skip
    """Return whether another actor, if it keeps its current velocity, comes into the ego's way within the style's
    horizon.
    """
    length, width = size[0] + 2 * BEFORE_M, size[1] + SLACK_M + 2 * style["room"]
    reach = (hypot(length, width) + hypot(other.length, other.width)) / 2
    for look in range(1, LOOKS + 1):
        later = style["horizon"] * look / LOOKS
        x, y, heading = _pose(ego, clock + style["pace"] * later / ROLLOUT_STEP_S * FRAMES)
        ox, oy = other.x + vx * later, other.y + vy * later
        if hypot(ox - x, oy - y) <= reach:
            then = Box(ox, oy, other.heading, other.length, other.width)
            if overlap(Box(x, y, heading, length, width), then):
                return True
    return False


@inner
def _runs_into(box: Box, actor: int, tracks: FloatArray, frame: int, sizes: FloatArray) -> bool:
    """Return whether the ego, in front of its middle, touches an actor other than the changed one."""
    c, s = cos(box.heading), sin(box.heading)
    own = hypot(box.length, box.width) / 2
    for k in range(1, sizes.shape[0]):
        x, y, heading, _ = tracks[k, frame]
        dx, dy = x - box.x, y - box.y
        reach = own + (sizes[k, 0] + sizes[k, 1]) / 2
        # Written so that an absent actor (NaN) is skipped.
        if k == actor or not dx * dx + dy * dy <= reach * reach or dx * c + dy * s < 0.0:
            continue
        if overlap(box, Box(x, y, heading, sizes[k, 0], sizes[k, 1])):
            return True
    return False


@inner
def _towards(now: float, wanted: float, most: float) -> float:
    return now + max(-most, min(most, wanted - now))


@inner
def _rolled(what: Record, style: Record, near_s: float, tracks: FloatArray, sizes: FloatArray, ending: Record) -> None:
    """Roll out one change with one style of driving, and fill `ending`.

    `near_s`: time since the window's beginning at which the ego, at its recorded speed, is nearest to the actor, s.
    """
    ego, track, actor = tracks[0], tracks[what["actor"]], what["actor"]
    size = (sizes[0, 0], sizes[0, 1])
    begins = _advanced(track, float(what["first"]), what["ahead"])
    at = _Moves(begins, what["pace"] if _mps(track, begins) >= STANDS_MPS else 1.0, 0.0, 0.0)
    clock, share, aside = what["first"] + (1.0 - style["pace"]) * near_s / ROLLOUT_STEP_S * FRAMES, style["pace"], 0.0
    threatened, braking_until = inf, -inf
    ending["contact"], ending["gap"], ending["at"], ending["ego"] = inf, inf, 0.0, 0.0
    ending["brakes"], ending["struck"] = inf, False
    # The velocity of the actor at the first moment is the recorded one, or 0 if it stands longer.
    moved = _Moves(at.clock - (0.0 if what["delay"] > 0.0 else at.share * FRAMES), at.share, 0.0, 0.0)
    ox, oy, oh = _placed(track, moved)
    for step in range(int((what["last"] - what["first"]) / FRAMES) + 1):
        since = step * ROLLOUT_STEP_S
        frame = min(int(what["first"] + step * FRAMES), tracks.shape[1] - 1)
        x, y, heading = _pose(ego, clock)
        x, y = x - aside * sin(heading), y + aside * cos(heading)
        before_x, before_y = ox, oy
        ox, oy, oh = _placed(track, at)
        vx, vy = (ox - before_x) / ROLLOUT_STEP_S, (oy - before_y) / ROLLOUT_STEP_S
        speed = _mps(ego, clock) * share
        box = Box(x, y, heading, size[0], size[1])
        other = Box(ox, oy, oh, what["length"], what["width"])
        if hypot(ox - x, oy - y) - (hypot(size[0], size[1]) + hypot(other.length, other.width)) / 2 < ending["gap"]:
            gap = apart(box, other)
            if gap < ending["gap"]:
                ahead = (ox - x) * cos(heading) + (oy - y) * sin(heading)
                ending["gap"], ending["at"], ending["ego"] = gap, since, speed
                ending["struck"] = ahead > 0.0 or speed > hypot(vx, vy)
            if gap == 0.0:
                ending["contact"] = since
                return
        if (style["pace"] != 1.0 or style["aside"] != 0.0) and _runs_into(box, actor, tracks, frame, sizes):
            ending["contact"], ending["gap"], ending["at"], ending["ego"] = since, 0.0, since, speed
            ending["struck"] = True
            return
        if _threatens(ego, clock, style, size, other, vx, vy) and not _hidden(
            x, y, ox, oy, actor, tracks, frame, sizes
        ):
            threatened = min(threatened, since)
            if since >= threatened + style["delay"] - 1e-9:
                braking_until = since + RELEASES_S
                ending["brakes"] = min(ending["brakes"], since)
        elif since > braking_until:
            threatened = inf
        before = max(_mps(ego, clock), LEAST_PACE_MPS)
        if since < braking_until:
            share = max(0.0, share - style["braking"] * ROLLOUT_STEP_S / before)
        else:
            share = min(style["pace"], share + GAINS_MPS2 * ROLLOUT_STEP_S / before)
        clock += share * FRAMES
        aside = _towards(aside, style["aside"], abs(style["aside"]) * ROLLOUT_STEP_S / SIDEWAYS_S)
        at = _acted(what, track, at, since)


@compiled(WHAT_IFS, STYLES, CUBE, TABLE, ENDINGS)
def roll_out(whats: Records, styles: Records, tracks: FloatArray, sizes: FloatArray, endings: Records) -> None:
    """Roll out every change with every style of driving.

    Args:
        whats: [C] the changes. styles: [S] the styles.
        tracks: [A, T, 4] x, y (m), heading (rad, continuous), distance from the frame to the next (m); the ego first.
            NaN before an actor appears; after it has left, straight on.
        sizes: [A, 3] length, width, height, m.
        endings: [C, S] output. A change whose smallest gap with the first style exceeds `MISSES_M` is not rolled out
            with further styles.
    """
    for w in range(whats.size):
        for s in range(styles.size):
            if s > 0 and endings[w, 0]["gap"] > MISSES_M:
                endings[w, s] = endings[w, 0]
            else:
                near_s = endings[w, 0]["at"] if s > 0 else 0.0
                _rolled(whats[w], styles[s], near_s, tracks, sizes, endings[w, s])
