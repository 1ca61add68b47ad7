"""What is said of a campaign while it runs."""

from __future__ import annotations

from typing import Protocol

from foresee_dsl.campaign.storage.records import Kind
from foresee_dsl.campaign.storage.store import Row


class Listener(Protocol):
    """Is told while a campaign runs: a progress bar, a log."""

    def planned(self, kind: Kind, count: int) -> None:
        """So many more steps of a kind are known of."""

    def known(self, row: Row) -> None:
        """One of them was in the store."""

    def finished(self, row: Row) -> None:
        """One of them was done, and is in the store."""

    def broken(self, what: str) -> None:
        """One of them cannot be done."""


class Silent:
    """Hears everything and says nothing."""

    def planned(self, kind: Kind, count: int) -> None:
        """Say nothing."""

    def known(self, row: Row) -> None:
        """Say nothing."""

    def finished(self, row: Row) -> None:
        """Say nothing."""

    def broken(self, what: str) -> None:
        """Say nothing."""
