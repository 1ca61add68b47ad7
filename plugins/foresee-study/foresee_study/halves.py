"""Halves of the test cases, by a hash of their names: settings are chosen on the even half, results are reported on the
odd half.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from enum import StrEnum
from pathlib import Path

from foresee_dsl.language.document import TestCase


class Half(StrEnum):
    """A half of the test cases, or all of them."""

    EVEN = "even"
    ODD = "odd"
    ALL = "all"


def half_of(address: str) -> Half:
    """Return the half of a test case: whether the SHA-256 of its name, `scenario3.foresee::r01`, is even or odd.

    Its folder does not matter.
    """
    return Half.ODD if _digest(address)[-1] % 2 else Half.EVEN


def of_half(cases: Iterable[TestCase], half: Half) -> tuple[TestCase, ...]:
    """Return the test cases of a half, or all."""
    return tuple(case for case in cases if half in (Half.ALL, half_of(case.id)))


def sample(cases: Sequence[TestCase], count: int | None) -> tuple[TestCase, ...]:
    """Return up to `count` test cases from all families, in their order: those with the smallest hashes; None: all."""
    chosen = sorted(cases, key=lambda case: _digest(case.id))[:count]
    kept = {case.id for case in chosen}
    return tuple(case for case in cases if case.id in kept)


def _digest(address: str) -> bytes:
    return hashlib.sha256(Path(address).name.encode()).digest()
