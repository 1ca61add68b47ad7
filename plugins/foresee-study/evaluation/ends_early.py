"""Runs the passing children of a campaign once more, ended early and to their clips' ends, and compares both runs.

    python plugins/foresee-study/evaluation/ends_early.py --half even --ranker exhaustive --preset focused --points 40

It prints the number of children, how many ended early, the share of the simulated time that this saves, and every child
whose verdict differs or whose early run is not the beginning of the whole one. The figures of
docs/background/performance.md are from such runs.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from allocations import SCENARIOS, result_of
from foresee_study.halves import Half

from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.records import ClipOutcome
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps.inputs import clip_of, mutant_of
from foresee_dsl.derive.clipping.clip import DRIVES_S
from foresee_dsl.drivers.registry import handover_of, load_driver
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_cases


class Compared(NamedTuple):
    """A passing child: its name, how long its two runs took (s), and what differs ("" for nothing)."""

    name: str
    early_s: float
    whole_s: float
    differs: str


def compared(task: tuple[ClipOutcome, CampaignSettings]) -> list[Compared]:
    """Run the passing children of a clip again, in both ways."""
    clip, settings = task
    case, runs = _cases()[clip.seed], list[Compared]()
    clip_case = expand_clip(clip_of(clip.text), case, source=Path(clip.file))
    setup = DriverSetup(settings.driver, settings.seed)
    for child in clip.children:
        if not child.passed:
            continue
        mutant = expand_mutant(mutant_of(child.text), clip_case, source=Path(child.file))
        early, whole = (replace(setup, ends_early=ends).run(mutant) for ends in (True, False))
        beginning = whole.trace.states[: early.trace.frames]
        same = np.array_equal(early.trace.states, beginning, equal_nan=True)
        differs = "" if whole.passed and same else f"{early.reason} | {whole.reason}"
        runs.append(Compared(child.name, early.duration_s, whole.duration_s, differs))
    return runs


@cache
def _cases() -> dict[str, TestCase]:
    return {case.id: case for case in load_test_cases([SCENARIOS])}


def main() -> None:
    """Run the campaign, compare its children, and print what was seen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--half", type=Half, default=Half.EVEN)
    for option, default in (("driver", "pdm"), ("ranker", "reach"), ("preset", "avoidable")):
        parser.add_argument(f"--{option}", default=default)
    for option, number in (("points", 3), ("children", 4), ("seed", 0), ("jobs", 2)):
        parser.add_argument(f"--{option}", type=int, default=number)
    parser.add_argument("--out", type=Path, default=Path("out/ends_early"))
    chosen = parser.parse_args()
    settings = CampaignSettings(
        driver=chosen.driver, ranker=chosen.ranker, preset=chosen.preset, risky_points=chosen.points,
        children=chosen.children, seed=chosen.seed, against=(),
        handover_s=handover_of(load_driver(chosen.driver), 5.0 - DRIVES_S),
    )  # fmt: skip
    result, _ = result_of(settings, chosen.half, chosen.out, chosen.jobs)
    failing_s = sum(child.duration_s for clip in result.clips for child in clip.children if not child.passed)
    with multiprocessing.get_context("spawn").Pool(chosen.jobs) as pool:
        tasks = [(clip, settings) for clip in result.clips if clip.children]
        runs = [run for some in pool.imap(compared, tasks) for run in some]
    early_s, whole_s = sum(run.early_s for run in runs) + failing_s, sum(run.whole_s for run in runs) + failing_s
    ended = sum(run.early_s < run.whole_s for run in runs)
    different = [f"  {run.name}: {run.differs}" for run in runs if run.differs]
    lines = (
        f"{len(result.children)} children, {len(runs)} passed, {ended} of them ended early",
        f"{whole_s:.0f} s of simulated time without, {early_s:.0f} s with: {1 - early_s / whole_s:.1%} less",
        f"{len(different)} differ",
        *different,
    )
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
