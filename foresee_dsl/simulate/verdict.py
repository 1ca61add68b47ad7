"""How a run ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from foresee_dsl.simulate.trace import Trace


class Verdict(StrEnum):
    """The outcome of a run; F1-F5 are the paper's kinds of failure (section 4.4)."""

    PASS = "pass"
    F1 = "F1"  # off the drivable area, or into a static object
    F2 = "F2"  # into a pedestrian
    F3 = "F3"  # frontal with a vehicle
    F4 = "F4"  # lateral with a vehicle
    F5 = "F5"  # rear-end with a vehicle
    STUCK = "stuck"
    TIMEOUT = "timeout"
    CRASH = "crash"  # the driver or the simulator broke, not the car
    INVALID = "invalid"  # a collision that is there at the first frame

    @property
    def is_collision(self) -> bool:
        """F1 to F5."""
        return self in _COLLISIONS

    @property
    def is_failure(self) -> bool:
        """A failure of the software under test: F1 to F5, or stuck."""
        return self in _COLLISIONS or self is Verdict.STUCK


_COLLISIONS = frozenset({Verdict.F1, Verdict.F2, Verdict.F3, Verdict.F4, Verdict.F5})


@dataclass(frozen=True)
class ExpectationResult:
    """One `expect` line.

    Attributes:
        text: as written. held: whether it did.
        margin: by how much, positive where it held; None where there is no number.
        unit: the margin's, that of the comparison which decides.
        decides: the comparison or fact that decides, as text; "" where it could not be said at any frame.
        name: the line's label, or "".
    """

    text: str
    held: bool
    margin: float | None = None
    unit: str = ""
    decides: str = ""
    name: str = ""


@dataclass(frozen=True)
class RunResult:
    """What a run gives back.

    Attributes:
        verdict: how it ended. time_s: when that was decided. with_: the other party's id, or "".
        reason: a sentence for people, such as `F4 lateral collision with runner at 3.15 s`.
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
