"""What the steps of a campaign give, as immutable records, and how they are stored: as compressed JSON."""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, get_args

from pydantic import TypeAdapter

from foresee_dsl.avoidance.anticipating import Anticipation
from foresee_dsl.avoidance.judges import AnyJudgement
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.derive.minimise.outcome import Boundary, Dropped
from foresee_dsl.files import unpacked_within
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import DriverNotes, Impact, Verdict, passes
from foresee_dsl.story import Story


class Judged:
    """What records of failures have in common: the judges' answers, and what follows from them."""

    judgements: tuple[AnyJudgement, ...]
    references: tuple[ReferenceRun, ...]

    @property
    def preventability(self) -> Preventability | None:
        """The answer of R157's driver; None where it was no failure."""
        return next((found for found in self.judgements if isinstance(found, Preventability)), None)

    @property
    def anticipation(self) -> Anticipation | None:
        """That of the anticipating driver, likewise."""
        return next((found for found in self.judgements if isinstance(found, Anticipation)), None)

    @property
    def preventable(self) -> Preventable | None:
        """Whether a careful driver would have avoided it; None where it was no failure, or was not looked at."""
        return self.preventability.verdict if self.preventability else None

    @property
    def avoided(self) -> tuple[ReferenceRun, ...]:
        """Those of its runs with other drivers that pass, where these drivers pass the unmutated clip as well."""
        return tuple(run for run in self.references if run.avoids)

    @property
    def avoidable(self) -> bool:
        """Whether any judge or another driver avoids it, or would have."""
        return any(found.avoids for found in (*self.judgements, *self.references))


@dataclass(frozen=True)
class SeedOutcome(Judged):
    """One test case as it was run, unmutated. `judgements` and `story`: of a failure. `notes`: if
    there are any."""

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
    judgements: tuple[AnyJudgement, ...] = ()
    story: Story | None = None
    notes: DriverNotes | None = None
    references: tuple[ReferenceRun, ...] = ()
    """Of a failure: its runs with other drivers."""
    broken_expectations: tuple[str, ...] = ()
    """The expectations that do not hold, a sentence each."""

    shown = (
        "test_case=id family meaning verdict broken_expectations reason duration_s:2 risky_points impact "
        "near_misses=near preventability anticipation references story notes trace"
    )

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return passes(self.verdict, self.broken_expectations)


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
    """The mutants of one clip.

    Attributes:
        plans: by which its children are drawn (`derive.mutate.Mutator.plans`).
        searched: how many children the preset's search has, where rounds may ask for them.
    """

    drafts: tuple[MutantDraft, ...]
    plans: tuple[tuple[tuple[str, str], ...], ...] = ()
    searched: int = 0


@dataclass(frozen=True)
class ChildOutcome(Judged):
    """One mutant as it was run; `text` already holds what was found. `judgements` and `story`: of a failure."""

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
    judgements: tuple[AnyJudgement, ...] = ()
    impact: Impact | None = None
    near: NearMisses | None = None
    story: Story | None = None
    notes: DriverNotes | None = None
    """Of a run that did not pass, if there are any."""
    references: tuple[ReferenceRun, ...] = ()
    """Of a failure: its runs with other drivers."""
    round: int | None = None
    """The round that asked for it, where children are allocated in rounds."""
    drawn_near: str = ""
    """The child of the same clip near which it was drawn, if it was."""
    broken_expectations: tuple[str, ...] = ()
    """As of a `SeedOutcome`."""

    shown = (
        "mutant=name round drawn_near? meaning operators changes verdict broken_expectations with=with_ reason "
        "digest file=failed_file? impact near_misses=near preventability anticipation references story"
    )

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return passes(self.verdict, self.broken_expectations)

    @property
    def changes(self) -> list[str]:
        """What the mutant changes, as its file says it (parsing 1,200 mutants for the same words takes seconds)."""
        lines = (line.strip() for line in self.text.splitlines() if "change " in line)
        return [line.removeprefix("change ") for line in lines if line.startswith("change ")]

    @property
    def failed_file(self) -> str:
        """Its file, which only a failure has."""
        return self.file if self.verdict.is_failure else ""


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
    notes: DriverNotes | None = None
    """As of a `ChildOutcome`."""

    shown = (
        "clip=name test_case=seed verdict deviation_m/max=largest_m?:4 deviation_m/median_others=median_m?:4 "
        "deviation_m/ego=ego_m?:4 within_0.1_m=within:4 children"
    )

    @property
    def failing(self) -> tuple[ChildOutcome, ...]:
        """The children that failed."""
        return tuple(c for c in self.children if c.verdict.is_failure)


class Reduced(NamedTuple):
    """How many there were before, and are now."""

    before: int = 0
    now: int = 0


_NONE = Reduced()


@dataclass(frozen=True)
class Minimised:
    """The representative of a finding, made as small as its failure allows.

    Attributes:
        child: its run. clip: the name of its clip. clip_text: that clip's file.
        dropped: what was left out. boundaries: where its numbers begin to fail.
        changes, actors, clip_lines: how many there were before and are now; lines of a clip's file.
        runs: how many that took. complete: whether the budget was enough for all reductions.
        note: why it is as it was, or less small than it might be; "" where there is nothing to say.
    """

    child: ChildOutcome
    clip: str
    clip_text: str
    dropped: Dropped = field(default_factory=Dropped)
    boundaries: tuple[Boundary, ...] = ()
    changes: Reduced = _NONE
    actors: Reduced = _NONE
    clip_lines: Reduced = _NONE
    runs: int = 0
    complete: bool = True
    note: str = ""

    shown = (
        "file clip=clip_file changed=child.changes reason=child.reason sentence=child.story.sentence "
        "preventability=child.preventable anticipation=child.anticipation.answer references=child.references "
        "dropped changes actors clip_lines "
        "boundary=boundaries runs complete note"
    )

    @property
    def folder(self) -> str:
        """Where its files are, relative to the campaign's folder."""
        return f"findings/{self.child.name}"

    @property
    def file(self) -> str:
        """Its mutant's file, likewise."""
        return f"{self.folder}/{self.child.name}.foresee"

    @property
    def clip_file(self) -> str:
        """Its clip's, likewise."""
        return f"{self.folder}/{self.clip}.foresee"


Record = SeedOutcome | Forecast | ClipOutcome | Mutants | ChildOutcome | ReferenceRun | Minimised
"""A step's result. A new one is added here; `campaign.assembly` then fails the type check until it knows it."""


def encode(record: Record) -> bytes:
    """Return a record as it is stored; floats keep every bit."""
    plain = _adapter(type(record).__name__).dump_python(record, mode="json")
    # Level 1: a clip's 8 kB of text become 2 kB in 0.1 ms; level 6 saves another tenth and takes three times as long.
    return zlib.compress(json.dumps(plain, separators=(",", ":")).encode(), 1)


def decode(data: bytes, kind: type[Any]) -> Record:
    """Return a stored record.

    Raises:
        ValueError: another version of the record's class wrote it, or it is larger than the limit `record` allows.
    """
    record: Record = _adapter(kind.__name__).validate_json(unpacked_within("record", data))
    return record


@cache
def _adapter(name: str) -> TypeAdapter[Any]:
    return TypeAdapter(next(kind for kind in get_args(Record) if kind.__name__ == name))
