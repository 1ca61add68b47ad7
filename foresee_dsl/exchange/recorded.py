"""The driver and the seed with which an export runs a test case."""

from __future__ import annotations

from foresee_dsl.campaign.driving import recorded_run
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.project.document import TestCase


def driver_and_seed(case: TestCase, driver: str, seed: int | None) -> tuple[str, int]:
    """Return the driver and seed of the run: the given ones, otherwise those that the mutant records.

    Args:
        driver: "" for the recorded one. seed: None for the recorded one.

    Raises:
        ExchangeError: the mutant records a program, which the export of a received file must not start.
    """
    recorded, number = recorded_run(case.mutant.origin if case.mutant is not None else None)
    if not driver and ":" in recorded:
        raise ExchangeError(
            f"recorded with a program as its driver ({recorded}): write it, or another driver, with --driver"
        )
    return driver or recorded, number if seed is None else seed
