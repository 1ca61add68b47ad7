"""Another driver in the place of the one that fails: whether it avoids the failure, and how."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from foresee_dsl.avoidance.comparison import how_avoided
from foresee_dsl.avoidance.judge import Failure
from foresee_dsl.simulate.results.verdict import RunResult, Verdict


@dataclass(frozen=True)
class ReferenceRun:
    """A failing test case or child, driven by another driver: a `Judgement`.

    Attributes:
        driver: its address. verdict, reason, duration_s: of that run.
        before: the verdict of the clip, unmutated, with the same driver; None where it was not run, as the child did
            not pass, and of a test case, which has no clip.
        how: what the driver does otherwise than the one that fails, in phrases.
    """

    driver: str
    verdict: Verdict
    reason: str
    duration_s: float
    before: Verdict | None = None
    how: tuple[str, ...] = ()

    @property
    def passes(self) -> bool:
        """Whether the failure does not happen to this driver, nor another one."""
        return self.verdict is Verdict.PASS

    @property
    def avoids(self) -> bool:
        """Whether it shows that the failure could be avoided: the driver passes, and passes unmutated as well."""
        return self.passes and self.before in (None, Verdict.PASS)

    @property
    def name(self) -> str:
        """As of a `Judgement`, like the next four."""
        return self.driver

    answers: ClassVar[tuple[str, ...]] = ()

    @property
    def answer(self) -> str:
        """How the run ended."""
        return self.verdict.value

    @property
    def why(self) -> str:
        """What it does otherwise, or how it fails."""
        return self.told if self.passes else self.reason

    @property
    def settles(self) -> bool:
        """Whether the driver drove it to an end."""
        return self.passes or self.verdict.is_failure

    @property
    def origin(self) -> None:
        """Nothing: a mutant's origin names all drivers that avoid it in one line (`campaign.assembly`)."""
        return

    @property
    def told(self) -> str:
        """The driver, what it does otherwise, and whether the comparison holds: `idm brakes 0.8 s earlier`."""
        text = f"{self.driver} {', '.join(self.how) or 'passes, driving nearly the same way'}"
        return text if self.before in (None, Verdict.PASS) else f"{text} (but fails before the mutation: {self.before})"

    shown = "driver verdict reason before_mutation=before avoids=passes how"


@dataclass(frozen=True)
class ReferenceDriver:
    """The judge: a driver that may be any.

    Attributes:
        driver: its address. drive: runs the failing test case with it.
        before: returns the verdict of the unmutated clip with it; None of a test case, which has no clip.
    """

    driver: str
    drive: Callable[[], RunResult]
    before: Callable[[], Verdict] | None = None

    def judge(self, failure: Failure) -> ReferenceRun:
        """Run the failing test case; where the driver passes, ask for the clip's own verdict too."""
        result = self.drive()
        if result.verdict is not Verdict.PASS:
            return ReferenceRun(self.driver, result.verdict, result.reason, result.duration_s)
        before = self.before() if self.before is not None else None
        how = how_avoided(failure.trace, result.trace) if failure.trace is not None else ()
        return ReferenceRun(self.driver, result.verdict, result.reason, result.duration_s, before, how)
