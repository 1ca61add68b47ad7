"""Which part of the tool is at work: `with Part.SUMO:`, or `@Part.COMPILE.measured` for a whole function.

Without `--profile` no clock runs, and a block costs a tenth of a microsecond. With it, each part's time is counted
(`campaign.profiling`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from functools import wraps
from typing import Any, Protocol, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


class RunningClock(Protocol):
    """What counts the time of parts; times nest."""

    refers: bool
    """Whether a reference driver drives, not the driver under test."""

    def begin(self, part: Part) -> None:
        """Count for a part from now on."""

    def begin_decision(self, *, first: bool) -> None:
        """Count for the driver; `first`: it is reset, closed, or asked for its first decision."""

    def end(self) -> None:
        """Count for the part again that was at work before the last `begin`."""

    def add_programs(self, cpu_ns: int) -> None:
        """Count the CPU time of the driver's programs, which have ended."""

    def count_run(self, simulated_s: float) -> None:
        """Count a run that is over."""


_clock: RunningClock | None = None


def start(clock: RunningClock | None) -> None:
    """Let a clock count the parts of this process from now on; None: no clock."""
    global _clock  # noqa: PLW0603 - one clock a process, as there is one CPU time
    _clock = clock


def clock() -> RunningClock | None:
    """Return the clock of this process, if one runs."""
    return _clock


@contextmanager
def reference_driver() -> Iterator[None]:
    """Count drivers' time within it as that of a reference driver."""
    if _clock is None:
        yield
        return
    _clock.refers = True
    try:
        yield
    finally:
        _clock.refers = False


def count_run(simulated_s: float) -> None:
    """Count a run that is over."""
    if _clock is not None:
        _clock.count_run(simulated_s)


class Part(Enum):
    """A part of the tool that time is counted for. A member is a context: within it the part is at work.

    Attributes:
        number: its place in this list. title: what it does, for people. own: CPU time is read at its beginning and end.
        simulates: it is at work between the first frame of a run and the last.
    """

    DRIVER = "driver", "driver: decisions", "simulates"
    DRIVER_BEGINS = "driver_begins", "driver: reset, first step, close", "own simulates"
    REFERENCES = "references", "reference drivers' decisions", "simulates"
    PIPE = "pipe", "writing and reading a program's lines", "simulates"
    SUMO = "sumo", "SUMO's own step", "simulates"
    WORLD = "world", "telling and reading SUMO", "simulates"
    ACTORS = "actors", "ego and other actors", "simulates"
    DIRECTOR = "director", "director: triggers, conditions", "simulates"
    SENSING = "sensing", "sensing", "simulates"
    PICTURES = "pictures", "pictures for the driver", "simulates"
    JUDGING = "judging", "judging", "simulates"
    RECORDING = "recording", "recording", "simulates"
    LOOP = "loop", "the loop around these", "simulates"
    MEASURING = "measuring", "the profile itself", ""
    PLACING = "placing", "placing everybody in SUMO", "own"
    COMPILE = "compile", "compiling", "own"
    FORECAST = "forecast", "forecast", "own"
    CLIP = "clip", "clips: cutting, comparing", "own"
    MUTATE = "mutate", "mutants: drawing, writing", "own"
    EXPLAIN = "explain", "failures: models, stories", "own"
    MINIMISE = "minimise", "minimising findings", "own"
    STORE = "store", "store: results, traces", "own"
    FOLDER = "folder", "writing the campaign's folder", "own"
    ENGINE = "engine", "deciding what is next", "own"
    HANDING = "handing", "handing tasks to workers", "own"
    READING = "reading", "reading and checking scenarios", "own"
    START = "start", "start-up: Python, imports, SUMO", "own"
    REST = "rest", "the rest (reports, pages)", "own"
    IDLE = "idle", "waiting", "own"

    def __new__(cls, name: str, title: str, flags: str) -> Part:
        """Make one; its value is its name in JSON."""
        made = object.__new__(cls)
        made._value_ = name
        made.number = len(cls.__members__)
        made.title, made.own, made.simulates = title, "own" in flags, "simulates" in flags
        return made

    number: int
    title: str
    own: bool
    simulates: bool

    def __enter__(self) -> None:
        """The part begins to work."""
        if _clock is not None:
            _clock.begin(self)

    def __exit__(self, *_: object) -> None:
        """What was at work before goes on."""
        if _clock is not None:
            _clock.end()

    def measured(self, function: F) -> F:
        """Let a function work for this part."""

        @wraps(function)
        def within(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - whatever it takes and gives
            with self:
                return function(*args, **kwargs)

        return cast(F, within)
