"""Finds out since when the ego's sensors have seen the opponent without a break, and what hid it before."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.compile.roads.polyline import crosses
from foresee_dsl.kernels.boxes import overlaps_of
from foresee_dsl.simulate.sensing.sight import in_view, sight_of
from foresee_dsl.simulate.trace import HEADING, STEP_S, X, Y
from foresee_dsl.story.facts import Facts
from foresee_dsl.story.story import LOOKS_BACK_S
from foresee_dsl.story.wording import full_name

BLINK_S = 0.25
"""A shorter loss of sight is ignored, s. Ours: a post hides a pedestrian from the ego for two or three frames."""
_BEAM_M = 0.1


@dataclass(frozen=True)
class Sighting:
    """When the ego's sensors saw the opponent.

    Attributes:
        since_s: time from which it is visible without a break until the end, s; None if it is not visible at the end.
        from_start: it is visible in the whole searched part of the run.
        hidden_by: what hid it just before, in words; "" if nothing did (it was out of range or absent).
        lost_s: last time at which it was visible before it was hidden, s. It was hidden before `since_s`, or before the
            end if it is not visible at the end. None if it was not visible earlier in the searched part.
        searched_s: length of the searched part, up to the end of the run, s.
    """

    since_s: float | None
    from_start: bool
    hidden_by: str = ""
    lost_s: float | None = None
    searched_s: float = 0.0

    @property
    def again(self) -> bool:
        """Whether it was visible before as well, and then hidden."""
        return self.since_s is not None and self.lost_s is not None

    def before_s(self, end_s: float) -> float:
        """Return how long it was visible without a break before a time, s; 0 if it was not."""
        return 0.0 if self.since_s is None else max(end_s - self.since_s, 0.0)


def sighting_of(facts: Facts, actor: int) -> Sighting:
    """Return when an actor was visible to the sensors of the drivers under test, without their noise."""
    trace, sight = facts.trace, sight_of(facts.bundle)
    first = max(0, facts.last - round(LOOKS_BACK_S / STEP_S))
    since, blind, searched_s = None, 0, round((facts.last - first) * STEP_S, 6)
    for frame in range(facts.last, first - 1, -1):
        if in_view(trace, actor, frame, sight):
            since, blind = frame, 0
            continue
        blind += 1
        if blind * STEP_S >= BLINK_S:
            break
    if since is not None and blind * STEP_S < BLINK_S:
        return Sighting(round(since * STEP_S, 6), True, searched_s=searched_s)
    hidden = (facts.last + 1 if since is None else since) - 1
    lost = next((k for k in range(hidden - blind, first - 1, -1) if in_view(trace, actor, k, sight)), None)
    lost_s = None if lost is None else round(lost * STEP_S, 6)
    if since is None:
        hider = hidden_by(facts, actor, facts.last if lost is None else lost + 1)
        return Sighting(None, False, hider, lost_s, searched_s)
    return Sighting(round(since * STEP_S, 6), False, hidden_by(facts, actor, since - 1), lost_s, searched_s)


def hidden_by(facts: Facts, actor: int, frame: int) -> str:
    """Return what hides an actor from the ego at a frame, in words; if several things hide it, the thing that is
    nearest to the actor; "" if nothing hides it.
    """
    (x, y), (ox, oy) = facts.xy(0, frame), facts.xy(actor, frame)
    if math.isnan(ox):
        return ""
    beam = np.array([[(x + ox) / 2, (y + oy) / 2, math.atan2(oy - y, ox - x), math.hypot(ox - x, oy - y), _BEAM_M]])
    others = [k for k in range(1, len(facts.trace.actors)) if k != actor]
    poses = facts.trace.states[frame][others][:, [X, Y, HEADING]]
    sizes = np.array([(facts.info(k).length_m, facts.info(k).width_m) for k in others]).reshape(-1, 2)
    boxes = np.column_stack([poses, sizes])
    hits = np.flatnonzero(overlaps_of(np.repeat(beam, len(others), axis=0), boxes)) if others else np.empty(0, int)
    if hits.size:
        gaps = np.hypot(boxes[hits, 0] - ox, boxes[hits, 1] - oy)
        info = facts.info(others[int(hits[int(gaps.argmin())])])
        return full_name(info)
    sightline = ((x, y), (ox, oy))
    hides = any(crosses(sightline, (*outline, outline[0])) for outline in facts.network.buildings)
    return "a building" if hides else ""
