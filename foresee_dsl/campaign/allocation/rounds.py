"""The rounds of a campaign that allocates its mutants.

The results of one round decide which clips get the next mutants. How they decide it is the allocation's class
(`METHODS`); everything else is here.

A round begins when all mutants of the earlier rounds have ended. So its choices depend only on their results and the
campaign's seed, not on the speed of workers, and a stopped campaign repeats the same rounds. Results of reference
drivers count one round later, because these drive while the next round's mutants run.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.allocation.adaptive import Adaptive
from foresee_dsl.campaign.allocation.draws import (
    ChildFacts,
    DrawnChild,
    Method,
    PastChild,
    RoundBudget,
    SeededClip,
    clip_draws,
)
from foresee_dsl.campaign.allocation.stories import Stories
from foresee_dsl.campaign.records import ChildOutcome, Mutants, decode
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.steps.requests import RequestedMutant, RoundRequest
from foresee_dsl.campaign.steps.step import StepNode
from foresee_dsl.derive.mutate import Draw

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.storage.store import StoredResult


class Steps(Protocol):
    """The methods of a campaign's `Stages` that rounds use."""

    @property
    def settings(self) -> CampaignSettings:
        """Return the campaign's settings."""
        ...

    def row(self, node: StepNode) -> StoredResult | None:
        """Return the result of a step, if there is one."""
        ...

    def after(self, node: StepNode, row: StoredResult) -> tuple[StepNode, ...]:
        """Return the steps that depend on a step with this result."""
        ...

    def walk(self, roots: Sequence[StepNode] | None = None) -> Iterator[tuple[StepNode, StoredResult | None]]:
        """Yield every step that follows from the roots, with its result if there is one."""
        ...

    def further(self, clip: StepNode, step: MutantsStep, request: RoundRequest) -> StepNode:
        """Return the step that draws one more mutant from a clip that has mutants already."""
        ...


METHODS: Mapping[str, Method] = {"adaptive": Adaptive(), "stories": Stories()}
"""The allocations in rounds, by the name of the setting."""
MOST = 2
"""Largest number of mutants of one clip in one round and with one seed, as a multiple of the setting `children`."""
FIRST_WHY = "each clip gets one child in the first round"
_NEVER = sys.maxsize
"""Round number of steps that no round waits for."""


@dataclass(frozen=True)
class Round:
    """The allocation of one round, for reports.

    Attributes:
        number, of: index of the round, and number of rounds. children, before, total: numbers of mutants of this round,
            of the earlier rounds, and of all rounds. clips: number of mutants of each clip. ways: number of mutants
            drawn in each way.
    """

    number: int
    of: int
    children: int
    before: int
    total: int
    clips: Mapping[str, int]
    ways: Mapping[str, int]

    @property
    def sentence(self) -> str:
        """Return the round in a sentence."""
        most = ", ".join(f"{name} {count}" for name, count in list(self.clips.items())[:_NAMED])
        more = ", ..." if len(self.clips) > _NAMED else ""
        ways = ", ".join(f"{way} {count}" for way, count in self.ways.items())
        clips = "1 clip" if len(self.clips) == 1 else f"{len(self.clips)} clips"
        return (
            f"round {self.number} of {self.of}: {self.children} of {self.total} children to {clips}: "
            f"{most}{more} ({ways})"
        )


_NAMED = 3


class Rounds:
    """The rounds of one part of a campaign: its test cases and all steps that depend on them."""

    def __init__(self, stages: Steps, seeds: tuple[StepNode, ...]) -> None:
        """Begin with the first round, in which each clip gets its first mutants."""
        self._stages, self.seeds = stages, seeds
        self.number = 1
        self.nodes: list[StepNode] = []
        """Mutation steps that the later rounds requested."""
        self.begun: list[Round] = []
        """The later rounds that have begun."""
        self.finished = False
        """True when there is no further round."""
        self._facts: dict[StepNode, ChildFacts] = {}

    @property
    def ready(self) -> bool:
        """Return whether all results that the next round waits for are available."""
        walked = self._stages.walk((*self.seeds, *self.nodes))
        return all(row is not None or awaited_by(node) > self.number + 1 for node, row in walked)

    @property
    def left(self) -> int:
        """Return the number of mutants of the mutated clips that no round has allocated yet."""
        if self.finished:
            return 0
        units = self._units()
        requested = sum(len(node.step.request.children) for node in self.nodes
                    if isinstance(node.step, MutantsStep) and self._stages.row(node) is None)  # fmt: skip
        return self._stages.settings.children * len(units) - sum(len(unit.drawn) for unit in units) - requested

    def next(self) -> tuple[StepNode, ...]:
        """Begin the next round and return its first steps; empty if no mutants are left to allocate or to draw."""
        units, method = self._units(), METHODS[self._stages.settings.allocation]
        of = method.rounds
        total = self._stages.settings.children * len(units)
        allocated = sum(len(unit.drawn) for unit in units)
        if self.number >= of or allocated >= total:
            self.finished = True
            return ()
        count = spread(total - allocated, of - self.number)[0]
        past = self._past(units)
        seed = self._stages.settings.seed
        rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, self.number])))
        self.number += 1
        budget = RoundBudget(self.number, of, count, MOST * self._stages.settings.children, rng)
        method.give_out(clip_draws(units, self._facts), past, budget)
        asking = [unit for unit in units if unit.wanted]
        nodes = tuple(self._stages.further(unit.clip, unit.step, unit.round_request(self.number)) for unit in asking)
        self.nodes += nodes
        self.begun.append(
            Round(
                self.number,
                of,
                sum(len(unit.wanted) for unit in asking),
                allocated,
                total,
                counts(unit.step.name for unit in asking for _ in unit.wanted),
                counts(unit.way(want.draw.plan, want.how).words for unit in asking for want in unit.wanted),
            )
        )
        return nodes or self.next()

    def _units(self) -> list[SeededClip]:
        """Return the mutated clips with their mutants, in an order that depends only on content hashes."""
        units: dict[tuple[str, str, int], SeededClip] = {}
        for node, row in self._stages.walk((*self.seeds, *self.nodes)):
            step = node.step
            if not isinstance(step, MutantsStep) or row is None or node.above is None:
                continue
            record = decode(row.record, Mutants)
            if not isinstance(record, Mutants) or not (record.plans or record.searched):
                continue
            name = step.draft.pin, step.name, step.seed
            unit = units.setdefault(name, SeededClip(node.above, step, record.plans))
            unit.searched = max(unit.searched, record.searched)
            children = {child.step.mutant.number: child for child in self._stages.after(node, row)
                        if isinstance(child.step, ChildStep)}  # fmt: skip
            for request_of_child in requested(step.request, record, self._stages.settings.first_children):
                unit.count(request_of_child)
                child = children.get(request_of_child.number)
                if child is not None and isinstance(child.step, ChildStep):
                    unit.drawn.append(DrawnChild(child, child.step, step.request.round, request_of_child))
                else:
                    unit.missed(request_of_child)
        return [units[name] for name in sorted(units)]

    def _past(self, units: list[SeededClip]) -> list[PastChild]:
        """Return the mutants that have run, in the order of their rounds."""
        every = sorted(((drawn, unit) for unit in units for drawn in unit.drawn), key=lambda pair: pair[0].round)
        return [
            PastChild(
                unit.step.draft.pin,
                unit.group,
                unit.way(drawn.request.draw.plan, drawn.request.how),
                facts,
                facts.avoidable or self._others_avoid(drawn),
            )
            for drawn, unit in every
            if (facts := self._read(drawn.node)) is not None
        ]

    def _read(self, node: StepNode) -> ChildFacts | None:
        if node not in self._facts:
            row = self._stages.row(node)
            record = decode(row.record, ChildOutcome) if row is not None else None
            if not isinstance(record, ChildOutcome):
                return None
            self._facts[node] = ChildFacts.of(record, node.case.family, self._stages.settings.goal)
        return self._facts[node]

    def _others_avoid(self, drawn: DrawnChild) -> bool:
        """Return whether a reference driver avoids a mutant's failure, among the results that this round may use."""
        row = self._stages.row(drawn.node)
        if drawn.round >= self.number or row is None or not self._facts[drawn.node].story:
            return False
        after = ((node, self._stages.row(node)) for node in self._stages.after(drawn.node, row))
        records = (decode(reference_row.record, ReferenceRun) for node, reference_row in after
                   if reference_row is not None and node.step.record is ReferenceRun)  # fmt: skip
        return any(isinstance(record, ReferenceRun) and record.avoids for record in records)


def requested(request: RoundRequest, record: Mutants, first: int) -> tuple[RequestedMutant, ...]:
    """Return the mutants that a round requested of a clip.

    In the first round these are the requested ones, and `first` independent draws, for which there is no explicit
    request.
    """
    if request.round > 1:
        return request.children
    earlier = len(request.children)
    drawn = ((k, Draw.numbered(k, len(record.plans), min(record.searched, first))) for k in range(1, first + 1))
    return (*request.children,
            *(RequestedMutant(earlier + k, draw, why=FIRST_WHY) for k, draw in drawn if draw is not None))  # fmt: skip


def awaited_by(node: StepNode) -> int:
    """Return the number of the first round that waits for a step's result."""
    above: StepNode | None = node
    while above is not None and not isinstance(above.step, MutantsStep):
        above = above.above
    in_round = above.step.request.round if above is not None and isinstance(above.step, MutantsStep) else 1
    if node.step.kind == "reference":
        return in_round + 2
    return in_round + 1 if node.step.kind in ("seed", "forecast", "clip", "mutants", "child") else _NEVER


def spread(children: int, rounds: int) -> tuple[int, ...]:
    """Return the number of mutants of each round, as even as possible; the first rounds get the remainder."""
    each, over = divmod(children, rounds)
    return tuple(each + (k < over) for k in range(rounds))


def counts(names: Iterable[str]) -> dict[str, int]:
    """Return the number of occurrences of each name, the most frequent first, then by name."""
    return dict(sorted(Counter(names).items(), key=lambda item: (-item[1], item[0])))
