"""Estimates how much of a campaign is done and how long the rest takes, including runs that are not planned yet."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable

from foresee_dsl.campaign.allocation.rounds import Round
from foresee_dsl.campaign.execution.engine import Listener
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import FAILED, STEPS
from foresee_dsl.campaign.steps.step import AnyStep
from foresee_dsl.campaign.storage.store import Row

_STEPS = {step.kind: step for step in STEPS}


def _run_above(step: type[AnyStep]) -> str:
    above = step.follows
    while above and not _STEPS[above].drives:
        above = _STEPS[above].follows
    return above


RUNS = tuple(step for step in STEPS if step.drives)
"""The steps that run test cases, clips or mutants, in an order in which each comes after the step that it depends
on."""
_ABOVE = {step.kind: _run_above(step) for step in RUNS}
"""For each kind of run, the kind on which it depends; "" for the first."""
USUAL_SHARE = {"clip": 0.69, "child": 0.92}
"""Share of the maximum number of runs of a kind (per run of the kind on which it depends) that usually takes place; it
replaces the step's own `share`. Ours: measured with the bundled library and `pdm`, which gave 120 test cases, 332 clips
and 1220 children."""
_WEIGHT = 12
"""Number of measured runs that have as much weight as the usual values. Ours: the first few runs change the estimate
little, and after fifty the measured runs nearly determine it."""
_FAILING = 0.1
"""Share of children that are assumed to fail until runs have shown it; a step's `share` refers to it. Ours, measured as
above."""
_ALIKE_FROM, _ALIKE_POWER = 64, 0.36
"""From the first number of failures on, the number of findings is assumed to grow as the number of failures to the
power of the second value, because most failures repeat a story. Ours: measured with the bundled library and `pdm`,
where 64 failures had 24 findings to be minimised, and 1,985 failures had 82."""
_SHOWN_FROM = 0.02
"""An estimate is shown when this share of the work is done. Ours."""
_SMOOTH = 0.1
"""Weight of the newest estimate of the campaign's duration in the running average of these estimates, which is updated
every `_EVERY_S`. Ours."""
_EVERY_S = 0.5
"""Wall time between two updates of that average, s. Ours."""
_NEARLY = 0.9
"""From this share of the work on, the time left is at least the time that the remaining work takes at the average rate.
Ours."""


class TimeLeft(Listener):
    """Counts a campaign's runs, and estimates the time left, so that the estimate changes little from one moment to the
    next.
    """

    def __init__(self, settings: CampaignSettings, clock: Callable[[], float] = time.monotonic) -> None:
        """Start the clock; `clock` returns the current time, s."""
        self._clock, self._began_s = clock, clock()
        self.total: Counter[str] = Counter()
        """Number of planned runs by kind."""
        self.finished: Counter[str] = Counter()
        self.run_here: Counter[str] = Counter()
        """The finished runs that were not in the store, counted by kind."""
        at_most = {step.kind: step.at_most(settings) for step in RUNS}
        at_most["child"] *= settings.repeat
        self._usual = {step.kind: at_most[step.kind] * USUAL_SHARE.get(step.kind, step.share) for step in RUNS}
        self._in_rounds = settings.in_rounds
        self._children = 0
        """Total number of children in all rounds; 0 until a later round states it, or if there are no rounds."""
        self._failed: Counter[str] = Counter()
        self._wall_s: defaultdict[str, float] = defaultdict(float)
        self._whole_s = 0.0
        self.shown_share = 0.0
        """Share of the whole time that had passed at the last call of `left_s`; it never decreases."""
        self._looked_s = self._began_s

    def planned(self, kind: str, count: int) -> None:
        """Count further planned runs of a kind."""
        self.total[kind] += count

    def round(self, begun: Round) -> None:
        """Take the total number of children from a round that begins."""
        self._children = max(self._children, begun.total)

    def done(self, row: Row, *, new: bool = True) -> None:
        """Count a finished run; `new`: whether it was run now, not taken from the store."""
        self.finished[row.kind] += 1
        self._failed[row.kind] += row.verdict in FAILED
        if new:
            self.run_here[row.kind] += 1
            self._wall_s[row.kind] += row.wall_s

    @property
    def share(self) -> float:
        """Return the share of the work that is done, 0 to 1."""
        done, whole = 0.0, 0.0
        of_kind: dict[str, float] = {}
        for step in RUNS:
            kind, above = step.kind, _ABOVE[step.kind]
            expected = of_kind.get(above, 0.0)
            if above:
                ahead = max(0.0, expected - self.finished[above])
                seen = self.finished[above]
                each = (self.total[kind] + self._usual[kind] * _WEIGHT) / (seen + _WEIGHT)
                if kind == "child" and self._in_rounds:
                    # A round is planned only when the round before has ended; until then the usual number of children
                    # is assumed.
                    expected = max(self.total[kind], self._children or expected * self._usual[kind])
                elif not step.after_all:
                    expected = self.total[kind] + ahead * each
                elif self.total[kind]:
                    expected = float(self.total[kind])
                else:  # this step comes after all runs above it, and only for those that failed
                    failing = (self._failed[above] + _FAILING * _WEIGHT) / (seen + _WEIGHT)
                    alike = max(1.0, expected * failing / _ALIKE_FROM) ** (_ALIKE_POWER - 1)
                    expected *= failing * self._usual[kind] / _FAILING * alike
            else:
                expected = float(self.total[kind])
            each_s = (self._wall_s[kind] + step.usual_s * _WEIGHT) / (self.run_here[kind] + _WEIGHT)
            done += self.run_here[kind] * each_s
            whole += max(0.0, expected - (self.finished[kind] - self.run_here[kind])) * each_s
            of_kind[kind] = expected
        return min(1.0, done / whole) if whole else 0.0

    @property
    def left_s(self) -> float | None:
        """Return the estimated wall time until the end, s; None while less than `_SHOWN_FROM` of the work is done."""
        now_s, share = self._clock(), self.share
        if share < _SHOWN_FROM:
            return None
        took_s = now_s - self._began_s
        if not self._whole_s:
            self._whole_s = took_s / share
        elif (looks := (now_s - self._looked_s) / _EVERY_S) >= 1:
            self._whole_s += (1 - (1 - _SMOOTH) ** looks) * (took_s / share - self._whole_s)
            self._looked_s = now_s
        # Near the end, the remaining work says more than the average over the whole campaign.
        left_s = max(took_s * (1 - share) / share if share > _NEARLY else 0.0, self._whole_s - took_s, 0.0)
        self.shown_share = max(self.shown_share, took_s / (took_s + left_s) if took_s else 0.0)
        return left_s
