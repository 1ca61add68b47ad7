"""Test cases of the bundled library to measure with: all families, near misses on foot, on wheels and behind vans."""

from __future__ import annotations

from foresee_dsl.files import data_folder
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.loading import load_test_cases

ADDRESSES = (
    "scenario3.foresee::r01",
    "scenario3/behind_the_bus.foresee::schoolchild",
    "scenario4/pulls_out.foresee::van_without_a_look",
    "scenario7.foresee::r03",
    "scenario8/walkers_behind_the_gap.foresee::suitcase_in_the_rain",
    "scenario9/into_the_roundabout.foresee::lorry_past_the_far_arm",
)


def cases() -> list[TestCase]:
    """Return them, loaded."""
    folder = data_folder("scenarios")
    return list(load_test_cases([f"{folder / address}" for address in ADDRESSES]))
