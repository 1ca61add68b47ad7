"""A run as an animated picture (GIF): one fixed view from above, drawn ten times a second."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

import numpy as np

from foresee_dsl.errors import ForeseeError
from foresee_dsl.kernels.boxes import IntArray
from foresee_dsl.report.drawing import svg
from foresee_dsl.report.drawing.sheet import PAD, DrawnPart, Sheet, Words
from foresee_dsl.report.drawing.svg import MISSING, png_of_svg
from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.measures import measure
from foresee_dsl.report.show.moments import Snapshot
from foresee_dsl.report.show.panels import Panel, key_frame, strip_panels, window_before
from foresee_dsl.report.show.sources import ShownRun
from foresee_dsl.report.show.strip import SIZES, map_of, opponent_of
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.story import Moment

EVERY_S = 0.1
"""Time between two pictures, s. GIF counts time in hundredths of a second, and browsers show pictures longer that
should last less than 0.02 s."""
HOLD_S = 1.5
"""Time for which the last picture stays before the film begins again, s. Ours: long enough to read its caption."""
BEFORE_S, AFTER_S = 7.0, 2.0
"""Part of the run that is filmed before and after its most critical moment, s. Ours: the length of most clips."""
SIDE_PX = 440.0
"""Side of the picture, px. Ours: a car in the widest view is 20 px long."""
COLOURS = 64
"""Number of colours of a film. Ours: 20 of them are the paints, the others the mixed colours at their edges."""
_CAPTION_S = 1.5
"""A moment of the story is in the caption for this long, s: as in the page's playback."""
_LETTERS = 64
"""Maximum length of a line above the picture, characters: what fits its width."""
_ZOOM = 1.0


def film(run: ShownRun, from_s: float | None = None, to_s: float | None = None) -> bytes:
    """Return a run as a GIF.

    Args:
        run: the run. from_s, to_s: part of it, s; by default the seconds around its most critical moment.

    Raises:
        ForeseeError: Pillow or resvg-py is not installed, or the part is empty.
    """
    trace, opponent = run.trace, opponent_of(run.trace, run.story)
    measures = measure(trace, run.bundle, opponent)
    key = key_frame(trace, measures.gap_m)
    first = trace.time_s[key] - BEFORE_S if from_s is None else from_s
    last = trace.time_s[key] + AFTER_S if to_s is None else to_s
    at = np.arange(0, trace.frames, round(EVERY_S / STEP_S))
    at = np.unique(np.append(at, (key, trace.frames - 1)))
    frames = at[(trace.time_s[at] >= first - 1e-9) & (trace.time_s[at] <= last + 1e-9)]
    if not frames.size:
        raise ForeseeError(f"there is no moment from {first:g} s to {last:g} s: the run has {trace.duration_s:.2f} s")
    window = window_before(trace, run.bundle, opponent, key)
    moments = [Snapshot("", frame, float(trace.time_s[frame]), _event_at(run.story.moments, float(trace.time_s[frame])))
               for frame in frames.tolist()]  # fmt: skip
    panels = strip_panels(trace, run.bundle, measures, opponent, moments, windows=[window] * len(moments))
    title = shortened(run.story.title, _LETTERS)
    return _gif([png_of_svg(_picture(panel, title), zoom=_ZOOM) for panel in panels], frames)


def _event_at(moments: Sequence[Moment], time_s: float) -> str:
    past = [moment for moment in moments if moment.time_s <= time_s + 0.011]
    return past[-1].text if past and time_s - past[-1].time_s < _CAPTION_S else ""


def _picture(panel: Panel, title: str) -> str:
    gap = f", gap {panel.gap_m:.1f} m" if math.isfinite(panel.gap_m) else ""
    figures = f"{panel.snapshot.time_s:.2f} s: {panel.ego_mps * 3.6:.0f} km/h{gap}"
    lines = (title, figures, shortened(panel.snapshot.text, _LETTERS))
    words = tuple(
        Words("title" if k < 2 else "quiet", line, PAD, PAD + 6 + 17 * k, "text", bold=k == 0)
        for k, line in enumerate(lines)
        if line
    )
    top = PAD + 17 * len(lines)
    sheet = Sheet(
        SIDE_PX + 2 * PAD,
        top + SIDE_PX + PAD,
        (map_of(panel, PAD, top, SIDE_PX),),
        (DrawnPart("caption", words=words),),
        "",
        SIZES,
    )
    return svg.svg_of(sheet, scheme="light")


def _gif(pictures: Sequence[bytes], frames: IntArray) -> bytes:
    try:
        from PIL import Image
    except ImportError as err:
        raise ForeseeError(MISSING.format("Pillow")) from err
    images = [Image.open(io.BytesIO(picture)).convert("RGB") for picture in pictures]
    colours = images[-1].quantize(COLOURS)
    images = [image.quantize(palette=colours, dither=Image.Dither.NONE) for image in images]
    shown_ms = [round(step * STEP_S * 1000) for step in np.diff(frames).tolist()] + [round(HOLD_S * 1000)]
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=shown_ms, loop=0, disposal=1)
    return file.getvalue()
