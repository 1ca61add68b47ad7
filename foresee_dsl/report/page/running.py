"""The page of a campaign that still runs: how far it is, and the failures and broken expectations so far;
it loads itself again and again.

The report replaces it when the campaign ends.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import StoredResult
from foresee_dsl.files import write_whole
from foresee_dsl.report.page.html import hash_of, page_style, page_templates
from foresee_dsl.report.terminal.live import TITLES, Figures
from foresee_dsl.simulate.results.verdict import DOES_NOT_HOLD, Verdict

EVERY_S = 10.0
"""Interval at which the page is written, and at which it loads itself again, s. Ours: writing takes 5 ms."""
MOST_LISTED = 100
"""Maximum number of failures that are listed; the latest come first. Ours: a few screens."""
_FAILING = frozenset(verdict.value for verdict in Verdict if verdict.is_failure)


class RunningPage(Figures):
    """Writes the page every `EVERY_S` while a campaign runs."""

    def __init__(
        self,
        file: Path,
        settings: CampaignSettings,
        clock: Callable[[], float] = time.monotonic,
        now: Callable[[], str] = lambda: time.strftime("%H:%M:%S"),
    ) -> None:
        """Prepare to write a file.

        Args:
            file: the page. settings: settings of the campaign. clock: returns a time, s, for the intervals. now:
                returns the time of day in words.
        """
        super().__init__(clock, settings)
        self._file, self._settings, self._now = file, settings, now
        self._listed: deque[StoredResult] = deque(maxlen=MOST_LISTED)
        self._written_s = -EVERY_S

    def planned(self, kind: str, count: int) -> None:
        """Count runs that are planned."""
        super().planned(kind, count)
        self._write()

    def done(self, row: StoredResult, *, new: bool = True) -> None:
        """Count a finished run, and list it if it failed or broke an expectation."""
        super().done(row, new=new)
        fails = row.verdict in _FAILING or row.reason.startswith(DOES_NOT_HOLD)
        if row.kind in ("seed", "child") and fails:
            self._listed.appendleft(row)
        self._write()

    def text(self) -> str:
        """Return the page as HTML."""
        kinds = [kind for kind in TITLES if self.total[kind]]
        style = page_style()
        return (
            page_templates()
            .get_template("running.html.j2")
            .render(
                style=style,
                style_hash=hash_of(style),
                every_s=round(EVERY_S),
                driver=self._settings.driver,
                finished=sum(self.finished[kind] for kind in kinds),
                total=sum(self.total[kind] for kind in kinds),
                ahead=self.ahead(),
                rows=[(TITLES[kind], self.finished[kind], self.total[kind]) for kind in kinds],
                failures=self.failures,
                failed=list(self._listed),
                now=self._now(),
            )
        )

    def _write(self) -> None:
        if self._clock() - self._written_s < EVERY_S:
            return
        self._written_s = self._clock()
        with suppress(OSError):  # a full disk does not end the campaign here: its own files say so
            write_whole(self._file, self.text())
