"""Step after a forecast: a clip is run without mutation and compared with the run that it was cut from.

With a preset that draws mutants from the parent's run (`Preset.draws_from_parent`), this step runs nothing, and
`clip_check` runs the clip after a mutant of it has failed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from foresee_dsl.campaign.driving import DriverSetup, notes_of
from foresee_dsl.campaign.records import ClipOutcome, Forecast
from foresee_dsl.campaign.steps.inputs import clip_case, clip_of
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.derive.clipping.fidelity import ClipDeviation, deviation, share_within, with_fidelity
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Clip
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.forecast import ForecastStep


@dataclass(frozen=True, eq=False)
class ClipStep(ClipPart["ForecastStep", Forecast]):
    """Run a clip without mutation and measure how far it deviates from its parent's run.

    `from_parent`: do not run it; its mutants are drawn from the seconds of the parent's run that it contains.
    """

    kind = "clip"
    title = "clips"
    follows = "forecast"
    record = ClipOutcome
    reads = "seed"
    turn = 1
    usual_s = 0.2

    from_parent: bool = False

    @classmethod
    def following(cls, above: ForecastStep, result: Forecast | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield one step per studied risky point."""
        parent_part = {"from_parent": True} if campaign.draws_from_parent else {}
        for draft in result.drafts if result is not None else ():
            key = campaign.key(cls, seed=above.run_key, pin=draft.pin, **parent_part)
            yield cls(key, f"{above.name}_p{draft.rank}", above.seed, draft, campaign.draws_from_parent)

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:
        """Return the number of studied risky points."""
        return settings.risky_points

    @Part.CLIP.measured
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[ClipOutcome, Trace | None]:
        """Run the clip and compare it."""
        if not self.from_parent:
            return run_clip(self, work, case, trace)
        outcome = ClipOutcome(
            seed=case.id, family=case.family, name=self.draft.name, file=f"{self.draft.name}.foresee",
            text=self.draft.text, rank=self.draft.rank, verdict=Verdict.PASS, largest_m=math.inf, median_m=math.inf,
            within=math.inf, ego_m=math.inf, not_run=True,
        )  # fmt: skip
        return outcome, None

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> ClipOutcome:
        """Return the clip's record for a broken run."""
        return broken_clip(self, case, file, verdict, reason)


def run_clip(step: ClipPart[Any, Any], work: Work, case: TestCase, trace: Trace | None) -> tuple[ClipOutcome, Trace]:
    """Run the clip of a step without mutation and compare it; `trace` is that of the parent's run."""
    draft = step.draft
    if trace is None:
        raise ValueError(f"clip {draft.name} cannot be compared, because its parent's trace is missing")
    started = time.perf_counter()
    file = work.folder / f"{draft.name}.foresee"
    own = clip_case(draft.text, work.case, file)
    model, result, fidelity = _measured(clip_of(draft.text), own, trace, work.setup(step.seed))
    outcome = ClipOutcome.of(
        result,
        seed=case.id,
        family=case.family,
        name=draft.name,
        file=file.name,
        text=print_model(model),
        rank=draft.rank,
        wall_s=time.perf_counter() - started,
        largest_m=fidelity.largest_m,
        median_m=fidelity.median_others_m,
        within=share_within(fidelity.others_m),
        others_m=fidelity.others_m,
        ego_m=fidelity.ego_m,
        notes=notes_of(result),
    )
    return outcome, result.trace


def broken_clip(step: ClipPart[Any, Any], case: TestCase, file: str, verdict: Verdict, reason: str) -> ClipOutcome:
    """Return the record of a clip for a broken run."""
    return ClipOutcome(
        seed=case.id, family=case.family, name=step.name, file=file, text=step.draft.text, rank=step.draft.rank,
        verdict=verdict, reason=reason,
    )  # fmt: skip


def measure_clip(
    model: Clip, parent: TestCase, parent_trace: Trace, file: Path, setup: DriverSetup
) -> tuple[Clip, TestCase, RunResult, ClipDeviation]:
    """Run a clip without mutation and write its deviation from its parent into it.

    Returns:
        The clip with its `fidelity` line, its test case, the run, and the deviation.
    """
    case = expand_clip(model, parent, source=file)
    model, result, fidelity = _measured(model, case, parent_trace, setup)
    return model, case, result, fidelity


def _measured(
    model: Clip, case: TestCase, parent_trace: Trace, setup: DriverSetup
) -> tuple[Clip, RunResult, ClipDeviation]:
    result = setup.run(case)
    fidelity = deviation(parent_trace, parent_trace.frame_at(model.start_s), result.trace)
    return with_fidelity(model, fidelity), result, fidelity
