"""The record that `--profile` prints: how a command's time was divided among the parts of the tool."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from foresee_dsl.campaign.profiling.clock import Measurement, Spent
from foresee_dsl.documents import every_field, rounded
from foresee_dsl.measuring import Part

_NS = 1e-9


@dataclass(frozen=True)
class PartTime:
    """Time of one part of the tool, without the time of nested parts.

    Attributes:
        title: task of the part. cpu_s: CPU time of this program, its workers and drivers' programs. wall_s: wall time,
            summed over processes.
            ms_per_simulated_s: wall time per simulated second. share_of_runs: share of the wall time between the first
            and last frames of all runs; None for parts outside of that time. share: share of all wall time.
    """

    part: Part
    title: str
    cpu_s: float
    wall_s: float
    ms_per_simulated_s: float | None
    share_of_runs: float | None
    share: float

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            **every_field(self),
            "cpu_s": rounded(self.cpu_s, 6),
            "wall_s": rounded(self.wall_s, 6),
            "ms_per_simulated_s": rounded(self.ms_per_simulated_s, 6),
            "share_of_runs": rounded(self.share_of_runs, 4),
            "share": rounded(self.share, 4),
        }


@dataclass(frozen=True)
class Profile:
    """The distribution of a command's time.

    Attributes:
        drivers: the drivers under test. parts: the parts that took any time, in the order of `Part`.
        runs, simulated_s, decisions: amount of measured work, without each run's first decision.
        driver_share: share of the driver's decisions in the time between the first and last frames of all runs; None
            without a decision. decision_ms: mean time of a decision. begin_s: mean time of a driver's reset and first
            decision.
        workers: number of processes that ran test cases. waited_s: sum of their idle times.
        wall_s: wall time of the whole command. not_measured: number of results that were already in the store.
    """

    drivers: tuple[str, ...]
    parts: tuple[PartTime, ...]
    runs: int
    simulated_s: float
    decisions: int
    driver_share: float | None
    decision_ms: float | None
    begin_s: float
    workers: int
    waited_s: float
    wall_s: float
    not_measured: int = 0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            **every_field(self),
            "simulated_s": rounded(self.simulated_s, 2),
            "driver_share": rounded(self.driver_share, 4),
            "decision_ms": rounded(self.decision_ms, 6),
            "begin_s": rounded(self.begin_s, 6),
            "waited_s": rounded(self.waited_s, 3),
            "wall_s": rounded(self.wall_s, 3),
        }

    @classmethod
    def of(
        cls,
        drivers: tuple[str, ...],
        own: Measurement,
        tasks: Measurement,
        *,
        workers: int = 1,
        worked_s: float = 0.0,
        not_measured: int = 0,
    ) -> Self:
        """Return the profile of a command from the measurements of its own process and of its tasks.

        `worked_s`: time during which there were workers.
        """
        both = own + tasks
        spent = {
            part: _worked(part, time_of_part) for part, time_of_part in both.spent.items() if part is not Part.IDLE
        }
        working_ns = sum(time_of_part.wall_ns for time_of_part in spent.values())
        simulating_ns = sum(time_of_part.wall_ns for part, time_of_part in spent.items() if part.simulates)
        decided_ns = spent.get(Part.DRIVER, Spent()).wall_ns
        begin_ns = spent.get(Part.DRIVER_BEGINS, Spent()).wall_ns
        busy_s = sum(time_of_part.wall_ns for part, time_of_part in tasks.spent.items() if part is not Part.IDLE) * _NS
        return cls(
            drivers=drivers,
            parts=tuple(
                _part_time(part, time_of_part, both.simulated_s, simulating_ns, working_ns)
                for part, time_of_part in spent.items()
            ),
            runs=both.runs,
            simulated_s=both.simulated_s,
            decisions=both.decisions,
            driver_share=decided_ns / simulating_ns if both.decisions else None,
            decision_ms=decided_ns / both.decisions * 1e-6 if both.decisions else None,
            begin_s=begin_ns / both.runs * _NS if both.runs else 0.0,
            workers=workers,
            waited_s=max(workers * worked_s - busy_s, 0.0),
            wall_s=sum(time_of_part.wall_ns for time_of_part in own.spent.values()) * _NS,
            not_measured=not_measured,
        )


def _worked(part: Part, time_of_part: Spent) -> Spent:
    """Return the time of a part.

    For distributing tasks and receiving results, only CPU time counts, because their remaining wall time is spent
    waiting.
    """
    return Spent(time_of_part.cpu_ns, time_of_part.cpu_ns) if part is Part.HANDING else time_of_part


def _part_time(part: Part, time_of_part: Spent, simulated_s: float, simulating_ns: int, working_ns: int) -> PartTime:
    return PartTime(
        part,
        part.title,
        time_of_part.cpu_ns * _NS,
        time_of_part.wall_ns * _NS,
        time_of_part.wall_ns * 1e-6 / simulated_s if simulated_s else None,
        time_of_part.wall_ns / simulating_ns if part.simulates else None,
        time_of_part.wall_ns / working_ns if working_ns else 0.0,
    )
