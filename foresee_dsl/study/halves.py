"""Halves of the test cases, by a hash of their names: settings are chosen on the even one, reported on the odd one."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from enum import StrEnum

from foresee_dsl.campaign.driving import case_name
from foresee_dsl.language.project.document import TestCase


class Half(StrEnum):
    """Which test cases are meant."""

    EVEN = "even"
    ODD = "odd"
    ALL = "all"

    def holds(self, name: str) -> bool:
        """Return whether a test case of this name (`red_light_runner_r02`) belongs to it."""
        return self in (Half.ALL, half_of(name))


def half_of(name: str) -> Half:
    """Return the half of a name: whether its SHA-256, as a number, is even or odd."""
    return Half.ODD if hashlib.sha256(name.encode()).digest()[-1] % 2 else Half.EVEN


def of_half(cases: Iterable[TestCase], half: Half) -> tuple[TestCase, ...]:
    """Return the test cases of a half."""
    return tuple(case for case in cases if half.holds(case_name(case)))
