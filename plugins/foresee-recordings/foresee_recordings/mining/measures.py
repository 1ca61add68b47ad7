"""The measures of conditions on recorded actors; their definitions are those of `simulate.triggers.measures`.

Distances and times to a touch come from the core's kernels. The way of a recorded actor is the way that it drove.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from foresee_dsl.kernels.conditions import STILL_MPS
from foresee_dsl.language import model as m
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import word_of
from foresee_dsl.simulate.results.metrics import ETA_SLOWEST_MPS
from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.mining import kernels
from foresee_recordings.mining.rows import Rows
from foresee_recordings.mining.traffic import ACCELERATION, HEADING, SPEED, X, Y
from foresee_recordings.recording import FloatArray, RecordingError


def values(measure: m.Measure, rows: Rows) -> FloatArray:
    """Return a measure at rows, [R] in SI units.

    Raises:
        RecordingError: a recording does not say what the measure needs.
    """
    name, other = measure.actor or "", word_of(measure.other or "")
    match measure.what:
        case "time":
            return np.asarray(rows.traffic.begins_s + rows.frames * STEP_S, dtype=np.float64)
        case "speed" | "acceleration":
            return column(rows, name, SPEED if measure.what == "speed" else ACCELERATION)
    if measure.what in BETWEEN and other in rows.states:
        return BETWEEN[measure.what](rows, name, other)
    raise RecordingError(f"{written(measure)} cannot be searched for: a recording does not say it")


def values_until(measure: m.Measure, rows: Rows, bound: float) -> FloatArray:
    """Return a measure at rows as `values` does, but infinity where it is certainly above a bound, which is faster."""
    name, other = measure.actor or "", word_of(measure.other or "")
    if other not in rows.states or measure.what not in ("distance", "headway", "ttc"):
        return values(measure, rows)
    out = np.empty(len(rows))
    pair = rows.traffic.states, rows.traffic.sizes, rows.states[name], rows.states[other]
    if measure.what == "ttc":
        kernels.times_to_touch_within(*pair, max(bound, 0.0), out)
        return out
    speed = np.ones(len(rows))
    if measure.what == "headway":
        speed = np.maximum(column(rows, name, SPEED), ETA_SLOWEST_MPS)
    kernels.gaps_within(*pair, bound * speed, out)
    out /= speed
    return out


def column(rows: Rows, name: str, which: int) -> FloatArray:
    """Return a column of an actor's states at rows, [R]."""
    states: FloatArray = rows.traffic.states[rows.states[name], which]
    return states


def gap(rows: Rows, name: str, other: str) -> FloatArray:
    """Return the distance between two actors' footprints, [R] m."""
    return _filled(kernels.gaps, rows, name, other)


def _filled(kernel: Callable[..., None], rows: Rows, name: str, other: str) -> FloatArray:
    out = np.empty(len(rows))
    kernel(rows.traffic.states, rows.traffic.sizes, rows.states[name], rows.states[other], out)
    return out


def _ttc(rows: Rows, name: str, other: str) -> FloatArray:
    return _filled(kernels.times_to_touch, rows, name, other)


def _headway(rows: Rows, name: str, other: str) -> FloatArray:
    return gap(rows, name, other) / np.maximum(column(rows, name, SPEED), ETA_SLOWEST_MPS)


def _relative_speed(rows: Rows, name: str, other: str) -> FloatArray:
    turned = column(rows, other, HEADING) - column(rows, name, HEADING)
    return column(rows, name, SPEED) - column(rows, other, SPEED) * np.cos(turned)


# --- along the way of the first actor ---------------------------------------------------------------------------------


class PairOnWay:
    """Where two actors are on the way of the first of them; see `simulate.triggers.ways`.

    Attributes:
        gap_ahead, gap_behind: [R] m from the first's front to the other's rear, and from the other's front to the
            first's rear; negative if it is not ahead, or not behind. overlap, lateral: [R] m.
        left: [R] how far the other's centre is to the left of the way, m.
        own_mps, other_mps: [R] speeds along the way.
    """

    def __init__(self, rows: Rows, name: str, other: str) -> None:
        traffic, sizes = rows.traffic, rows.traffic.sizes
        mine, theirs = rows.states[name], rows.states[other]
        own_s, s, self.left = np.empty(len(rows)), np.empty(len(rows)), np.empty(len(rows))
        own_way, other_way = np.empty(len(rows)), np.empty(len(rows))
        xy = traffic.states[theirs][:, [X, Y]]
        for actor in np.unique(rows.actors[name]).tolist():
            at, way = rows.actors[name] == actor, traffic.way(actor)
            own_s[at] = way.own_s[mine[at] - traffic.start[actor]]
            s[at], self.left[at] = way.project(xy[at])
            own_way[at], other_way[at] = way.heading_at(own_s[at]), way.heading_at(s[at])
        turned = traffic.states[theirs, HEADING] - other_way
        cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
        half = (sizes[theirs, 0] * cos + sizes[theirs, 1] * sin) / 2
        across = (sizes[theirs, 0] * sin + sizes[theirs, 1] * cos) / 2
        own_half = sizes[mine, 0] / 2
        self.gap_ahead = s - half - (own_s + own_half)
        self.gap_behind = own_s - own_half - (s + half)
        self.overlap = np.minimum(own_s + own_half, s + half) - np.maximum(own_s - own_half, s - half)
        self.lateral = np.maximum(np.abs(self.left) - sizes[mine, 1] / 2 - across, 0.0)
        self.own_mps = traffic.states[mine, SPEED] * np.cos(traffic.states[mine, HEADING] - own_way)
        self.other_mps = traffic.states[theirs, SPEED] * np.cos(turned)

    @property
    def time_s(self) -> FloatArray:
        """Return the time until both footprints are side by side, [R] s: `ttc_along`."""
        gap_m = np.maximum(self.gap_ahead, self.gap_behind)
        closing = np.where(self.gap_behind > 0, self.other_mps - self.own_mps, self.own_mps - self.other_mps)
        with np.errstate(divide="ignore", invalid="ignore"):
            times: FloatArray = np.where(closing > STILL_MPS, gap_m / closing, np.inf)
        return np.where(gap_m <= 0, 0.0, times)


BETWEEN: dict[str, Callable[[Rows, str, str], FloatArray]] = {
    "distance": gap,
    "ttc": _ttc,
    "headway": _headway,
    "lateral": lambda rows, name, other: PairOnWay(rows, name, other).lateral,
    "overlap": lambda rows, name, other: PairOnWay(rows, name, other).overlap,
    "ttc_along": lambda rows, name, other: PairOnWay(rows, name, other).time_s,
    "relative_speed": _relative_speed,
}
"""Measures between two actors, by their word."""
