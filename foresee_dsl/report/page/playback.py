"""Converts a run to data for the page's player: poses and visibility of actors, signals, and deviations from the
parent's run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import Signal, SumoBundle
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_dsl.kernels.boxes import box_distance, corners
from foresee_dsl.report.drawing.ground import with_patches
from foresee_dsl.report.drawing.shapes import CM, Shape, as_data, body_shapes, ground_shapes, line
from foresee_dsl.report.show.panels import Role, role_of
from foresee_dsl.simulate.results.criticality import CriticalityMeasure, criticality
from foresee_dsl.simulate.results.infraction import infractions_in
from foresee_dsl.simulate.results.near_misses import times_between
from foresee_dsl.simulate.sensing.sight import sight_of
from foresee_dsl.simulate.signals import colour_shown, state_at
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y

NEAR_M = 90.0
"""An actor that never comes this near to the ego is left out, m. Ours: a little more than the range of its sensors for
a car."""
SIGNALS_NEAR_M = 100.0
"""A signal that is always farther from the ego is left out, m. Ours: the range of the ego's camera."""
LONG_RUN_FRAMES = 400
"""Number of frames (20 s) above which only every second frame of a run is kept. Ours: the player interpolates
positions."""
APART_M = 0.3
"""An actor that is farther than this from its place in the parent's run is drawn with a ghost at that place, m. Ours: a
visible distance."""

MRAD = 1000.0
"""Units per rad: headings are rounded to 1 mrad, which is 3 mm at the bumper of a bus, 6 m from its centre."""

PET = "pet_s"
MEASURES = (
    *((m.value, m.words, m.unit or "share", 1 if m.unit == "m" else 2) for m in CriticalityMeasure),
    (PET, "time between both at a spot", "s", 2),
)
"""The curves of criticality that a page offers: name, words, unit, decimals."""


@dataclass(frozen=True)
class Parent:
    """The run from which a clip or mutant was derived; the derived run begins `start_s` after the beginning of this
    run.
    """

    trace: Trace
    start_s: float


@dataclass(frozen=True)
class Marks:
    """Events that the player marks in a playback.

    Attributes:
        opponent: id of the opponent, or "".
        contact_s, contact: time, s, and place, m, of the opponent's contact with the ego.
        forecast_s, forecast_with: time of the risky point from the run's first frame, s, and id of its actor.
    """

    opponent: str = ""
    contact_s: float | None = None
    contact: tuple[float, float] | None = None
    forecast_s: float | None = None
    forecast_with: str = ""


def playback(trace: Trace, bundle: SumoBundle, marks: Marks, parent: Parent | None = None) -> dict[str, Any]:
    """Return a run as data for the page's script, in the form that `templates/report/run.js` reads."""
    frames = shown_frames(trace.frames)
    columns = near_the_ego(trace, frames, marks.opponent)
    seen = _seen(trace, bundle, frames)
    heights = [actor.model.height_m for actor in bundle.scene.actors]
    run: dict[str, Any] = {
        "step": STEP_S * (int(frames[1] - frames[0]) if len(frames) > 1 else 1),
        "frames": len(frames),
        "end": round(trace.duration_s, 3),
        "actors": [
            {
                "id": trace.actors[k].id,
                "kind": trace.actors[k].kind,
                "model": trace.actors[k].model,
                "size": [trace.actors[k].length_m, trace.actors[k].width_m, round(heights[k], 2)],
                "paint": (role := role_of(trace, k, marks.opponent)).value,
                "shapes": as_data(_body(trace, k, role)),
                "way": _way(trace.states[frames, k]),
                "seen": toggles(seen[:, k]),
            }
            for k in columns
        ],
        "shapes": as_data(ground_shapes(with_patches({}, bundle.scene.slippery))),
        "opponent": marks.opponent,
        "signals": signal_heads(trace, bundle, frames),
        "gap": _gap(trace, frames, marks.opponent),
        "contact": None,
        "forecast": None,
        "curves": curves(trace, frames, marks.opponent),
        "rules": [
            [round(r.time_s, 2), round(r.until_s, 2), r.clause]
            for r in infractions_in(trace.meta)
            if r.actor == trace.actors[0].id
        ],
        "others": [],
        "reasons": [],
        "ghosts": [],
        "ghost_gap": [],
        "differs": None,
    }
    if marks.contact_s is not None:
        run["contact"] = [marks.contact_s, *([round(v, 2) for v in marks.contact] if marks.contact else [])]
    if parent is not None:
        run |= _ghosts(trace, frames, columns, parent, marks.opponent)
    if marks.forecast_s is not None:
        source = parent or Parent(trace, 0.0)
        run["forecast"] = [round(marks.forecast_s, 2), *_place_at(source, marks.forecast_s, marks.forecast_with)]
    return run


def _body(trace: Trace, actor: int, role: Role) -> tuple[Shape, ...]:
    """Return the shapes of an actor around its middle, with its front pointing to the right."""
    info = trace.actors[actor]
    outline = corners(np.array((0.0, 0.0, 0.0, info.length_m, info.width_m)))
    return body_shapes(outline, info.kind, role.value)


def shown_frames(count: int) -> IntArray:
    """Return the frames that a page shows: all, or of a long run every second one and the last."""
    step = 1 if count <= LONG_RUN_FRAMES else 2
    frames = np.arange(0, count, step)
    return frames if count == 0 or frames[-1] == count - 1 else np.append(frames, count - 1)


def near_the_ego(trace: Trace, frames: IntArray, opponent: str) -> list[int]:
    """Return the columns of the actors that a page shows: the ego, the opponent, and all that come within `NEAR_M`."""
    xy = trace.states[frames][:, :, [X, Y]]
    gaps = np.hypot(xy[:, :, 0] - xy[:, :1, 0], xy[:, :, 1] - xy[:, :1, 1])
    near = np.nan_to_num(gaps, nan=np.inf).min(axis=0) <= NEAR_M
    return [k for k, info in enumerate(trace.actors) if k == 0 or near[k] or info.id == opponent]


def _way(states: FloatArray) -> list[list[Any]]:
    """Return the stretches of time in which an actor is present: [first frame, number of frames, x, y, heading, speed].

    Each of the last four is a list: the first value, the first difference, and then by how much the difference changes,
    without the zeros at its end; a constant value is a list of one.
    """
    there = ~np.isnan(states[:, X])
    edges = [*toggles(there), len(there)]
    stretches = []
    for first, beyond in zip(edges[::2], edges[1::2], strict=False):
        part = states[first:beyond]
        heading = np.unwrap(part[:, HEADING])
        columns = ((part[:, X], CM), (part[:, Y], CM), (heading, MRAD), (part[:, SPEED], CM))
        stretches.append([first, beyond - first, *(_changes_of(deltas(values, unit)) for values, unit in columns)])
    return stretches


def ego_way(trace: Trace, frames: int) -> list[list[Any]]:
    """Return the way of the ego in another run (`trace`) of the situation that is shown, in the form of `_way`.
    `frames`: number of frames of the run that is shown; the way has the frames that a page shows of that run, up to the
    other run's end.
    """
    kept_frames = shown_frames(frames)
    states = np.full((len(kept_frames), trace.states.shape[2]), np.nan)
    there = kept_frames < trace.frames
    states[there] = trace.states[kept_frames[there], 0]
    return _way(states)


def _changes_of(differences: list[int]) -> list[int]:
    """Return a first value and its differences with each difference relative to the one before, without zeros at the
    end.

    An actor's speed is nearly constant, so these numbers are short: the page is a tenth smaller.
    """
    changes = [*differences[:2], *(now - before for before, now in pairwise(differences[1:]))]
    while len(changes) > 1 and not changes[-1]:
        changes.pop()
    return changes


def deltas(values: NDArray[np.float64], per_unit: float) -> list[int]:
    """Return the first value and then the differences, in units of 1 / `per_unit`; rounding errors do not add up."""
    whole = np.rint(values * per_unit).astype(np.int64)
    return [int(v) for v in np.diff(whole, prepend=0)]


def toggles(flags: NDArray[np.bool_]) -> list[int]:
    """Return the indices at which a flag changes; it counts as false before the first index."""
    changes = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0))
    return [int(k) for k in changes]


def _seen(trace: Trace, bundle: SumoBundle, frames: IntArray) -> NDArray[np.bool_]:
    """Return which actors are in the ego's line of sight, [frames, actors], without the noise and the misses of the
    sensors.
    """
    sight = sight_of(bundle)
    seen = np.zeros((len(frames), len(trace.actors)), dtype=np.bool_)
    seen[:, 0] = True
    for row, frame in enumerate(frames):
        poses = trace.states[frame][:, [X, Y, HEADING]]
        x, y, heading = poses[0].tolist()
        if not math.isnan(x):
            seen[row, sight.seen(x, y, heading, poses[1:]) + 1] = True
    return seen


def _gap(trace: Trace, frames: IntArray, opponent: str) -> list[int]:
    """Return the distance between the footprints of ego and opponent at each frame, cm; -1 if one is absent."""
    other = next((k for k, info in enumerate(trace.actors) if info.id == opponent and k), None)
    if other is None:
        return []
    away = box_distance(trace.boxes(0)[frames], trace.boxes(other)[frames])
    return [-1 if np.isnan(value) else round(float(value) * CM) for value in away]


def curves(trace: Trace, frames: IntArray, opponent: str) -> dict[str, list[list[Any]]]:
    """Return the criticality of ego and opponent, without the measures that never have a value.

    Each measure of `MEASURES` is a list of stretches with values, [first frame, [value, difference, ...]], in units of
    its last decimal.
    """
    other = next((k for k, info in enumerate(trace.actors) if info.id == opponent and k), None)
    if other is None:
        return {}
    series: dict[str, FloatArray] = {m.value: values for m, values in criticality(trace, other).items()}
    series[PET] = times_between(trace, other)
    stretches = {name: _stretches(series[name][frames], decimals) for name, _, _, decimals in MEASURES}
    return {name: parts for name, parts in stretches.items() if parts}


def _stretches(values: FloatArray, decimals: int) -> list[list[Any]]:
    there = np.isfinite(values)
    edges = [*toggles(there), len(there)]
    return [[first, deltas(values[first:beyond], 10.0**decimals)]
            for first, beyond in zip(edges[::2], edges[1::2], strict=False)]  # fmt: skip


def _ghosts(trace: Trace, frames: IntArray, columns: list[int], parent: Parent, opponent: str) -> dict[str, Any]:
    """Return the poses that actors have in the parent's run at the same times, where these are more than `APART_M` away
    from their places in this run.
    """
    first = round(parent.start_s / STEP_S)
    at = frames + first
    within = at < parent.trace.frames
    theirs = {info.id: k for k, info in enumerate(parent.trace.actors)}
    ghosts, differs = [], []
    for place, k in enumerate(columns):
        column = theirs.get(trace.actors[k].id)
        if column is None or not within.any():
            continue
        states = np.full((len(frames), parent.trace.states.shape[2]), np.nan)
        states[within] = parent.trace.states[at[within], column]
        mine = trace.states[frames, k]
        apart = np.hypot(states[:, X] - mine[:, X], states[:, Y] - mine[:, Y]) > APART_M
        if apart.any():
            ghosts.append({"of": place, "way": _way(states)})
            differs.append(float(trace.time_s[frames[int(np.argmax(apart))]]))
    gap = _gap(parent.trace, np.minimum(at, parent.trace.frames - 1), opponent)
    gap = [value if there else -1 for value, there in zip(gap, within, strict=True)] if ghosts and gap else []
    return {"ghosts": ghosts, "ghost_gap": gap, "differs": round(min(differs), 2) if differs else None}


def _place_at(run: Parent, time_s: float, actor: str) -> list[float]:
    """Return the place of an actor in the parent's run at a time of the derived run, m; empty if the actor is absent
    then.

    If the parent has no such actor, it is the place of the ego.
    """
    columns = {info.id: k for k, info in enumerate(run.trace.actors)}
    frame = run.trace.frame_at(run.start_s + time_s)
    state = run.trace.states[frame, columns.get(actor, 0)]
    return [round(float(v), 2) for v in state[[X, Y]]] if not np.isnan(state[X]) else []


def signal_heads(trace: Trace, bundle: SumoBundle, frames: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Return the signal heads near the ego: for each head `at`, its line on the road, cm, and `colours`: frame, colour,
    frame, colour...

    A colour is the name of a paint; a frame is an index into `frames`.
    """
    track = trace.states[:, 0, [X, Y]]
    heads = []
    for column, junction in enumerate(trace.signals):
        signal = bundle.signals.get(junction)
        place = bundle.network.junctions.get(junction)
        if signal is None or place is None:
            continue
        if np.nanmin(np.hypot(track[:, 0] - place.x, track[:, 1] - place.y)) > SIGNALS_NEAR_M:
            continue
        states = [state_at(signal, trace, column, frame) for frame in frames]
        heads += [{"at": line(at), "colours": _changes(states, link)} for at, link in _places(bundle.network, signal)]
    return heads


def _changes(states: list[str], link: int) -> list[int | str]:
    changes: list[int | str] = []
    before = ""
    for k, state in enumerate(states):
        colour = colour_shown(state, link) if link < len(state) else "off"
        if colour != before:
            changes += [k, colour]
            before = colour
    return changes


def _places(network: RoadNetwork, signal: Signal) -> Iterator[tuple[list[tuple[float, float]], int]]:
    """Yield a line and the index of a link for each signal head.

    The line is a part of the stop line for each movement from a lane, and a point at both ends of a crossing.
    """
    links: dict[str, list[int]] = {}
    for movement in network.movements:
        if movement.tls == signal.tls and movement.link not in links.setdefault(movement.from_lane, []):
            links[movement.from_lane].append(movement.link)
    for lane, mine in links.items():
        for share, link in enumerate(mine):
            yield _stop_line(network.lanes[lane], share, len(mine)), link
    for crossing in network.crossings.values():
        if crossing.tls == signal.tls:
            yield [crossing.lane.shape[0]] * 2, crossing.link
            yield [crossing.lane.shape[-1]] * 2, crossing.link


def _stop_line(lane: Lane, share: int, shares: int) -> list[tuple[float, float]]:
    """Return one of `shares` equal parts of the stop line at a lane's end, counted from the right."""
    (x0, y0), (x1, y1) = lane.shape[-2], lane.shape[-1]
    heading = math.atan2(y1 - y0, x1 - x0)
    left = [(k / shares - 0.5) * lane.width_m * 0.9 for k in (share, share + 1)]
    return [(x1 - math.sin(heading) * way, y1 + math.cos(heading) * way) for way in left]
