"""Recorded traffic lights with a cycle: their colours over time, and the programs of a network's signals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from xml.etree.ElementTree import Element, SubElement  # only to build elements; `safe_xml` parses

from foresee_dsl.compile.templates import number

_MOST_CHANGES = 100_000
"""Largest number of changes of one light. Ours: a change each second for a day."""
_LONGEST_S = 1800.0
"""Longest common cycle of the lights of a junction, s. Ours: lights of one junction have one cycle of 1 or 2 minutes;
without a common one they repeat after this time."""
_STATES = {"red": "r", "amber": "y", "off": "O"}
"""SUMO's letter for each colour; green has two."""


@dataclass(frozen=True)
class SignalCycle:
    """Colours (`red`, `amber`, `green`, `off`) with durations, s, that repeat; they begin anew at `offset_s`."""

    colours: tuple[tuple[float, str], ...]
    offset_s: float = 0.0

    @property
    def period_s(self) -> float:
        """The duration of all colours, s."""
        return sum(duration for duration, _ in self.colours)

    def changes(self, begin_s: float, end_s: float) -> list[tuple[float, str]]:
        """Return the times and colours of all changes from `begin_s` to `end_s`, s, the first at `begin_s`."""
        at = begin_s - (begin_s - self.offset_s) % self.period_s
        changes: list[tuple[float, str]] = []
        while at <= end_s and len(changes) < _MOST_CHANGES:
            for duration, colour in self.colours:
                same = changes and changes[-1][1] == colour
                if at + duration > begin_s and at <= end_s and not same:
                    changes.append((max(at, begin_s), colour))
                at += duration
        return changes

    def colour_at(self, time_s: float) -> str:
        """Return the colour at a time."""
        rest = (time_s - self.offset_s) % self.period_s
        for duration, colour in self.colours:
            if rest < duration:
                return colour
            rest -= duration
        return self.colours[-1][1]


def set_programs(root: Element, cycles: Mapping[tuple[str, int], SignalCycle]) -> int:
    """Give the signals of a net the recorded cycles, and return the number of these signals.

    At second 0 of a run they show what the recording shows at its second 0. Links without a recorded light may always
    drive, and yield as without a signal.

    Args:
        cycles: the cycle at the end of a lane, by the lane's edge and index.
    """
    links: dict[str, dict[int, SignalCycle | None]] = {}
    for connection in root.iterfind("connection"):
        signal, index = connection.get("tl"), int(connection.get("linkIndex", "-1"))
        if signal is not None and index >= 0:
            start = connection.get("from", ""), int(connection.get("fromLane", "0"))
            links.setdefault(signal, {})[index] = cycles.get(start)
    yielding = {junction.get("id", ""): _yielding(junction) for junction in root.iterfind("junction")}
    count = 0
    for program in root.iterfind("tlLogic"):
        id_ = program.get("id", "")
        own = links.get(id_, {})
        if any(cycle is not None for cycle in own.values()):
            _write(program, own, yielding.get(id_, frozenset()))
            count += 1
    return count


def _write(program: Element, links: Mapping[int, SignalCycle | None], yielding: frozenset[int]) -> None:
    cycles = [cycle for cycle in links.values() if cycle is not None]
    period_s = _common([cycle.period_s for cycle in cycles])
    times = {0.0, period_s}
    for cycle in cycles:
        times.update(round(time, 3) for time, _ in cycle.changes(0.0, period_s))
    for phase in list(program):
        program.remove(phase)
    program.attrib.update(type="static", programID="0", offset="0")
    states: list[tuple[float, str]] = []
    for begin_s, end_s in pairwise(sorted(times)):
        if end_s > period_s:
            break
        state = "".join(
            _letter(links.get(index), (begin_s + end_s) / 2, index in yielding) for index in range(max(links) + 1)
        )
        if states and states[-1][1] == state:
            states[-1] = states[-1][0] + end_s - begin_s, state
        else:
            states.append((end_s - begin_s, state))
    for duration, state in states:
        SubElement(program, "phase", {"duration": number(duration), "state": state})


def _letter(cycle: SignalCycle | None, time_s: float, yields: bool) -> str:
    colour = "green" if cycle is None else cycle.colour_at(time_s)
    return _STATES.get(colour, "g" if yields else "G")


def _yielding(junction: Element) -> frozenset[int]:
    """Return the links of a junction that yield to others."""
    return frozenset(
        int(request.get("index", "-1"))
        for request in junction.iterfind("request")
        if "1" in request.get("response", "")
    )


def _common(periods_s: list[float]) -> float:
    """Return the shortest time after which all periods repeat together, to the millisecond, s."""
    common = math.lcm(*(max(round(period * 1000), 1) for period in periods_s)) / 1000
    return min(common, _LONGEST_S)
