"""The record of how a run ended, which the records of all runs share: of test cases, clips, mutants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import NO_NOTES, DriverNotes, Impact, RunResult, Verdict, passes
from foresee_dsl.simulate.rules.infraction import Infraction


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
