"""Which functions belong to which part of the tool; they are wrapped where a profile was asked for, and only there.

The functions themselves know nothing of it: without a profile nothing here is imported.
"""

from __future__ import annotations

import resource
import sys
import types
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, wraps
from importlib import import_module
from typing import Any, NamedTuple, Self

from foresee_dsl.campaign.profiling.clock import Clock, Part


class Seam(NamedTuple):
    """A function, or methods of a class, that work for a part.

    Attributes:
        module, name: where it is. A class: `methods` (with spaces between; `*`: all public ones that no other seam of
            the class names).
    """

    part: Part
    module: str
    name: str
    methods: str = ""


_SIMULATE = "foresee_dsl.simulate"
RUNS = (
    Seam(Part.START, f"{_SIMULATE}.world", "World", "__init__"),
    Seam(Part.SUMO, f"{_SIMULATE}.world", "World", "step"),
    Seam(Part.WORLD, f"{_SIMULATE}.world", "World", "*"),
    Seam(Part.WORLD, f"{_SIMULATE}.moved_bodies", "MovedBodies", "*"),
    Seam(Part.WORLD, f"{_SIMULATE}.signals", "Signals", "*"),
    Seam(Part.ACTORS, f"{_SIMULATE}.actors.simulation", "Simulation", "step"),
    Seam(Part.DIRECTOR, f"{_SIMULATE}.triggers.director", "Director", "step record"),
    Seam(Part.SENSING, f"{_SIMULATE}.sensing.perception", "Sensing", "observe ego_state table actors signals"),
    Seam(Part.PICTURES, f"{_SIMULATE}.rasters.canvas", "RunViews", "at"),
    Seam(Part.PICTURES, f"{_SIMULATE}.rasters.canvas", "StepViews", "draw birds_eye forward"),
    Seam(Part.JUDGING, f"{_SIMULATE}.runner", "_Run", "_look"),
    Seam(Part.JUDGING, f"{_SIMULATE}.results.near_misses", "near_misses"),
    Seam(Part.JUDGING, f"{_SIMULATE}.triggers.unfired", "unfired"),
    Seam(Part.RECORDING, f"{_SIMULATE}.recorder", "Recorder", "frame event trace"),
    Seam(Part.RECORDING, f"{_SIMULATE}.trace", "Trace", "packed save digest"),
    Seam(Part.PLACING, f"{_SIMULATE}.runner", "_Run", "__init__"),
    Seam(Part.PIPE, "foresee_dsl.drivers.external", "reset_line"),
    Seam(Part.PIPE, "foresee_dsl.drivers.external", "step_line"),
    Seam(Part.PIPE, "foresee_dsl.drivers.external", "read_control"),
    Seam(Part.COMPILE, "foresee_dsl.compile", "compile_test_case"),
    Seam(Part.START, "foresee_dsl.campaign.driving", "made"),
)
"""What a process that runs test cases does."""
_STEPS = "foresee_dsl.campaign.steps"
STEPS = (
    *RUNS,
    Seam(Part.FORECAST, f"{_STEPS}.forecast", "ForecastStep", "run"),
    Seam(Part.CLIP, f"{_STEPS}.forecast", "clip_around"),
    Seam(Part.CLIP, f"{_STEPS}.clip", "ClipStep", "run"),
    Seam(Part.MUTATE, f"{_STEPS}.mutants", "MutantsStep", "run"),
    Seam(Part.MUTATE, f"{_STEPS}.child", "ChildStep", "run"),
    Seam(Part.MINIMISE, f"{_STEPS}.minimise", "MinimiseStep", "run"),
    Seam(Part.EXPLAIN, "foresee_dsl.campaign.findings.failures", "explained"),
    Seam(Part.STORE, f"{_STEPS}.inputs", "load_case"),
    Seam(Part.STORE, f"{_STEPS}.inputs", "load_trace"),
)
"""What a campaign's worker does."""
COMMANDS = (
    Seam(Part.READING, "foresee_dsl.language.project.loading", "load_test_cases"),
    Seam(Part.READING, "foresee_dsl.compile", "placement_mistakes"),
)
"""What a command that runs test cases does beside that."""
CAMPAIGN = (
    *COMMANDS,
    Seam(Part.ENGINE, "foresee_dsl.campaign.stages", "Stages", "__init__ row has_more_time after choose task"),
    Seam(Part.ENGINE, "foresee_dsl.campaign.execution.engine", "run_missing"),
    Seam(Part.STORE, "foresee_dsl.campaign.storage.store", "Store", "__init__ get has add drop close"),
    Seam(Part.FOLDER, "foresee_dsl.campaign.assembly", "assemble"),
    Seam(Part.FOLDER, "foresee_dsl.campaign.folder", "CampaignFolder", "publish"),
)
"""What a campaign's own process does."""


def missing(seams: Sequence[Seam]) -> list[str]:
    """Return the functions and methods that do not exist (any more)."""
    gone = []
    for seam in seams:
        found = getattr(import_module(seam.module), seam.name, None)
        names = [seam.name] if found is None else [m for m in seam.methods.split() if m != "*" and m not in vars(found)]
        gone += [f"{seam.module}: {name}" for name in names]
    return gone


def install(clock: Clock, seams: Sequence[Seam], *, runs: bool = True) -> list[tuple[object, str, Any]]:
    """Wrap the functions, for good or until `remove`; those that do not exist are left out.

    `runs`: in this process runs are simulated.

    Returns:
        What was replaced: its holder, its name there, and what was there.
    """
    replaced: list[tuple[object, str, Any]] = []
    for seam in seams:
        found = getattr(import_module(seam.module), seam.name, None)
        if isinstance(found, type):
            replaced += _wrap_methods(clock, seam, found, seams)
        elif found is not None:
            replaced += _replace(found, _timed(clock, seam.part, found))
    if STEPS[-1] in seams:
        referring = import_module(f"{_STEPS}.referring")
        replaced += _replace(referring.driven, _referring(clock, referring.driven))
    if runs:
        runner = import_module(f"{_SIMULATE}.runner")
        replaced += _replace(runner.run, _counted(clock, runner.run))
        replaced += _replace(runner.Watch, _watching(clock, runner.Watch))
    return replaced


def remove(replaced: Sequence[tuple[object, str, Any]]) -> None:
    """Put back what `install` replaced, also in modules that were imported later."""
    for holder, name, original in reversed(replaced):
        if isinstance(holder, types.ModuleType):
            _replace(getattr(holder, name), original)
        else:
            setattr(holder, name, original)


@contextmanager
def installed(clock: Clock, seams: Sequence[Seam], *, runs: bool = True) -> Iterator[None]:
    """Wrap the functions within it."""
    replaced = install(clock, seams, runs=runs)
    try:
        yield
    finally:
        remove(replaced)


def _wrap_methods(clock: Clock, seam: Seam, owner: type, seams: Sequence[Seam]) -> list[tuple[object, str, Any]]:
    replaced: list[tuple[object, str, Any]] = []
    named = {m for other in seams if other[1:3] == seam[1:3] for m in other.methods.split()}
    for name, method in list(vars(owner).items()):
        public = not name.startswith("_") and name not in named and isinstance(method, types.FunctionType)
        if name not in seam.methods.split() and not (seam.methods == "*" and public):
            continue
        if isinstance(method, cached_property):
            replaced.append((method, "func", method.func))
            method.func = _timed(clock, seam.part, method.func)
        elif isinstance(method, property) and method.fget is not None:
            replaced.append((owner, name, method))
            setattr(owner, name, property(_timed(clock, seam.part, method.fget)))
        elif isinstance(method, types.FunctionType):
            replaced.append((owner, name, method))
            setattr(owner, name, _timed(clock, seam.part, method))
    return replaced


def _replace(original: object, new: object) -> list[tuple[object, str, Any]]:
    """Replace a function or class by something else in all modules of this package that have imported it."""
    if original is new:
        return []
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("foresee_dsl.")]
    places = [(module, name) for module in modules for name, value in list(vars(module).items()) if value is original]
    for module, name in places:
        setattr(module, name, new)
    return [(module, name, original) for module, name in places]


def _timed(clock: Clock, part: Part, function: Callable[..., Any]) -> Callable[..., Any]:
    enter, simulates = clock.enter, part.simulates

    @wraps(function)
    def timed(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - whatever it takes and gives
        if simulates and clock.part is Part.PLACING:  # SUMO steps there too, before the first frame
            return function(*args, **kwargs)
        before = enter(part)
        try:
            return function(*args, **kwargs)
        finally:
            enter(before)

    return timed


def _counted(clock: Clock, run: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function that runs a test case, counting what it does."""
    timed = _timed(clock, Part.LOOP, run)

    @wraps(run)
    def counted(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - as above
        result = timed(*args, **kwargs)
        clock.runs += 1
        clock.simulated_s += result.duration_s
        return result

    return counted


def _referring(clock: Clock, driven: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function that drives with a reference driver, wrapped: its time is not that of the driver under
    test."""
    timed = _timed(clock, Part.EXPLAIN, driven)

    @wraps(driven)
    def referring(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - as above
        clock.refers = True
        try:
            return timed(*args, **kwargs)
        finally:
            clock.refers = False

    return referring


def _watching(clock: Clock, watch: type) -> type:
    """Return the watch over a run's driver, which knows when the driver is at work.

    A driver is not wrapped: frames of ours would be in its tracebacks, and a proxy is no instance of its class.
    """

    class Timed(watch):  # type: ignore[misc]
        _calls = 0

        def __enter__(self) -> Self:
            self._programs_ns = _programs_ns()
            super().__enter__()
            return self

        def __exit__(self, *ended: object) -> None:
            super().__exit__(*ended)
            self.calls = 0
            # An external driver's program has ended by now; it worked while its driver waited for it.
            clock.add(Part.REFERENCES if clock.refers else Part.DRIVER, cpu_ns=_programs_ns() - self._programs_ns)

        def _get(self) -> int:
            return self._calls

        def _set(self, calls: int) -> None:
            if calls % 2:
                # When a run is over, `close` is counted as a call, but from further on.
                self._other_part = clock.decide(begins=calls < 4 or calls > self._calls + 1)
            elif self._calls % 2:
                clock.enter(self._other_part)
            self._calls = calls

        calls = property(_get, _set)  # type: ignore[assignment]  # the run counts it up as before

    return Timed


def _programs_ns() -> int:
    """Return the CPU time of programs that this process started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return round((used.ru_utime + used.ru_stime) * 1e9)
