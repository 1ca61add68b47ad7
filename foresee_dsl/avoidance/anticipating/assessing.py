"""Assesses a failure for the anticipating driver, and its answers.

It tries manoeuvres in order, confirms them by runs, and words the answer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import ClassVar, Literal, Self

import numpy as np

from foresee_dsl.avoidance.anticipating.ahead import CLEAR_SIGHT, DriveAhead
from foresee_dsl.avoidance.anticipating.extended_path import ExtendedPath
from foresee_dsl.avoidance.anticipating.foresight import onset, priority_ways
from foresee_dsl.avoidance.anticipating.manoeuvre import Manoeuvre, ScreenedManoeuvre, Screening, sideways
from foresee_dsl.avoidance.anticipating.settings import CLEAR_M, LOOKS_ON_S, MARGIN_M, MOST_RUNS, STOOD_S
from foresee_dsl.avoidance.judge import ANTICIPATING, Failure, contact
from foresee_dsl.avoidance.r157.risk import REACTION_S
from foresee_dsl.documents import or_null, rounded
from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.simulate.mission import mission_of
from foresee_dsl.simulate.results.verdict import Impact, RunResult, Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing.settings import STANDARD, SensorSettings
from foresee_dsl.simulate.sensing.sight import sight_of
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, STEP_S

_BRAKED_MPS2 = 3.5
"""An ego that is hit from behind may have caused the contact if it braked harder than this, m/s^2. Ours: just over
comfortable braking.
"""
_LOOKS_BACK_S = 3.0
SLOWER_MPS = 0.5
"""If the difference in speed is smaller than this, a run without braking counts as driven in the same way, m/s. Ours: 2
km/h.
"""


ShortAnswer = Literal["braking", "evading", "ahead", "no", "undecided"]


class Answer(StrEnum):
    """Whether an anticipating driver would have prevented the failure, and by which manoeuvre."""

    origin: ShortAnswer
    """The answer in a mutant's `origin`."""

    def __new__(cls, value: str, origin: ShortAnswer) -> Self:
        """Make a member."""
        member = str.__new__(cls, value)
        member._value_, member.origin = value, origin
        return member

    BRAKING = "preventable by braking", "braking"
    EVADING = "preventable by evading", "evading"
    AHEAD = "preventable by driving ahead of time", "ahead"
    NO = "not preventable", "no"
    UNDECIDED = "undecided", "undecided"

    @property
    def preventable(self) -> bool:
        """Whether the driver would have prevented the failure by any manoeuvre."""
        return self in (Answer.BRAKING, Answer.EVADING, Answer.AHEAD)


@dataclass(frozen=True)
class Anticipation:
    """The result of an assessment.

    Attributes:
        answer: whether the failure was preventable, and by which manoeuvre. why: a sentence for people, with figures.
        seen_s: time from which the driver could foresee the conflict. begins_s: time at which the manoeuvre begins.
        braking_mps2: hardest braking. sideways_m: how far it evades, left positive.
        slower_mps: how much slower the driver that drives ahead of time is when the conflict becomes foreseeable.
        spare_s: how much later R157's hardest braking could have begun if the others had moved as recorded.
        least_m: smallest distance to any actor in the run that confirms the answer; None without such a run.
        runs: number of simulation runs.
    """

    answer: Answer
    why: str
    seen_s: float | None = None
    begins_s: float | None = None
    braking_mps2: float | None = None
    sideways_m: float | None = None
    slower_mps: float | None = None
    spare_s: float | None = None
    least_m: float | None = None
    runs: int = 0

    name: ClassVar[str] = ANTICIPATING

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "answer": self.answer,
            "why": self.why,
            "seen_s": rounded(or_null(self.seen_s), 2),
            "begins_s": rounded(or_null(self.begins_s), 2),
            "braking_mps2": rounded(or_null(self.braking_mps2), 1),
            "sideways_m": rounded(or_null(self.sideways_m), 1),
            "slower_mps": rounded(or_null(self.slower_mps), 1),
            "spare_s": rounded(or_null(self.spare_s), 2),
            "least_m": rounded(or_null(self.least_m), 2),
            "runs": self.runs,
        }

    @property
    def avoids(self) -> bool:
        """Return whether the driver avoids the failure; see `Judgement` for this property and the next."""
        return self.answer.preventable

    @property
    def origin(self) -> tuple[str, str]:
        """The setting and value for a mutant's `origin`."""
        return "anticipating", self.answer.origin


class AnticipatingDriver:
    """The judge: it drives the test case up to `MOST_RUNS` times."""

    def judge(self, failure: Failure) -> Anticipation:
        """Return whether an anticipating driver would have prevented the failure, and by which manoeuvre."""
        failed = failure.contact
        if failed is None:
            what = failure.without_contact
            return Anticipation(Answer.UNDECIDED, f"{what}: the model only knows how to keep clear of others")
        return _Assessment(failure, failed).answer()


@dataclass(frozen=True)
class _ConfirmingRun:
    """The result of a run that confirms a manoeuvre in the real simulation."""

    result: RunResult

    @property
    def least_m(self) -> float | None:
        """Smallest distance to any actor, m; None without a near miss."""
        near = self.result.near_misses.distance_m
        return near.value if near is not None else None

    @property
    def clear(self) -> bool:
        """Whether the run ended on the road without a contact, and the ego kept at least `CLEAR_M` away from all
        actors.
        """
        if self.result.verdict not in (Verdict.PASS, Verdict.TIMEOUT, Verdict.STUCK):
            return False
        return self.least_m is None or self.least_m >= CLEAR_M


class _Assessment:
    """The assessment of one failure; it counts the simulation runs that it needs."""

    def __init__(self, failure: Failure, failed: Impact) -> None:
        bundle, result = failure.bundle, failure.result
        self._result, self._failed, self._trace = result, failed, result.trace
        end_s = min(bundle.scene.end_s, result.time_s + LOOKS_ON_S)
        self._bundle = replace(bundle, scene=replace(bundle.scene, end_s=end_s))
        self._whole, self._failure = bundle, failure
        self._way = ExtendedPath(result.trace, bundle.scene.ego.line)
        self._other = result.trace.index(failed.with_)
        self._first = priority_ways(mission_of(bundle))
        self._runs = 0
        self._failed_attempts: list[str] = []

    def answer(self) -> Anticipation:
        """Return the answer, after trying in turn to foresee the conflict, brake, evade and drive ahead of time."""
        return replace(self._answered(), runs=self._runs)

    def _answered(self) -> Anticipation:
        seen_s = self._seen_s()
        standing = self._stands(seen_s)
        if standing and not self._moved():
            return Anticipation(Answer.NO, standing, seen_s=seen_s)
        self._runs += 1
        if why := self._failure.astray:
            return Anticipation(Answer.UNDECIDED, why, seen_s=seen_s)
        begins_s = None if seen_s is None else round(seen_s + REACTION_S, 6)
        if standing:
            self._failed_attempts.append(standing)
        elif begins_s is not None and begins_s < self._result.time_s:
            screening = Screening(self._trace, self._way, self._whole)
            for attempt in (self._by_braking, self._by_evading):
                anticipation = attempt(screening, begins_s)
                if anticipation is not None:
                    return replace(anticipation, seen_s=seen_s)
        anticipation = self._by_driving_ahead(seen_s)
        if anticipation is None and standing:
            anticipation = Anticipation(Answer.NO, "; ".join(self._failed_attempts))
        return replace(anticipation or self._not(seen_s, begins_s), seen_s=seen_s)

    def _moved(self) -> bool:
        return bool((self._trace.states[:, 0, SPEED] >= STANDS_MPS).any())

    def _stands(self, seen_s: float | None) -> str:
        """Return for how long the ego had stood, in words, if it stood before the driver could act; else ""."""
        if self._failed.ego_mps >= STANDS_MPS:
            return ""
        moving = np.flatnonzero(self._trace.states[:, 0, SPEED] >= STANDS_MPS)
        since_s = (int(moving[-1]) + 1) * STEP_S if len(moving) else 0.0
        if since_s > 0.0 and seen_s is not None and since_s > seen_s + REACTION_S:
            return ""  # the ego still drove when it could have acted
        how = f"for {self._result.time_s - since_s:.1f} s" if since_s > 0.0 else "from the first frame on"
        return f"the ego stood {how}: {self._failed.struck}"

    def _seen_s(self) -> float | None:
        return onset(self._trace, self._way, self._other, sight_of(self._whole), self._first)

    def _run(self, driver: Driver, sensors: SensorSettings = STANDARD) -> _ConfirmingRun:
        self._runs += 1
        return _ConfirmingRun(run(self._bundle, driver, sensors=sensors, rules=RulesMode.OFF))

    def _confirm(self, screened: ScreenedManoeuvre) -> _ConfirmingRun:
        return self._run(Manoeuvre(self._trace, self._way, screened.plan, self._whole.scene))

    def _by_braking(self, screening: Screening, begins_s: float) -> Anticipation | None:
        screened = screening.braking(begins_s)
        confirmed = self._confirm(screened)
        hardest = screening.hardest(begins_s)
        if not confirmed.clear and screened.plan != hardest.plan:
            screened, confirmed = hardest, self._confirm(hardest)
        plan = screened.plan
        strength = f"braking with up to {plan.braking_mps2:.1f} m/s^2 from {begins_s:.2f} s on"
        stood_s = self._stood_before_a_walker(confirmed.result)
        if stood_s is not None:
            why = f"{strength} brings the ego to a stand {stood_s:.1f} s before {self._failed.with_} walks into it"
            return Anticipation(Answer.BRAKING, why, begins_s=begins_s, braking_mps2=plan.braking_mps2, least_m=0.0)
        if not confirmed.clear:
            self._failed_attempts.append(f"{strength} {self._ended(confirmed)}")
            return None
        spare = screening.latest_s(begins_s) - begins_s if screened.least_m >= MARGIN_M else 0.0
        early = f" ({self._result.time_s - begins_s:.1f} s before the contact"
        early += f"; the hardest braking had {spare:.1f} s more)" if spare >= 0.1 else ")"
        return Anticipation(
            Answer.BRAKING, f"{strength}{early} {self._leaves(confirmed)}",
            begins_s=begins_s, braking_mps2=plan.braking_mps2, spare_s=round(spare, 6), least_m=confirmed.least_m,
        )  # fmt: skip

    def _stood_before_a_walker(self, result: RunResult) -> float | None:
        """Return how long the ego had stood when the same walker walked into it, s; None if the run ended otherwise."""
        left = contact(result)
        if left is None or left.with_ != self._failed.with_ or result.verdict is not Verdict.F2:
            return None
        speeds = result.trace.states[:, 0, SPEED]
        moving = np.flatnonzero(speeds >= STANDS_MPS)
        stood_s = (len(speeds) - 1 - int(moving[-1]) if len(moving) else len(speeds)) * STEP_S
        return stood_s if stood_s >= STOOD_S - 1e-9 else None

    def _by_evading(self, screening: Screening, begins_s: float) -> Anticipation | None:
        for screened in screening.evading(begins_s)[:2]:
            confirmed, plan = self._confirm(screened), screened.plan
            mild = f", braking with {plan.braking_mps2:.1f} m/s^2," if plan.braking_mps2 else ""
            what = f"evading {sideways(plan.sideways_m)}{mild} from {begins_s:.2f} s on"
            if confirmed.clear:
                return Anticipation(
                    Answer.EVADING, f"{what} {self._leaves(confirmed)}", begins_s=begins_s,
                    braking_mps2=plan.braking_mps2 or None, sideways_m=plan.sideways_m, least_m=confirmed.least_m,
                )  # fmt: skip
            self._failed_attempts.append(f"{what} {self._ended(confirmed)}")
        return None

    def _by_driving_ahead(self, seen_s: float | None) -> Anticipation | None:
        if self._runs >= MOST_RUNS:
            return None
        driver = DriveAhead(self._trace, self._way, self._whole.scene)
        confirmed = self._run(driver, sensors=CLEAR_SIGHT)
        slower, at_s = self._slower(confirmed.result, seen_s)
        what = f"driving ahead of time{_done(driver, slower, at_s)},"
        if confirmed.clear and slower < SLOWER_MPS and driver.braked_s is None:
            why = "a drive that is nearly the same passes, as others react to it otherwise: chance decides"
            return Anticipation(Answer.UNDECIDED, why, least_m=confirmed.least_m)
        if confirmed.clear:
            return Anticipation(Answer.AHEAD, f"{what} {self._leaves(confirmed)}", begins_s=driver.from_s,
                                slower_mps=round(slower, 6), least_m=confirmed.least_m)  # fmt: skip
        self._failed_attempts.append(f"{what} {self._ended(confirmed)}")
        return None

    def _slower(self, result: RunResult, seen_s: float | None) -> tuple[float, float]:
        """Return how much slower the ego is when the conflict becomes foreseeable, m/s, and that time, s.

        If the ego is not slower then, the largest difference and its time are returned.
        """
        frames = min(result.trace.frames, self._trace.frames)
        less = self._trace.states[:frames, 0, SPEED] - result.trace.states[:frames, 0, SPEED]
        frame = min(round((self._result.time_s if seen_s is None else seen_s) / STEP_S), frames - 1)
        if less[frame] < SLOWER_MPS:
            frame = int(less.argmax())
        return float(less[frame]), frame * STEP_S

    def _not(self, seen_s: float | None, begins_s: float | None) -> Anticipation:
        ends = "; ".join(self._failed_attempts)
        if seen_s is None and self._failed.side == "rear":
            last = self._trace.states[-round(_LOOKS_BACK_S / STEP_S) :, 0, ACCELERATION]
            braked = -float(last.min())
            if braked > _BRAKED_MPS2:
                why = f"hit from behind after it braked with {braked:.1f} m/s^2, which the model does not judge; {ends}"
                return Anticipation(Answer.UNDECIDED, why)
            return Anticipation(Answer.NO, f"hit from behind while it drove evenly; {ends}")
        if seen_s == 0.0:
            return Anticipation(Answer.UNDECIDED, f"it is in the way at the first frame already; {ends}")
        if begins_s is None or begins_s >= self._result.time_s:
            when = (
                "never before the contact"
                if seen_s is None
                else f"{self._result.time_s - seen_s:.2f} s before the contact, sooner than it can react"
            )
            return Anticipation(Answer.NO, f"the driver can tell {when}; {ends}")
        return Anticipation(Answer.NO, ends)

    def _leaves(self, confirmed: _ConfirmingRun) -> str:
        near = confirmed.least_m
        return "avoids it" if near is None else f"avoids it, {near:.1f} m at the nearest"

    def _ended(self, confirmed: _ConfirmingRun) -> str:
        left = contact(confirmed.result)
        if left is None:
            near = confirmed.least_m
            grazes = near is not None and near < CLEAR_M
            return f"comes within {near:.2f} m" if grazes else f"ends otherwise: {confirmed.result.reason}"
        stands = ", the ego standing" if left.ego_mps < STANDS_MPS else ""
        return f"leaves {left.relative_mps:.1f} m/s ({left.struck}{stands})"


def _done(driver: DriveAhead, slower_mps: float, at_s: float) -> str:
    """Return the driver's actions in words: for which hazard it slowed, by how much, and how it then braked."""
    reasons, kmh = driver.slowed_for, slower_mps * 3.6
    because = f" for {reasons[0]}" if reasons else ""
    slower = f", {kmh:.0f} km/h slower at {at_s:.2f} s" if kmh >= 1.0 else ""
    braked = (
        f", braking with up to {driver.braked_mps2:.1f} m/s^2 from {driver.braked_s:.2f} s on"
        if (driver.braked_s is not None)
        else ""
    )
    return f"{because}{slower}{braked}"
