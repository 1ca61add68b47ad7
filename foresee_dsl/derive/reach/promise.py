"""Estimates how much a change is worth: the kinds of contact that its values cause, and how many of them a careful
driver avoids.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from foresee_dsl.avoidance.candidates.behaviours import what_if
from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.avoidance.candidates.scoring import EGO_STANDS_MPS, avoidable_shares
from foresee_dsl.derive.reach.rolling import RollOut
from foresee_dsl.derive.reach.settings import ReachSettings
from foresee_dsl.forecast.settings import PEDESTRIAN_KINDS
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y

_QUARTERS = 4
_MET = "met"
"""The role of an actor that comes near the ego although nothing was changed."""


class Tale(NamedTuple):
    """A description of a contact; contacts with equal descriptions are probably the same finding.

    Attributes:
        role: class of the actor.
        course: its heading relative to the ego's, in quarters of a turn (0: the same).
        side: side of the ego where it is, in quarters (0: front, 1: left).
        place: the ego's lane.
        stands: whether the ego stands.
    """

    role: str
    course: int
    side: int
    place: int
    stands: bool


@dataclass(frozen=True, eq=False)
class ReachPromise:
    """A change of an actor, and the contacts that its values cause.

    Attributes:
        reaching: indices of the values that reach the recorded ego.
        tales: for each kind of contact, the share of the values that cause it.
        contact_frame: mean frame of the run at which values reach the ego; if none does, the frame of the smallest gap.
    """

    rolled: RollOut
    reaching: IntArray
    tales: dict[Tale, float]
    contact_frame: int

    @property
    def onset(self) -> int:
        """Return the frame at which the change begins."""
        return self.rolled.change.onset


def promise(trace: Trace, rolled: RollOut, gaps: FloatArray, settings: ReachSettings) -> ReachPromise:
    """Return the contacts of a change. `gaps`: [A, T] recorded gaps of the actors to the ego, m; infinite for
    obstacles."""
    least = rolled.gaps.min(axis=1)
    reaching = np.flatnonzero(least <= 0.0)
    first = np.where(least <= 0.0, (rolled.gaps <= 0.0).argmax(axis=1), rolled.gaps.argmin(axis=1))
    tales: dict[Tale, float] = {}
    for n in reaching.tolist():
        tale = _tale(trace, rolled, n, int(first[n]))
        tales[tale] = tales.get(tale, 0.0) + 1.0 / len(least)
    onset = rolled.change.onset
    window = gaps[:, onset : onset + round(settings.met_s / STEP_S) + 1].min(axis=1)
    nearest = int(window.argmin())
    if np.isfinite(window[nearest]):
        tales[Tale(_MET, nearest, 0, 0, stands=False)] = settings.met_weight / (1.0 + float(window[nearest]))
    among = first[reaching] if len(reaching) else first[[int(least.argmin())]]
    return ReachPromise(rolled, reaching, tales, int(rolled.frames[round(float(among.mean()))]))


def avoided_share(run: RecordedRun, promised: ReachPromise, settings: ReachSettings) -> float:
    """Return the mean share of contacts that a careful driver avoids, over `settings.decided` of the values that reach
    the ego.
    """
    rolled, change = promised.rolled, promised.rolled.change
    if not len(promised.reaching):
        return 0.0
    places = np.unique(np.round(np.linspace(0, len(promised.reaching) - 1, settings.decided)).astype(np.int64))
    last = change.onset + rolled.every * rolled.steps
    what = what_if(run.trace.actors[change.actor], change.actor, change.onset, last)
    return float(avoidable_shares(run, what, _rows(run, rolled, promised.reaching[places])).mean())


def _rows(run: RecordedRun, rolled: RollOut, chosen: IntArray) -> FloatArray:
    """Return the actor's track with each of the chosen values: [C, T, 4], laid out as in `RecordedRun.tracks`."""
    change = rolled.change
    rows = np.repeat(run.tracks[None, change.actor], len(chosen), axis=0)
    every, steps = rolled.every, rolled.steps
    poses = rolled.poses[chosen, : steps + 1]
    moved = np.diff(poses, axis=1)
    way = np.hypot(moved[..., 0], moved[..., 1]) / every
    for k in range(every):
        at = slice(change.onset + k, change.onset + every * steps, every)
        rows[:, at, :3] = poses[:, :-1] + moved * k / every
        rows[:, at, 3] = way
    return rows


def _tale(trace: Trace, rolled: RollOut, value: int, step: int) -> Tale:
    frame = int(rolled.frames[step])
    x, y, heading = rolled.poses[value, step]
    ego, info = trace.states[frame, 0], trace.actors[0]
    dx, dy = x - ego[X], y - ego[Y]
    cos, sin = math.cos(ego[HEADING]), math.sin(ego[HEADING])
    ahead, left = (dx * cos + dy * sin) / info.length_m, (dy * cos - dx * sin) / info.width_m
    side = (0 if ahead > 0 else 2) if abs(ahead) >= abs(left) else (1 if left > 0 else 3)
    course = round((heading - ego[HEADING]) / (math.tau / _QUARTERS)) % _QUARTERS
    kind = trace.actors[rolled.change.actor].kind
    role = kind if kind in PEDESTRIAN_KINDS or kind == "bicycle" else "vehicle"
    return Tale(role, course, side, int(trace.lanes[frame, 0]), bool(ego[SPEED] < EGO_STANDS_MPS))


def in_order(promises: Sequence[ReachPromise], settings: ReachSettings) -> list[ReachPromise]:
    """Return the promises, best first: each is rated by the kinds of contact that those before it do not have.

    Each earlier promise lowers the worth of its kinds of contact, in proportion to their share in it. Of two equal
    promises, the one with the later onset comes first, because it leaves less time unused.
    """
    tales = list(dict.fromkeys(tale for candidate in promises for tale in candidate.tales))
    column = {tale: k for k, tale in enumerate(tales)}
    shares = np.zeros((len(promises), len(tales)))
    for k, candidate in enumerate(promises):
        for tale, share in candidate.tales.items():
            shares[k, column[tale]] = share
    worth: FloatArray = np.ones(len(tales))
    left = list(range(len(promises)))
    order: list[ReachPromise] = []
    while left and len(order) < settings.proposals:
        gains = np.round(shares[left] @ worth, 9)
        best = max(range(len(left)), key=lambda k: (gains[k], promises[left[k]].onset, -left[k]))
        if gains[best] <= 0:
            break
        own_shares = shares[left[best]] / shares[left[best]].sum()
        worth = worth * (1.0 - (1.0 - settings.again) * own_shares)
        order.append(promises[left.pop(best)])
    return order
