"""Step after a failing mutant: a reference driver drives it, which shows whether it avoids the failure, and how."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Self

from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.records import ChildOutcome, MutantDraft
from foresee_dsl.campaign.steps.case_reference import Reference, drive_failure
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.inputs import CaseRef, clip_case, mutant_of
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace


@dataclass(frozen=True, eq=False)
class ReferenceStep(Reference, ClipPart[ChildStep, ChildOutcome]):
    """Run a failing mutant with a reference driver; if that one passes, also the clip without mutation."""

    kind = "reference"
    title = "failures with reference drivers"
    follows = "child"
    reads = "child"
    runs = 2
    share = 0.05
    turn = 3
    usual_s = 0.3

    mutant: MutantDraft
    driver: str

    @classmethod
    def following(cls, above: ChildStep, result: ChildOutcome | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield one step per reference driver."""
        for driver, identity in campaign.references if result is not None else ():
            key = campaign.key(cls, child=above.key, clip=above.draft.pin, driver=identity)
            yield cls(key, f"{above.name}_{driver}", above.seed, above.draft, above.mutant, driver)

    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[ReferenceRun, Trace | None]:  # noqa: ARG002
        """Run the mutant, then the clip; compare the mutant's run with the failing one."""
        file, setup = work.folder / f"{self.draft.name}.foresee", work.setup(self.seed, self.driver)
        clip = clip_case(self.draft.text, work.case, file)
        child = expand_mutant(mutant_of(self.mutant.text), clip, source=work.folder / f"{self.name}.foresee")
        before = partial(verdict_of_clip, self.draft.text, work.case, file, setup)
        return drive_failure(setup, child, before, trace)[0], None


_MOST_KNOWN = 64
"""Maximum number of cached verdicts. Ours: a few drivers for each of the clips that a process caches."""
_KNOWN: dict[tuple[str, CaseRef, DriverSetup], Verdict] = {}
"""Verdicts of clips with reference drivers, cached because failing mutants of one clip share them."""


def verdict_of_clip(text: str, parent: CaseRef, file: Path, setup: DriverSetup) -> Verdict:
    """Return the verdict of a clip without mutation, cached per process."""
    verdict = _KNOWN.get((text, parent, setup))
    if verdict is None:
        verdict = setup.run(clip_case(text, parent, file)).verdict
        if verdict is Verdict.PASS or verdict.is_failure:  # runs that crashed or took too long are repeated
            while len(_KNOWN) >= _MOST_KNOWN:
                del _KNOWN[next(iter(_KNOWN))]
            _KNOWN[text, parent, setup] = verdict
    return verdict
