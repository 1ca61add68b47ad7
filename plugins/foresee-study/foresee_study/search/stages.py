"""The steps of a search as a campaign: the search proposes, the campaign's engine runs, and the results are sent back.

The engine asks for the next steps of a test case when all earlier ones have ended (`Rounds`), so that the result is the
same for any number of workers, and a stopped search continues from the store.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from foresee_dsl.campaign.allocation.rounds import Rounds
from foresee_dsl.campaign.records import ChildOutcome, ClipOutcome, decode
from foresee_dsl.campaign.settings import CampaignSettings, Shard
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.clip import ClipStep
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.steps.requests import RoundRequest
from foresee_dsl.campaign.steps.step import StepNode
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.derive.presets import preset
from foresee_dsl.language.document import TestCase
from foresee_study.search.mutants import ProposedMutants
from foresee_study.search.protocol import FAR, OBJECTIVES, Evaluation, Point, Search
from foresee_study.search.space import dimensions_of, index_at, run_margins

IDLE = 50
"""Number of proposals in a row without a new run after which a search ends. Ours: then its space is exhausted."""


class SearchStages(Stages):
    """The steps of a search in each of several test cases. The settings' ranker lists the moments."""

    def __init__(
        self,
        cases: Sequence[TestCase],
        settings: CampaignSettings,
        store: Store | None,
        out: Path,
        shard: Shard = Shard(),  # noqa: B008 - immutable
        *,
        search: Search,
        budget_s: float,
    ) -> None:
        """Begin; `budget_s`: simulated time of clips and mutants in each test case, s, which is never exceeded.

        Raises:
            DriverError: there is no such driver.
        """
        super().__init__(cases, settings, store, out, shard)
        self._new: dict[StepNode, tuple[StepNode, ...]] = {}
        self._first: dict[str, StepNode] = {}
        self.rounds = tuple(SearchRounds(self, node, search, budget_s) for node in self.seeds)

    def after(self, node: StepNode, row: StoredResult) -> tuple[StepNode, ...]:
        """Return the steps that follow by themselves: no clips, which the search chooses, and no mutant twice."""
        if node.step.kind == "forecast":
            return ()
        if not isinstance(node.step, ProposedMutants):
            return super().after(node, row)
        if node not in self._new:
            nodes = self.proposed(node, row)
            name = node.over("seed").step.key
            self._new[node] = tuple(n for n in nodes if self._first.setdefault(f"{name} {n.step.key}", n) is n)
        return self._new[node]

    def proposed(self, node: StepNode, row: StoredResult) -> tuple[StepNode, ...]:
        """Return all mutants of a step, also those that an earlier step has made."""
        return super().after(node, row)

    def moments(self, seed: StepNode) -> tuple[StepNode, ...]:
        """Return the clips of a test case, in the order of time; none if it did not pass."""
        row = self.row(seed)
        forecast = next((n for n in self.after(seed, row) if n.step.kind == "forecast"), None) if row else None
        clips = self.row(forecast) if forecast is not None else None
        return super().after(forecast, clips) if forecast is not None and clips is not None else ()


class SearchRounds(Rounds):
    """The rounds of a search in one test case: in turn the clips and the mutants that it proposes."""

    def __init__(self, stages: SearchStages, seed: StepNode, search: Search, budget_s: float) -> None:
        """Begin before the first proposal."""
        super().__init__(stages, (seed,))
        self._search_stages, self._search, self._budget_s = stages, search, budget_s
        self._mutants = 0
        self._spent_s: dict[str, float] = {}
        """Simulated time of each run, by the key of its step."""
        self._run = self._rounds()

    @property
    def left(self) -> int:
        """Return 0, since a search does not say how many mutants it will propose."""
        return 0

    def next(self) -> tuple[StepNode, ...]:
        """Begin the next round and return its steps; empty at the end of the search."""
        self.number += 1
        nodes = next(self._run, ())
        self.nodes += nodes
        self.finished = not nodes
        return nodes

    def _rounds(self) -> Iterator[tuple[StepNode, ...]]:
        settings, seed = self._stages.settings, self.seeds[0]
        clips = self._search_stages.moments(seed)
        if not clips:
            return
        entropy = [settings.seed, int(seed.case.meaning.encode().hex(), 16), int(self._search.name.encode().hex(), 16)]
        proposals = self._search.proposals(dimensions_of(preset(settings.preset)), np.random.default_rng(entropy))
        points, idle = next(proposals), 0
        while True:
            evaluations: list[Evaluation] = []
            while len(evaluations) < len(points):
                chosen = self._fitting([(clips[index_at(p[0], len(clips))], p) for p in points[len(evaluations) :]])
                runs = len(self._spent_s)
                if new := tuple(dict.fromkeys(clip for clip, _ in chosen if clip not in self.nodes)):
                    yield new
                    self._count(new)
                requested = self._requested(chosen)
                if requested:
                    yield tuple(requested.values())
                evaluations += self._evaluations(chosen, requested)
                idle = 0 if len(self._spent_s) > runs else idle + 1
                if not chosen or idle == IDLE:
                    return
            try:
                points = proposals.send(evaluations)
            except StopIteration:
                return

    def _fitting(self, chosen: list[tuple[StepNode, Point]]) -> list[tuple[StepNode, Point]]:
        """Return the first proposals: those that cannot exceed the simulated time, whatever their runs take."""
        settings = self._stages.settings
        longest_s, new = settings.before_s + settings.after_s, set(self.nodes)
        cost_s, count = sum(self._spent_s.values()), 0
        for clip, _ in chosen:
            cost_s += longest_s * (1 + (clip not in new))
            new.add(clip)
            if cost_s > self._budget_s:
                break
            count += 1
        return chosen[:count]

    def _requested(self, chosen: list[tuple[StepNode, Point]]) -> dict[StepNode, StepNode]:
        """Return the steps that make the mutants, by clip; clips that are not faithful to their run have none."""
        points: dict[StepNode, list[tuple[int, Point]]] = {}
        for clip, point in chosen:
            self._mutants += 1
            row = self._stages.row(clip)
            outcome = decode(row.record, ClipOutcome) if row is not None else None
            if isinstance(outcome, ClipOutcome) and MutantsStep.wanted(outcome, self._stages.settings):
                points.setdefault(clip, []).append((self._mutants, point))
        return {clip: self._mutants_step(clip, tuple(own)) for clip, own in points.items()}

    def _mutants_step(self, clip: StepNode, points: tuple[tuple[int, Point], ...]) -> StepNode:
        if not isinstance(clip.step, ClipStep):
            raise TypeError(f"{clip.step.name} is not a clip")
        step = ProposedMutants.at(clip.step, self.number, points)
        return self._stages.further(clip, step, RoundRequest(self.number))

    def _evaluations(
        self, chosen: list[tuple[StepNode, Point]], requested: dict[StepNode, StepNode]
    ) -> list[Evaluation]:
        """Return what the runs of the proposals showed, in their order."""
        runs: dict[Point, StepNode] = {}
        for node in requested.values():
            row = self._stages.row(node)
            if row is None or not isinstance(node.step, ProposedMutants):
                continue
            points = dict(node.step.points)
            for child in self._search_stages.proposed(node, row):
                if isinstance(child.step, ChildStep):
                    runs[points[child.step.mutant.number]] = child
        self._count(tuple(runs.values()))
        return [self._evaluation(point, runs.get(point)) for _, point in chosen]

    def _evaluation(self, point: Point, node: StepNode | None) -> Evaluation:
        row = self._stages.row(node) if node is not None else None
        child = decode(row.record, ChildOutcome) if row is not None else None
        if not isinstance(child, ChildOutcome):
            return Evaluation(point, (FAR,) * len(OBJECTIVES))
        return Evaluation(point, run_margins(child), child.verdict.is_failure)

    def _count(self, nodes: Sequence[StepNode]) -> None:
        for node in nodes:
            row = self._stages.row(node)
            self._spent_s[node.step.key] = row.simulated_s if row is not None else 0.0
