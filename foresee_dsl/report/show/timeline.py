"""The timeline of a run: a line each for speeds, accelerations, gap, time to collision and visibility."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from rich.text import Text

from foresee_dsl.kernels.arrays import BoolArray, FloatArray
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.report.drawing.palette import PAINTS
from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.measures import Measures
from foresee_dsl.report.show.moments import Snapshot

_BARS = " ▁▂▃▄▅▆▇█"
_LABEL, _FIGURES = 18, 17
"""Widths of a line's name and of the figures at its end, columns."""
_LEAST_COLUMNS, _MOST_COLUMNS = 20, 120
LEAST_MPS2 = 0.5
"""A line of an acceleration that never exceeds this is left out, m/s^2. Ours: half of the gentlest braking."""
GAP_MOST_M = 50.0
"""A gap of at least this size has a full bar, m."""
_EGO, _OTHER = PAINTS["ego"].terminal, PAINTS["opponent"].terminal
_WAS = "  in its parent"


@dataclass(frozen=True)
class TimelineLine:
    """A line of the timeline: its name, a sign for each column, the figures at its end, and its style."""

    name: str
    signs: str
    figures: str
    style: str = ""


def timeline(
    measures: Measures,
    moments: Sequence[Snapshot],
    opponent: str,
    width: int,
    *,
    parent: Measures | None = None,
    signals: Sequence[str] = (),
) -> Iterator[Text]:
    """Yield the lines of a timeline, with the letters of the moments above and the seconds below.

    Args:
        measures: values of the run. moments: moments of the strip. opponent: id of the opponent, "" for none.
        width: columns. parent: values of the parent's run, shown below those of this run to the same scale.
        signals: colour of the signal ahead of the ego at each frame, "" for none.
    """
    columns = min(max(width - _LABEL - _FIGURES - 2, _LEAST_COLUMNS), _MOST_COLUMNS)
    scale = _Scale(measures.time_s, columns)
    yield Text(f"{'':<{_LABEL}} {scale.marks(moments)}".rstrip(), style="bold")
    for line in _lines(measures, opponent, scale, None if parent is None else _as_long(parent, len(measures.time_s))):
        name = shortened(line.name, _LABEL)
        yield Text.assemble(f"{name:<{_LABEL}} ", (f"{line.signs:<{columns}}", line.style), f" {line.figures}")
    if any(signals):
        yield _signal_line(scale.middle(signals), columns)
    yield Text(f"{'':<{_LABEL}} {scale.seconds()}", style="dim")


_LAMPS = {colour: (colour[0], PAINTS[colour].terminal) for colour in ("red", "amber", "green")} | {"": ("·", "dim")}


def _signal_line(colours: Sequence[str], columns: int) -> Text:
    """Return the line of the signal ahead: a letter for each column."""
    line = Text(f"{'signal ahead':<{_LABEL}} ")
    for colour in colours:
        line.append(*_LAMPS[colour])
    last = next((colour for colour in reversed(colours) if colour), "")
    return line.append(" " * (columns - len(colours)) + (f" {last} at the end" if colours[-1] else ""))


def _as_long(measures: Measures, frames: int) -> Measures:
    """Return measures of this number of frames: cut, or extended with NaN (False)."""
    rest = max(frames - len(measures.time_s), 0)
    fitted: dict[str, Any] = {
        name: np.concatenate([values[:frames], np.full(rest, np.nan).astype(values.dtype) if rest else values[:0]])
        for name, values in vars(measures).items()
    }
    if rest:
        fitted["ego_sees"][-rest:] = fitted["other_sees"][-rest:] = False  # a comparison with NaN would be true here
    return Measures(**fitted)


class _Scale:
    """The frames that each column of the timeline stands for."""

    def __init__(self, time_s: FloatArray, columns: int) -> None:
        self._time_s, self._columns = time_s, columns
        frames = len(time_s)
        edges = np.linspace(0, frames, columns + 1)
        self._spans = [
            slice(min(int(a), frames - 1), max(int(b), min(int(a), frames - 1) + 1))
            for a, b in pairwise(edges.tolist())
        ]

    def of(self, values: FloatArray, worst: Callable[[FloatArray], float]) -> list[float]:
        """Return a value for each column: the worst value at its frames; NaN if they have none."""
        worsts = []
        for span in self._spans:
            part = values[span][~np.isnan(values[span])]
            worsts.append(float(worst(part)) if part.size else math.nan)
        return worsts

    def any(self, holds: BoolArray) -> list[bool]:
        """Return for each column whether a condition holds in at least half of its frames."""
        return [bool(holds[span].mean() >= 0.5) for span in self._spans]

    def middle(self, values: Sequence[str]) -> list[str]:
        """Return for each column the value at the middle of its frames."""
        return [values[(span.start + span.stop - 1) // 2] for span in self._spans]

    def column(self, time_s: float) -> int:
        """Return the column of a time."""
        return min(int(time_s / self._step_s), self._columns - 1)

    def marks(self, moments: Sequence[Snapshot]) -> str:
        """Return the letters of moments at their columns; a letter whose column is occupied moves to the right."""
        signs = [" "] * self._columns
        for moment in moments:
            free = [k for k in range(self.column(moment.time_s), self._columns) if signs[k] == " "]
            if free:
                signs[free[0]] = moment.letter
        return "".join(signs)

    def seconds(self) -> str:
        """Return the axis: the numbers of seconds at their columns."""
        end = float(self._time_s[-1]) if len(self._time_s) else 0.0
        step = next(step for step in (0.5, 1, 2, 5, 10, 20, 50, 100) if step == 100 or end / step <= self._columns / 7)
        signs = [" "] * (self._columns + 4)
        for k in range(int(end / step) + 1):
            text, at = f"{k * step:g}", self.column(k * step)
            signs[at : at + len(text)] = text
        return "".join(signs).rstrip() + " s"

    @property
    def _step_s(self) -> float:
        end = float(self._time_s[-1]) if len(self._time_s) else 0.0
        return max(end, 0.05) / max(self._columns - 1, 1)


def _lines(measures: Measures, opponent: str, scale: _Scale, parent: Measures | None) -> Iterator[TimelineLine]:
    was = (None, None, None) if parent is None else (parent.ego_mps, parent.other_mps, parent.gap_m)
    yield from _motion("ego", measures.ego_mps, measures.ego_mps2, scale, _EGO, was[0])
    if not opponent:
        return
    stands = not _most(measures.other_mps) > STANDS_MPS  # of a static object, speed and sight are left out
    if not stands:
        yield from _motion(opponent, measures.other_mps, measures.other_mps2, scale, _OTHER, was[1])
    most = min(_most(measures.gap_m), GAP_MOST_M)
    yield TimelineLine("gap", _bars(scale.of(measures.gap_m, np.min), most), f"least {_least(measures.gap_m):.2f} m")
    if was[2] is not None and np.isfinite(was[2]).any():
        yield TimelineLine(_WAS, _bars(scale.of(was[2], np.min), most), f"least {_least(was[2]):.2f} m", "dim")
    if np.isfinite(measures.ttc_s).any():
        worst = scale.of(measures.ttc_s, np.min)
        signs = "".join("·" if not math.isfinite(value) else str(min(int(value), 9)) for value in worst)
        yield TimelineLine("time to collision", signs, f"least {_least(measures.ttc_s):.2f} s")
    yield from _sight("ego sees", measures.ego_sees, measures, scale, _EGO)
    if not stands:
        yield from _sight("seen by", measures.other_sees, measures, scale, _OTHER)


def _motion(
    name: str, mps: FloatArray, mps2: FloatArray, scale: _Scale, style: str, was: FloatArray | None
) -> Iterator[TimelineLine]:
    """Yield the lines of an actor's speed, its speed in the parent's run, its braking and its acceleration."""
    present = mps[~np.isnan(mps)]
    if not present.size:
        return
    most_kmh = _most(mps if was is None else np.concatenate([mps, was])) * 3.6
    title = f"{shortened(name, _LABEL - 6)} speed"
    yield TimelineLine(title, _bars(scale.of(mps * 3.6, np.mean), most_kmh), _kmh(present), style)
    if was is not None and (before := was[~np.isnan(was)]).size:
        yield TimelineLine(_WAS, _bars(scale.of(was * 3.6, np.mean), most_kmh), _kmh(before), "dim")
    for word, signed in (("brakes", -mps2), ("speeds up", mps2)):
        most = _most(signed)
        if most > LEAST_MPS2:
            bars = _bars([max(value, 0.0) for value in scale.of(signed, np.max)], most, least=LEAST_MPS2)
            yield TimelineLine(f"  {word}", bars, f"most {most:.1f} m/s^2", style)


def _kmh(mps: FloatArray) -> str:
    return f"{mps[0] * 3.6:.0f} to {mps[-1] * 3.6:.0f} km/h"


def _sight(words: str, holds: BoolArray, measures: Measures, scale: _Scale, style: str) -> Iterator[TimelineLine]:
    share = float(holds.mean()) if len(holds) else 0.0
    signs = "".join("━" if held else "·" for held in scale.any(holds))
    if share in (0.0, 1.0):
        yield TimelineLine(words, signs, "all the time" if share else "never", style)
        return
    # The time from which the last value holds.
    since = float(measures.time_s[np.flatnonzero(holds != holds[-1])[-1] + 1])
    yield TimelineLine(words, signs, f"{'since' if holds[-1] else 'not since'} {since:.2f} s", style)


def _bars(values: Sequence[float], most: float, *, least: float = 0.0) -> str:
    """Return values as bars of eight heights; the lowest is zero. A value that is NaN or below `least` has no bar."""
    signs = []
    for value in values:
        if math.isnan(value) or (least and value < least):
            signs.append(" ")
        else:
            share = 0.0 if most <= 0 else min(value / most, 1.0)
            signs.append(_BARS[max(math.ceil(share * 8 - 1e-9), 1)])
    return "".join(signs)


def _most(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def _least(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.min()) if finite.size else math.nan
