"""rq4: two iterations of DriveFuzz, and the forecast where that found nothing.

A test case that failed is not tried again: what is counted are failing test cases. In each iteration DriveFuzz comes
first, then the forecast, on the unmutated test cases that DriveFuzz did not make fail. Those that neither made fail go
into the second iteration, with other seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from foresee_dsl.campaign.driving import case_name
from foresee_dsl.language.project.document import TestCase
from foresee_study.fuzz.settings import FuzzSettings
from foresee_study.fuzzed import Fuzzed
from foresee_study.measured import Measured
from foresee_study.questions import campaigns
from foresee_study.settings import SECOND_ITERATION, StudySettings, Wanted

Forecasts = Callable[[Wanted, Sequence[TestCase]], Measured | None]
"""Runs a campaign on test cases; None where it was stopped."""
Fuzzes = Callable[[FuzzSettings, Sequence[TestCase], int, int], Fuzzed | None]
"""Fuzzes test cases, in a repetition and an iteration; None where it was stopped."""


@dataclass(frozen=True)
class Split:
    """Which test cases each technique made fail in one iteration, and which are left, by their names."""

    fuzzed: frozenset[str]
    forecast: frozenset[str]
    left: frozenset[str]


def split(names: Iterable[str], fuzzing: Fuzzed, forecasts: Measured) -> Split:
    """Divide test cases by who found a failure; DriveFuzz comes first."""
    all_names = frozenset(names)
    by_fuzzing = fuzzing.failed & all_names
    by_forecast = frozenset(case.name for case in forecasts.usable if case.fails) & (all_names - by_fuzzing)
    return Split(by_fuzzing, by_forecast, all_names - by_fuzzing - by_forecast)


def complement(settings: StudySettings, cases: Sequence[TestCase], *, fuzzes: Fuzzes, forecasts: Forecasts) -> bool:
    """Go through both iterations of every driver and repetition; return whether they were done to the end."""
    for first in campaigns(settings, ("foresee",)):
        if first.repetition >= settings.fuzz_repetitions:
            continue
        remaining = tuple(cases)
        for iteration in (1, 2):
            later = 0 if iteration == 1 else SECOND_ITERATION
            wanted = replace(first, seed=first.seed + later)
            drive = FuzzSettings(first.driver, settings.fuzz_cycles, settings.fuzz_mutations, wanted.seed)
            fuzzing = fuzzes(drive, remaining, first.repetition, iteration)
            forecast = forecasts(wanted, remaining) if fuzzing is not None else None
            if fuzzing is None or forecast is None:
                return False
            left = split((case.name for case in forecast.usable), fuzzing, forecast).left
            remaining = tuple(case for case in remaining if case_name(case) in left)
    return True
