"""The timeline of a run: speeds, accelerations, gap, time to collision and who sees whom, a line each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from rich.text import Text

from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.measures import BoolArray, FloatArray, Measures
from foresee_dsl.report.show.moments import STANDS_MPS, Snapshot

_BARS = " ▁▂▃▄▅▆▇█"
_LABEL, _FIGURES = 18, 17
"""Columns of a line's name and of its figures."""
_LEAST_COLUMNS, _MOST_COLUMNS = 20, 120
LEAST_MPS2 = 0.5
"""A line of an acceleration that never exceeds this is left out. Ours: half of the gentlest braking."""
GAP_MOST_M = 50.0
"""Gaps that are larger have the full bar."""
_EGO, _OTHER = "blue", "red"
_WAS = "  in its parent"


@dataclass(frozen=True)
class Line:
    """One line: its name, what it shows in each column, figures at its end, its style."""

    name: str
    signs: str
    figures: str
    style: str = ""


def timeline(
    found: Measures,
    moments: Sequence[Snapshot],
    opponent: str,
    width: int,
    *,
    parent: Measures | None = None,
    signals: Sequence[str] = (),
) -> Iterator[Text]:
    """Yield the lines of a timeline in a width: the moments' letters above, the seconds below.

    Args:
        found: what was measured. moments: those of the strip. opponent: its id, "" for none. width: columns.
        parent: of the parent's run; its speeds and gap are shown below those of this run, to the same scale.
        signals: what the signal ahead of the ego shows at each frame, "" for none.
    """
    columns = min(max(width - _LABEL - _FIGURES - 2, _LEAST_COLUMNS), _MOST_COLUMNS)
    scale = _Scale(found.time_s, columns)
    yield Text(f"{'':<{_LABEL}} {scale.marks(moments)}".rstrip(), style="bold")
    for line in _lines(found, opponent, scale, None if parent is None else _as_long(parent, len(found.time_s))):
        name = shortened(line.name, _LABEL)
        yield Text.assemble(f"{name:<{_LABEL}} ", (f"{line.signs:<{columns}}", line.style), f" {line.figures}")
    if any(signals):
        yield _signal_line(scale.middle(signals), columns)
    yield Text(f"{'':<{_LABEL}} {scale.seconds()}", style="dim")


_LAMPS = {"red": ("r", "red"), "amber": ("a", "yellow"), "green": ("g", "green"), "": ("·", "dim")}


def _signal_line(colours: Sequence[str], columns: int) -> Text:
    """Return the line of the signal ahead: a letter a column."""
    line = Text(f"{'signal ahead':<{_LABEL}} ")
    for colour in colours:
        line.append(*_LAMPS[colour])
    last = next((colour for colour in reversed(colours) if colour), "")
    return line.append(" " * (columns - len(colours)) + (f" {last} at the end" if colours[-1] else ""))


def _as_long(found: Measures, frames: int) -> Measures:
    """Return measures cut, or continued with NaN (False), to so many frames."""
    rest = max(frames - len(found.time_s), 0)
    fitted: dict[str, Any] = {
        name: np.concatenate([values[:frames], np.full(rest, np.nan).astype(values.dtype) if rest else values[:0]])
        for name, values in vars(found).items()
    }
    if rest:
        fitted["ego_sees"][-rest:] = fitted["other_sees"][-rest:] = False  # NaN would be true
    return Measures(**fitted)


class _Scale:
    """Which frames each column stands for."""

    def __init__(self, time_s: FloatArray, columns: int) -> None:
        self._time_s, self._columns = time_s, columns
        frames = len(time_s)
        edges = np.linspace(0, frames, columns + 1)
        self._spans = [
            slice(min(int(a), frames - 1), max(int(b), min(int(a), frames - 1) + 1))
            for a, b in pairwise(edges.tolist())
        ]

    def of(self, values: FloatArray, worst: Callable[[FloatArray], float]) -> list[float]:
        """Return a value for each column: the worst of its frames, NaN where there is none."""
        found = []
        for span in self._spans:
            part = values[span][~np.isnan(values[span])]
            found.append(float(worst(part)) if part.size else math.nan)
        return found

    def any(self, holds: BoolArray) -> list[bool]:
        """Return for each column whether something holds in most of its frames."""
        return [bool(holds[span].mean() >= 0.5) for span in self._spans]

    def middle(self, values: Sequence[str]) -> list[str]:
        """Return for each column the value at the middle of its frames."""
        return [values[(span.start + span.stop - 1) // 2] for span in self._spans]

    def column(self, time_s: float) -> int:
        """Return the column of a time."""
        return min(int(time_s / self._step_s), self._columns - 1)

    def marks(self, moments: Sequence[Snapshot]) -> str:
        """Return the letters of moments at their columns; one that has no room moves on to the right."""
        signs = [" "] * self._columns
        for moment in moments:
            free = [k for k in range(self.column(moment.time_s), self._columns) if signs[k] == " "]
            if free:
                signs[free[0]] = moment.letter
        return "".join(signs)

    def seconds(self) -> str:
        """Return the axis: a number of seconds where each begins."""
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


def _lines(found: Measures, opponent: str, scale: _Scale, parent: Measures | None) -> Iterator[Line]:
    was = (None, None, None) if parent is None else (parent.ego_mps, parent.other_mps, parent.gap_m)
    yield from _motion("ego", found.ego_mps, found.ego_mps2, scale, _EGO, was[0])
    if not opponent:
        return
    stands = not _most(found.other_mps) > STANDS_MPS  # a static object: its speed, and what it sees, say nothing
    if not stands:
        yield from _motion(opponent, found.other_mps, found.other_mps2, scale, _OTHER, was[1])
    most = min(_most(found.gap_m), GAP_MOST_M)
    yield Line("gap", _bars(scale.of(found.gap_m, np.min), most), f"least {_least(found.gap_m):.2f} m")
    if was[2] is not None and np.isfinite(was[2]).any():
        yield Line(_WAS, _bars(scale.of(was[2], np.min), most), f"least {_least(was[2]):.2f} m", "dim")
    if np.isfinite(found.ttc_s).any():
        worst = scale.of(found.ttc_s, np.min)
        signs = "".join("·" if not math.isfinite(value) else str(min(int(value), 9)) for value in worst)
        yield Line("time to collision", signs, f"least {_least(found.ttc_s):.2f} s")
    yield from _sight("ego sees", found.ego_sees, found, scale, _EGO)
    if not stands:
        yield from _sight("seen by", found.other_sees, found, scale, _OTHER)


def _motion(
    name: str, mps: FloatArray, mps2: FloatArray, scale: _Scale, style: str, was: FloatArray | None
) -> Iterator[Line]:
    """Yield the lines of an actor's speed, of that in the parent's run, and of what it brakes and speeds up."""
    known = mps[~np.isnan(mps)]
    if not known.size:
        return
    most_kmh = _most(mps if was is None else np.concatenate([mps, was])) * 3.6
    title = f"{shortened(name, _LABEL - 6)} speed"
    yield Line(title, _bars(scale.of(mps * 3.6, np.mean), most_kmh), _kmh(known), style)
    if was is not None and (before := was[~np.isnan(was)]).size:
        yield Line(_WAS, _bars(scale.of(was * 3.6, np.mean), most_kmh), _kmh(before), "dim")
    for word, signed in (("brakes", -mps2), ("speeds up", mps2)):
        most = _most(signed)
        if most > LEAST_MPS2:
            bars = _bars([max(value, 0.0) for value in scale.of(signed, np.max)], most, least=LEAST_MPS2)
            yield Line(f"  {word}", bars, f"most {most:.1f} m/s^2", style)


def _kmh(mps: FloatArray) -> str:
    return f"{mps[0] * 3.6:.0f} to {mps[-1] * 3.6:.0f} km/h"


def _sight(words: str, holds: BoolArray, found: Measures, scale: _Scale, style: str) -> Iterator[Line]:
    share = float(holds.mean()) if len(holds) else 0.0
    signs = "".join("━" if held else "·" for held in scale.any(holds))
    if share in (0.0, 1.0):
        yield Line(words, signs, "all the time" if share else "never", style)
        return
    # since when it is as it is at the end
    since = float(found.time_s[np.flatnonzero(holds != holds[-1])[-1] + 1])
    yield Line(words, signs, f"{'since' if holds[-1] else 'not since'} {since:.2f} s", style)


def _bars(values: Sequence[float], most: float, *, least: float = 0.0) -> str:
    """Return values as bars of eight heights; the lowest for zero, nothing where there is none or under `least`."""
    signs = []
    for value in values:
        if math.isnan(value) or (least and value < least):
            signs.append(" ")
        else:
            share = 0.0 if most <= 0 else min(value / most, 1.0)
            signs.append(_BARS[max(math.ceil(share * 8 - 1e-9), 1)])
    return "".join(signs)


def _most(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if known.size else 0.0


def _least(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.min()) if known.size else math.nan
