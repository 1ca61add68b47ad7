"""A picture of a situation: its actors from above at the decisive moment, with their tracks before and after it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from foresee_dsl.kernels.boxes import corners
from foresee_dsl.report.drawing.labels import width_of
from foresee_dsl.report.drawing.shapes import Shape, body_shapes, ground_shapes
from foresee_dsl.report.drawing.sheet import (
    PAD,
    DrawnPart,
    Key,
    Map,
    MapFrame,
    Sheet,
    Sizes,
    Words,
    legend,
    scale_and_north,
)
from foresee_dsl.report.safe_text import safe, shortened
from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.mining.roads import ground_around
from foresee_recordings.mining.situation import Situation, measure_text
from foresee_recordings.mining.traffic import Traffic, X, Y
from foresee_recordings.recording import FloatArray

WIDTH, HEIGHT = 720.0, 480.0
"""Size of the map, px. Ours: as wide as the pictures of `foresee draw`."""
BEHIND_S, AHEAD_S = 3.0, 3.0
"""Times for which tracks are drawn before and after the moment, s. Ours: the longest time in which actors react."""
MARGIN_M, LEAST_M = 8.0, 45.0
"""Margin around the tracks of the situation's actors, and smallest width of a picture, m. Ours: two lanes, and a
junction."""
FARTHEST_M = 220.0
"""Largest width of a picture, m. Ours: a car is then 15 px long."""
_SIZES = Sizes(room=1.0)
_PAINTS = ("opponent", "a1", "a2")


def picture(traffic: Traffic, situation: Situation) -> Sheet:
    """Return the picture of a situation."""
    frame_number = traffic.frame_at(situation.moment_s)
    actors = [traffic.ids[name] for name in (situation.ego, *situation.others)]
    top = PAD + 44.0
    frame = _frame(traffic, actors, frame_number)
    left, bottom, right, up = frame.bounds
    ground = ground_around(traffic, (left, bottom, right, up))
    parts = [DrawnPart(shape.paint, (shape,)) for shape in ground_shapes(ground, bars=frame.scale > 3)]
    paints = dict(zip(actors, ("ego", *_PAINTS), strict=False))
    parts += [part for actor, paint in paints.items() for part in _tracks(traffic, actor, frame_number, paint)]
    parts += _bodies(traffic, frame_number, paints, frame)
    scale, _ = scale_and_north(frame, _SIZES)
    parts.append(scale)
    keys = [
        Key("ego", f"ego {situation.ego}"),
        *(Key(paint, f"{traffic.tracks[k].kind} {traffic.tracks[k].id}") for k, paint in list(paints.items())[1:]),
        Key("traffic", "others"),
        Key("ego-way", f"{BEHIND_S:.0f} s before", line=True),
        Key("ego-way", f"{AHEAD_S:.0f} s after", line=True, dash=(5.0, 4.0)),
    ]
    below, height = legend(keys, WIDTH + 2 * PAD, top + HEIGHT + PAD, _SIZES)
    title = f"{situation.name.replace('_', ' ')} at {situation.moment_s:.2f} s of {traffic.recording.source.name}"
    measures = ", ".join(measure_text(key, value) for key, value in situation.measures.items())
    head = DrawnPart(
        "header",
        words=(
            Words("title", safe(shortened(title, 80)), PAD, PAD + 8, "title", bold=True),
            Words("quiet", safe(shortened(situation.sentence, 110)), PAD, PAD + 26),
            Words("quiet", safe(measures), PAD, PAD + 42, "small"),
        ),
    )
    label = shortened(f"{title}: {situation.sentence}", 300)
    return Sheet(WIDTH + 2 * PAD, height, (Map(PAD, top + 8, frame, tuple(parts)),), (head, *below), label, _SIZES)


def _frame(traffic: Traffic, actors: list[int], frame: int) -> MapFrame:
    places = []
    for actor in actors:
        part = traffic.part(actor, frame - round(BEHIND_S / STEP_S), frame + round(AHEAD_S / STEP_S))
        places.append(part[:, [X, Y]] if len(part) else traffic.part(actor)[:1, [X, Y]])
    every = np.vstack(places)
    low, high = every.min(axis=0), every.max(axis=0)
    middle, size = (low + high) / 2, high - low + 2 * MARGIN_M
    wide = min(max(float(size[0]), float(size[1]) * WIDTH / HEIGHT, LEAST_M), FARTHEST_M)
    if wide == FARTHEST_M:  # the actors at the moment matter more than their ways
        now = np.vstack([_place(traffic, actor, frame) for actor in actors])
        middle = (now.min(axis=0) + now.max(axis=0)) / 2
    scale = WIDTH / wide
    return MapFrame(WIDTH, HEIGHT, float(middle[0]) - wide / 2, float(middle[1]) + HEIGHT / scale / 2, scale)


def _place(traffic: Traffic, actor: int, frame: int) -> FloatArray:
    frame = min(max(frame, int(traffic.first[actor])), int(traffic.last[actor]))
    place: FloatArray = traffic.part(actor, frame, frame)[:, [X, Y]]
    return place


def _tracks(traffic: Traffic, actor: int, frame: int, paint: str) -> Iterator[DrawnPart]:
    for first, last, dash in (
        (frame - round(BEHIND_S / STEP_S), frame, ()),
        (frame, frame + round(AHEAD_S / STEP_S), (5.0, 4.0)),
    ):
        points = traffic.part(actor, first, last)[:, [X, Y]]
        if len(points) > 1:
            yield DrawnPart("track", (Shape(f"{paint}-way", (points,), closed=False, width=2.0, dash=dash),))


def _bodies(traffic: Traffic, frame: int, paints: dict[int, str], map_frame: MapFrame) -> Iterator[DrawnPart]:
    """Yield the bodies at a frame, the situation's actors last; an actor that is not there at the frame is drawn at the
    nearest frame at which it is."""
    left, bottom, right, top = map_frame.bounds
    present = np.flatnonzero((traffic.first <= frame) & (traffic.last >= frame)).tolist()
    for actor in sorted({*present, *paints}, key=lambda k: (k in paints, -list(paints).index(k) if k in paints else k)):
        x, y = _place(traffic, actor, frame)[0].tolist()
        if not (left - 10 <= x <= right + 10 and bottom - 10 <= y <= top + 10):
            continue
        at = min(max(frame, int(traffic.first[actor])), int(traffic.last[actor]))
        box = traffic.boxes(traffic.rows(actor, np.array([at])))
        track, paint = traffic.tracks[actor], paints.get(actor, "traffic")
        shapes = body_shapes(corners(box)[0], track.kind, paint, map_frame.scale)
        words: tuple[Words, ...] = ()
        if actor in paints:
            px, py = map_frame.point(x, y)
            aside = math.hypot(track.length_m, track.width_m) / 2 * map_frame.scale + 4
            name = shortened(track.id, 20)
            if px + aside + width_of(name, _SIZES.text) > map_frame.width:
                words = (Words(f"{paint}-name", safe(name), px - aside, py, anchor="end", bold=True),)
            else:
                words = (Words(f"{paint}-name", safe(name), px + aside, py, bold=True),)
        yield DrawnPart(paint, shapes, words, title=shortened(track.id, 60))
