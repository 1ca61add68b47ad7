"""What an ego that stands for long could wait for: the signal ahead, and who is in front of it."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.simulate.trace import STEP_S, X, Y
from foresee_dsl.story.facts import Facts
from foresee_dsl.story.place import kind_of
from foresee_dsl.story.wording import full_name, metres

SIGNAL_AHEAD_M = 30.0
"""A signal farther ahead is not what it waits for. Ours: four cars and the crossing."""
IN_FRONT_M = 30.0
"""The same for an actor in front."""
_AHEAD_RAD = math.pi / 4


def waiting(facts: Facts) -> str:
    """Return what is ahead of the ego at the end of a run, in words."""
    return f"{_signal(facts)}, {_in_front(facts)}"


def _signal(facts: Facts) -> str:
    """The next junction of the ego's way: how far it is, and what its signal shows since when."""
    line = facts.bundle.scene.ego.line
    if line is None:
        return "no junction is ahead"
    (x, y), heading, half = facts.xy(0, facts.last), facts.heading(0, facts.last), facts.info(0).front_m
    here = line.project(x + half * math.cos(heading), y + half * math.sin(heading))[0]
    for passage in line.passages:
        room = passage.entry_s - here
        if passage.exit_s < here or room > SIGNAL_AHEAD_M:
            continue
        where = f"{metres(room)} before" if room > 0 else "inside"
        text = f"{where} the {kind_of(facts.network, passage.junction)} {passage.junction}"
        colour = facts.colour(passage.movement, facts.last)
        if not colour:
            return text
        first = facts.last
        while first > 0 and facts.colour(passage.movement, first - 1) == colour:
            first -= 1
        return f"{text}, whose signal is {colour} for the last {(facts.last - first) * STEP_S:.1f} s"
    return f"no junction is within {SIGNAL_AHEAD_M:.0f} m"


def _in_front(facts: Facts) -> str:
    """The nearest actor within 45 degrees of straight ahead."""
    (x, y), heading = facts.xy(0, facts.last), facts.heading(0, facts.last)
    states = facts.trace.states[facts.last, 1:]
    dx, dy = states[:, X] - x, states[:, Y] - y
    far = np.hypot(dx, dy)
    off = np.abs(np.remainder(np.arctan2(dy, dx) - heading + math.pi, math.tau) - math.pi)
    far = np.where((off < _AHEAD_RAD) & ~np.isnan(far), far, np.inf)
    if not far.size or far.min() > IN_FRONT_M:
        return f"with nobody within {IN_FRONT_M:.0f} m in front of it"
    nearest = int(far.argmin())
    gap = metres(facts.gap_m(nearest + 1, facts.last))
    return f"with {full_name(facts.info(nearest + 1))} {gap} in front of it"
