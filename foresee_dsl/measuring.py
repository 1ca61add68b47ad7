"""Attribution of time to parts of the tool: `with Part.SUMO:`, or `@Part.COMPILE.measured` for a whole function.

Without `--profile` no clock runs, and such a block costs 0.1 microseconds. With it, `campaign.profiling` sums up the
time of each part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from functools import wraps
from typing import Any, Protocol, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


class RunningClock(Protocol):
    """A clock that counts the time of parts; the parts nest."""

    refers: bool
    """True while a reference driver drives instead of the driver under test."""

    def begin(self, part: Part) -> None:
        """Count the time from now on for a part."""

    def begin_decision(self, *, first: bool) -> None:
        """Count the time from now on for the driver; `first`: whether it is reset or closed, or makes its first
        decision."""

    def end(self) -> None:
        """Count again for the part that was active before the last `begin`."""

    def add_programs(self, cpu_ns: int) -> None:
        """Add the CPU time of the driver's programs, which have ended, in ns."""

    def count_run(self, simulated_s: float) -> None:
        """Count a finished run and its simulated time."""


_clock: RunningClock | None = None


def start(clock: RunningClock | None) -> None:
    """Use a clock for this process from now on; None: stop counting."""
    global _clock  # noqa: PLW0603 - one clock per process, as CPU time is per process
    _clock = clock


def clock() -> RunningClock | None:
    """Return the clock of this process, if one runs."""
    return _clock


@contextmanager
def reference_driver() -> Iterator[None]:
    """Count the time of drivers inside this context as that of a reference driver."""
    if _clock is None:
        yield
        return
    _clock.refers = True
    try:
        yield
    finally:
        _clock.refers = False


def count_run(simulated_s: float) -> None:
    """Count a finished run and its simulated time."""
    if _clock is not None:
        _clock.count_run(simulated_s)


class Part(Enum):
    """A part of the tool whose time is counted. A member is a context manager: inside it the part is active.

    Attributes:
        number: its index in this list. title: its task, for people. own: CPU time is read at its beginning and end.
        simulates: it is active between the first and the last frame of a run.
    """

    DRIVER = "driver", "driver: decisions", "simulates"
    DRIVER_BEGINS = "driver_begins", "driver: reset, first step, close", "own simulates"
    REFERENCES = "references", "reference drivers' decisions", "simulates"
    PIPE = "pipe", "writing and reading a program's lines", "simulates"
    SUMO = "sumo", "SUMO's own step", "simulates"
    WORLD = "world", "orders to SUMO, reading it", "simulates"
    ACTORS = "actors", "ego and other actors", "simulates"
    DIRECTOR = "director", "director: triggers, conditions", "simulates"
    SENSING = "sensing", "sensing", "simulates"
    PICTURES = "pictures", "pictures for the driver", "simulates"
    JUDGING = "judging", "judging", "simulates"
    RECORDING = "recording", "recording", "simulates"
    LOOP = "loop", "the loop around these", "simulates"
    MEASURING = "measuring", "the profile itself", ""
    PLACING = "placing", "placing the actors in SUMO", "own"
    COMPILE = "compile", "compiling", "own"
    FORECAST = "forecast", "forecast", "own"
    CLIP = "clip", "clips: cutting, comparing", "own"
    MUTATE = "mutate", "mutants: drawing, writing", "own"
    EXPLAIN = "explain", "failures: models, stories", "own"
    MINIMISE = "minimise", "minimising findings", "own"
    STORE = "store", "store: results, traces", "own"
    FOLDER = "folder", "writing the campaign's folder", "own"
    ENGINE = "engine", "choosing the next task", "own"
    HANDING = "handing", "handing tasks to workers", "own"
    READING = "reading", "reading and checking scenarios", "own"
    START = "start", "start-up: Python, imports, SUMO", "own"
    REST = "rest", "the rest (reports, pages)", "own"
    IDLE = "idle", "waiting", "own"

    def __new__(cls, name: str, title: str, flags: str) -> Part:
        """Create a member; its value is its name in JSON."""
        part = object.__new__(cls)
        part._value_ = name
        part.number = len(cls.__members__)
        part.title, part.own, part.simulates = title, "own" in flags, "simulates" in flags
        return part

    number: int
    title: str
    own: bool
    simulates: bool

    def __enter__(self) -> None:
        """Count for this part from now on."""
        if _clock is not None:
            _clock.begin(self)

    def __exit__(self, *_: object) -> None:
        """Count again for the part that was active before."""
        if _clock is not None:
            _clock.end()

    def timed(self, function: F) -> F:
        """Return a function for one run whose time counts for this part: without a clock, the function itself."""
        return function if _clock is None else self.measured(function)

    def measured(self, function: F) -> F:
        """Return a function whose time counts for this part."""

        @wraps(function)
        def within(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - arguments and result of any function
            with self:
                return function(*args, **kwargs)

        return cast(F, within)
