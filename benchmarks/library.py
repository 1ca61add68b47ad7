"""Test cases of the bundled library for benchmarks: all families, near misses on foot, on wheels and behind vans."""

from __future__ import annotations

from collections.abc import Iterator

from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.files import data_folder
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.runner import run

ADDRESSES = (
    "scenario3.foresee::r01",
    "scenario3/behind_the_bus.foresee::schoolchild",
    "scenario4/pulls_out.foresee::van_without_a_look",
    "scenario7.foresee::r03",
    "scenario8/walkers_behind_the_gap.foresee::suitcase_in_the_rain",
    "scenario9/into_the_roundabout.foresee::lorry_past_the_far_arm",
)

EVERY = 6
"""Every sixth of the 120 bundled test cases is clipped: twenty, from all families."""
BEFORE_S, AFTER_S = 5.0, 5.0
"""Length of a clip before and after its risky point, s, as in the bundled campaign."""


def cases() -> list[TestCase]:
    """Return the test cases of `ADDRESSES`."""
    folder = data_folder("scenarios")
    return list(load_test_cases([f"{folder / address}" for address in ADDRESSES]))


def clips() -> Iterator[SumoBundle]:
    """Yield a compiled clip of every sixth bundled test case, around the first risky point of its run with `pdm`."""
    folder = data_folder("scenarios")
    every = load_test_cases([str(path) for path in sorted(folder.glob("scenario*"))])
    ranker = load_ranker("foresee")
    for case in every[::EVERY]:
        trace = run(compile_test_case(case), PdmDriver(), seed=0).trace
        point = ranker.rank(trace, seed=0, before_s=BEFORE_S, after_s=AFTER_S)[0]
        file = case.source.parent / "clip.foresee"  # this file is never written
        model = clip_around(case, trace, point, file, before_s=BEFORE_S, after_s=AFTER_S)
        yield compile_test_case(expand_clip(model, case, source=file))
