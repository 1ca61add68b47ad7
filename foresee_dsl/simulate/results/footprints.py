"""Footprints on their paths in a run, and the contacts that would follow if the actors kept their speeds along these
paths.

A *path* is the curve that a footprint followed in the run, continued straight ahead after the run's end. Ours: actors
are predicted along their paths, not along the heading of each frame. With straight lines an actor that turns at a
junction would have a small time to collision with actors waiting there, and so would two actors that meet in a bend.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import IntArray, box_overlap
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

HORIZON_S = 5.0
"""Longest TTC and PET that are reported, s. Ours: conflict studies call 1.5 s to 3 s serious."""
LOOKS_AHEAD_S = 0.1
"""Time step of the search for a contact, s; the time of the contact is then refined to a millisecond. Ours: only a
touch of two corners is shorter than a step, and the search misses it."""
_STEPS_AHEAD_S: FloatArray = np.arange(0.0, HORIZON_S + 1e-9, LOOKS_AHEAD_S)
_HALVINGS = 7
"""Number of halvings after which the step of 0.1 s is shorter than a millisecond."""


class Footprints:
    """All footprints of a run, with their paths."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.xy: FloatArray = trace.states[:, :, [X, Y]]
        self.heading: FloatArray = trace.states[:, :, HEADING]
        self.speed: FloatArray = trace.states[:, :, SPEED]
        self.size = np.array([(info.length_m, info.width_m) for info in trace.actors], dtype=np.float64)
        self.radius: FloatArray = np.hypot(self.size[:, 0], self.size[:, 1]) / 2
        delta = self.xy[:, 1:] - self.xy[:, :1]
        self.apart: FloatArray = np.hypot(delta[..., 0], delta[..., 1])
        """Distance between the centres of the ego and each other actor, [T, A - 1] m; NaN where the actor is absent."""
        self._paths: dict[int, ActorPath] = {}

    def boxes(self, frames: IntArray, actors: IntArray | int) -> FloatArray:
        """Return footprints, [N, 5]."""
        boxes = np.empty((len(frames), 5))
        boxes[:, :2], boxes[:, 2], boxes[:, 3:] = (
            self.xy[frames, actors],
            self.heading[frames, actors],
            self.size[actors],
        )
        return boxes

    def path(self, actor: int) -> ActorPath:
        """Return an actor's path; computed once and then kept."""
        if actor not in self._paths:
            self._paths[actor] = ActorPath(self, actor)
        return self._paths[actor]


class ActorPath:
    """An actor's path, as a function of the length along it, m."""

    def __init__(self, run: Footprints, actor: int) -> None:
        self.present: IntArray = np.flatnonzero(~np.isnan(run.xy[:, actor, 0]))
        self._xy, self._heading = run.xy[self.present, actor], np.unwrap(run.heading[self.present, actor])
        steps = self._xy[1:] - self._xy[:-1]
        self._along = np.zeros(len(self._xy) or 1)
        np.cumsum(np.hypot(steps[:, 0], steps[:, 1]), out=self._along[1:])
        self.along: FloatArray = np.full(len(run.xy), np.nan)
        self.along[self.present] = self._along

    def places(self, along: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and y (m) at lengths along the path, continued straight ahead beyond its end."""
        beyond = np.maximum(along - self._along[-1], 0.0)
        last = self._heading[-1]
        x = np.interp(along, self._along, self._xy[:, 0]) + beyond * math.cos(last)
        y = np.interp(along, self._along, self._xy[:, 1]) + beyond * math.sin(last)
        return x, y

    def headings(self, along: FloatArray) -> FloatArray:
        """Return the headings (rad) at lengths along the path."""
        headings: FloatArray = np.interp(along, self._along, self._heading)
        return headings


@dataclass(frozen=True)
class Contacts:
    """The predicted contacts of the ego with an actor, [N].

    Attributes:
        frames: frames with a predicted contact within `HORIZON_S`. ttc_s: time until the footprints touch.
        closing_mps: speed at which the ego comes nearer along its own heading at the touch; 0 if it stands.
        turned_rad: heading of the other relative to the ego's at the touch.
        aside_m: distance, m, by which the ego would have to drive farther to the left or to the right to pass: the
            smaller of both.
    """

    frames: IntArray
    ttc_s: FloatArray
    closing_mps: FloatArray
    turned_rad: FloatArray
    aside_m: FloatArray


_NO_CONTACTS = Contacts(np.empty(0, np.intp), *(np.empty(0) for _ in range(4)))


def predicted(run: Footprints, frames: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the ego's predicted positions after each frame, [N, steps ahead] x and y, m."""
    ego = run.path(0)
    return ego.places(ego.along[frames, None] + run.speed[frames, 0, None] * _STEPS_AHEAD_S)


def contacts_with(
    run: Footprints, actor: int, looked_at: IntArray, ego_places: tuple[FloatArray, FloatArray]
) -> Contacts:
    """Return the predicted contacts with an actor.

    Args:
        run: the run. actor: column of the other actor. looked_at: frames for which contacts are predicted. ego_places:
            what `predicted` returns for these frames.
    """
    ego, reach = run.path(0), run.radius[0] + run.radius[actor]
    closing = run.speed[looked_at, 0] + run.speed[looked_at, actor]
    can = np.flatnonzero(run.apart[looked_at, actor - 1] - reach <= closing * HORIZON_S)  # False where absent
    if not can.size:
        return _NO_CONTACTS
    frames, path = looked_at[can], run.path(actor)
    speeds = run.speed[frames, 0], run.speed[frames, actor]
    x, y = path.places(path.along[frames, None] + speeds[1][:, None] * _STEPS_AHEAD_S)
    near = (x - ego_places[0][can]) ** 2 + (y - ego_places[1][can]) ** 2 <= reach * reach
    row, column = np.nonzero(near)

    def boxes(row: IntArray, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return both footprints of each row, `tau` (s) after the frame of that row."""
        mine, theirs = ego.along[frames[row]] + speeds[0][row] * tau, path.along[frames[row]] + speeds[1][row] * tau
        return _swept(ego, mine, run.size[0]), _swept(path, theirs, run.size[actor])

    def touch(row: IntArray, tau: FloatArray) -> NDArray[np.bool_]:
        return box_overlap(*boxes(row, tau))

    touching = touch(row, _STEPS_AHEAD_S[column])
    if not touching.any():
        return _NO_CONTACTS
    row, first = np.unique(row[touching], return_index=True)
    late = _STEPS_AHEAD_S[column[touching][first]]
    early = np.maximum(late - LOOKS_AHEAD_S, 0.0)
    for _ in range(_HALVINGS):
        middle = (early + late) / 2
        there = touch(row, middle)
        early, late = np.where(there, early, middle), np.where(there, middle, late)
    ttc = np.where(touch(row, np.zeros(len(row))), 0.0, late)
    a, b = boxes(row, ttc)
    turned, (dx, dy) = b[:, 2] - a[:, 2], (b[:, :2] - a[:, :2]).T
    closes = speeds[0][row] - speeds[1][row] * np.cos(turned)
    closes = np.where(speeds[0][row] < STANDS_MPS, 0.0, np.maximum(closes, 0.0))
    aside = (a[:, 4] + across(b, turned)) / 2 - np.abs(np.cos(a[:, 2]) * dy - np.sin(a[:, 2]) * dx)
    return Contacts(frames[row], ttc, closes, turned, np.maximum(aside, 0.0))


def across(boxes: FloatArray, turned_rad: FloatArray) -> FloatArray:
    """Return the extent of footprints at right angles to a direction, m; they are turned by `turned_rad` from it."""
    extent: FloatArray = np.abs(np.sin(turned_rad)) * boxes[:, 3] + np.abs(np.cos(turned_rad)) * boxes[:, 4]
    return extent


def _swept(path: ActorPath, along: FloatArray, size: FloatArray) -> FloatArray:
    boxes = np.empty((len(along), 5))
    boxes[:, 0], boxes[:, 1] = path.places(along)
    boxes[:, 2], boxes[:, 3:] = path.headings(along), size
    return boxes
