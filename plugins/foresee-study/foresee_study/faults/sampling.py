"""Selects the test cases of the benchmark: a half of the library by the hash of their names, in a stratified order."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Sequence

from foresee_dsl.files import data_folder
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_cases
from foresee_study.halves import Half, of_half


def library(half: Half = Half.ALL) -> list[TestCase]:
    """Return the bundled test cases of one half, or all, in an order in which every prefix is a stratified sample."""
    places = sorted(str(place) for place in data_folder("scenarios").glob("scenario*"))
    return stratified(of_half(load_test_cases(places), half))


def name(case: TestCase) -> str:
    """Return a test case's address below the folder of the scenarios: `scenario3.foresee::r01`."""
    folder = data_folder("scenarios").resolve()
    return f"{case.source.resolve().relative_to(folder).as_posix()}::{case.id.partition('::')[2]}"


def stratified(cases: Sequence[TestCase]) -> list[TestCase]:
    """Return test cases in an order in which every prefix has each family in nearly the same share as the whole; within
    a family, the hashes of the names give the order.
    """
    families: dict[str, list[TestCase]] = defaultdict(list)
    for case in sorted(cases, key=lambda case: _hash(name(case) + " order")):
        families[case.family].append(case)
    turns = [
        ((place + 0.5) / len(group), family, case)
        for family, group in families.items()
        for place, case in enumerate(group)
    ]
    return [case for _, _, case in sorted(turns, key=lambda turn: turn[:2])]


def _hash(text: str) -> int:
    return int(hashlib.sha256(text.encode()).hexdigest()[:12], 16)
