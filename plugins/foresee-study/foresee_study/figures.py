"""Draws figures with matplotlib as SVG and PDF: box plots, cumulative curves, heat maps.

Equal results give equal bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import replacing
from foresee_study.curves import Clock, curve
from foresee_study.measured import Counted, MeasuredCampaign
from foresee_study.questions import CLIPS_S, POINTS
from foresee_study.results import Results, counts_of
from foresee_study.settings import CHOSEN_S, EXHAUSTIVE
from foresee_study.statistics.bootstrap import resampled_sums
from foresee_study.tables.rankers import shown_rankers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_COLOURS = MappingProxyType({
    "foresee": "#0072b2", "random": "#999999", "selforacle": "#d55e00", "proximity": "#009e73", "careful": "#cc79a7",
    "exhaustive": "#000000",
})  # fmt: skip
"""Colours of Okabe and Ito 2008, which people with colour vision deficiency can distinguish."""
_OTHERS = "#e69f00"
_STEPS = 400
"""Number of points of a curve."""
_SETTINGS = MappingProxyType(
    {"svg.hashsalt": "foresee", "svg.fonttype": "none", "font.size": 8, "axes.spines.top": False,
     "axes.spines.right": False, "figure.dpi": 100, "pdf.fonttype": 42}
)  # fmt: skip
FORMATS = MappingProxyType({".svg": {"Date": None, "Creator": None}, ".pdf": {"CreationDate": None, "Producer": None}})
"""The formats of figures, and the metadata that each leaves out, so that a file does not depend on the time of
writing."""


class NoFiguresError(ForeseeError):
    """Raised if matplotlib is not installed."""


def write_figures(results: Results, folder: Path) -> tuple[str, ...]:
    """Write every figure for which there are results, and return the names of the figures.

    Raises:
        NoFiguresError: matplotlib is not installed.
    """
    try:
        import matplotlib as mpl
    except ImportError as err:
        raise NoFiguresError(
            "no figures: they need matplotlib, which `pip install 'foresee-dsl[study]'` installs"
        ) from err
    mpl.use("agg")
    folder.mkdir(parents=True, exist_ok=True)
    names = []
    with mpl.rc_context(dict[Any, Any](_SETTINGS)):
        for name, draw in FIGURES.items():
            figure = draw(results)
            if figure is None:
                continue
            for suffix, left_out in FORMATS.items():
                with replacing(folder / f"{name}{suffix}") as file:
                    figure.savefig(file, format=suffix[1:], bbox_inches="tight", metadata=left_out)
            names.append(name)
    return tuple(names)


def _panels(rows: int, columns: int, *, width: float = 3.2, height: float = 2.4) -> tuple[Figure, list[list[Axes]]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    return figure, [list(line) for line in axes]


def _boxes(results: Results) -> Figure | None:
    """Draw the collisions of a repetition by ranker: boxes are resamples, points are repetitions."""
    ways = [(clip_s, n) for clip_s in CLIPS_S for n in POINTS]
    drivers = [d for d in results.drivers if any(results.of_campaign(d, r) for r in shown_rankers(results))]
    if not drivers:
        return None
    figure, panels = _panels(len(drivers), 1, width=7.0)
    for driver, (axes,) in zip(drivers, panels, strict=True):
        rankers = shown_rankers(results)
        for place, (clip_s, n) in enumerate(ways):
            for k, ranker in enumerate(rankers):
                campaigns = results.of_campaign(driver, ranker, clip_s, points=n)
                if campaigns:
                    at = place + (k - (len(rankers) - 1) / 2) * 0.8 / len(rankers)
                    _box(axes, at, 0.7 / len(rankers), campaigns, _COLOURS.get(ranker, _OTHERS))
        axes.set_xticks(range(len(ways)), [f"{clip_s:g} s x {n}" for clip_s, n in ways])
        axes.set_ylabel("collisions")
        axes.set_title(driver)
        for ranker in rankers:
            axes.plot([], [], "s", color=_COLOURS.get(ranker, _OTHERS), label=ranker)
        axes.legend(frameon=False, ncols=len(rankers))
    return figure


def _box(axes: Axes, at: float, width: float, campaigns: Sequence[MeasuredCampaign], colour: str) -> None:
    names = sorted({case.name for m in campaigns for case in m.usable})
    counts = counts_of(campaigns, lambda case: case.count(Counted.COLLISIONS))
    drawn = resampled_sums(counts, names) / len(campaigns)
    low, first, middle, third, high = np.percentile(drawn, [2.5, 25, 50, 75, 97.5])
    stats = [{"med": middle, "q1": first, "q3": third, "whislo": low, "whishi": high, "fliers": []}]
    style = {"color": colour}
    axes.bxp(stats, positions=[at], widths=[width], boxprops=style, whiskerprops=style, capprops=style,
             medianprops=style, manage_ticks=False)  # fmt: skip
    axes.plot([at] * len(campaigns), [m.count(Counted.COLLISIONS) for m in campaigns], ".", color=colour, markersize=3)


def _curves(results: Results) -> Figure | None:
    """Draw the cumulative collisions over simulated and wall time, as the mean of the repetitions."""
    drivers = [d for d in results.drivers if any(results.of_campaign(d, r) for r in shown_rankers(results))]
    if not drivers:
        return None
    figure, panels = _panels(len(drivers), len(Clock))
    for driver, line in zip(drivers, panels, strict=True):
        for clock, axes in zip(Clock, line, strict=True):
            others = [*shown_rankers(results), EXHAUSTIVE]
            ends = [_end(results.of_campaign(driver, ranker), clock) for ranker in others[:-1]]
            for ranker in others:
                campaigns = results.of_campaign(driver, ranker)
                if campaigns:
                    _step(axes, campaigns, clock, min(_end(campaigns, clock), max(ends)), ranker)
            axes.set_xlabel(f"{clock.value} hours")
            axes.set_ylabel("collisions")
            axes.set_title(driver)
            axes.legend(frameon=False)
    return figure


def _end(campaigns: Sequence[MeasuredCampaign], clock: Clock) -> float:
    return max((curve(m, clock).end_s for m in campaigns), default=0.0)


def _step(axes: Axes, campaigns: Sequence[MeasuredCampaign], clock: Clock, end_s: float, ranker: str) -> None:
    times = np.linspace(0, end_s, _STEPS)
    counts = np.mean([[line.at(t) for t in times] for line in (curve(m, clock) for m in campaigns)], axis=0)
    axes.step(times / 3600, counts, where="post", color=_COLOURS.get(ranker, _OTHERS), label=ranker)


def _heat(results: Results) -> Figure | None:
    """Draw the collisions, findings and avoidable findings per clip of foresee, by family and driver."""
    drivers = [d for d in results.drivers if results.of_campaign(d, "foresee")]
    if not drivers or not results.families:
        return None
    figure, (line,) = _panels(1, len(Counted), width=1.2 + 0.6 * len(drivers), height=1 + 0.4 * len(results.families))
    for what, axes in zip(Counted, line, strict=True):
        values = np.array([[_a_clip(results, d, f, what) for d in drivers] for f in results.families])
        axes.imshow(np.nan_to_num(values), cmap="Blues", vmin=0, aspect="auto")
        axes.set_xticks(range(len(drivers)), drivers, rotation=45, ha="right")
        axes.set_yticks(range(len(results.families)), [f"scenario {f}" for f in results.families])
        axes.set_title(f"{what.value} a clip")
        for (row, column), value in np.ndenumerate(values):
            dark = value > 0.6 * float(np.nanmax(values, initial=0.0))
            text = "-" if np.isnan(value) else f"{value:.2f}"
            axes.text(column, row, text, ha="center", va="center", color="white" if dark else "black")
    return figure


def _a_clip(results: Results, driver: str, family: str, what: Counted) -> float:
    campaigns = results.of_campaign(driver, "foresee", CHOSEN_S, family=family)
    clips = sum(m.clips for m in campaigns)
    return sum(m.count(what) for m in campaigns) / clips if clips else float("nan")


FIGURES: MappingProxyType[str, Callable[[Results], Figure | None]] = MappingProxyType(
    {"rq2_boxes": _boxes, "rq2_heat": _heat, "rq3_curves": _curves}
)
"""The figures by name; the name of a figure begins with the name of its question."""
CAPTIONS = MappingProxyType({
    "rq2_boxes": "Collisions by ranker, length of the clips and number of risky points. Points: repetitions. Boxes: "
                 "resamples of test cases and repetitions, whiskers at 2.5 and 97.5 %.",
    "rq2_heat": "Collisions, findings and avoidable findings per clip of foresee, by family and driver.",
    "rq3_curves": "Cumulative collisions over the time of clips and children, means of the repetitions.",
})  # fmt: skip


def figures_of(question: str, names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the figures of a question with their captions."""
    yield from ((name, CAPTIONS[name]) for name in names if name.startswith(f"{question}_"))
