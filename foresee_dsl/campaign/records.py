"""The records of a campaign's results (test cases, clips, mutants, findings) and their storage as compressed JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, Self, get_args

from pydantic import TypeAdapter

from foresee_dsl.avoidance.anticipating import Answer, Anticipation
from foresee_dsl.avoidance.judge import Opinion
from foresee_dsl.avoidance.judges import AnyJudgement
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.avoidance.responsibility import Responsibility, responsibility_of
from foresee_dsl.derive.minimise.outcome import Boundary, DropCounts
from foresee_dsl.documents import every_field, or_null, packed, read_fields, read_record, rounded, unpacked, where_set
from foresee_dsl.simulate.results.goal import GoalMargin
from foresee_dsl.simulate.results.verdict import NO_NOTES, DriverNotes, RunRecord, Verdict
from foresee_dsl.story import Story


@dataclass(frozen=True, kw_only=True)
class JudgedRun(RunRecord):
    """The run of a test case or a mutant in a campaign, with the judges' answers if it failed.

    Attributes:
        judgements, story: for a failure, the judges' answers and what happened.
        references: for a failure, its runs with reference drivers.
        goal: how near the run came to breaking the campaign's goal; None without a goal.
        meaning: hash of the test case's meaning, by which another campaign finds the same test case.
    """

    judgements: tuple[AnyJudgement, ...] = ()
    references: tuple[ReferenceRun, ...] = ()
    story: Story | None = None
    goal: GoalMargin | None = None
    meaning: str = ""

    @classmethod
    def from_document(cls, data: Mapping[str, Any]) -> Self:
        """Return the run that a JSON document states. A child has of its text only the changes, and a file only if it
        failed.
        """
        return cls(**cls._fields_in(data))

    @classmethod
    def _fields_in(cls, data: Mapping[str, Any]) -> dict[str, Any]:
        judges: dict[str, type[AnyJudgement]] = {"preventability": Preventability, "anticipation": Anticipation}
        answers = [read_record(kind, data[key]) for key, kind in judges.items() if data.get(key)]
        answers += [read_record(Opinion, opinion) for opinion in data.get("opinions", ())]
        return {**read_fields(cls, data, "reason"), "judgements": tuple(answers)}

    @property
    def breaks_goal(self) -> bool:
        """Return whether the run broke the goal of its campaign; False without a goal."""
        return self.goal is not None and not self.goal.held

    @property
    def responsibility(self) -> Responsibility | None:
        """Return whose failure it is, and the reason in one line; None if the run did not fail."""
        if self.story is None or not self.verdict.is_failure:
            return None
        return responsibility_of(self.story, self.verdict, self.judgements, self.references)

    @property
    def preventability(self) -> Preventability | None:
        """Return the answer of the careful driver of UN Regulation 157; None if the run did not fail."""
        return next((judgement for judgement in self.judgements if isinstance(judgement, Preventability)), None)

    @property
    def anticipation(self) -> Anticipation | None:
        """Return the answer of the anticipating driver; None if the run did not fail."""
        return next((judgement for judgement in self.judgements if isinstance(judgement, Anticipation)), None)

    @property
    def opinions(self) -> tuple[Opinion, ...]:
        """Return the answers of the judges that store no figures of their own."""
        return tuple(judgement for judgement in self.judgements if isinstance(judgement, Opinion))

    @property
    def preventable(self) -> Preventable | None:
        """Return whether a careful driver would have avoided the failure; None without a failure or an answer."""
        return self.preventability.verdict if self.preventability else None

    @property
    def avoided(self) -> tuple[ReferenceRun, ...]:
        """Return the runs of reference drivers that avoid the failure and also pass the unmutated clip."""
        return tuple(run for run in self.references if run.avoids)

    @property
    def avoidable(self) -> bool:
        """Return whether any judge or reference driver says that the failure could have been avoided."""
        return any(answer.avoids for answer in (*self.judgements, *self.references))


@dataclass(frozen=True)
class CaseRunOutcome(JudgedRun):
    """The run of one test case without mutation. `judgements` and `story` exist for failures, `notes` if there are
    any.

    `trace`: its file in the campaign's folder, or "". `risky_points`: number that the ranker found; the clips are cut
    around the first of them.
    """

    id: str
    family: str = ""
    scenario: str = ""
    wall_s: float = 0.0
    trace: str = ""
    risky_points: int = 0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "test_case": self.id,
            "family": self.family,
            "meaning": self.meaning,
            "verdict": self.verdict,
            "broken_expectations": self.broken_expectations,
            "infractions": self.infractions,
            "reason": self.reason,
            "duration_s": rounded(self.duration_s, 2),
            "risky_points": self.risky_points,
            "impact": self.impact,
            "near_misses": self.near,
            "preventability": self.preventability,
            "anticipation": self.anticipation,
            "opinions": where_set(or_null(self.opinions)),
            "references": self.references,
            "story": self.story,
            "notes": self.noted,
            "trace": self.trace,
            "goal": where_set(self.goal),
        }

    @classmethod
    def _fields_in(cls, data: Mapping[str, Any]) -> dict[str, Any]:
        notes = data.get("notes")
        own = {"family": data["family"], "notes": read_record(DriverNotes, notes) if notes else NO_NOTES}
        return super()._fields_in(data) | own

    @property
    def noted(self) -> DriverNotes | None:
        """Return the notes for the driver's developer; None if there are none."""
        return self.notes if self.notes != NO_NOTES else None


@dataclass(frozen=True)
class Draft:
    """A clip that has not been run yet.

    Attributes:
        rank: rank of its risky point. text: its file. name: its name.
        pin: the pin for its mutants. risk: hash of its `risk` line, which determines its mutations.
    """

    rank: int
    text: str
    name: str
    pin: str
    risk: str


@dataclass(frozen=True)
class Forecast:
    """The risky points of a run: their number, and the clips that are cut around the first of them."""

    points: int
    drafts: tuple[Draft, ...]


@dataclass(frozen=True)
class MutantDraft:
    """A mutant that has not been run yet.

    `number`: last part of its name. `meaning`: hash of its test case's meaning. `suffix`: the end of its name, after
    that of its clip.
    """

    number: int
    text: str
    meaning: str
    suffix: str


@dataclass(frozen=True)
class Mutants:
    """The mutants of one clip.

    Attributes:
        plans: plans by which mutants are drawn (`derive.mutate.Mutator.plans`).
        searched: number of mutants of the preset's search, if rounds may request them.
    """

    drafts: tuple[MutantDraft, ...]
    plans: tuple[tuple[tuple[str, str], ...], ...] = ()
    searched: int = 0


@dataclass(frozen=True)
class ChildOutcome(JudgedRun):
    """The run of one mutant; `text` already contains the result. `judgements` and `story` exist for failures."""

    name: str
    file: str = ""
    text: str = ""
    operators: tuple[str, ...] = ()
    round: int | None = None
    """Round that requested it, if mutants are allocated in rounds."""
    drawn_near: str = ""
    """Name of the earlier mutant whose changes this one varies or adds to; empty if it was drawn independently."""
    why: str = ""
    """Why it was made, in a sentence, if mutants are allocated in rounds."""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "mutant": self.name,
            "round": self.round,
            "drawn_near": or_null(self.drawn_near),
            "why": where_set(self.why),
            "meaning": self.meaning,
            "operators": self.operators,
            "changes": self.changes,
            "verdict": self.verdict,
            "broken_expectations": self.broken_expectations,
            "infractions": self.infractions,
            "with": self.with_,
            "reason": self.reason,
            "digest": self.digest,
            "file": or_null(self.written_file),
            "impact": self.impact,
            "near_misses": self.near,
            "preventability": self.preventability,
            "anticipation": self.anticipation,
            "opinions": where_set(or_null(self.opinions)),
            "references": self.references,
            "story": self.story,
            "goal": where_set(self.goal),
        }

    @classmethod
    def _fields_in(cls, data: Mapping[str, Any]) -> dict[str, Any]:
        text = "".join(f"change {change}\n" for change in data.get("changes", ()))
        return {**super()._fields_in(data), "file": data.get("file") or "", "text": text}

    @property
    def changes(self) -> list[str]:
        """Return the mutant's changes as the text of its file; parsing 1,200 mutants for the same text would take
        seconds.
        """
        lines = (line.strip() for line in self.text.splitlines() if "change " in line)
        return [line.removeprefix("change ") for line in lines if line.startswith("change ")]

    @property
    def is_written(self) -> bool:
        """Return whether the campaign's folder has its file: it failed, or broke an expectation."""
        return self.verdict.is_failure or bool(self.broken_expectations)

    @property
    def written_file(self) -> str:
        """Return its file in the campaign's folder, or ""."""
        return self.file if self.is_written else ""


def why_untrusted(verdict: Verdict, largest_m: float, limit_m: float) -> str:
    """Return, in words, why a campaign does not use a clip; "" if it does.

    Args:
        verdict, largest_m: verdict of the clip's run without mutation, and its largest deviation from the parent's run.
        limit_m: the largest deviation that is allowed, m.
    """
    if verdict is not Verdict.PASS:
        return f"its own run without mutation ends with {verdict.value}"
    if largest_m <= limit_m:
        return ""
    return f"it strays {in_metres(largest_m)} from its parent's run ({limit_m:g} m are allowed)"


def in_metres(deviation_m: float) -> str:
    """Return a deviation in words; it is infinite if an actor of the clip could not be placed in the world."""
    return f"{deviation_m:.2f} m" if math.isfinite(deviation_m) else "infinitely far"


@dataclass(frozen=True)
class ClipOutcome(RunRecord):
    """The run of one clip without mutation, and its mutants.

    `largest_m`: largest deviation of any actor from the parent's run. `median_m`: median of the largest deviations of
    the other actors. `within`: share of the other actors that stayed within 0.1 m of their places in that run.
    `others_m`: largest deviation of each other actor. `ego_m`: the deviation of the ego.
    `not_run`: its mutants were drawn from the parent's run, and none failed, so it was not run; its verdict is that of
    the parent's run, and its deviations are not known (infinite).
    `dropped`: number of its mutants that do not count, because the clip was run after them and failed or deviated.
    """

    seed: str
    family: str = ""
    name: str = ""
    file: str = ""
    text: str = ""
    rank: int = 0
    wall_s: float = 0.0
    largest_m: float = 0.0
    median_m: float = 0.0
    within: float = 1.0
    children: tuple[ChildOutcome, ...] = ()
    others_m: tuple[float, ...] = ()
    ego_m: float = 0.0
    not_run: bool = False
    dropped: int = 0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "clip": self.name,
            "test_case": self.seed,
            "verdict": self.verdict,
            "not_run": where_set(self.not_run or None),
            "dropped": where_set(self.dropped or None),
            "deviation_m": {
                "max": rounded(or_null(self.largest_m), 4),
                "median_others": rounded(or_null(self.median_m), 4),
                "ego": rounded(or_null(self.ego_m), 4),
            },
            "within_0.1_m": rounded(or_null(self.within), 4),
            "children": self.children,
        }

    @classmethod
    def from_document(cls, data: Mapping[str, Any]) -> Self:
        """Return the clip that a JSON document states, without its text."""
        keys = {"largest_m": "max", "median_m": "median_others", "ego_m": "ego"}
        deviation_m = data.get("deviation_m", {})
        fields = read_fields(cls, data, "clip", "children")
        for name, key in keys.items():
            if key in deviation_m:
                fields[name] = math.inf if deviation_m[key] is None else deviation_m[key]
        return cls(**fields)

    def trusted(self, limit_m: float) -> bool:
        """Return whether the clip passes without mutation and deviates by at most `limit_m`, or was not run."""
        return self.not_run or not why_untrusted(self.verdict, self.largest_m, limit_m)

    @property
    def failing(self) -> tuple[ChildOutcome, ...]:
        """Return the mutants that failed."""
        return tuple(c for c in self.children if c.verdict.is_failure)

    @property
    def written(self) -> tuple[ChildOutcome, ...]:
        """Return the mutants whose files are in the campaign's folder."""
        return tuple(c for c in self.children if c.is_written)


class Reduced(NamedTuple):
    """A count before and after minimisation."""

    before: int
    now: int


_NONE = Reduced(0, 0)


@dataclass(frozen=True, kw_only=True)
class WrittenMinimised:
    """What `campaign.json` states about a minimised representative; see `Minimised`, from which it is written."""

    file: str
    clip: str
    changed: tuple[str, ...]
    reason: str
    sentence: str | None
    preventability: Preventable | None = None
    anticipation: Answer | None = None
    references: tuple[ReferenceRun, ...] = ()
    dropped: DropCounts
    changes: Reduced
    actors: Reduced
    clip_lines: Reduced
    boundary: tuple[Boundary, ...]
    runs: int
    complete: bool
    note: str


@dataclass(frozen=True)
class Minimised:
    """The minimised representative of a finding.

    Attributes:
        child: its run. clip: the name of its clip. clip_text: the file of that clip.
        dropped: changes and actors that were left out. boundaries: the values at which its changed numbers begin to
            cause the failure.
        changes, actors, clip_lines: numbers of changes, actors and lines of the clip's file, before and after.
        runs: number of runs needed. complete: whether the budget was enough for all reductions.
        note: why it is unchanged or not as small as possible; "" without a note.
    """

    child: ChildOutcome
    clip: str
    clip_text: str
    dropped: DropCounts = field(default_factory=DropCounts)
    boundaries: tuple[Boundary, ...] = ()
    changes: Reduced = _NONE
    actors: Reduced = _NONE
    clip_lines: Reduced = _NONE
    runs: int = 0
    complete: bool = True
    note: str = ""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return every_field(self.written)

    @property
    def written(self) -> WrittenMinimised:
        """Return what `campaign.json` states about it."""
        run = self.child
        return WrittenMinimised(
            file=self.file,
            clip=self.clip_file,
            changed=tuple(run.changes),
            reason=run.reason,
            sentence=run.story.sentence if run.story else None,
            preventability=run.preventable,
            anticipation=run.anticipation.answer if run.anticipation else None,
            references=run.references,
            dropped=self.dropped,
            changes=self.changes,
            actors=self.actors,
            clip_lines=self.clip_lines,
            boundary=self.boundaries,
            runs=self.runs,
            complete=self.complete,
            note=self.note,
        )

    @property
    def folder(self) -> str:
        """Return the folder of its files, relative to the campaign's folder."""
        return f"findings/{self.child.name}"

    @property
    def file(self) -> str:
        """Return the mutant's file, relative to the campaign's folder."""
        return f"{self.folder}/{self.child.name}.foresee"

    @property
    def clip_file(self) -> str:
        """Return the clip's file, relative to the campaign's folder."""
        return f"{self.folder}/{self.clip}.foresee"


@dataclass(frozen=True)
class Repeats:
    """Runs of a finding in several processes, the first one included.

    `ends`: number of runs by verdict. `same`: whether all have one verdict and one trace.
    """

    ends: dict[str, int]
    same: bool

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"runs": self.runs, "failed": self.failed, "ends": self.ends, "same": self.same}

    @property
    def runs(self) -> int:
        """Number of runs."""
        return sum(self.ends.values())

    @property
    def failed(self) -> int:
        """Number of runs that failed."""
        return sum(count for verdict, count in self.ends.items() if verdict in FAILED)


@dataclass(frozen=True, kw_only=True)
class WrittenFinding:
    """What `campaign.json` states about a finding, in its order; see `grouping.Finding`, from which it is written.

    Values with a default may be missing in a file of an older version.
    """

    number: int = 0
    name: str
    title: str = ""
    story: str = ""
    judgement: Responsibility | None = None
    sentence: str
    class_: str
    verdict: Verdict
    test_case: str
    family: str = ""
    file: str
    clip: str | None = None
    count: int
    siblings: tuple[str, ...]
    sibling_files: tuple[str, ...]
    preventability: Preventable | None = None
    why: str | None
    anticipation: Answer | None = None
    anticipation_why: str | None = None
    opinions: tuple[Opinion, ...] = ()
    avoided: int | None = None
    references: tuple[ReferenceRun, ...] = ()
    ego_manoeuvre: str = ""
    opponent_manoeuvre: str | None = None
    place: str = ""
    mutation: str | None = None
    minimised: WrittenMinimised | None = None
    repeats: Repeats | None = None
    rate: str | None = None

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        document = {name.removesuffix("_"): value for name, value in every_field(self).items()}
        return document | {"opinions": where_set(or_null(self.opinions))}

    @property
    def judgements(self) -> tuple[AnyJudgement, ...]:
        """Return the answers of the judges, with their reasons but without their figures."""
        braking = (Preventability(self.preventability, self.why or ""),) if self.preventability is not None else ()
        ahead = (Anticipation(self.anticipation, self.anticipation_why or ""),) if self.anticipation is not None else ()
        return (*braking, *ahead, *self.opinions)


FAILED = frozenset(verdict.value for verdict in Verdict if verdict.is_failure)
"""The verdicts that count as failures, in the form in which rows of the store contain them."""
Record = CaseRunOutcome | Forecast | ClipOutcome | Mutants | ChildOutcome | ReferenceRun | Minimised | Repeats
"""A step's result. A new class is added here; `campaign.assembly` then fails the type check until it handles it."""


def encode(record: Record) -> bytes:
    """Return a record in its stored form; floats keep every bit."""
    return packed(_adapter(type(record).__name__), record)


def decode(data: bytes, kind: type[Any]) -> Record:
    """Return a stored record.

    Raises:
        ValueError: another version of the record's class wrote it, or it is larger than the limit `record` allows.
    """
    record: Record = unpacked(_adapter(kind.__name__), data)
    return record


@cache
def _adapter(name: str) -> TypeAdapter[Any]:
    return TypeAdapter(next(kind for kind in get_args(Record) if kind.__name__ == name))
