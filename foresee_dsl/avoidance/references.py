"""Runs reference drivers in the place of the failing driver, to see whether and how they avoid the failure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from foresee_dsl.avoidance.comparison import NOT_COMPARED, compared
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.documents import or_null
from foresee_dsl.drivers.registry import sees_all
from foresee_dsl.simulate.results.verdict import RunRecord, RunResult, Verdict
from foresee_dsl.simulate.sensing.settings import IDEAL, STANDARD
from foresee_dsl.simulate.trace import Trace


@dataclass(frozen=True)
class ReferenceRun(RunRecord):
    """A failing test case or child, driven by another driver.

    Attributes:
        driver: the driver's address.
        before: verdict of the unmutated clip with the same driver; None if the child did not pass, so that the clip
            was not run, or for a test case, which has no clip.
        how: how it reacts where the failing driver failed, in phrases.
        apart: why a passing run does not show that the failure could be avoided: it did not meet the same situation
            (`avoidance.comparison`); "" if it did.
    """

    driver: str
    before: Verdict | None = None
    how: tuple[str, ...] = ()
    apart: str = ""

    @property
    def passes(self) -> bool:
        """Whether this driver passes, without any failure."""
        return self.verdict is Verdict.PASS

    @property
    def avoids(self) -> bool:
        """Whether the run shows that the failure could be avoided: the driver met the same situation and reacted, and
        both of its runs pass.

        The two runs are that of the mutant and that of the unmutated clip.
        """
        return self.passes and not self.apart and self.before in (None, Verdict.PASS)

    @property
    def sentence(self) -> str:
        """The driver and its reaction, or why it is not comparable: `idm brakes 0.8 s earlier`."""
        if self.apart:
            return f"{self.driver} passes, but is not comparable: {self.apart}"
        text = f"{self.driver} {', '.join(self.how) or 'passes'}"
        return text if self.before in (None, Verdict.PASS) else f"{text} (but fails before the mutation: {self.before})"

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "driver": self.driver,
            "verdict": self.verdict,
            "reason": self.reason,
            "before_mutation": self.before,
            "avoids": self.avoids,
            "how": self.how,
            "apart": or_null(self.apart),
        }


def reference_run(
    driver: str,
    result: RunResult,
    failed: Trace | None,
    bundle: SumoBundle,
    before: Callable[[], Verdict] | None = None,
) -> ReferenceRun:
    """Return the record of a reference driver's run of a failing test case; if it passes, with how it avoids the
    failure.

    Args:
        driver: its address. result: its run. failed: trace of the failing run; None if it was lost.
        bundle: the compiled test case.
        before: returns the verdict of the unmutated clip with this driver; None for a test case, which has no clip. It
            is called only if the driver passes.
    """
    passes, comparison = result.verdict is Verdict.PASS, NOT_COMPARED
    if passes and failed is not None:
        comparison = compared(failed, result.trace, bundle, IDEAL if sees_all(driver) else STANDARD)
    return ReferenceRun(
        driver, before() if passes and before is not None else None, comparison.how, comparison.apart,
        verdict=result.verdict, reason=result.reason, duration_s=result.duration_s,
    )  # fmt: skip
