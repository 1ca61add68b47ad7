"""Finds the part of a driver that causes a failure: drives it again with one part after the other replaced by an ideal
one, and says which replacement makes the failure go away.

A failure goes away where the driver meets the same situation and passes (`avoidance.comparison`). Because both runs are
of the same driver, even a small difference counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import combinations

from foresee_dsl.avoidance.anticipating.foresight import LOOKS_EVERY_FRAMES
from foresee_dsl.avoidance.comparison import EARLIER_S, NOT_COMPARED, compared
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.documents import or_null
from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.simulate.results.outcome import contact_of
from foresee_dsl.simulate.results.verdict import RunRecord, RunResult, Verdict
from foresee_dsl.simulate.sensing.settings import IDEAL, STANDARD
from foresee_dsl.simulate.sensing.sight import Sight, in_view, sight_of
from foresee_dsl.simulate.trace import Trace

Parts = tuple[DriverPart, ...]
ORDER = (
    DriverPart.RULES,
    DriverPart.CONTROL,
    DriverPart.PERCEPTION,
    DriverPart.TRACKING,
    DriverPart.PREDICTION,
)
"""The order in which a part is named if several alone suffice. Ideal rules and control change the least; tracking and
prediction depend on perception; ideal prediction knows the future. Ours; docs/background/faults.md#causes explains it.
"""
Drive = Callable[[frozenset[DriverPart]], RunResult]
"""Drives the failing test case again with these ideal parts."""


@dataclass(frozen=True)
class IdealRun(RunRecord):
    """A failing test case, driven again with ideal parts.

    Attributes:
        parts: the ideal parts.
        how: how the driver reacts where it failed, in phrases.
        apart: why a passing run does not show that the failure goes away; "" if it does.
        late_s: how much later it would come to the place of the failure, if it is not comparable for that reason, s.
    """

    parts: Parts
    how: tuple[str, ...] = ()
    apart: str = ""
    late_s: float = 0.0

    @property
    def helps(self) -> bool:
        """Whether the failure goes away."""
        return self.verdict is Verdict.PASS and not self.apart

    @property
    def elsewhere(self) -> bool:
        """Whether it passes, but without meeting the situation in which the driver failed."""
        return self.verdict is Verdict.PASS and bool(self.apart)

    @property
    def outcome(self) -> str:
        """What becomes of the failure, in words, with the reason."""
        if self.helps:
            return ": ".join(["goes away", *([", ".join(self.how)] if self.how else [])])
        if self.elsewhere:
            return f"passes elsewhere: {self.apart}"
        return f"{'still fails' if self.verdict.is_failure else 'no answer'}: {self.reason}"

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "parts": self.parts,
            "verdict": self.verdict,
            "reason": self.reason,
            "duration_s": self.duration_s,
            "helps": self.helps,
            "how": self.how,
            "apart": or_null(self.apart),
        }


def ideal_run(parts: Iterable[DriverPart], failed: RunResult, bundle: SumoBundle, drive: Drive) -> IdealRun:
    """Drive a failing run's test case again with these ideal parts."""
    wanted = frozenset(parts)
    result = drive(wanted)
    comparison = NOT_COMPARED
    if result.verdict is Verdict.PASS:
        sensors = IDEAL if DriverPart.PERCEPTION in wanted else STANDARD
        comparison = compared(failed.trace, result.trace, bundle, sensors)
    ordered = tuple(part for part in DriverPart if part in wanted)
    apart = "" if comparison.met else comparison.apart
    return IdealRun.of(result, parts=ordered, how=comparison.how, apart=apart, late_s=comparison.late_s)


@dataclass(frozen=True)
class Diagnosis:
    """Which part of a driver causes a failure.

    Attributes:
        driver, seed: those of the failing run. verdict, reason: how it ended.
        declared: the parts that can be replaced. runs: the runs with ideal parts, in the order in which they were made.
        cause: the part, or the smallest combination of parts, whose ideal form makes the failure go away; () if there
            is none.
        sure: whether the run with the ideal cause meets the same situation. If not, the cause is only probable: the
            run passes, and nothing else is different in it.
        seen: what ideal perception shows earlier, in words; "" if perception is not part of the cause.
    """

    driver: str
    seed: int
    verdict: Verdict
    reason: str
    declared: Parts
    runs: tuple[IdealRun, ...]
    cause: Parts = ()
    seen: str = ""
    sure: bool = True

    @property
    def also(self) -> Parts:
        """Further parts that alone make the failure go away; with a probable cause, those that are as likely: ideal,
        they make the run pass in the same other situation.
        """
        alone = [run for run in self.runs if len(run.parts) == 1]
        if self.sure:
            same = [run for run in alone if run.helps]
        else:
            apart = {run.apart for run in alone if run.parts == self.cause}
            same = [run for run in alone if run.elsewhere and run.apart in apart]
        return tuple(run.parts[0] for run in same if run.parts != self.cause)

    @property
    def text(self) -> str:
        """The diagnosis as a sentence."""
        if not self.cause:
            return self._without_cause()
        run = next(run for run in self.runs if run.parts == self.cause)
        if not self.sure:
            likely = f" (as likely: {_named(self.also, 'or')})" if self.also else ""
            cause = f"probably {_named(self.cause, 'and')}{likely}"
            return f"{cause}: if it is ideal, the run passes, but in another situation ({run.apart})"
        how = [*([self.seen] if self.seen else []), *(phrase for phrase in run.how if phrase != "drives on")]
        also = f" (also with {_named(self.also, 'or')} alone)" if self.also else ""
        only = "only goes away with" if len(self.cause) > 1 else "goes away with"
        return f"the failure {only} ideal {_named(self.cause, 'and')}{also}" + (f": {', '.join(how)}" if how else "")

    def _without_cause(self) -> str:
        """Return what the runs show if no ideal part makes the failure go away."""
        if any(run.elsewhere for run in self.runs):
            return "unclear: only with all of these parts ideal the run passes, and then in another situation"
        left = "" if DriverPart.TRACKING in self.declared else " or a part that the driver does not declare"
        return (
            f"none of these parts causes it, as it still fails with each of them ideal, and with all of them. "
            f"What remains is the planning{left}, or a situation that comes too late for this driver"
        )

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "driver": self.driver,
            "seed": self.seed,
            "verdict": self.verdict,
            "reason": self.reason,
            "declared": self.declared,
            "cause": self.cause,
            "sure": self.sure,
            "also": self.also,
            "text": self.text,
            "runs": self.runs,
        }


def diagnosed(
    failed: RunResult, bundle: SumoBundle, drive: Drive, *, driver: str, seed: int, declared: Parts
) -> Diagnosis:
    """Return which of a driver's parts causes its failure.

    First, each part is replaced alone. If several suffice, the cause is the one that comes first in `ORDER`. If none
    suffices, all parts are replaced together. If that helps, each pair is tried; if no pair helps, the parts are put
    back one by one as long as the rest suffices. If nothing helps, a part with which the run passes in another
    situation is the probable cause.

    Args:
        failed: the failing run. bundle: its compiled test case. drive: drives it again. declared: the driver's parts.
    """
    runs: list[IdealRun] = []

    def helps(parts: Iterable[DriverPart]) -> bool:
        wanted = tuple(part for part in DriverPart if part in frozenset(parts))
        earlier = next((run for run in runs if run.parts == wanted), None)
        if earlier is None:
            earlier = ideal_run(wanted, failed, bundle, drive)
            runs.append(earlier)
        return earlier.helps

    alone = [part for part in declared if helps((part,))]
    cause: Parts = (min(alone, key=ORDER.index),) if alone else ()
    if not alone and len(declared) > 2 and helps(declared):
        pairs = combinations([part for part in ORDER if part in declared], 2)
        cause = next((pair for pair in pairs if helps(pair)), ())
        if not cause:
            cause = declared
            for part in reversed(ORDER):
                less = tuple(each for each in cause if each is not part)
                if len(less) < len(cause) and helps(less):
                    cause = less
    elif not alone and helps(declared):
        cause = declared
    sure = bool(cause) or not (cause := _probable(runs))
    cause = tuple(part for part in DriverPart if part in cause)
    seen = _seen(failed, bundle) if DriverPart.PERCEPTION in cause else ""
    return Diagnosis(driver, seed, failed.verdict, failed.reason, declared, tuple(runs), cause, seen, sure)


def _probable(runs: Iterable[IdealRun]) -> Parts:
    """Return the part with which the run passes in another situation; () if there is none.

    Nothing but this part was changed, so it is what changes the situation. A driver that comes later has slowed down,
    while one that comes earlier may pass by luck: with several parts, the first is preferred.
    """
    passing = [run for run in runs if len(run.parts) == 1 and run.elsewhere]
    if not passing:
        return ()
    return min(passing, key=lambda run: (run.late_s <= 0, run.late_s < 0, ORDER.index(run.parts[0]))).parts


def _named(parts: Parts, joint: str) -> str:
    *first, last = map(str, parts)
    return f"{', '.join(first)} {joint} {last}" if first else last


def _seen(failed: RunResult, bundle: SumoBundle) -> str:
    """Return when ideal and when real sensors first see the actor that the ego hit, in words; "" if it is the same."""
    trace = failed.trace
    impact = contact_of(trace)
    if impact is None:
        return ""
    actor = trace.index(impact.with_)
    times = [_first_seen_s(trace, actor, sight_of(bundle, sensors)) for sensors in (IDEAL, STANDARD)]
    ideal_s, real_s = times
    if ideal_s is None or (real_s is not None and real_s - ideal_s < EARLIER_S):
        return ""
    instead = f"instead of {real_s:.1f} s" if real_s is not None else "instead of never"
    return f"{impact.with_} is first seen at {ideal_s:.1f} s {instead}"


def _first_seen_s(trace: Trace, actor: int, sight: Sight) -> float | None:
    frames = (frame for frame in range(0, trace.frames, LOOKS_EVERY_FRAMES) if in_view(trace, actor, frame, sight))
    first = next(frames, None)
    return None if first is None else float(trace.time_s[first])
