"""The results of benchmarks, and functions that measure and compare costs."""

from __future__ import annotations

import resource
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Figure:
    """A result of a benchmark.

    Attributes:
        name: a short, stable name, such as `cold_check_over_python`.
        value: the measured value. unit: "ratio", "s", ...
        means: the meaning of the value in a sentence.
        target: the largest value that meets the target; None without a target.
        more: larger is better: the target is the smallest value that meets it.
    """

    name: str
    value: float
    unit: str
    means: str
    target: float | None = None
    more: bool = False

    @property
    def met(self) -> bool:
        """Whether the target is met; True without a target."""
        if self.target is None:
            return True
        return self.value >= self.target if self.more else self.value <= self.target


_Cost = float | tuple[float, ...]


def interleaved(works: Mapping[str, Callable[[], _Cost]], rounds: int) -> dict[str, list[float]]:
    """Return the median costs of several works, each done once a round, so that a slow minute slows all of them.

    Args:
        works: functions by name that do the work and return its cost (a number, or several of different kinds).
        rounds: number of rounds.

    Returns:
        For each name, the median of each kind of cost.
    """
    return {name: [statistics.median(kind) for kind in kinds] for name, kinds in costs(works, rounds).items()}


def costs(works: Mapping[str, Callable[[], _Cost]], rounds: int) -> dict[str, list[tuple[float, ...]]]:
    """Return all costs of several works, each done once a round.

    Returns:
        For each name and kind of cost, one value per round.
    """
    samples: dict[str, list[tuple[float, ...]]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            cost = work()
            samples[name].append(cost if isinstance(cost, tuple) else (cost,))
    return {name: list(zip(*rows, strict=True)) for name, rows in samples.items()}


def run_program(command: Sequence[str]) -> tuple[float, float]:
    """Run a program and return its wall time and its CPU time, s.

    The two are equal for a program with one thread, unless other programs use the machine meanwhile.

    Raises:
        CalledProcessError: the program failed.
    """
    passed, spent = time.perf_counter(), _cpu(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=True)  # noqa: S603 - our own
    return time.perf_counter() - passed, _cpu(resource.RUSAGE_CHILDREN) - spent


def cpu_of(work: Callable[[], object]) -> float:
    """Call a function and return the CPU time that this process spent, s."""
    spent = _cpu(resource.RUSAGE_SELF)
    work()
    return _cpu(resource.RUSAGE_SELF) - spent


def peak_mb(pid: str = "self") -> float:
    """Return the peak memory of a process, including shared memory, MB; 0 if the system does not report it.

    `getrusage` is not used, because it reports to a new process the size of its parent.
    """
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0.0
    lines = (line.split() for line in status.splitlines() if line.startswith("VmHWM:"))
    return next((int(words[1]) * 1024 / 1e6 for words in lines), 0.0)


def _cpu(processes: int) -> float:
    usage = resource.getrusage(processes)
    return usage.ru_utime + usage.ru_stime
