"""Runs reference drivers in the place of the failing driver, to see whether and how they avoid the failure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from foresee_dsl.avoidance.comparison import NOT_COMPARED, Comparison, compared
from foresee_dsl.avoidance.judge import Failure
from foresee_dsl.documents import or_null
from foresee_dsl.drivers.registry import sees_all
from foresee_dsl.simulate.results.verdict import RunRecord, RunResult, Verdict
from foresee_dsl.simulate.sensing.settings import IDEAL, STANDARD


@dataclass(frozen=True)
class ReferenceRun(RunRecord):
    """A failing test case or child, driven by another driver: a `Judgement`.

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
    def name(self) -> str:
        """The name of the driver; see `Judgement` for this and the next four properties."""
        return self.driver

    answers: ClassVar[tuple[str, ...]] = ()

    @property
    def answer(self) -> str:
        """The verdict of the run."""
        return self.verdict.value

    @property
    def why(self) -> str:
        """How it differs from the failing driver, or why it fails."""
        return self.sentence if self.passes else self.reason

    @property
    def settles(self) -> bool:
        """Whether the run passed or failed, rather than crashed or timed out."""
        return self.passes or self.verdict.is_failure

    @property
    def origin(self) -> None:
        """Always None: a mutant's `origin` names all avoiding drivers in one line (`campaign.assembly`)."""
        return

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


@dataclass(frozen=True)
class ReferenceDriver:
    """The judge that runs one reference driver.

    Attributes:
        driver: the driver's address. drive: runs the failing test case with it.
        before: returns the verdict of the unmutated clip with it; None for a test case, which has no clip.
    """

    driver: str
    drive: Callable[[], RunResult]
    before: Callable[[], Verdict] | None = None

    def judge(self, failure: Failure) -> ReferenceRun:
        """Return the run of the failing test case; if the driver passes, with its verdict on the unmutated clip."""
        result = self.drive()
        if result.verdict is not Verdict.PASS:
            return self._run(result)
        before = self.before() if self.before is not None else None
        comparison = NOT_COMPARED
        if failure.trace is not None and failure.compiled is not None:
            comparison = compared(
                failure.trace, result.trace, failure.compiled, IDEAL if sees_all(self.driver) else STANDARD
            )
        return self._run(result, before, comparison)

    def _run(
        self, result: RunResult, before: Verdict | None = None, comparison: Comparison = NOT_COMPARED
    ) -> ReferenceRun:
        return ReferenceRun(
            self.driver, before, comparison.how, comparison.apart,
            verdict=result.verdict, reason=result.reason, duration_s=result.duration_s,
        )  # fmt: skip
