"""The plan of a study, computed before anything runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.campaign.steps.step import StepNode
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.documents import every_field
from foresee_study.questions import wanted_by
from foresee_study.running import Cases, stages_of, watched
from foresee_study.settings import BUNDLED, StudyCampaign, StudySettings


@dataclass(frozen=True)
class QuestionPlan:
    """The work for a question.

    Attributes:
        campaigns: number of its campaigns.
        done, to_run: number of stored runs, and of missing runs that are certain.
        at_most_more: maximum number of runs that may follow from these.
        one_core_s: maximum time of all missing runs on one core, s.
    """

    question: str
    campaigns: int
    done: int
    to_run: int
    at_most_more: int
    one_core_s: float

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return every_field(self, 1)


def plan_study(
    names: Sequence[str], settings: StudySettings, cases: Cases, store: Store | None
) -> tuple[QuestionPlan, ...]:
    """Return the work for each question; runs of an earlier question are not counted again."""
    seen: set[str] = set()
    planned: set[StudyCampaign] = set()
    plans = []
    for name in names:
        counts: Counter[str] = Counter()
        seconds = 0.0
        wanted, _ = watched(wanted_by([name], settings))
        for campaign in (w for w in wanted if w not in planned):
            planned.add(campaign)
            stages = stages_of(campaign, cases[campaign.group], store, Path())
            each_s = store.mean_wall_s(campaign.driver) if store is not None else {}
            slower = _SLOWER_THAN_PDM.get(campaign.driver, 1.0)
            for node, row in stages.walk():
                # A run may belong to another campaign as well; the runs that follow from this campaign's forecast do
                # not.
                if row is None:
                    clips, children = _following(node, campaign)
                    counts["more"] += clips + children
                    seconds += clips * each_s.get("clip", slower * _CLIP_S)
                    seconds += children * each_s.get("child", slower * _CHILD_S)
                if node.step.drives and node.step.key not in seen:
                    seen.add(node.step.key)
                    counts["done" if row is not None else "to run"] += 1
                    seconds += 0.0 if row is not None else each_s.get(node.step.kind, slower * node.step.usual_s)
        if name == "rq4":
            fuzzing = _fuzzing(settings, len(cases[BUNDLED]))
            counts["more"] += fuzzing * len(settings.drivers)
            seconds += fuzzing * _FUZZED_S * sum(_SLOWER_THAN_PDM.get(driver, 1.0) for driver in settings.drivers)
        plans.append(QuestionPlan(name, len(wanted), counts["done"], counts["to run"], counts["more"], seconds))
    return tuple(plans)


def _following(node: StepNode, wanted: StudyCampaign) -> tuple[int, int]:
    """Return the maximum number of clips and of mutants that may follow from a step without a result."""
    points = min(wanted.risky_points, _USUAL_POINTS)
    if wanted.budget_s is not None:  # at most: each mutant in a clip of its own
        runs = int(wanted.budget_s / wanted.clip_s / 2) if node.step.kind == "seed" else 0
        return runs, runs
    match node.step.kind:
        case "seed" | "forecast":
            return points, points * wanted.children
        case "clip" | "mutants":
            return 0, wanted.children
        case _:
            return 0, 0


_USUAL_POINTS = 45
"""Maximum number of clips of a test case in the exhaustive search: the paper's 45 for a run of 48 s (section 4.3)."""
_CLIP_S, _CHILD_S = 0.3, 0.12
"""Assumed wall times of a clip and of a mutant, s; they are used until the store has measured ones. Ours: the bundled
scenarios with `pdm`."""
_FUZZED_S = 0.7
"""Wall time of a fuzzed test case that is assumed, s. Ours: the bundled scenarios with `pdm`."""
_SLOWER_THAN_PDM = {"fusion": 4.0, "fusion_safe": 2.5, "frenetix": 2.5}
"""How many times as long a run takes with another driver as with `pdm`. Ours: wall times of the campaigns of
`benchmarks/study` on the odd half, compared with those of `pdm` and the same ranker: 2.6 to 4.4 with `fusion`, 1.8 to
2.8 with `fusion_safe`, 1.0 to 2.7 with `frenetix`."""


def _fuzzing(settings: StudySettings, cases: int) -> int:
    """Return the maximum number of DriveFuzz's runs with a driver in two iterations: the number without a failure."""
    each = cases * settings.fuzz_cycles * settings.fuzz_mutations
    return 2 * each * min(settings.fuzz_repetitions, settings.repetitions)
