"""The runs of an export: of each test case with a driver and a seed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from foresee_dsl.campaign.driving import recorded_setup, run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.exchange.protocol import Tell
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult


@dataclass(frozen=True)
class ExportedRun:
    """A run that is exported: the test case, what it was compiled to, and its result; `note` says how it ended."""

    case: TestCase
    bundle: SumoBundle
    result: RunResult
    note: str


def runs(
    addresses: Sequence[str], *, driver: str, seed: int | None, allow_outside: bool, tell: Tell
) -> Iterator[ExportedRun]:
    """Yield a run of each test case, clip or mutant.

    Args:
        addresses: each `FILE` or `FILE::CASE`.
        driver, seed: driver and seed of the runs; "" and None: those that a mutant records, otherwise `pdm` and 0.

    Raises:
        ExchangeError: as `driver_and_seed`.
        InputError, CompileError, DriverError: a test case cannot be run.
    """
    for address in addresses:
        case = load_test_case(address, allow_outside=allow_outside)
        tell(f"running {case.id}")
        of_case, number = driver_and_seed(case, driver, seed)
        bundle = compile_test_case(case)
        result = run_test_case(case, of_case, number)
        yield ExportedRun(case, bundle, result, f"{case.id}, driven by {of_case}: {result.reason}")


def driver_and_seed(case: TestCase, driver: str, seed: int | None) -> tuple[str, int]:
    """Return the driver and seed of the run: the given ones, otherwise those that the mutant records.

    Args:
        driver: "" for the recorded one. seed: None for the recorded one.

    Raises:
        ExchangeError: the mutant records a program, which the export of a received file must not start.
    """
    recorded = recorded_setup(case)
    if not driver and ":" in recorded.driver:
        raise ExchangeError(
            f"recorded with a program as its driver ({recorded.driver}): write it, or another driver, with --driver"
        )
    return driver or recorded.driver, recorded.seed if seed is None else seed
