"""What a benchmark returns, and how costs are compared."""

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
    """One figure.

    Attributes:
        name: short and stable, such as `cold_check_over_python`.
        value: measured. unit: "ratio", "s", ...
        means: what it measures, in a sentence.
        target: what the value is to be at most; None where it is only for the reader.
        more: more is better: the value is to be at least the target.
    """

    name: str
    value: float
    unit: str
    means: str
    target: float | None = None
    more: bool = False

    @property
    def met(self) -> bool:
        """Whether the target is met (a figure without one meets it)."""
        if self.target is None:
            return True
        return self.value >= self.target if self.more else self.value <= self.target


_Cost = float | tuple[float, ...]


def interleaved(works: Mapping[str, Callable[[], _Cost]], rounds: int) -> dict[str, list[float]]:
    """Return the median cost of several works, each done once a round, so that a slow minute slows all of them.

    Args:
        works: by name, functions that do the work and return what it cost (a number, or several of different kinds).
        rounds: how often.

    Returns:
        By name the median of each kind of cost.
    """
    return {name: [statistics.median(kind) for kind in kinds] for name, kinds in costs(works, rounds).items()}


def costs(works: Mapping[str, Callable[[], _Cost]], rounds: int) -> dict[str, list[tuple[float, ...]]]:
    """Return every cost of several works, each done once a round.

    Returns:
        By name, for each kind of cost, one value a round.
    """
    found: dict[str, list[tuple[float, ...]]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            cost = work()
            found[name].append(cost if isinstance(cost, tuple) else (cost,))
    return {name: list(zip(*rows, strict=True)) for name, rows in found.items()}


def run_program(command: Sequence[str]) -> tuple[float, float]:
    """Run a program and return the seconds that passed, and those of CPU that it spent.

    The two are the same for a program of one thread, unless others wanted the machine meanwhile.

    Raises:
        CalledProcessError: it failed.
    """
    passed, spent = time.perf_counter(), _cpu(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=True)  # noqa: S603 - our own
    return time.perf_counter() - passed, _cpu(resource.RUSAGE_CHILDREN) - spent


def cpu_of(work: Callable[[], object]) -> float:
    """Do something and return the seconds of CPU that this process spent."""
    spent = _cpu(resource.RUSAGE_SELF)
    work()
    return _cpu(resource.RUSAGE_SELF) - spent


def peak_mb(pid: str = "self") -> float:
    """Return how much memory a process has had at most, shared with others or not; 0 where the system does not tell.

    `getrusage` would tell a new process the size of the one that started it.
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
