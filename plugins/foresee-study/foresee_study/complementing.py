"""Runs rq4: two iterations of DriveFuzz, each followed by the forecast on the test cases without a failure.

The study counts failing test cases, so a test case that has failed is not used again. In each iteration DriveFuzz comes
first, then the forecast, on the unmutated test cases in which DriveFuzz found no failure. Test cases in which both
techniques saw no failure go into the second iteration, with other seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from foresee_dsl.campaign.driving import case_name
from foresee_dsl.language.document import TestCase
from foresee_study.fuzz.settings import FuzzSettings
from foresee_study.fuzzed import Fuzzed
from foresee_study.measured import MeasuredCampaign
from foresee_study.questions import campaigns
from foresee_study.settings import SECOND_ITERATION, StudyCampaign, StudySettings

Forecasts = Callable[[StudyCampaign, Sequence[TestCase]], MeasuredCampaign | None]
"""A function that runs a campaign on test cases; it returns None if the campaign was stopped."""
Fuzzes = Callable[[FuzzSettings, Sequence[TestCase], int, int], Fuzzed | None]
"""A function that fuzzes test cases in a repetition and an iteration; it returns None if it was stopped."""


@dataclass(frozen=True)
class Split:
    """The names of the test cases that failed with each technique in one iteration, and of those that are left."""

    fuzzed: frozenset[str]
    forecast: frozenset[str]
    left: frozenset[str]


def split(names: Iterable[str], fuzzing: Fuzzed, forecasts: MeasuredCampaign) -> Split:
    """Divide test cases by the technique that found a failure; DriveFuzz takes precedence."""
    all_names = frozenset(names)
    by_fuzzing = fuzzing.failed & all_names
    by_forecast = frozenset(case.name for case in forecasts.usable if case.fails) & (all_names - by_fuzzing)
    return Split(by_fuzzing, by_forecast, all_names - by_fuzzing - by_forecast)


def complement(settings: StudySettings, cases: Sequence[TestCase], *, fuzzes: Fuzzes, forecasts: Forecasts) -> bool:
    """Run both iterations for every driver and repetition; return whether all were completed."""
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
