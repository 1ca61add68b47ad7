"""What the steps of a campaign give, and how it is kept: JSON by the classes' own fields, compressed."""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeVar

from pydantic import TypeAdapter

from foresee_dsl.campaign.results import ChildOutcome, ClipOutcome, SeedOutcome

Kind = Literal["seed", "forecast", "clip", "mutants", "child"]
"""The kinds of step, in the order in which they follow from each other."""
KINDS: tuple[Kind, ...] = ("seed", "forecast", "clip", "mutants", "child")
RUNS: tuple[Kind, ...] = ("seed", "clip", "child")
"""Those that drive."""


@dataclass(frozen=True)
class Draft:
    """A clip before it was run.

    Attributes:
        rank: its risky point's. text: its file. name, parent, case: what its first line says.
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


Record = SeedOutcome | Forecast | ClipOutcome | Mutants | ChildOutcome
_CLASSES: dict[str, type[Any]] = {
    "seed": SeedOutcome,
    "forecast": Forecast,
    "clip": ClipOutcome,
    "mutants": Mutants,
    "child": ChildOutcome,
}
_T = TypeVar("_T")


@dataclass(frozen=True)
class Made:
    """What a worker hands over: one record, and the trace (a packed `.npz`) that belongs to it."""

    key: str
    kind: Kind
    name: str
    record: Record
    trace: bytes | None = None
    driver: str = ""
    wall_s: float = 0.0


def encode(record: Record, kind: Kind) -> bytes:
    """Return a record as it is kept; floats keep every bit."""
    plain = _adapter(kind).dump_python(record, mode="json")
    # Level 1: a clip's 8 kB of text become 2 kB in 0.1 ms; level 6 saves another tenth and takes three times as long.
    return zlib.compress(json.dumps(plain, separators=(",", ":")).encode(), 1)


def decode(data: bytes, kind: Kind, of: type[_T]) -> _T:
    """Return a record as it was.

    Raises:
        ValueError: another version of the record's class wrote it.
    """
    record = _adapter(kind).validate_json(zlib.decompress(data))
    if not isinstance(record, of):
        raise TypeError(f"a record of kind {kind} is a {type(record).__name__}, not a {of.__name__}")
    return record


@cache
def _adapter(kind: Kind) -> TypeAdapter[Any]:
    return TypeAdapter(_CLASSES[kind])
