"""The cost of forecasting a run as a share of simulating it, and the cost of a roll-out of a candidate of `careful`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.figures import Figure, costs, cpu_of
from benchmarks.library import cases
from foresee_dsl.avoidance.candidates.behaviours import Behaviours
from foresee_dsl.avoidance.candidates.ranker import CarefulRanker
from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.avoidance.candidates.scoring import CAREFUL, DRIVES, endings
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.forecast.foresee import close_encounters
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.printer import print_model
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.simulate.world import World

ROUNDS = 5
STYLES = 1 + len(DRIVES) + len(CAREFUL)
_MOST = 0.03
"""Target of the share (docs/background/architecture.md)."""
_TIMES = 5
"""Number of forecasts per measurement, because the clock of CPU time has a resolution of only 10 ms on some systems."""


def figures() -> Iterator[Figure]:
    """Measure, and return the share."""
    settings = CampaignSettings(ranker="foresee", preset="focused", risky_points=4)
    simulating_s = forecasting_s = cutting_s = rolling_s = 0.0
    rolled_out = 0
    with tempfile.TemporaryDirectory() as folder:
        for case in cases():
            trace = run_test_case(case, settings.driver, settings.seed).trace
            taken = _costs(case, trace, settings, Path(folder))
            # The minimum counts, because other programs on the machine only add to the cost.
            simulating_s += min(taken["simulate"][0])
            forecasting_s += min(taken["forecast"][0]) / _TIMES
            cutting_s += min(taken["cut"][0]) / _TIMES
            rolled, candidates = _roll_outs(trace)
            rolling_s, rolled_out = rolling_s + rolled, rolled_out + candidates
    World.close_shared()
    means = "CPU for ranking the moments of a run over CPU for simulating it, with pdm"
    yield Figure("forecast_share", forecasting_s / simulating_s, "ratio", means, _MOST)
    means = "CPU for cutting the clips out (not the forecast's, but the same step of a campaign) over the same"
    yield Figure("clip_cutting_share", cutting_s / simulating_s, "ratio", means)
    means = f"CPU for one candidate of `careful` with {STYLES} styles of driving over 10 s; {rolled_out} candidates"
    yield Figure("candidate_us", 1e6 * rolling_s / max(rolled_out, 1), "us", means)


def _costs(
    case: TestCase, trace: Trace, settings: CampaignSettings, folder: Path
) -> dict[str, list[tuple[float, ...]]]:
    points = _ranked(trace, settings)
    return costs(
        {
            "simulate": lambda: cpu_of(lambda: run_test_case(case, settings.driver, settings.seed)),
            "forecast": lambda: cpu_of(lambda: [_ranked(trace, settings) for _ in range(_TIMES)]),
            "cut": lambda: cpu_of(lambda: [_cut(case, trace, points, settings, folder) for _ in range(_TIMES)]),
        },
        ROUNDS,
    )


def _roll_outs(trace: Trace) -> tuple[float, int]:
    """Return the CPU time of rolling out the candidates of a run's encounters, s, and their number."""
    ranker = CarefulRanker()
    run = RecordedRun.of(trace)
    windows = []
    for encounter in close_encounters(trace, ranker.encounters, before_s=5.0):
        first, last = encounter.frame - 100, min(trace.frames - 1, encounter.frame + 100)
        behaviours = Behaviours(run, first, last, encounter.frame, ranker.settings, np.random.default_rng(0))
        windows.append(list(behaviours.of(encounter.actor)))
    taken = min(cpu_of(lambda: [endings(run, candidates) for candidates in windows]) for _ in range(ROUNDS))
    return taken, sum(map(len, windows))


def _ranked(trace: Trace, settings: CampaignSettings) -> tuple[RiskyPoint, ...]:
    ranker = load_ranker(settings.ranker)
    return ranker.rank(trace, seed=settings.seed, before_s=settings.before_s, after_s=settings.after_s)


def _cut(
    case: TestCase, trace: Trace, points: tuple[RiskyPoint, ...], settings: CampaignSettings, folder: Path
) -> list[str]:
    window = {"before_s": settings.before_s, "after_s": settings.after_s}
    return [
        print_model(clip_around(case, trace, point, folder / f"p{point.rank}.foresee", **window))
        for point in points[: settings.risky_points]
    ]
