"""Counts the results that a campaign found in its store, which were therefore not measured."""

from __future__ import annotations

from foresee_dsl.campaign.execution.engine import Listener
from foresee_dsl.campaign.storage.store import Row


class StoredCounts(Listener):
    """Counts the results that a campaign found in its store."""

    def __init__(self) -> None:
        self._reused: set[str] = set()
        self._new: set[str] = set()

    def done(self, row: Row, *, new: bool = True) -> None:
        """Record a result; two steps of this campaign may share one."""
        (self._new if new else self._reused).add(row.key)

    @property
    def count(self) -> int:
        """Return the number of results that were in the store before."""
        return len(self._reused - self._new)
