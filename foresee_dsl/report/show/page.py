"""The page of `foresee show`: headline, story, differences from the parent, timeline and strip."""

from __future__ import annotations

import math
import shlex
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rich.text import Text

from foresee_dsl.language.diff.addresses import diff_cases
from foresee_dsl.language.diff.rendering import render_groups
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.show.characters import legend_lines, pair_lines, strip_lines
from foresee_dsl.report.show.measures import Measures, measure, signal_ahead
from foresee_dsl.report.show.panels import Strip, Up
from foresee_dsl.report.show.sources import ShownRun
from foresee_dsl.report.show.strip import make_strip
from foresee_dsl.report.show.timeline import timeline
from foresee_dsl.report.verdicts import unfired_lines
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

DIFFERS_M, DIFFERS_MPS, DIFFERS_RAD = 0.05, 0.05, 0.01
"""Differences up to this size in place (m), speed (m/s) and heading (rad) are ignored. Ours: 0.05 m in a picture is
less than a pixel."""
VISIBLE_M = 0.3
"""Two panels differ visibly if the places of an actor in them are at least this far apart, m. Ours: one dot of a panel
in characters, at 16 m a side."""
_MOST = 6
"""Maximum number of actors that are named. Ours: with more names, a reader would not see what matters."""


@dataclass(frozen=True)
class Departure:
    """How an actor first deviates from the parent's run.

    Attributes:
        actor: id of the actor.
        time_s: time of the first deviation, s.
        how: that deviation in words.
        largest_m, largest_at_s: largest distance between the actor's places in both runs, m, and its time, s, while
        both runs last.
        model: the names of both models; "" if they are the same.
    """

    actor: str
    time_s: float
    largest_m: float
    largest_at_s: float
    how: str
    model: str = ""


def departures(parent: Trace, child: Trace) -> tuple[Departure, ...]:
    """Return the actors that move differently in the child's run, in the order in which they first deviate."""
    frames = min(parent.frames, child.frames)
    columns = {info.id: k for k, info in enumerate(parent.actors)}
    listed = []
    for k, info in enumerate(child.actors):
        if info.id not in columns:
            listed.append(Departure(info.id, 0.0, 0.0, 0.0, "is only in this run"))
            continue
        column = columns[info.id]
        model = parent.actors[column].model
        departure = _departure(parent, child, column, k, frames)
        if model != info.model:
            moves = departure or Departure(info.id, 0.0, 0.0, 0.0, "")
            departure = replace(moves, time_s=0.0, model=f"{model} => {info.model}")
        if departure is not None:
            listed.append(departure)
    gone = columns.keys() - {info.id for info in child.actors}
    listed += [Departure(name, 0.0, 0.0, 0.0, "is not in this run") for name in sorted(gone)]
    return tuple(sorted(listed, key=lambda departure: (departure.time_s, departure.actor != "ego", departure.actor)))


def parts_from(parent: Trace, child: Trace) -> float:
    """Return the time from which pictures of both runs differ visibly, s: an actor is `VISIBLE_M` away; infinite if
    they never do.
    """
    frames = min(parent.frames, child.frames)
    ids = {info.id: k for k, info in enumerate(parent.actors)}
    pairs = [(ids[info.id], k) for k, info in enumerate(child.actors) if info.id in ids]
    was, now = (trace.states[:frames][:, list(columns), :2]
                for trace, columns in zip((parent, child), zip(*pairs, strict=True), strict=True))  # fmt: skip
    far = np.hypot(*np.moveaxis(now - was, 2, 0))
    apart = ((far > VISIBLE_M) | (np.isnan(was[..., X]) != np.isnan(now[..., X]))).any(axis=1)
    if not apart.any():
        return math.inf if parent.frames >= child.frames else float(child.time_s[frames])
    return float(child.time_s[int(apart.argmax())])


def _departure(parent: Trace, child: Trace, a: int, b: int, frames: int) -> Departure | None:
    was, now = parent.states[:frames, a], child.states[:frames, b]
    gone = np.isnan(was[:, X]) != np.isnan(now[:, X])
    far = np.nan_to_num(np.hypot(now[:, X] - was[:, X], now[:, Y] - was[:, Y]))
    faster = np.nan_to_num(now[:, SPEED] - was[:, SPEED])
    turned = np.nan_to_num(np.abs((now[:, HEADING] - was[:, HEADING] + np.pi) % (2 * np.pi) - np.pi))
    differs = gone | (far > DIFFERS_M) | (np.abs(faster) > DIFFERS_MPS) | (turned > DIFFERS_RAD)
    if not differs.any():
        return None
    first, largest = int(differs.argmax()), int(far.argmax())
    if gone[first]:
        how = "is gone" if np.isnan(now[first, X]) else "is still there"
    elif abs(faster[first]) > DIFFERS_MPS:
        how = f"is {abs(float(faster[first])):.1f} m/s {'faster' if faster[first] > 0 else 'slower'}"
    elif far[first] > DIFFERS_M:
        how = f"is {float(far[first]):.2f} m elsewhere"
    else:
        how = f"is turned by {np.degrees(float(turned[first])):.1f} deg"
    name = child.actors[b].id
    return Departure(name, float(child.time_s[first]), float(far[largest]), float(child.time_s[largest]), how)


def in_words(departing: Sequence[Departure]) -> tuple[str, ...]:
    """Return a sentence for each deviating actor, in the order in which they first deviate."""
    lines = []
    for departure in departing[:_MOST]:
        model = f"is another model ({departure.model})" if departure.model else ""
        how = ", and ".join(part for part in (model, departure.how) if part)
        grows = (
            f", up to {departure.largest_m:.1f} m away at {departure.largest_at_s:.2f} s"
            if departure.largest_m > DIFFERS_M
            else ""
        )
        lines.append(f"from {departure.time_s:.2f} s {departure.actor} {how}{grows}")
    if len(departing) > _MOST:
        lines.append(f"and {len(departing) - _MOST} more")
    return tuple(lines) or ("all actors move in the same way, so both runs are the same",)


_PATH = 4000
"""Maximum length of a path, characters. A path of this length is not cut, and no system allows longer ones."""


@dataclass(frozen=True)
class Page:
    """A run and, if it is a mutant's, the run of its parent. `up`, `most`: see `make_strip`."""

    run: ShownRun
    parent: ShownRun | None
    up: Up = "ego"
    most: int = 6

    @cached_property
    def strips(self) -> tuple[Strip, ...]:
        """Return the strip of the run; if there is a parent, first the parent's strip at the same moments and
        places.
        """
        run, parent = self.run, self.parent
        title = "" if parent is None else f"this run: {_ended(run.trace)}"
        own = make_strip(run.trace, run.case, run.story, title=title, up=self.up, most=self.most)
        if parent is None:
            return (own,)
        return make_strip(parent.trace, parent.case, title=f"its parent: {_ended(parent.trace)}", like=own), own

    @cached_property
    def departures(self) -> tuple[Departure, ...]:
        """Return the actors that move differently from the parent's run; none without a parent."""
        return departures(self.parent.trace, self.run.trace) if self.parent is not None else ()

    def lines(self, width: int, *, wrap: bool) -> Iterator[Text]:
        """Yield the page line by line.

        Args:
            width: columns. wrap: whether sentences are broken at the width; otherwise each is one line, for a pipe.
        """
        yield from self.head(width, wrap=wrap)
        yield Text()
        yield from self.timeline(width)
        yield Text()
        yield from self.pictures(width)
        yield from self.foot()

    def head(self, width: int, *, wrap: bool) -> Iterator[Text]:
        """Yield the part above the timeline: result, story, unfired triggers, differences from the parent."""
        run, story = self.run, self.run.story
        meta = run.trace.meta
        verdict = next((v for v in Verdict if v.value == meta.get("verdict")), None)
        reason = safe(meta.get("reason", ""))
        yield Text.assemble((safe(run.address, _PATH), "bold"))
        yield Text.assemble((reason, verdict.style if verdict else ""))
        source = f", from {safe(run.trace_file, _PATH)}" if run.trace_file is not None else ""
        yield Text(f"driver {safe(run.driver)} {safe(meta.get('driver_version', ''))}, seed {run.seed}{source}", "dim")
        yield Text()
        if story.sentence and safe(story.sentence) != reason:
            yield from _wrapped(safe(story.sentence, 1000), width if wrap else 0, "")
            yield Text()
        for moment in story.moments:
            text = f"{moment.time_s:6.2f} s  {safe(moment.text)}"
            yield from _wrapped(text, width if wrap else 0, " " * 10)
        origin = run.case.mutant.origin if run.case.mutant is not None else None
        if origin is not None and origin.why:
            yield Text()
            yield from _wrapped(f"Why it was made: {safe(origin.why, 1000)}", width if wrap else 0, "  ")
        if run.case.clip is None:
            yield from unfired_lines(run.unfired, width if wrap else 0)
        if self.parent is not None:
            yield Text()
            yield from self._differences(self.parent, width if wrap else 0)

    def timeline(self, width: int) -> Iterator[Text]:
        """Yield the timeline, with the moments of the strip marked."""
        strip = self.strips[-1]
        before = _measured(self.parent, self.strips[0].opponent) if self.parent is not None else None
        measures, signals = _measured(self.run, strip.opponent), signal_ahead(self.run.trace, self.run.case)
        yield from timeline(measures, strip.moments, strip.opponent, width, parent=before, signals=signals)

    def pictures(self, width: int) -> Iterator[Text]:
        """Yield the strip; after the first visible difference from the parent's strip, both strips side by side."""
        *parents, own = self.strips
        if not parents:
            yield from strip_lines(own, width)
        else:
            from_s = parts_from(self.parent.trace, self.run.trace) if self.parent is not None else math.inf
            same, other = (tuple(panel for panel in own.panels if (panel.snapshot.time_s < from_s) is together)
                           for together in (True, False))  # fmt: skip
            if same:
                yield Text(f"both runs{f', the same until {from_s:.2f} s' if other else ''}", style="bold")
                yield from strip_lines(replace(own, panels=same), width)
            yield from pair_lines(parents[0], replace(own, panels=other), width)
        yield from legend_lines(self.strips, width)

    def foot(self) -> Iterator[Text]:
        """Yield the command that repeats the run."""
        run = self.run
        parts = ["foresee", "run", safe(run.address, _PATH), "--driver", safe(run.driver)]
        parts += ["--seed", str(run.seed)] if run.seed else []
        yield Text(shlex.join(parts), style="cyan")

    def _differences(self, parent: ShownRun, width: int) -> Iterator[Text]:
        yield Text.assemble(("Its parent ", "bold"), (safe(parent.address, _PATH), "bold"), f": {_ended(parent.trace)}")
        for line in render_groups(diff_cases(parent.case, self.run.case)).splitlines():
            if line.strip():
                yield Text(f"  {safe(line)}")
        for sentence in in_words(self.departures):
            yield from _wrapped(f"  {safe(sentence)}", width, "    ")


def _measured(run: ShownRun, opponent: str) -> Measures:
    return measure(run.trace, run.bundle, opponent)


def _ended(trace: Trace) -> str:
    return safe(trace.meta.get("reason") or trace.meta.get("verdict", ""))


def _wrapped(text: str, width: int, indent: str) -> Iterator[Text]:
    """Yield a sentence in lines of a width; width 0: in one line."""
    if not width:
        yield Text(text)
        return
    yield from map(Text, textwrap.wrap(text, width, subsequent_indent=indent, break_on_hyphens=False))
