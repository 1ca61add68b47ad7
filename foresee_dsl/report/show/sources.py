"""Finds the run to show: a stored trace if there is one, otherwise a new simulation of the test case."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foresee_dsl.campaign.driving import case_name, recorded_setup, run_test_case, sensors_of
from foresee_dsl.campaign.findings.named_failure import NamedFailure, find_failure
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.consent import may_start, without_parent
from foresee_dsl.errors import DriverError, ForeseeError
from foresee_dsl.language.diff.addresses import parent_address
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.addresses import is_file, parse_address
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import UnfiredTrigger
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.simulate.triggers.unfired import unfired

if TYPE_CHECKING:
    from foresee_dsl.story import Story


@dataclass(frozen=True)
class ShownRun:
    """A run to show.

    Attributes:
        address: the address with which the user can name the run again. case: its test case. trace: the run.
        driver, seed: the driver and the seed of the run.
        trace_file: the file from which the trace was read; None if the run was simulated now.
    """

    address: str
    case: TestCase
    trace: Trace
    driver: str
    seed: int
    trace_file: Path | None = None

    @cached_property
    def story(self) -> Story:
        """Return the story of the run."""
        from foresee_dsl.story import tell

        return tell(self.trace, self.case)

    @cached_property
    def bundle(self) -> SumoBundle:
        """Return the compiled test case."""
        return compile_test_case(self.case)

    @cached_property
    def unfired(self) -> tuple[UnfiredTrigger, ...]:
        """Return the triggers that never fired, and how near they came to it."""
        return unfired(self.case.scenario, lambda: self.bundle, self.trace, sensors_of(self.driver))


@dataclass(frozen=True)
class RunRequest:
    """The options of `foresee show`.

    Attributes:
        driver: name of the driver; "" for the recorded driver or, for a failure of a campaign whose file records none,
            for the campaign's driver; else `pdm`. seed: likewise; None for the recorded one, else 0.
        campaign: the campaign's folder. allow_outside: whether files may use others outside the project. fresh: whether
            to simulate even if there is a stored trace. full: whether to show the mutant of a finding as it was before
            it was minimised.
    """

    driver: str = ""
    seed: int | None = None
    campaign: Path = Path("out")
    allow_outside: bool = False
    fresh: bool = False
    full: bool = False


def find(target: str, request: RunRequest) -> ShownRun:
    """Return the run of an address, a trace, a mutant's file or a finding's name.

    Raises:
        ForeseeError: nothing has that name, or the test case of a trace was edited after its run.
        DriverError: the file records a program as its driver.
    """
    if target.endswith(".npz"):
        return _of_trace(Path(target), request)
    file, _ = parse_address(target)
    if not is_file(file) and "::" not in target and "/" not in target and not target.endswith(".foresee"):
        failure = find_failure(target, request.campaign, tests=True)
        # If the finding was minimised, its minimised mutant is shown.
        file = (not request.full and failure.minimised) or failure.file
        return of_address(file.as_posix(), request, failure)
    return of_address(target, request)


def of_address(address: str, request: RunRequest, failure: NamedFailure | None = None) -> ShownRun:
    """Return the run of a test case, a clip or a mutant: the stored run if it is up to date, else a new one.

    `failure`: the failure of a campaign whose run it is.
    """
    case = load_test_case(address, allow_outside=request.allow_outside)
    recorded = failure.setup(case) if failure is not None else recorded_setup(case)
    driver, seed = request.driver or recorded.driver, recorded.seed if request.seed is None else request.seed
    if not request.fresh:
        for file in _stored(case, request):
            trace = _same(file, case, driver, seed)
            if trace is not None:
                return ShownRun(address, case, trace, driver, seed, Path(_relative(file.as_posix())))
    if ":" in driver and not request.driver:
        raise DriverError(
            f"{case.id} was recorded with a program as its driver: {driver}. `--driver` with this address starts it"
        )
    return ShownRun(address, case, run_test_case(case, driver, seed).trace, driver, seed)


def parent_of(run: ShownRun, request: RunRequest, say: Callable[[str], None]) -> ShownRun | None:
    """Return the run of a mutant's clip with the same driver and seed; None if the run is not that of a mutant.

    Args:
        run: the mutant's run. request: the options of the command.
        say: is called with a note if the parent is not run because its driver is a program that was not allowed.
    """
    if run.case.mutant is None:
        return None
    address = parent_address(run.case.source.as_posix())
    same = replace(request, driver=run.driver, seed=run.seed, allow_outside=True)
    try:
        return of_address(_relative(address), same)
    except DriverError:  # there is no stored run, and a new one would start a program
        if may_start(run.driver):
            raise
        say(without_parent(run.driver))
        return None


def _of_trace(path: Path, request: RunRequest) -> ShownRun:
    try:
        trace = Trace.load(path)
    except ValueError as err:
        raise ForeseeError(str(err)) from err
    meta = trace.meta
    address = str(meta.get("test_case", ""))
    if not address:
        raise ForeseeError(f"{path} does not state its test case; `foresee run FILE --out DIR` writes traces that do")
    file = _relative(_locate(address, path))
    case = load_test_case(file, allow_outside=request.allow_outside)
    recorded = str(meta.get("meaning", ""))
    if recorded != case.meaning:
        raise ForeseeError(
            f"{path} is a run of an earlier state of {address} ({recorded or 'not recorded'}); it has changed "
            f"since then ({case.meaning}): show the file itself, `foresee show {file}`"
        )
    run = ShownRun(file, case, trace, str(meta.get("driver", "")), int(meta.get("seed", 0)), path)
    if [info.id for info in trace.actors] != [actor.id for actor in run.bundle.scene.actors]:
        raise ForeseeError(f"{path} is damaged: it has other actors than {file}")
    return run


def _locate(address: str, trace: Path) -> str:
    """Return the address of a trace's test case: the path that the trace states, or that file beside the trace (as in a
    campaign's `out`).
    """
    for folder in (Path(), trace.parent, trace.parent.parent):
        moved = (folder / address).as_posix()
        if is_file(parse_address(moved)[0]):
            return moved
    return address


def _stored(case: TestCase, request: RunRequest) -> Iterator[Path]:
    """Yield the existing files in which campaigns store the run's trace: in the folder of the given campaign, and in
    that of the campaign whose folder contains the test case's file.
    """
    beside = case.source.with_suffix(".npz")  # the trace of a minimised finding is in this folder
    if is_file(beside):
        yield beside
    folders = [request.campaign, *(above for above in case.source.parents if (above / "traces").is_dir())]
    for folder in dict.fromkeys(folders):
        file = folder / "traces" / f"{case_name(case)}.npz"
        if is_file(file):
            yield file


def _same(file: Path, case: TestCase, driver: str, seed: int) -> Trace | None:
    """Return a stored trace if test case, driver, seed and version are the same; None otherwise."""
    try:
        trace = Trace.load(file)
    except (ValueError, OSError):
        return None
    meta = trace.meta
    same = (meta.get("meaning"), meta.get("driver"), meta.get("seed")) == (case.meaning, driver, seed)
    return trace if same and _of_this_version(meta, driver) else None


def _of_this_version(meta: dict[str, Any], driver: str) -> bool:
    """Return whether a trace is of this tool and of the driver as it is now.

    The version of a program is not compared: it is known only when the program has started, and showing starts none.
    """
    from foresee_dsl import __version__
    from foresee_dsl.drivers.registry import load_driver

    version = load_driver(driver).version if may_start(driver) else ""
    return meta.get("tool") == __version__ and version in ("", meta.get("driver_version"))


def _relative(address: str) -> str:
    """Return an address relative to the working folder, if the file lies in it."""
    file, case = parse_address(address)
    here = Path.cwd()
    near = file.resolve().relative_to(here) if file.resolve().is_relative_to(here) else file
    return f"{near.as_posix()}::{case}" if case else near.as_posix()
