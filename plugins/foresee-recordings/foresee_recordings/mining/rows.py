"""Combinations of actors at their common frames, as rows: what a condition about several actors is evaluated on."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from foresee_recordings.mining.traffic import IntArray, Traffic, X, Y
from foresee_recordings.recording import KINDS, RecordingError

EGO = "ego"
EGO_KINDS = ("car", "van", "truck", "bus", "motorcycle")
"""Classes of actors that can be the ego: what a driver of this tool drives."""
MOST_NAMES = 3
"""Largest number of actors in a condition. Ours: with a fourth one, a minute of dense traffic takes hours."""
_TOUCHING_M = 30.0
"""Footprints of actors whose centres stay farther apart than this do not touch, m: the longest road trains are 25 m
long."""
_SAMPLED = 10
"""Pairs are first compared at every tenth frame, 0.5 s apart."""
_SLACK_M = 25.0
"""Length by which two actors can come nearer between two sampled frames, m. Ours: a quarter of a second at 100 m/s."""


@dataclass(frozen=True)
class Rows:
    """Rows, each with a frame and an actor for each name.

    Attributes:
        frames: [R]. actors: [R] number of the actor, by name. states: [R] its row in the table of states, by name.
        group: [R] number of the combination of actors; its rows are consecutive frames.
    """

    traffic: Traffic
    frames: IntArray
    actors: Mapping[str, IntArray]
    states: Mapping[str, IntArray]
    group: IntArray

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.frames)

    def at(self, chosen: NDArray[np.bool_] | IntArray) -> Rows:
        """Return some of the rows, by a mask or by their numbers."""
        return Rows(
            self.traffic,
            self.frames[chosen],
            {name: actors[chosen] for name, actors in self.actors.items()},
            {name: rows[chosen] for name, rows in self.states.items()},
            self.group[chosen],
        )


def rows_of(traffic: Traffic, names: Sequence[str], within_m: float) -> Iterator[Rows]:
    """Yield the rows of all combinations of actors, one ego at a time.

    Args:
        traffic: the recording. names: `ego`, and the others of a condition.
        within_m: actors whose centres never come nearer to the ego's than this are left out, m.

    Raises:
        RecordingError: a condition without `ego`, or with too many names.
    """
    others = [name for name in names if name != EGO]
    if EGO not in names:
        raise RecordingError("a condition to search for must be about `ego`, such as `ttc(ego, other) < 1.5 s`")
    if len(names) > MOST_NAMES:
        raise RecordingError(f"a condition to search for has at most {MOST_NAMES} actors: {', '.join(names)}")
    allowed = {name: [k for k, t in enumerate(traffic.tracks) if t.kind in kinds_of(name)] for name in names}
    near = neighbours(traffic, within_m) if others else {}
    for ego in allowed[EGO]:
        beside = {name: sorted(near.get(ego, frozenset()) & {*allowed[name]}) for name in others}
        combinations = [
            (ego, *chosen) for chosen in product(*beside.values()) if len({ego, *chosen}) == len(chosen) + 1
        ]
        for part in [combinations] if len(others) < 2 else [[c] for c in combinations]:
            rows = _joined(traffic, (EGO, *others), part, within_m)
            if len(rows):
                yield rows


def pairs_of(traffic: Traffic) -> Iterator[Rows]:
    """Yield the rows of each pair of actors once, as `a` and `b`, whose footprints may touch."""
    near = neighbours(traffic, _TOUCHING_M)
    for actor in sorted(near):
        rows = _joined(
            traffic, ("a", "b"), [(actor, other) for other in sorted(near[actor]) if other > actor], _TOUCHING_M
        )
        if len(rows):
            yield rows


def kinds_of(name: str) -> tuple[str, ...]:
    """Return the classes over which a name ranges: `pedestrian` or `truck2` over one class, `ego` over `EGO_KINDS`."""
    if name == EGO:
        return EGO_KINDS
    word = name.rstrip("0123456789_")
    return (word,) if word in KINDS else KINDS


def neighbours(traffic: Traffic, within_m: float) -> dict[int, frozenset[int]]:
    """Return for each actor those whose centres may come within a distance of its centre."""
    near: dict[int, set[int]] = defaultdict(set)
    for frame in range(0, int(traffic.last.max()) + _SAMPLED, _SAMPLED):
        # An actor that is present for less than the time between two samples counts at the sample after it begins.
        present = np.flatnonzero((traffic.first <= frame) & (traffic.last > frame - _SAMPLED))
        rows = traffic.start[present] + np.minimum(frame, traffic.last[present]) - traffic.first[present]
        xy = traffic.states[rows][:, [X, Y]]
        apart = xy[:, None] - xy
        i, j = np.nonzero((apart**2).sum(axis=2) <= (within_m + _SLACK_M) ** 2)
        for a, b in zip(present[i].tolist(), present[j].tolist(), strict=True):
            if a != b:
                near[a].add(b)
    return {actor: frozenset(others) for actor, others in near.items()}


def _joined(traffic: Traffic, names: Sequence[str], combinations: Sequence[tuple[int, ...]], within_m: float) -> Rows:
    """Return the rows of combinations of actors: from the first to the last common frame with all near the ego."""
    spans: list[tuple[tuple[int, ...], IntArray]] = []
    for actors in combinations:
        first, last = int(traffic.first[[*actors]].max()), int(traffic.last[[*actors]].min())
        if first > last:
            continue
        frames = np.arange(first, last + 1)
        near = np.ones(len(frames), dtype=np.bool_)
        middle = traffic.part(actors[0], first, last)[:, [X, Y]]
        for other in actors[1:]:
            away = traffic.part(other, first, last)[:, [X, Y]] - middle
            near &= (away**2).sum(axis=1) <= within_m**2
        at = np.flatnonzero(near)
        if len(at):
            spans.append((actors, frames[at[0] : at[-1] + 1]))
    counts = [len(frames) for _, frames in spans]
    frames = np.concatenate([frames for _, frames in spans]) if spans else np.empty(0, np.int64)
    chosen = {
        name: np.repeat(np.array([actors[k] for actors, _ in spans], dtype=np.int64), counts)
        for k, name in enumerate(names)
    }
    states = {name: traffic.start[actors] + frames - traffic.first[actors] for name, actors in chosen.items()}
    return Rows(traffic, frames, chosen, states, np.repeat(np.arange(len(spans)), counts))
