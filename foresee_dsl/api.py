"""The package for programs and notebooks: `import foresee_dsl as fs`, then `fs.run(...)`.

The functions are the commands of the same names, and return records instead of printing them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.assessment import DriverRun, assess_drivers
from foresee_dsl.campaign.conformance.records import Conformance
from foresee_dsl.campaign.conformance.suite import conform as _conform
from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers import CPUS
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.derive.clipping.clip import DRIVES_S
from foresee_dsl.drivers.consent import allowing
from foresee_dsl.drivers.protocol import Driver, checked_driver
from foresee_dsl.drivers.registry import handover_of, load_driver, reference_drivers
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.notebooks import show_as
from foresee_dsl.report.notebook import Finding, html_of_case, html_of_run, read_findings
from foresee_dsl.simulate.results.verdict import RunResult, Verdict

__all__ = [
    "Conformance",
    "Finding",
    "RunResult",
    "TestCase",
    "Verdict",
    "assess",
    "campaign",
    "conform",
    "findings",
    "load",
    "run",
]

Cases = str | Path | TestCase | Iterable[str | Path | TestCase]
"""Test cases: a file, a folder, an address (`FILE::CASE`), a loaded test case, or several of these."""

show_as(TestCase, html_of_case)
show_as(RunResult, html_of_run)


def load(paths: Cases) -> tuple[TestCase, ...]:
    """Return all test cases of files, folders and addresses.

    Raises:
        InputError: the files have errors, with their places, or there is no scenario.
    """
    listed = [paths] if isinstance(paths, str | Path | TestCase) else list(paths)
    cases: list[TestCase] = []
    for path in listed:
        cases += [path] if isinstance(path, TestCase) else load_test_cases([path])
    return tuple(cases)


def run(case: str | Path | TestCase, driver: str | Driver | type = "pdm", *, seed: int = 0) -> RunResult:
    """Drive one test case in this process, and return how it ended, with the trace.

    Args:
        case: a test case, or its address. driver: a driver's address as for `--driver` (naming a program is consent to
            start it), an object with the methods of a driver, or its class.

    Raises:
        InputError: the file has errors. DriverError: there is no such driver, or the object is not a driver.
    """
    test_case = case if isinstance(case, TestCase) else load_test_case(case)
    if isinstance(driver, str):
        with allowing([driver]):
            return run_test_case(test_case, driver, seed)
    loaded = checked_driver(driver() if isinstance(driver, type) else driver, repr(driver))
    return DriverSetup(loaded.name, seed).run(test_case, lambda: loaded)


def assess(
    cases: Cases, drivers: str | Iterable[str] = "pdm", *, jobs: int = CPUS, seed: int = 0
) -> tuple[DriverRun, ...]:
    """Drive test cases with each of the drivers, in several processes, and return a record of each run.

    Raises:
        InputError, DriverError: as `run`.
    """
    addresses = [drivers] if isinstance(drivers, str) else list(drivers)
    with allowing(addresses), _without_main():
        return assess_drivers(load(cases), addresses, jobs=jobs, seed=seed)


def campaign(
    cases: Cases,
    driver: str = "pdm",
    *,
    out: str | Path = "out",
    jobs: int = CPUS,
    **settings: Any,  # noqa: ANN401 - of `CampaignSettings`
) -> CampaignResult:
    """Do the whole method: drive test cases, cut clips, mutate them, group the failures; write a campaign's folder.

    Results in the folder's store are not computed again. `findings(out)` returns what was found.

    Args:
        settings: of `CampaignSettings`, such as `children=8, risky_points=2, before_s=4.0`.

    Raises:
        InputError, DriverError: as `run`. TypeError: there is no such setting.
    """
    with allowing([driver]), _without_main():
        defaults = CampaignSettings(driver=driver, **settings)
        settings.setdefault("against", reference_drivers(driver))
        settings.setdefault("handover_s", handover_of(load_driver(driver), max(defaults.before_s - DRIVES_S, 0.0)))
        with Store(Path(out) / "store") as store:
            return run_campaign(
                load(cases), CampaignSettings(driver=driver, **settings), out=Path(out), store=store,
                options=RunOptions(jobs=jobs), repeat=True,
            )  # fmt: skip


def findings(folder: str | Path = "out") -> tuple[Finding, ...]:
    """Return the findings of a campaign's folder, the driver's own faults first.

    Raises:
        ForeseeError: the folder does not hold a campaign.
    """
    return read_findings(Path(folder))


def conform(driver: str, *, jobs: int = CPUS, seed: int = 0) -> Conformance:
    """Check a driver from outside, as `foresee conform` does.

    Raises:
        DriverError: there is no such driver.
    """
    with allowing([driver]), _without_main():
        return _conform(driver, seed=seed, jobs=jobs)


@contextmanager
def _without_main() -> Iterator[None]:
    """Keep worker processes, which start within this block, from executing the caller's script.

    They need only installed packages. Python's `multiprocessing` would execute the script in each of them, so that one
    without `if __name__ == "__main__":` would begin its campaign again and again.
    """
    main = sys.modules["__main__"]
    before = main.__spec__, getattr(main, "__file__", None)
    main.__spec__, main.__file__ = None, None
    try:
        yield
    finally:
        main.__spec__, main.__file__ = before
