"""Track numbers: one stays with an object while it is seen, and says nothing about it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from foresee_dsl.simulate.sensing.noise import keys_of

_AT_ONCE = 1024
"""Numbers are drawn in a random order from so many; then from the next so many. Ours: more than a run needs."""


@lru_cache(maxsize=16)  # the runs of a campaign mostly have one seed
def _order(seed: int) -> tuple[int, ...]:
    return tuple(np.argsort(keys_of(seed, ("tracks",), _AT_ONCE)[0], kind="stable").tolist())


class Tracks:
    """Gives out track numbers; none twice in a run."""

    def __init__(self, seed: int, forgets_frames: int) -> None:
        """Begin a run.

        Args:
            seed: of the run. forgets_frames: an object unseen for more frames gets a new number.
        """
        self._order = _order(seed)
        self._forgets = forgets_frames
        self._given = 0
        self._last: dict[int, tuple[int, int]] = {}

    def of(self, index: int, frame: int) -> int:
        """Return the number of an object that is seen at a frame (frames come in order)."""
        last = self._last.get(index)
        if last is not None and frame - last[1] <= self._forgets:
            number = last[0]
        else:
            rounds, k = divmod(self._given, _AT_ONCE)
            number = self._order[k] + rounds * _AT_ONCE
            self._given += 1
        self._last[index] = (number, frame)
        return number
