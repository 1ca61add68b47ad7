"""Judges whether UN Regulation 157's careful driver, in the ego's place, would have avoided a failure by braking.

The failing run is driven again, the ego on its recorded path at its recorded speed, until the careful driver has
perceived the risk (`avoidance.r157.risk`) and its delay is over. From then on it brakes along the same path. The other
actors act by the test case, in the real simulation, and may react to the braking ego. A lateral escape is not modelled.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import ClassVar, Literal, Self, assert_never

from foresee_dsl.avoidance.judge import R157, Failure, contact
from foresee_dsl.avoidance.r157.risk import Perception, perceive
from foresee_dsl.avoidance.replay import Replay
from foresee_dsl.documents import every_field
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.simulate.results.verdict import Impact, RunResult, Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing.sight import sight_of


class Preventable(StrEnum):
    """Whether a careful and competent driver would have avoided the failure."""

    origin: Literal["yes", "no", "unknown"]
    """The answer in a mutant's `origin`."""

    def __new__(cls, value: str, origin: Literal["yes", "no", "unknown"]) -> Self:
        """Make a member."""
        member = str.__new__(cls, value)
        member._value_, member.origin = value, origin
        return member

    YES = "preventable", "yes"
    NO = "unavoidable", "no"
    UNKNOWN = "undecided", "unknown"


@dataclass(frozen=True)
class Preventability:
    """The answer of the careful driver's assessment, with its figures.

    Attributes:
        verdict: whether it was preventable. why: a sentence for people.
        struck: whether the ego or the other actor struck the other one, in words such as `runner struck the ego`; ""
            without a contact.
        impact_mps: relative speed at the failure's contact, m/s; None without a contact.
        perceived_s: when the risk was perceived; None if it was not. braked_s: when braking began; None if it did not
            begin.
        braked_impact_mps: relative speed at the contact in spite of braking, m/s; None without a contact.
    """

    verdict: Preventable
    why: str
    struck: str = ""
    impact_mps: float | None = None
    perceived_s: float | None = None
    braked_s: float | None = None
    braked_impact_mps: float | None = None

    name: ClassVar[str] = R157

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return every_field(self, 3)

    @property
    def answer(self) -> str:
        """Return the answer in a few words; see `Judgement` for this property and the next ones."""
        return self.verdict.value

    @property
    def avoids(self) -> bool:
        """Whether braking avoids the failure."""
        return self.verdict is Preventable.YES

    @property
    def origin(self) -> tuple[str, str]:
        """The setting and value for a mutant's `origin`."""
        return "preventable", self.verdict.origin


class R157Driver:
    """The judge: it simulates the failing test case at most twice."""

    def judge(self, failure: Failure) -> Preventability:
        """Return whether a careful and competent driver would have avoided the failure."""
        failed = failure.contact
        if failed is None:
            what = failure.without_contact
            return Preventability(Preventable.UNKNOWN, f"{what}: the model only says when to brake for others")
        return replace(_judged(failure, failed), struck=failed.struck, impact_mps=failed.relative_mps)


def _judged(failure: Failure, failed: Impact) -> Preventability:
    if failed.ego_mps < STANDS_MPS:
        return Preventability(Preventable.UNKNOWN, f"the ego stood: {failed.struck}")
    bundle, result = failure.bundle, failure.result
    seen = perceive(result.trace, result.trace.index(failed.with_), sight_of(bundle))
    if seen is None:
        where = " in the rear" if failed.side == "rear" else ""
        return Preventability(Preventable.UNKNOWN, f"no risk in front to brake for: {failed.struck}{where}")
    if failure.astray:
        return Preventability(Preventable.UNKNOWN, failure.astray)
    if seen.brakes_s >= result.time_s:
        return _too_late(seen, result.time_s)
    return _after_braking(
        seen, failed, run(bundle, Replay(result.trace, seen.brakes_s, bundle.scene), rules=RulesMode.OFF)
    )


def _too_late(seen: Perception, contact_s: float) -> Preventability:
    if seen.at_once:
        return Preventability(Preventable.UNKNOWN, _BEFORE)
    onset = f"the risk begins {contact_s - seen.onset_s:.2f} s before the contact, which is before braking can begin"
    perceived = seen.perceived_s if seen.perceived_s < contact_s else None
    return Preventability(Preventable.NO, onset, perceived_s=perceived)


_BEFORE = "the risk is there at the first frame: a driver would have seen it coming before"


def _after_braking(seen: Perception, failed: Impact, braked: RunResult) -> Preventability:
    """Return the judgement from the run in which the careful driver braked."""
    left = contact(braked)
    verdict, why = _without_contact(braked) if left is None else _with_contact(seen, failed, left)
    return Preventability(
        verdict,
        f"braking from {seen.brakes_s:.2f} s {why}",
        perceived_s=seen.perceived_s,
        braked_s=seen.brakes_s,
        braked_impact_mps=left.relative_mps if left else None,
    )


def _without_contact(braked: RunResult) -> tuple[Preventable, str]:
    match braked.verdict:
        case Verdict.PASS | Verdict.TIMEOUT | Verdict.STUCK | Verdict.RULE | Verdict.GOAL:
            return Preventable.YES, "avoids the contact"
        case (
            Verdict.F1 | Verdict.F2 | Verdict.F3 | Verdict.F4 | Verdict.F5 | Verdict.CRASH | Verdict.INVALID
        ):  # off the road without a contact, or the simulation failed
            return Preventable.UNKNOWN, f"ends otherwise: {braked.reason}"
        case _:
            assert_never(braked.verdict)


def _with_contact(seen: Perception, failed: Impact, left: Impact) -> tuple[Preventable, str]:
    if left.with_ != failed.with_:
        return Preventable.UNKNOWN, f"avoids {failed.with_}, but {left.struck}"
    if left.ego_mps < STANDS_MPS:
        return Preventable.UNKNOWN, f"brings the ego to a stand before {left.struck}"
    leaves = f"leaves an impact of {left.relative_mps:.1f} m/s, without it {failed.relative_mps:.1f} m/s: {left.struck}"
    return (Preventable.UNKNOWN, f"{leaves}; {_BEFORE}") if seen.at_once else (Preventable.NO, leaves)
