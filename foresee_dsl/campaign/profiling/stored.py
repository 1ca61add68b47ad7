"""Which results of a campaign were not measured, as they were in the store."""

from __future__ import annotations

from foresee_dsl.campaign.execution.engine import Listener
from foresee_dsl.campaign.storage.store import Row


class Stored(Listener):
    """Counts the results that a campaign found in its store."""

    def __init__(self) -> None:
        self._found: set[str] = set()
        self._new: set[str] = set()

    def done(self, row: Row, *, new: bool = True) -> None:
        """Note one; two steps of this campaign may have one result."""
        (self._new if new else self._found).add(row.key)

    @property
    def count(self) -> int:
        """How many were there before."""
        return len(self._found - self._new)
