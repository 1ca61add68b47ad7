"""The result of a run (verdict, contact, expectations, triggers that never fired), and the part of it that all records
of runs share: those of test cases, clips and mutants."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any, Literal, Self

from foresee_dsl.documents import every_field, read_fields, rounded
from foresee_dsl.drivers.following import Deviation
from foresee_dsl.notebooks import Displayed
from foresee_dsl.simulate.results.goal import GoalMargin
from foresee_dsl.simulate.results.infraction import Infraction
from foresee_dsl.simulate.results.near_misses import NearMisses, near_misses
from foresee_dsl.simulate.trace import Trace


@dataclass(frozen=True)
class Nearest:
    """How near one part of a condition came to holding in a run in which the whole condition never held.

    Attributes:
        text: the part, as written. time_s: the time when it was nearest; None if it could never be evaluated.
        value: the value measured then, in `unit`; None for a fact without a number.
        short: the difference to the bound, in `unit`; None for a fact without a number.
        held_s: for a `for`, the longest time for which its condition held, s; None for other parts, or if the condition
            never held.
        held: whether the part held at some time, but not together with the other parts.
        note: for a fact with a distance, the reason why it did not hold, in a few words.
    """

    text: str
    time_s: float | None = None
    value: float | None = None
    short: float | None = None
    unit: str = ""
    held_s: float | None = None
    held: bool = False
    note: str = ""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {**every_field(self), "words": self.words}

    @property
    def words(self) -> str:
        """The nearest approach in words, such as `nearest 7.3 s at 12.4 s`."""
        if self.time_s is None:
            return "it could not be evaluated at any time"
        at = f" at {self.time_s:.2f} s"
        if self.held_s is not None:
            return f"held for {self.held_s:.2f} s{at}"
        if self.value is not None:
            return f"nearest {self.value:.4g} {self.unit}".rstrip() + at + (f", {self.note}" if self.note else "")
        if self.short is not None:
            return f"{self.short:.4g} {self.unit} short{at}"
        return "it never held"


@dataclass(frozen=True)
class UnfiredTrigger:
    """A trigger, or a step of one, that never began in a run, although it waited for its condition.

    Attributes:
        text: its condition, as written.
        name: label of the trigger, or "".
        index: the trigger's number in the file.
        where: place of a step in the trigger; () for the trigger itself.
        since_s: time from which it waited, s.
        nearest: the nearest approach of each part that never held; if every part held at some time, that of each part
            that did not hold at the moment at which most parts held.
        together: whether every part held at some time, but never all at once.
    """

    text: str
    name: str
    index: int
    where: tuple[int, ...]
    since_s: float
    nearest: tuple[Nearest, ...]
    together: bool = False


Side = Literal["front", "left", "right", "rear"]
Striker = Literal["ego", "other", "both", "neither"]


class Verdict(StrEnum):
    """The outcome of a run, with all its attributes; F1 to F5 are the paper's kinds of failure (section 4.4).

    Attributes:
        label: its name in tables, a few words.
        is_collision: whether it is one of F1 to F5.
        is_failure: whether it is a failure of the software under test: F1 to F5, stuck, rule, or goal.
        style: style of the text in a terminal.
        contact: name of the contact in a run's reason, with braces for the other actor.
    """

    _value_: str
    label: str
    is_collision: bool
    is_failure: bool
    style: str
    contact: str

    def __new__(
        cls, value: str, label: str, counts_as: str = "", style: str = "bold red", contact: str = "collision with {}"
    ) -> Self:
        """Create a member; `counts_as`: `collision`, `failure` or neither."""
        verdict = str.__new__(cls, value)
        verdict._value_, verdict.label, verdict.style, verdict.contact = value, label, style, contact
        verdict.is_collision, verdict.is_failure = counts_as == "collision", bool(counts_as)
        return verdict

    PASS = "pass", "passed", "", "bold green"
    F1 = "F1", "object or off road", "collision"
    F2 = "F2", "pedestrian", "collision"
    F3 = "F3", "frontal", "collision", "bold red", "frontal collision with {}"
    F4 = "F4", "lateral", "collision", "bold red", "lateral collision with {}"
    F5 = "F5", "rear", "collision", "bold red", "rear collision with {}"
    STUCK = "stuck", "stood with nothing to wait for", "failure"
    RULE = "rule", "broke a traffic rule", "failure"
    GOAL = "goal", "broke the goal of its campaign", "failure"
    TIMEOUT = "timeout", "did not arrive in time", "", "bold yellow"
    CRASH = "crash", "the driver or the simulator broke, not the car"
    INVALID = "invalid", "a collision at the first frame"


def passes(verdict: Verdict, broken: Sequence[str] = ()) -> bool:
    """Return whether a run passed: its verdict is `pass` and no expectation is broken. All commands use this rule."""
    return verdict is Verdict.PASS and not broken


EXPECTATION = "expectation"
"""Text that reports show instead of the verdict `pass` if an expectation does not hold."""
COLLISIONS = tuple(verdict for verdict in Verdict if verdict.is_collision)
FAILURES: tuple[Verdict, ...] = tuple(
    verdict for verdict in Verdict if verdict.is_failure and verdict is not Verdict.GOAL
)
"""The verdicts that count as failures in every run, in the order in which tables list them; `goal` exists only in
campaigns with a goal."""


DOES_NOT_HOLD = "does not hold: "
"""How the reason of a run that breaks an expectation begins."""
_VALUE = r"-?(?:\d+\.\d\d|inf|nan)(?: \S+)?"
_MEASURED = re.compile(rf" \((?:by {_VALUE}|{_VALUE} in `[^`]*`)\)$")
"""Matches the measured value at the end of such a reason: ` (0.51 m in `distance(ego, walker) > 0.6 m`)`."""


def without_measured(broken_sentence: str) -> str:
    """Return the sentence of a broken expectation without the measured value: equal for all runs that break it."""
    return _MEASURED.sub("", broken_sentence)


@dataclass(frozen=True)
class ExpectationResult:
    """The result of one `expect` line.

    Attributes:
        text: the line, as written. held: whether it held.
        margin: distance to the bound, positive if the line held; None without a number.
        unit: unit of the margin: that of the deciding comparison.
        decides: the comparison or fact that decided the result, as text; "" if the line had no outcome at any frame.
        name: the line's label, or "".
        value: the value that the deciding comparison compared with its bound, in `unit`; None without a comparison.
    """

    text: str
    held: bool
    margin: float | None = None
    unit: str = ""
    decides: str = ""
    name: str = ""
    value: float | None = None

    @property
    def broken_sentence(self) -> str:
        """Return the reason of a run that breaks the expectation, with the expectation and the measured value."""
        measured = ""
        if self.value is not None:
            measured = f" ({self.value:.2f} {self.unit}".rstrip() + f" in `{self.decides}`)"
        elif self.margin is not None:
            measured = f" (by {-self.margin:.2f} {self.unit}".rstrip() + ")"
        return f"{DOES_NOT_HOLD}{self.text}{measured}"


@dataclass(frozen=True)
class Impact:
    """A contact between the ego and another actor.

    Attributes:
        with_: id of the other actor.
        side: side of the ego that was touched first. other_side: the same for the other actor.
        ahead_m, left_m: point of contact on the ego's outline, relative to the centre of its footprint and its heading.
        turned_rad: the other's heading minus the ego's, -pi to pi (left positive).
        struck_by: the party that moved towards the other along the contact normal: the ego, the other, both, or neither
            (they touched in passing).
        relative_mps: magnitude of the difference of the velocities.
        closing_mps: component of that difference along the contact normal, positive if the actors approach each other.
        ego_mps, other_mps: the speeds of the ego and of the other actor.
    """

    with_: str
    side: Side
    other_side: Side
    ahead_m: float
    left_m: float
    turned_rad: float
    struck_by: Striker
    relative_mps: float
    closing_mps: float
    ego_mps: float
    other_mps: float

    def as_document(self) -> dict[str, object]:
        """Return the contact as a JSON document."""
        return {
            "with": self.with_,
            "side": self.side,
            "other_side": self.other_side,
            "ahead_m": rounded(self.ahead_m, 3),
            "left_m": rounded(self.left_m, 3),
            "turned_deg": rounded(self.turned_deg, 1),
            "struck_by": self.struck_by,
            "relative_mps": rounded(self.relative_mps, 3),
            "closing_mps": rounded(self.closing_mps, 3),
            "ego_mps": rounded(self.ego_mps, 3),
            "other_mps": rounded(self.other_mps, 3),
        }

    @classmethod
    def from_document(cls, data: Mapping[str, Any]) -> Self:
        """Return the contact that a JSON document states."""
        return cls(**read_fields(cls, data), turned_rad=math.radians(data["turned_deg"]))

    @property
    def turned_deg(self) -> float:
        """Return `turned_rad` in degrees."""
        return math.degrees(self.turned_rad)

    @property
    def struck(self) -> str:
        """Return in words which party struck the other."""
        return {
            "ego": f"the ego struck {self.with_}",
            "other": f"{self.with_} struck the ego",
            "both": f"the ego and {self.with_} struck each other",
            "neither": f"the ego and {self.with_} touched in passing",
        }[self.struck_by]


@dataclass(frozen=True)
class Hang:
    """The call during which a driver exceeded a limit of wall time.

    On a faster machine the same call may stay within the limit.
    """

    call: Literal["reset", "step", "run"]
    limit_s: float


@dataclass(frozen=True)
class DriverNotes:
    """Notes about a run for the developer of the driver.

    Attributes:
        output: the driver's output, if its process keeps it (`simulate.printed`).
        traceback: frames of the driver's own code at its exception. hang: the call during which it was ended.
        changed: changes that the driver made to its process, as phrases that follow "the driver"; they were undone.
        not_closed: the exception of the driver's `close`, as a sentence; "" without one. Documents have it in the
            traceback, which begins with it unless the driver broke before.
    """

    output: str = ""
    traceback: str = ""
    hang: Hang | None = None
    changed: tuple[str, ...] = ()
    not_closed: str = ""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"output": self.output, "traceback": self.traceback, "hang": self.hang, "changed": self.changed}


NO_NOTES = DriverNotes()


@dataclass(frozen=True)
class RunResult(Displayed):
    """The result of a run.

    Attributes:
        verdict: the outcome. time_s: time of the decision. with_: id of the other party, or "".
        reason: a sentence for people, such as `F4 lateral collision with runner (car) at 3.15 s, 6.3 m/s`; for a
            collision the sentence ends with the relative speed. If the verdict is `pass`, the sentence begins with the
            expectations that do not hold.
        duration_s: simulated time. steps: number of simulation steps.
        trace: the whole run, up to its end.
    """

    verdict: Verdict
    time_s: float
    with_: str
    reason: str
    duration_s: float
    steps: int
    trace: Trace = field(repr=False)
    expectations: tuple[ExpectationResult, ...] = ()
    impact: Impact | None = None
    """The contact, also that of a run that is `invalid` at its first frame; None if the run ended without a contact,
    for example because the ego left the road."""
    notes: DriverNotes = NO_NOTES
    """What the developer of the driver may want to know: the driver's output, exception, or hang."""
    infractions: tuple[Infraction, ...] = ()
    """The traffic rules that the ego broke, in the order of time."""
    goal: GoalMargin | None = None
    """How near the run came to breaking its test case's goal; None without a goal."""
    tracking: Deviation | None = None
    """How far the ego was from its driver's trajectories; None if the driver answered controls only."""
    unfired: tuple[UnfiredTrigger, ...] = ()
    """Triggers and steps that never began in the run; computed only on request (`simulate.triggers.unfired`)."""

    @property
    def broken_expectations(self) -> tuple[str, ...]:
        """Return the expectations that do not hold, one sentence each."""
        return tuple(result.broken_sentence for result in self.expectations if not result.held)

    @property
    def passed(self) -> bool:
        """Whether the verdict is `pass` and all expectations hold."""
        return passes(self.verdict, self.broken_expectations)

    @cached_property
    def near_misses(self) -> NearMisses:
        """Return how near the run came to a failure; computed at the first call and then kept."""
        return near_misses(self.trace)


@dataclass(frozen=True, kw_only=True)
class RunRecord:
    """How one run ended, without its trace. A subclass adds what was run, and what else was measured.

    Attributes:
        verdict, reason, with_, time_s, duration_s, impact, notes: see `RunResult`. with_, time_s: "" and 0 where they
            are not recorded.
        near: how near the run came to a failure; None if it was not computed.
        digest: digest of the trace, equal for equal runs; "" if the process died or was ended.
        broken_expectations: the broken expectations, one sentence each.
        infractions: the traffic rules that the ego broke, in the order of time.
    """

    verdict: Verdict
    reason: str = ""
    with_: str = ""
    time_s: float = 0.0
    duration_s: float = 0.0
    digest: str = ""
    impact: Impact | None = None
    near: NearMisses | None = None
    notes: DriverNotes = NO_NOTES
    broken_expectations: tuple[str, ...] = ()
    infractions: tuple[Infraction, ...] = ()

    @classmethod
    def of(cls, result: RunResult, /, **more: Any) -> Self:  # noqa: ANN401 - fields of any type
        """Return the record of a result. `more`: the fields that the subclass adds, `near` and `digest`, which take
        time to compute, and fields that replace those of the result.
        """
        shared = {
            "verdict": result.verdict,
            "reason": result.reason,
            "with_": result.with_,
            "time_s": result.time_s,
            "duration_s": result.duration_s,
            "impact": result.impact,
            "notes": result.notes,
            "broken_expectations": result.broken_expectations,
            "infractions": result.infractions,
        }
        return cls(**{**shared, **more})

    @property
    def passed(self) -> bool:
        """Return whether the run passed and all expectations hold."""
        return passes(self.verdict, self.broken_expectations)

    @property
    def hangs(self) -> bool:
        """Return whether the driver exceeded a limit of wall time."""
        return self.notes.hang is not None

    @property
    def exceeded_wall_time(self) -> bool:
        """Return whether the run took too much wall time: its driver exceeded a limit, or its process was ended, so
        that there is no simulated time. A timeout of the test case itself has a simulated time.
        """
        return self.hangs or (self.verdict is Verdict.TIMEOUT and not self.duration_s)
