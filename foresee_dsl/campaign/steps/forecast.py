"""Step after a passed run: the risky points of the run are ranked, and clips are cut around the first ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.avoidance.candidates.scoring import Promise
from foresee_dsl.campaign.driving import relative_path
from foresee_dsl.campaign.records import CaseRunOutcome, Draft, Forecast
from foresee_dsl.campaign.steps.inputs import risk_hash
from foresee_dsl.campaign.steps.step import KeyInputs, Step, Work
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.derive.clipping.clip import clip as make_clip
from foresee_dsl.derive.clipping.clip import clip_frames
from foresee_dsl.derive.presets import preset
from foresee_dsl.forecast.margin import MarginRanker
from foresee_dsl.forecast.pair_goal import PairGoal
from foresee_dsl.forecast.protocol import Mutations, Proposes, Ranker, RollsOutGoals
from foresee_dsl.forecast.registry import load_ranker, ranker_within
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.language.model import Clip
from foresee_dsl.language.printer import print_model
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.case_run import CaseStep
    from foresee_dsl.forecast.protocol import RiskyPoint


@dataclass(frozen=True, eq=False)
class ForecastStep(Step["CaseStep", CaseRunOutcome]):
    """Rank the risky points of a run, and cut the clips around the first of them. `run_key`: the run's key."""

    kind = "forecast"
    title = "forecasts"
    follows = "seed"
    record = Forecast
    drives = False
    reads = "seed"
    same_task = True
    turn = 0
    usual_s = 0.03

    run_key: str

    @classmethod
    def following(cls, above: CaseStep, result: CaseRunOutcome | None, campaign: KeyInputs) -> Iterator[Self]:  # noqa: ARG003
        """Yield the one forecast of a run."""
        s = campaign.settings
        searched = s.preset if preset(s.preset).search is not None else None
        proposing = {"mutations": s.preset} if isinstance(load_ranker(s.ranker), Proposes) else {}
        key = campaign.key(cls, seed=above.key, ranker=campaign.ranker, before_s=s.before_s, after_s=s.after_s,
                           handover_s=s.handover_s, count=s.risky_points, random_seed=above.seed,
                           searched=searched, **proposing)  # fmt: skip
        yield cls(key, above.name, above.seed, above.key)

    @staticmethod
    def wanted(result: CaseRunOutcome, settings: CampaignSettings) -> bool:  # noqa: ARG004
        """Return True for a run that passed, as only these are studied."""
        return result.verdict is Verdict.PASS

    @Part.FORECAST.measured
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[Forecast, None]:
        """Rank the risky points and cut the clips."""
        if trace is None:
            raise ValueError(f"the forecast of {self.name} has no trace")
        s = work.settings
        models = {name: spec_of(model) for name, model in case.models.items()}
        mutations = Mutations(s.preset, models)
        ranker = ranker_within(s.ranker, lambda: compile_test_case(case), mutations)
        if case.goal:
            ranker = toward_goal(ranker, case)
        points = ranker.rank(trace, seed=self.seed, before_s=s.before_s, after_s=s.after_s)
        search = preset(s.preset).search
        promise = Promise(RecordedRun.of(trace), search, self.seed) if search is not None else None
        # Points at the same moment, such as of two actors, have clips of the same meaning; only the first is kept.
        drafts: dict[str, Draft] = {}
        around = {"before_s": s.before_s, "after_s": s.after_s, "handover_s": s.handover_s}

        def studied() -> Iterator[RiskyPoint]:
            """Yield the points, without those at which the preset's search would find no mutation. The search looks for
            contacts, and what breaks a goal need not be one; so with a goal these points come last.
            """
            others: list[RiskyPoint] = []
            for point in points:
                frames = clip_frames(trace, point, **around)
                if promise is None or promise.of(point.frame, frames.first, frames.last):
                    yield point
                else:
                    others.append(point)
            yield from others if case.goal else ()

        for point in studied():
            if len(drafts) == s.risky_points:
                break
            file = work.folder / f"{self.name}_p{point.rank}.foresee"
            draft = _draft(clip_around(case, trace, point, file, **around), point.rank)
            drafts.setdefault(draft.pin, draft)
        return Forecast(len(points), tuple(drafts.values())), None


def toward_goal(ranker: Ranker, case: TestCase) -> Ranker:
    """Return the ranker of a campaign with a goal.

    A ranker that proposes changes uses the goal, if a roll-out can compute it. Otherwise the moments of the smallest
    margins come after its proposals; with any other ranker they come before its points.
    """
    if not isinstance(ranker, RollsOutGoals):
        return MarginRanker(ranker)
    pair = PairGoal.of(case)
    return ranker.toward(pair) if pair is not None else MarginRanker(ranker, first=False)


@Part.CLIP.measured
def clip_around(
    case: TestCase,
    trace: Trace,
    point: RiskyPoint,
    file: Path,
    *,
    before_s: float,
    after_s: float,
    handover_s: float = 0.0,
) -> Clip:
    """Return the clip of the seconds around a risky point of a run; `file` is its future file.

    Raises:
        ValueError: the hand-over is too long (see `derive.clipping.clip`).
    """
    parent = relative_path(case.source, file.parent)
    return make_clip(case, trace, point, before_s=before_s, after_s=after_s, name=file.stem, parent=parent,
                     handover_s=handover_s)  # fmt: skip


def _draft(clip: Clip, rank: int) -> Draft:
    return Draft(
        rank=rank,
        text=print_model(clip),
        name=clip.name,
        pin=clip_pin(clip, clip.pin),
        risk=risk_hash(clip),
    )
