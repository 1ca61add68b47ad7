"""How a run ended."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Literal

from foresee_dsl.simulate.results.near_misses import NearMisses, near_misses
from foresee_dsl.simulate.trace import Trace

Side = Literal["front", "left", "right", "rear"]
Striker = Literal["ego", "other", "both", "neither"]


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
class Impact:
    """How the ego and another touched.

    Attributes:
        with_: the other's id.
        side: which side of the ego was touched first. other_side: and of the other.
        ahead_m, left_m: where on the ego's outline, from the centre of its footprint along and across its heading.
        turned_rad: the other's heading less the ego's, -pi to pi (left positive).
        struck_by: who moved towards the other along the contact normal: the ego, the other, both, or neither (they
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

    def as_dict(self) -> dict[str, float | str]:
        """Return it for JSON; angles in degrees."""
        return {
            "with": self.with_,
            "side": self.side,
            "other_side": self.other_side,
            "ahead_m": round(self.ahead_m, 3),
            "left_m": round(self.left_m, 3),
            "turned_deg": round(math.degrees(self.turned_rad), 1),
            "struck_by": self.struck_by,
            "relative_mps": round(self.relative_mps, 3),
            "closing_mps": round(self.closing_mps, 3),
            "ego_mps": round(self.ego_mps, 3),
            "other_mps": round(self.other_mps, 3),
        }

    @property
    def struck(self) -> str:
        """Who struck whom, in words."""
        return {
            "ego": f"the ego struck {self.with_}",
            "other": f"{self.with_} struck the ego",
            "both": f"the ego and {self.with_} struck each other",
            "neither": f"the ego and {self.with_} touched in passing",
        }[self.struck_by]


@dataclass(frozen=True)
class RunResult:
    """What a run gives back.

    Attributes:
        verdict: how it ended. time_s: when that was decided. with_: the other party's id, or "".
        reason: a sentence for people, such as `F4 lateral collision with runner (car) at 3.15 s, 6.3 m/s`;
            of a collision the relative speed is its last part.
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
    """Of a contact, the `invalid` one of the first frame too; None where nobody was touched (off the road as well)."""

    @cached_property
    def near_misses(self) -> NearMisses:
        """How near it came to a failure; worked out when it is asked for first."""
        return near_misses(self.trace)
