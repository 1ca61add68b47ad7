"""The page of `foresee show`: headline, story, differences from the parent, timeline and strip."""

from __future__ import annotations

import math
import shlex
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from rich.text import Text

from foresee_dsl.language.diff.addresses import diff_cases
from foresee_dsl.language.diff.rendering import render_groups
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.show.characters import legend_lines, pair_lines, strip_lines
from foresee_dsl.report.show.differences import Departure, departures, in_words, parts_from
from foresee_dsl.report.show.measures import Measures, measure, signal_ahead
from foresee_dsl.report.show.panels import Strip, Up
from foresee_dsl.report.show.sources import ShownRun
from foresee_dsl.report.show.timeline import timeline
from foresee_dsl.report.strip import make_strip
from foresee_dsl.report.unfired import unfired_lines
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

_PATH = 4000
"""Maximum length of a path, characters: paths are not cut, because no system allows longer ones."""


@dataclass(frozen=True)
class Page:
    """A run, and the parent's run if it is a mutant's. `up`, `most`: see `make_strip`."""

    run: ShownRun
    parent: ShownRun | None
    up: Up = "ego"
    most: int = 6

    @cached_property
    def strips(self) -> tuple[Strip, ...]:
        """The run's strip; before it the parent's strip at the same moments and places, if there is a parent."""
        run, parent = self.run, self.parent
        title = "" if parent is None else f"this run: {_ended(run.trace)}"
        own = make_strip(run.trace, run.case, run.story, title=title, up=self.up, most=self.most)
        if parent is None:
            return (own,)
        return make_strip(parent.trace, parent.case, title=f"its parent: {_ended(parent.trace)}", like=own), own

    @cached_property
    def departures(self) -> tuple[Departure, ...]:
        """The actors that move differently from the parent's run; none without a parent."""
        return departures(self.parent.trace, self.run.trace) if self.parent is not None else ()

    def lines(self, width: int, *, wrap: bool) -> Iterator[Text]:
        """Yield the page line by line.

        Args:
            width: columns. wrap: break sentences at the width; otherwise each is one line, for a pipe.
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
        """Yield the strip; from the first visible difference from the parent's on, both strips side by side."""
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
