"""How a run ended."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Literal, Self

from foresee_dsl.simulate.results.near_misses import NearMisses, near_misses
from foresee_dsl.simulate.results.unfired import Unfired
from foresee_dsl.simulate.trace import Trace

Side = Literal["front", "left", "right", "rear"]
Striker = Literal["ego", "other", "both", "neither"]


class Verdict(StrEnum):
    """The outcome of a run; F1-F5 are the paper's kinds of failure (section 4.4). All that is known of each is here.

    Attributes:
        label: in a few words, for tables.
        is_collision: F1 to F5.
        is_failure: of the software under test: F1 to F5, or stuck.
        style: how a terminal shows it.
        contact: how a run's reason calls the contact, the other actor in braces.
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
        """Make a member; `counts_as`: `collision`, `failure` or neither."""
        made = str.__new__(cls, value)
        made._value_, made.label, made.style, made.contact = value, label, style, contact
        made.is_collision, made.is_failure = counts_as == "collision", bool(counts_as)
        return made

    PASS = "pass", "passed", "", "bold green"
    F1 = "F1", "object or off road", "collision"
    F2 = "F2", "pedestrian", "collision"
    F3 = "F3", "frontal", "collision", "bold red", "frontal collision with {}"
    F4 = "F4", "lateral", "collision", "bold red", "lateral collision with {}"
    F5 = "F5", "rear", "collision", "bold red", "rear collision with {}"
    STUCK = "stuck", "stood with nothing to wait for", "failure"
    TIMEOUT = "timeout", "did not arrive in time", "", "bold yellow"
    CRASH = "crash", "the driver or the simulator broke, not the car"
    INVALID = "invalid", "a collision at the first frame"


def passes(verdict: Verdict, broken: Sequence[str] = ()) -> bool:
    """Whether a run passed: its verdict is `pass`, and no expectation is broken. The one rule for every command."""
    return verdict is Verdict.PASS and not broken


EXPECTATION = "expectation"
"""What reports show in place of the verdict `pass` where an expectation does not hold."""
COLLISIONS = tuple(verdict for verdict in Verdict if verdict.is_collision)
FAILURES = tuple(verdict for verdict in Verdict if verdict.is_failure)
"""Those that are counted, in the order of the tables."""


@dataclass(frozen=True)
class ExpectationResult:
    """One `expect` line.

    Attributes:
        text: as written. held: whether it did.
        margin: by how much, positive where it held; None where there is no number.
        unit: the margin's, that of the comparison which decides.
        decides: the comparison or fact that decides, as text; "" where it had no outcome at any frame.
        name: the line's label, or "".
        value: what that comparison compared with its bound, in `unit`; None where nothing was compared.
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
        """What was asked, with its label, and what was measured: the reason of a run that breaks it."""
        measured = ""
        if self.value is not None:
            measured = f" ({self.value:.2f} {self.unit}".rstrip() + f" in `{self.decides}`)"
        elif self.margin is not None:
            measured = f" (by {-self.margin:.2f} {self.unit}".rstrip() + ")"
        return f"does not hold: {self.text}{measured}"


@dataclass(frozen=True)
class Impact:
    """How the ego and another touched.

    Attributes:
        with_: the other's id.
        side: which side of the ego was touched first. other_side: and of the other.
        ahead_m, left_m: where on the ego's outline, from the centre of its footprint along and across its heading.
        turned_rad: the other's heading less the ego's, -pi to pi (left positive).
        struck_by: which moved towards the other along the contact normal: the ego, the other, both, or neither (they
            touched in passing).
        relative_mps: the magnitude of the difference of the velocities.
        closing_mps: its part along the contact normal, positive where they come together.
        ego_mps, other_mps: the speed of each.
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

    shown = (
        "with=with_ side other_side ahead_m:3 left_m:3 turned_deg:1 struck_by relative_mps:3 closing_mps:3 ego_mps:3 "
        "other_mps:3"
    )

    @property
    def turned_deg(self) -> float:
        """`turned_rad` in degrees."""
        return math.degrees(self.turned_rad)

    @property
    def struck(self) -> str:
        """Which of the two struck the other, in words."""
        return {
            "ego": f"the ego struck {self.with_}",
            "other": f"{self.with_} struck the ego",
            "both": f"the ego and {self.with_} struck each other",
            "neither": f"the ego and {self.with_} touched in passing",
        }[self.struck_by]


@dataclass(frozen=True)
class Hang:
    """What a driver took too much wall time for: such a `timeout` may be none on another machine."""

    call: Literal["reset", "step", "run"]
    limit_s: float


@dataclass(frozen=True)
class DriverNotes:
    """What the developer of a driver wants to know about a run.

    Attributes:
        output: what it printed, where its process keeps that (`simulate.printed`).
        traceback: of its exception, the frames of its own code. hang: what it was ended in.
        changed: what it changed of the process that ran it, as phrases that follow "the driver"; it was put back.
    """

    output: str = ""
    traceback: str = ""
    hang: Hang | None = None
    changed: tuple[str, ...] = ()


NO_NOTES = DriverNotes()


@dataclass(frozen=True)
class RunResult:
    """What a run gives back.

    Attributes:
        verdict: how it ended. time_s: when that was decided. with_: the other party's id, or "".
        reason: a sentence for people, such as `F4 lateral collision with runner (car) at 3.15 s, 6.3 m/s`;
            of a collision the relative speed is its last part.
            Of a run whose verdict is `pass` it begins with the expectations that do not hold.
        duration_s: simulated time. steps: simulation steps.
        trace: the whole run (up to the failure).
    """

    verdict: Verdict
    time_s: float
    with_: str
    reason: str
    duration_s: float
    steps: int
    trace: Trace
    expectations: tuple[ExpectationResult, ...] = ()
    impact: Impact | None = None
    """Of a contact, the `invalid` one of the first frame too; None without a contact (off the road as well)."""
    notes: DriverNotes = NO_NOTES
    """What the driver printed, raised, or hung at."""
    unfired: tuple[Unfired, ...] = ()
    """Triggers and steps that never came; worked out where somebody asks (`simulate.triggers.unfired`)."""

    @property
    def broken_expectations(self) -> tuple[str, ...]:
        """The expectations that do not hold, a sentence each."""
        return tuple(one.broken_sentence for one in self.expectations if not one.held)

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return passes(self.verdict, self.broken_expectations)

    @cached_property
    def near_misses(self) -> NearMisses:
        """How near it came to a failure; computed when it is asked for first."""
        return near_misses(self.trace)
