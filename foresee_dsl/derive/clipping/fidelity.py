"""How true a clip is to its parent: the unmutated clip is run and compared with the window it was cut from."""

from __future__ import annotations

import math
import statistics
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.language.model import Clip, Fidelity, Quantity
from foresee_dsl.simulate.trace import Trace, X, Y

WITHIN_M = 0.1
"""The deviation that counts as none in `share_within`. Ours: a third of what localisation on local roads may be off
(0.29 m, Reid et al. 2019)."""


@dataclass(frozen=True)
class Deviation:
    """How far the actors of a clip's run were from where their parent's run had them.

    Attributes:
        actors: by id, the largest distance over the compared frames, m; the ego is the first of them.
        frames: how many frames were compared: the window, or less where the clip's run ended earlier.
    """

    actors: Mapping[str, float]
    frames: int

    @property
    def ego_m(self) -> float:
        """The ego's: its driver starts afresh where the clip begins."""
        return next(iter(self.actors.values()), 0.0)

    @property
    def others_m(self) -> tuple[float, ...]:
        """Those of the others."""
        return tuple(self.actors.values())[1:]

    @property
    def largest_m(self) -> float:
        """The largest of all."""
        return max(self.actors.values(), default=0.0)

    @property
    def largest_others_m(self) -> float:
        """The largest without the ego."""
        return max(self.others_m, default=0.0)

    @property
    def median_others_m(self) -> float:
        """The median without the ego (0 when it is alone)."""
        return statistics.median(self.others_m) if self.others_m else 0.0

    @property
    def share_within(self) -> float:
        """Which share of all stayed within 0.1 m."""
        return share_within(tuple(self.actors.values()))

    @property
    def share_others_within(self) -> float:
        """Which share of the others did."""
        return share_within(self.others_m)


def share_within(deviations: Sequence[float]) -> float:
    """Return which share of some deviations (m) is within 0.1 m; 1 where there are none."""
    return sum(far <= WITHIN_M for far in deviations) / len(deviations) if deviations else 1.0


def deviation(parent: Trace, start_frame: int, child: Trace, *, without: Container[str] = frozenset()) -> Deviation:
    """Compare the run of an unmutated clip with its parent's.

    An actor that is in the world in one of the runs only counts with its distance from where it was last in the
    other, unless it left both within a frame of each other. Actors that the parent did not have at the window's
    beginning are not compared.

    Args:
        parent: the run that the clip was cut from.
        start_frame: the frame of it at which the clip begins.
        child: the clip's run.
        without: actors that the clip leaves out, which are not compared either.

    Raises:
        ValueError: the window does not lie in the parent's run, or the child lacks an actor that was there.
    """
    if not 0 <= start_frame < parent.frames:
        raise ValueError(f"the parent's run has {parent.frames} frames, none is {start_frame}")
    frames = min(parent.frames - start_frame, child.frames)
    columns = {info.id: k for k, info in enumerate(child.actors)}
    found: dict[str, float] = {}
    for k, info in enumerate(parent.actors):
        there = parent.states[start_frame : start_frame + frames, k, [X, Y]]
        if not frames or np.isnan(there[0, 0]) or info.id in without:
            continue
        if info.id not in columns:
            raise ValueError(f"the clip's run has no actor {info.id!r}")
        here = child.states[:frames, columns[info.id], [X, Y]]
        found[info.id] = _apart(here, there)
    # An actor that the clip could not put into the world at all has no place: infinitely far.
    return Deviation({actor: math.inf if math.isnan(far) else far for actor, far in found.items()}, frames)


def with_fidelity(clip: Clip, found: Deviation) -> Clip:
    """Return the clip with its `fidelity` line (centimetres), in place of the one that it may have had."""
    line = Fidelity(
        deviation=Quantity.of(found.largest_others_m, "length", 2), ego=Quantity.of(found.ego_m, "length", 2)
    )
    body = tuple(item for item in clip.body if not isinstance(item, Fidelity))
    return clip.model_copy(update={"body": (*body, line)})


def _apart(here: NDArray[np.float64], there: NDArray[np.float64]) -> float:
    """Return the largest distance between two tracks ([T, 2], m), NaN where the first is absent at the beginning."""
    stays = [int(np.flatnonzero(~np.isnan(places[:, 0])).max(initial=-1)) + 1 for places in (here, there)]
    # A vehicle at the end of its route leaves in one frame or the next: a matter of rounding.
    last = min(stays) if max(stays) - min(stays) <= 1 else max(stays)
    return float(np.hypot(*(_held(here[:last]) - _held(there[:last])).T).max(initial=0.0 if last else np.nan))


def _held(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fill the frames at which an actor is absent with where it was last ([T, 2], the first frame is filled)."""
    known = np.maximum.accumulate(np.where(np.isnan(places[:, 0]), 0, np.arange(len(places))))
    held: NDArray[np.float64] = places[known]
    return held
