"""Measures the fidelity of a clip: how far the run of the unmutated clip is from the window of its parent's run."""

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
"""Largest deviation that `share_within` counts as within, m. Ours: a third of the permitted error of localisation on
local roads (0.29 m, Reid et al. 2019)."""


@dataclass(frozen=True)
class ClipDeviation:
    """The distances of the actors in a clip's run from their places in the parent's run.

    Attributes:
        actors: the largest distance of each actor over the compared frames, m, by the actor's id; the ego comes first.
        frames: number of compared frames: those of the window, or fewer if the clip's run ended earlier.
    """

    actors: Mapping[str, float]
    frames: int

    @property
    def ego_m(self) -> float:
        """Return the largest deviation of the ego, m.

        It deviates because its driver starts anew at the clip's beginning.
        """
        return next(iter(self.actors.values()), 0.0)

    @property
    def others_m(self) -> tuple[float, ...]:
        """Return the largest deviation of each other actor, m."""
        return tuple(self.actors.values())[1:]

    @property
    def largest_m(self) -> float:
        """Return the largest deviation of all actors, m."""
        return max(self.actors.values(), default=0.0)

    @property
    def largest_others_m(self) -> float:
        """Return the largest deviation of the actors without the ego, m."""
        return max(self.others_m, default=0.0)

    @property
    def median_others_m(self) -> float:
        """Return the median of the other actors' largest deviations, m; 0 if the ego is alone."""
        return statistics.median(self.others_m) if self.others_m else 0.0


def share_within(deviations: Sequence[float]) -> float:
    """Return the share of the deviations (m) that are at most 0.1 m, so that the actors stayed within that of their
    places in the parent's run; 1 if there are no deviations.
    """
    return sum(far <= WITHIN_M for far in deviations) / len(deviations) if deviations else 1.0


def deviation(parent: Trace, start_frame: int, child: Trace, *, without: Container[str] = frozenset()) -> ClipDeviation:
    """Compare the run of an unmutated clip with its parent's.

    While an actor is in the world in one run only, its distance is measured to its last place in the other run, unless
    it left the two runs within one frame of each other. Actors that are absent at the window's beginning are not
    compared, except those whose recorded track begins later.

    Args:
        parent: the run from which the clip was cut.
        start_frame: its frame at which the clip begins.
        child: the clip's run.
        without: actors that the clip leaves out; they are not compared.

    Raises:
        ValueError: the window does not lie in the parent's run, or the child lacks an actor of it.
    """
    if not 0 <= start_frame < parent.frames:
        raise ValueError(f"the parent's run has {parent.frames} frames, so there is no frame {start_frame}")
    frames = min(parent.frames - start_frame, child.frames)
    columns = {info.id: k for k, info in enumerate(child.actors)}
    distances: dict[str, float] = {}
    for k, info in enumerate(parent.actors):
        there = parent.states[start_frame : start_frame + frames, k, [X, Y]]
        present = np.flatnonzero(~np.isnan(there[:, 0]))
        first = int(present[0]) if present.size else frames
        if first == frames or (first > 0 and not info.path) or info.id in without:
            continue
        if info.id not in columns:
            raise ValueError(f"the clip's run has no actor {info.id!r}")
        here = child.states[:frames, columns[info.id], [X, Y]]
        distances[info.id] = _apart(here[first:], there[first:])
    # An actor that the clip could not place in the world has no position, so its distance is infinite.
    return ClipDeviation({actor: math.inf if math.isnan(far) else far for actor, far in distances.items()}, frames)


def with_fidelity(clip: Clip, measured: ClipDeviation) -> Clip:
    """Return the clip with a new `fidelity` line (to the centimetre), which replaces a present one."""
    line = Fidelity(
        deviation=Quantity.of(measured.largest_others_m, "length", 2), ego=Quantity.of(measured.ego_m, "length", 2)
    )
    body = tuple(item for item in clip.body if not isinstance(item, Fidelity))
    return clip.model_copy(update={"body": (*body, line)})


def _apart(here: NDArray[np.float64], there: NDArray[np.float64]) -> float:
    """Return the largest distance between two tracks, [T, 2] m; NaN if the actor is absent at the beginning of the
    first.
    """
    stays = [int(np.flatnonzero(~np.isnan(places[:, 0])).max(initial=-1)) + 1 for places in (here, there)]
    # A rounding error decides in which of two frames a vehicle leaves at the end of its route.
    last = min(stays) if max(stays) - min(stays) <= 1 else max(stays)
    return float(np.hypot(*(_held(here[:last]) - _held(there[:last])).T).max(initial=0.0 if last else np.nan))


def _held(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return places, [T, 2], in which frames without the actor have its last place; at the first frame it must be
    present.
    """
    last_present = np.maximum.accumulate(np.where(np.isnan(places[:, 0]), 0, np.arange(len(places))))
    held: NDArray[np.float64] = places[last_present]
    return held
