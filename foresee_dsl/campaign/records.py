"""What the steps of a campaign give, as immutable records, and how they are stored: as compressed JSON."""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass
from functools import cache
from typing import Any, get_args

from pydantic import TypeAdapter

from foresee_dsl.derive.preventability import Preventability, Preventable
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import Impact, Verdict
from foresee_dsl.story import Story


@dataclass(frozen=True)
class SeedOutcome:
    """One test case as it was run, unmutated. `preventability` and `story`: of a failure."""

    id: str
    family: str
    scenario: str
    verdict: Verdict
    reason: str
    duration_s: float
    wall_s: float
    trace: str = ""
    meaning: str = ""
    """Its test case's, here and of a child: how another campaign finds the same one."""
    risky_points: int = 0
    impact: Impact | None = None
    near: NearMisses | None = None
    preventability: Preventability | None = None
    story: Story | None = None


@dataclass(frozen=True)
class Draft:
    """A clip before it was run.

    Attributes:
        rank: its risky point's. text: its file. name, parent, case: as in its first line.
        pin: what a child of it pins. risk: a hash of its `risk` line, by which it is mutated.
    """

    rank: int
    text: str
    name: str
    parent: str
    case: str
    pin: str
    risk: str


@dataclass(frozen=True)
class Forecast:
    """The risky points of a run: how many there are, and the clips around the first of them."""

    points: int
    drafts: tuple[Draft, ...]


@dataclass(frozen=True)
class MutantDraft:
    """A mutant before it was run. `number`: the last part of its name. `meaning`: its test case's."""

    number: int
    text: str
    meaning: str


@dataclass(frozen=True)
class Mutants:
    """The mutants of one clip."""

    drafts: tuple[MutantDraft, ...]


@dataclass(frozen=True)
class ChildOutcome:
    """One mutant as it was run; `text` already holds what was found. `preventability` and `story`: of a failure."""

    name: str
    file: str
    text: str
    operators: tuple[str, ...]
    verdict: Verdict
    with_: str
    reason: str
    time_s: float
    duration_s: float
    digest: str
    meaning: str = ""
    preventability: Preventability | None = None
    impact: Impact | None = None
    near: NearMisses | None = None
    story: Story | None = None

    @property
    def preventable(self) -> Preventable | None:
        """Whether a careful driver would have avoided it; None where it was no failure, or was not looked at."""
        return self.preventability.verdict if self.preventability else None


@dataclass(frozen=True)
class ClipOutcome:
    """One clip as it was run unmutated, and its children.

    `largest_m`: the largest deviation of any actor from the parent's window. `median_m`: the median over the other
    actors. `within`: the share of the other actors that stay within 0.1 m. `others_m`: the largest deviation of each of
    them. `ego_m`: the ego's.
    """

    seed: str
    family: str
    name: str
    file: str
    text: str
    rank: int
    verdict: Verdict
    reason: str
    duration_s: float
    wall_s: float
    largest_m: float
    median_m: float
    within: float
    children: tuple[ChildOutcome, ...] = ()
    others_m: tuple[float, ...] = ()
    ego_m: float = 0.0

    @property
    def failing(self) -> tuple[ChildOutcome, ...]:
        """The children that failed."""
        return tuple(c for c in self.children if c.verdict.is_failure)


Record = SeedOutcome | Forecast | ClipOutcome | Mutants | ChildOutcome
"""A step's result. A new one is added here; `campaign.assembly` then fails the type check until it knows it."""


def encode(record: Record) -> bytes:
    """Return a record as it is stored; floats keep every bit."""
    plain = _adapter(type(record).__name__).dump_python(record, mode="json")
    # Level 1: a clip's 8 kB of text become 2 kB in 0.1 ms; level 6 saves another tenth and takes three times as long.
    return zlib.compress(json.dumps(plain, separators=(",", ":")).encode(), 1)


def decode(data: bytes, kind: type[Any]) -> Record:
    """Return a stored record.

    Raises:
        ValueError: another version of the record's class wrote it.
    """
    record: Record = _adapter(kind.__name__).validate_json(zlib.decompress(data))
    return record


@cache
def _adapter(name: str) -> TypeAdapter[Any]:
    return TypeAdapter(next(kind for kind in get_args(Record) if kind.__name__ == name))
