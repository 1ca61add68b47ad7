"""A clock that counts wall and CPU time for the active part of the tool, without the time of nested parts."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from foresee_dsl.measuring import Part


@dataclass(frozen=True)
class Spent:
    """CPU and wall time of one part, ns."""

    cpu_ns: int = 0
    wall_ns: int = 0

    def __add__(self, other: Spent) -> Spent:
        """Return the sum of both."""
        return Spent(self.cpu_ns + other.cpu_ns, self.wall_ns + other.wall_ns)


@dataclass(frozen=True)
class Measurement:
    """Measured times by part (parts without time are left out), with the amount of work done.

    Attributes:
        decisions: number of drivers' decisions, without the first of each run.
    """

    spent: Mapping[Part, Spent] = field(default_factory=dict)
    runs: int = 0
    decisions: int = 0
    simulated_s: float = 0.0

    def __add__(self, other: Measurement) -> Measurement:
        """Return the sum of both."""
        parts = [part for part in Part if part in self.spent or part in other.spent]
        return Measurement(
            MappingProxyType({p: self.spent.get(p, Spent()) + other.spent.get(p, Spent()) for p in parts}),
            self.runs + other.runs,
            self.decisions + other.decisions,
            self.simulated_s + other.simulated_s,
        )

    def __reduce__(self) -> tuple[object, ...]:
        """Pass the measurement to another process."""
        return Measurement, (dict(self.spent), self.runs, self.decisions, self.simulated_s)


EVERY = 8
"""CPU time is read around one in this many decisions. Ours: reading it around every decision took 6 % of a campaign, so
this takes less than 1 %.
"""


class Clock:
    """Counts time for one part at a time.

    Wall time is read at each change of the part. Reading CPU time costs ten times as much (measured: 0.3 to 1.6 us), so
    it is read only where a part with `own` begins or ends, and around one in `EVERY` of the driver's decisions, as a
    driver may wait for a program or a GPU. The CPU time of the other parts between two readings is divided in
    proportion to their wall time, because none of these parts waits.

    Attributes:
        part: the active part. refers: a reference driver drives.
    """

    def __init__(self, part: Part = Part.IDLE, *, exactly: bool = False) -> None:
        """Begin with a part. `exactly`: read CPU time at each change, for benchmarks on a busy machine."""
        self.part = part
        self._before: list[Part] = []
        self._always = exactly
        self.refers = False
        self.runs = self.decisions = 0
        self.simulated_s = 0.0
        self._exactly = False
        """Whether CPU time is read around the present decision."""
        self._decisions = 0
        self._own_cpu = self._own_wall = 0  # times of the decisions around which CPU time was read
        self._open = [0] * len(Part)  # wall time since CPU time was last read
        self._wall = [0] * len(Part)
        self._cpu = [0] * len(Part)
        self._cpu_read = time.process_time_ns()
        self._since = time.perf_counter_ns()

    def enter(self, part: Part) -> Part:
        """Count for another part from now on; return the previous one."""
        now, before = time.perf_counter_ns(), self.part
        self._open[before.number] += now - self._since
        self._since, self.part = now, part
        if part.own or before.own or self._always or (self._exactly and Part.DRIVER in (part, before)):
            self._share_out()
        return before

    def begin(self, part: Part) -> None:
        """Count for a part from now on, until `end`."""
        if part.simulates and self.part is Part.PLACING:  # SUMO also steps there, before the first frame
            part = Part.PLACING
        self._before.append(self.enter(part))

    def end(self) -> None:
        """Count again for the part that was active before the last `begin`."""
        if self._before:  # otherwise the part began before this clock existed
            self.enter(self._before.pop())

    def begin_decision(self, *, first: bool) -> None:
        """Count for the driver's decision until `end`; `first`: the first of a run, a reset, or a closing."""
        if self.refers:
            self.begin(Part.REFERENCES)
        elif first:
            self.begin(Part.DRIVER_BEGINS)
        else:
            self.decisions += 1
            self._exactly = self._decisions % EVERY == 0
            self._decisions += 1
            self.begin(Part.DRIVER)

    def add_programs(self, cpu_ns: int) -> None:
        """Add the CPU time of the driver's programs, which worked while the driver waited for them."""
        self.add(Part.REFERENCES if self.refers else Part.DRIVER, cpu_ns=cpu_ns)

    def count_run(self, simulated_s: float) -> None:
        """Count a finished run."""
        self.runs += 1
        self.simulated_s += simulated_s

    def add(self, part: Part, *, cpu_ns: int = 0, wall_ns: int = 0) -> None:
        """Add time that this clock did not measure."""
        self._cpu[part.number] += cpu_ns
        self._wall[part.number] += wall_ns

    def take(self) -> Measurement:
        """Return the times since the last call."""
        self.enter(self.part)
        self._share_out()
        spent = {
            part: Spent(self._cpu[part.number], self._wall[part.number]) for part in Part if self._wall[part.number]
        }
        measurement = Measurement(spent, self.runs, self.decisions, self.simulated_s)
        self.runs = self.decisions = 0
        self.simulated_s = 0.0
        self._wall, self._cpu = [0] * len(Part), [0] * len(Part)
        return measurement

    def _share_out(self) -> None:
        """Divide the CPU time since the last reading among the parts; the time that this takes counts for the profile
        itself.
        """
        cpu = time.process_time_ns()
        spent, self._cpu_read = cpu - self._cpu_read, cpu
        driver, opened = Part.DRIVER.number, self._open
        others = sum(opened) - opened[driver]
        if others > opened[Part.MEASURING.number]:
            waits = self._own_cpu / self._own_wall if self._own_wall else 1.0
            of_driver = min(round(opened[driver] * waits), spent)
        else:
            of_driver = round(spent * opened[driver] / (sum(opened) or 1))
            self._own_cpu += of_driver
            self._own_wall += opened[driver]
        self._cpu[driver] += of_driver
        for number, wall in enumerate(opened):
            if wall:
                self._wall[number] += wall
                if number != driver:
                    self._cpu[number] += (spent - of_driver) * wall // others
                opened[number] = 0
        now = time.perf_counter_ns()
        opened[Part.MEASURING.number] = now - self._since
        self._since = now
