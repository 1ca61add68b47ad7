"""Signals for a page: where each shows its colour, and when it becomes another one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import Signal, SumoBundle
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.report.page.numbers import line
from foresee_dsl.simulate.trace import Trace, X, Y

NEAR_M = 100.0
"""Signals farther away from the ego during the whole run are left out; ours: what its camera sees at most."""


def signal_heads(trace: Trace, bundle: SumoBundle, frames: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Return the signal heads near the ego: a line `at` the road (cm), and `colours`: frame, letter, frame, letter...

    A letter is SUMO's, in lower case: r, y, g, u (red and yellow), o (off). Frames count those shown.
    """
    track = trace.states[:, 0, [X, Y]]
    heads = []
    for column, junction in enumerate(trace.signals):
        signal = bundle.signals.get(junction)
        place = bundle.network.junctions.get(junction)
        if signal is None or place is None:
            continue
        if np.nanmin(np.hypot(track[:, 0] - place.x, track[:, 1] - place.y)) > NEAR_M:
            continue
        states = _states(trace, column, signal, frames)
        heads += [{"at": line(at), "colours": _changes(states, link)} for at, link in _places(bundle.network, signal)]
    return heads


def _states(trace: Trace, column: int, signal: Signal, frames: NDArray[np.int64]) -> list[str]:
    """Return SUMO's state string of a signal at each frame."""
    names = trace.signal_stages[column]
    found = []
    for frame in frames:
        stage = names[trace.stages[frame, column]]
        phase, _ = signal.phase_at(stage, float(trace.elapsed[frame, column]))
        found.append(signal.phases[phase].state.lower())
    return found


def _changes(states: list[str], link: int) -> list[int | str]:
    changes: list[int | str] = []
    before = ""
    for k, state in enumerate(states):
        colour = state[link] if link < len(state) else "o"
        if colour != before:
            changes += [k, colour]
            before = colour
    return changes


def _places(network: RoadNetwork, signal: Signal) -> Iterator[tuple[list[tuple[float, float]], int]]:
    """Yield a line and a link for each head: part of the stop line for each way on from a lane, a crossing's ends."""
    links: dict[str, list[int]] = {}
    for movement in network.movements:
        if movement.tls == signal.tls and movement.link not in links.setdefault(movement.from_lane, []):
            links[movement.from_lane].append(movement.link)
    for lane, mine in links.items():
        for share, link in enumerate(mine):
            yield _stop_line(network.lanes[lane], share, len(mine)), link
    for crossing in network.crossings.values():
        if crossing.tls == signal.tls:
            yield [crossing.lane.shape[0]] * 2, crossing.link
            yield [crossing.lane.shape[-1]] * 2, crossing.link


def _stop_line(lane: Lane, share: int, shares: int) -> list[tuple[float, float]]:
    """Return a part of the stop line at a lane's end, from the right."""
    (x0, y0), (x1, y1) = lane.shape[-2], lane.shape[-1]
    heading = math.atan2(y1 - y0, x1 - x0)
    left = [(k / shares - 0.5) * lane.width_m * 0.9 for k in (share, share + 1)]
    return [(x1 - math.sin(heading) * way, y1 + math.cos(heading) * way) for way in left]
