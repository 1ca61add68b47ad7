"""How much of a campaign is done, and how long the rest takes: with what is likely to follow from what is known."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable

from foresee_dsl.campaign.allocation.rounds import Round
from foresee_dsl.campaign.node import AnyStep
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import STEPS
from foresee_dsl.campaign.storage.store import Row
from foresee_dsl.simulate.results.verdict import FAILURES

_STEPS = {step.kind: step for step in STEPS}


def _run_above(step: type[AnyStep]) -> str:
    above = step.follows
    while above and not _STEPS[above].drives:
        above = _STEPS[above].follows
    return above


RUNS = tuple(step for step in STEPS if step.drives)
"""The kinds of run, each after the one that it follows from."""
_ABOVE = {step.kind: _run_above(step) for step in RUNS}
"""The kind of run that each follows from; "" of the first."""
USUAL_SHARE = {"clip": 0.69, "child": 0.92}
"""How many of the runs that may follow from a run at most do follow, where the step's own `share` does not tell. Ours:
the bundled library with `pdm`, 120 test cases, 332 clips, 1220 children."""
_WEIGHT = 12
"""So many runs count as much as what is usual. Ours: the first few say little, fifty say nearly all."""
_FAILING = 0.1
"""The share of children that fail, until it is seen: a step's `share` is meant for it. Ours, as above."""
_ALIKE_FROM, _ALIKE_POWER = 64, 0.36
"""From so many failures on their findings grow with this power of them, as most tell a story that is known. Ours: the
bundled library with `pdm`, 64 failures with 24 findings to be made smaller, 1,985 with 82."""
_SHOWN_FROM = 0.02
_SMOOTH = 0.1
_EVERY_S = 0.5
_NEARLY = 0.9


class TimeLeft:
    """An estimate that changes little from one moment to the next."""

    def __init__(self, settings: CampaignSettings, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin now."""
        self._clock, self._began_s = clock, clock()
        at_most = {step.kind: step.at_most(settings) for step in RUNS}
        if "child" in at_most:
            at_most["child"] *= settings.repeat
        self._usual = {step.kind: at_most[step.kind] * USUAL_SHARE.get(step.kind, step.share) for step in RUNS}
        self._in_rounds = settings.allocation == "adaptive"
        self._children = 0
        """Where children are allocated in rounds: how many there will be, once it is known."""
        self._known: Counter[str] = Counter()
        self._finished: Counter[str] = Counter()
        self._failed: Counter[str] = Counter()
        self._here: Counter[str] = Counter()
        self._wall_s: defaultdict[str, float] = defaultdict(float)
        self._whole_s = 0.0
        self.shown_share = 0.0
        """The share of the time that is over, by the last `left_s`; it never falls."""
        self._looked_s = self._began_s

    def planned(self, kind: str, count: int) -> None:
        """So many more runs of a kind are known of."""
        self._known[kind] += count

    def round(self, begun: Round) -> None:
        """A later round of children begins."""
        self._children = max(self._children, begun.total)

    def done(self, row: Row, *, new: bool) -> None:
        """One of them is done; `new`: it took its time now."""
        self._finished[row.kind] += 1
        self._failed[row.kind] += row.verdict in FAILURES
        if new:
            self._here[row.kind] += 1
            self._wall_s[row.kind] += row.wall_s

    @property
    def share(self) -> float:
        """The share of the work that is done, 0 to 1."""
        done, whole = 0.0, 0.0
        of_kind: dict[str, float] = {}
        for step in RUNS:
            kind, above = step.kind, _ABOVE[step.kind]
            expected = of_kind.get(above, 0.0)
            if above:
                ahead = max(0.0, expected - self._finished[above])
                seen = self._finished[above]
                each = (self._known[kind] + self._usual[kind] * _WEIGHT) / (seen + _WEIGHT)
                if kind == "child" and self._in_rounds:
                    # Later rounds are given out when the ones before are over: until then what is usual counts.
                    expected = max(self._known[kind], self._children or expected * self._usual[kind])
                elif not step.after_all:
                    expected = self._known[kind] + ahead * each
                elif self._known[kind]:
                    expected = float(self._known[kind])
                else:  # it comes when all runs above are done, for those that failed
                    failing = (self._failed[above] + _FAILING * _WEIGHT) / (seen + _WEIGHT)
                    alike = max(1.0, expected * failing / _ALIKE_FROM) ** (_ALIKE_POWER - 1)
                    expected *= failing * self._usual[kind] / _FAILING * alike
            else:
                expected = float(self._known[kind])
            each_s = (self._wall_s[kind] + step.usual_s * _WEIGHT) / (self._here[kind] + _WEIGHT)
            done += self._here[kind] * each_s
            whole += max(0.0, expected - (self._finished[kind] - self._here[kind])) * each_s
            of_kind[kind] = expected
        return min(1.0, done / whole) if whole else 0.0

    @property
    def left_s(self) -> float | None:
        """Wall time until the end; None while too little is done to tell."""
        now_s, share = self._clock(), self.share
        if share < _SHOWN_FROM:
            return None
        took_s = now_s - self._began_s
        if not self._whole_s:
            self._whole_s = took_s / share
        elif (looks := (now_s - self._looked_s) / _EVERY_S) >= 1:
            self._whole_s += (1 - (1 - _SMOOTH) ** looks) * (took_s / share - self._whole_s)
            self._looked_s = now_s
        # Near the end what is left counts, not the average over the whole.
        left_s = max(took_s * (1 - share) / share if share > _NEARLY else 0.0, self._whole_s - took_s, 0.0)
        self.shown_share = max(self.shown_share, took_s / (took_s + left_s) if took_s else 0.0)
        return left_s
