"""The rounds of a campaign that allocates its mutants.

The results of one round decide which clips get the next mutants.

A round begins when all mutants of the earlier rounds have ended. So its choices depend only on their results and the
campaign's seed, not on the speed of workers, and a stopped campaign repeats the same rounds. Results of reference
drivers count one round later, because these drive while the next round's mutants run.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.allocation.choice import (
    SEARCHED_WAY,
    ChildFacts,
    MutantDraw,
    MutantDraws,
    PastChild,
    avoided,
    counts,
    halved,
    ranked,
    spread,
    worths,
)
from foresee_dsl.campaign.node import StepNode
from foresee_dsl.campaign.records import ChildOutcome, Mutants, decode
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.mutants import MutantsStep, RequestedMutant, RoundRequest
from foresee_dsl.derive.mutate import SEARCHED, Draw

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.storage.store import Row
    from foresee_dsl.derive.mutate import PlanNames


class Steps(Protocol):
    """The methods of a campaign's `Stages` that rounds use."""

    @property
    def settings(self) -> CampaignSettings:
        """Return the campaign's settings."""
        ...

    def row(self, node: StepNode) -> Row | None:
        """Return the result of a step, if there is one."""
        ...

    def after(self, node: StepNode, row: Row) -> tuple[StepNode, ...]:
        """Return the steps that depend on a step with this result."""
        ...

    def walk(self, roots: Sequence[StepNode] | None = None) -> Iterator[tuple[StepNode, Row | None]]:
        """Yield every step that follows from the roots, with its result if there is one."""
        ...

    def further(self, clip: StepNode, step: MutantsStep, request: RoundRequest) -> StepNode:
        """Return the step that draws one more mutant from a clip that has mutants already."""
        ...


ROUNDS = 4
"""Number of rounds. Ours: with four mutants per clip, each round has about as many mutants as there are clips."""
MOST = 2
"""Largest number of mutants of one clip in one round and with one seed, as a multiple of the setting `children`."""
NEAR_ENOUGH = 0.5
"""Mutants are drawn near an earlier mutant only if the nearness of that mutant is at least this (a distance of 1 m, or
a time to collision of 0.75 s). Ours: 3 of 92 mutants that were drawn near arbitrary near misses failed, but 15 of the
151 other mutants of the same rounds.
"""
NEAR_AT_MOST = 2
"""Maximum number of mutants drawn near one mutant."""
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

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "number": self.number,
            "of": self.of,
            "children": self.children,
            "before": self.before,
            "total": self.total,
            "clips": self.clips,
            "ways": self.ways,
        }

    @property
    def sentence(self) -> str:
        """Return the round in a sentence."""
        most = ", ".join(f"{name} {count}" for name, count in list(self.clips.items())[:_NAMED])
        more = ", ..." if len(self.clips) > _NAMED else ""
        ways = ", ".join(f"{way} {count}" for way, count in self.ways.items())
        return (
            f"round {self.number} of {self.of}: {self.children} of {self.total} children to {len(self.clips)} clips: "
            f"{most}{more} ({ways})"
        )


_NAMED = 3


class _DrawnChild(NamedTuple):
    """A drawn mutant. `node`: the step that runs it."""

    node: StepNode
    step: ChildStep
    round: int
    plan: int
    near: int


@dataclass
class _Unit:
    """A clip with one of the seeds of mutation, and the mutants that were drawn from it with this seed."""

    clip: StepNode
    step: MutantsStep
    plans: tuple[PlanNames, ...]
    drawn: list[_DrawnChild] = field(default_factory=list)
    searched: int = 0
    """Number of mutants that the preset's search proposes for the clip."""
    turns: Counter[int] = field(default_factory=Counter)
    """Number of independent draws requested so far, by plan."""
    uses: Counter[int] = field(default_factory=Counter)
    """Number of draws requested near a mutant, by the mutant's number."""
    dry: set[int] = field(default_factory=set)
    """The plans that have no further mutants."""
    numbers: int = 0
    """Total number of draws that were requested."""
    wanted: list[RequestedMutant] = field(default_factory=list)

    def way(self, plan: int, *, near: bool = False) -> MutantDraw:
        if plan == SEARCHED:
            return SEARCHED_WAY._replace(near=near)
        return MutantDraw(tuple(name for name, _ in self.plans[plan]), near)

    @property
    def open_plans(self) -> list[int]:
        """Return the plans (ways to draw mutants) that are not exhausted: the preset's search, then the others."""
        if self.turns[SEARCHED] < self.searched:
            return [SEARCHED]
        return [plan for plan in range(len(self.plans)) if plan not in self.dry]


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
        units = self._units()
        total = self._stages.settings.children * len(units)
        allocated = sum(len(unit.drawn) for unit in units)
        if self.number >= ROUNDS or allocated >= total:
            self.finished = True
            return ()
        count = spread(total - allocated, ROUNDS - self.number)[0]
        before = self._before(units)
        seed = self._stages.settings.seed
        rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, self.number])))
        self.number += 1
        most = MOST * self._stages.settings.children
        _give_out(units, before, MutantDraws(before.past, rng), count, self.number, most=most)
        asking = [unit for unit in units if unit.wanted]
        nodes = tuple(self._stages.further(unit.clip, unit.step, _request(unit, self.number)) for unit in asking)
        self.nodes += nodes
        ways = (unit.way(want.draw.plan, near=bool(want.near)) for unit in asking for want in unit.wanted)
        self.begun.append(
            Round(
                self.number,
                ROUNDS,
                sum(len(unit.wanted) for unit in asking),
                allocated,
                total,
                counts(unit.step.name for unit in asking for _ in unit.wanted),
                counts(f"{'near a child, ' if way.near else ''}{'+'.join(way.operators)}" for way in ways),
            )
        )
        return nodes or self.next()

    def _units(self) -> list[_Unit]:
        """Return the mutated clips with their mutants, in an order that depends only on content hashes."""
        units: dict[tuple[str, str, int], _Unit] = {}
        for node, row in self._stages.walk((*self.seeds, *self.nodes)):
            step = node.step
            if not isinstance(step, MutantsStep) or row is None or node.above is None:
                continue
            record = decode(row.record, Mutants)
            if not isinstance(record, Mutants) or not (record.plans or record.searched):
                continue
            name = step.draft.pin, step.name, step.seed
            unit = units.setdefault(name, _Unit(node.above, step, record.plans))
            unit.searched = max(unit.searched, record.searched)
            requested = step.request.children or _first(self._stages.settings.first_children, record)
            children = {child.step.mutant.number: child for child in self._stages.after(node, row)
                        if isinstance(child.step, ChildStep)}  # fmt: skip
            for want in requested:
                plan = want.draw.plan
                unit.numbers = max(unit.numbers, want.number)
                if want.near:
                    unit.uses[want.near_number] += 1
                else:
                    unit.turns[plan] = max(unit.turns[plan], want.draw.turn + 1)
                child = children.get(want.number)
                if child is not None and isinstance(child.step, ChildStep):
                    unit.drawn.append(_DrawnChild(child, child.step, step.request.round, plan, want.near_number))
                elif not want.near:
                    unit.dry.add(plan)
                else:
                    unit.uses[want.near_number] += NEAR_AT_MOST
        return [units[name] for name in sorted(units)]

    def _before(self, units: list[_Unit]) -> _Before:
        """Return the mutants of the earlier rounds with their worth."""
        every = sorted(((drawn, unit) for unit in units for drawn in unit.drawn), key=lambda pair: pair[0].round)
        finished = [(drawn, unit, facts) for drawn, unit in every if (facts := self._read(drawn.node)) is not None]
        values = worths((facts, self._others_avoid(drawn)) for drawn, _, facts in finished)
        past = [
            PastChild(unit.step.draft.pin, unit.way(drawn.plan, near=drawn.near > 0), worth, bool(facts.story))
            for (drawn, unit, facts), worth in zip(finished, values, strict=True)
        ]
        return _Before(past, {drawn.node: facts.nearness for drawn, _, facts in finished})

    def _read(self, node: StepNode) -> ChildFacts | None:
        if node not in self._facts:
            row = self._stages.row(node)
            record = decode(row.record, ChildOutcome) if row is not None else None
            if not isinstance(record, ChildOutcome):
                return None
            self._facts[node] = ChildFacts.of(record, node.case.family, self._stages.settings.goal)
        return self._facts[node]

    def _others_avoid(self, drawn: _DrawnChild) -> bool:
        """Return whether a reference driver avoids a mutant's failure, among the results that this round may use."""
        row = self._stages.row(drawn.node)
        if drawn.round >= self.number or row is None or not self._facts[drawn.node].story:
            return False
        after = ((node, self._stages.row(node)) for node in self._stages.after(drawn.node, row))
        records = (decode(reference_row.record, ReferenceRun) for node, reference_row in after
                   if reference_row is not None and node.step.record is ReferenceRun)  # fmt: skip
        return avoided(record for record in records if isinstance(record, ReferenceRun))


class _Before(NamedTuple):
    """The mutants of the earlier rounds.

    `nearness`: nearness to a contact, 0 to 1, of each mutant that passed, by its step.
    """

    past: list[PastChild]
    nearness: dict[StepNode, float]


def awaited_by(node: StepNode) -> int:
    """Return the number of the first round that waits for a step's result."""
    above: StepNode | None = node
    while above is not None and not isinstance(above.step, MutantsStep):
        above = above.above
    in_round = above.step.request.round if above is not None and isinstance(above.step, MutantsStep) else 1
    if node.step.kind == "reference":
        return in_round + 2
    return in_round + 1 if node.step.kind in ("seed", "forecast", "clip", "mutants", "child") else _NEVER


def _give_out(units: list[_Unit], before: _Before, ways: MutantDraws, count: int, number: int, *, most: int) -> None:
    """Choose `count` mutants, at most `most` of one clip and seed.

    The clips that remain in this round get mutants in turn; if these clips have no more mutants, other clips get them.
    """
    by_clip: defaultdict[str, list[_Unit]] = defaultdict(list)
    for unit in units:
        by_clip[unit.step.draft.pin].append(unit)
    order = ranked(list(by_clip), before.past)
    left, allocated = halved(len(order), number), Counter[str]()
    while allocated.total() < count:
        some = False
        for clip in order[:left]:
            open_ways = _open_ways(by_clip[clip], before.nearness)
            if not open_ways or allocated[clip] >= most * len(by_clip[clip]) or allocated.total() == count:
                continue
            _want(by_clip[clip], ways.choose(clip, open_ways), before.nearness)
            allocated[clip] += 1
            some = True
        if not some and left == len(order):
            return
        left = left if some else min(2 * left, len(order))


def _open_ways(units: list[_Unit], nearness: Mapping[StepNode, float]) -> tuple[MutantDraw, ...]:
    anew = (unit.way(plan) for unit in units for plan in unit.open_plans)
    near = (unit.way(drawn.plan, near=True) for unit in units for drawn in _bases(unit, nearness))
    return tuple(sorted({*anew, *near}))


def _bases(unit: _Unit, nearness: Mapping[StepNode, float]) -> Iterator[_DrawnChild]:
    """Yield the mutants near which further mutants may be drawn."""
    for drawn in unit.drawn:
        if nearness.get(drawn.node, 0.0) >= NEAR_ENOUGH and unit.uses[drawn.step.mutant.number] < NEAR_AT_MOST:
            yield drawn


def _want(units: list[_Unit], way: MutantDraw, nearness: Mapping[StepNode, float]) -> None:
    """Request, from one of a clip's units, a mutant that is drawn in this way."""
    if way.near:
        bases = [
            (unit, drawn)
            for unit in units
            for drawn in _bases(unit, nearness)
            if unit.way(drawn.plan, near=True) == way
        ]
        unit, drawn = max(bases, key=lambda pair: nearness[pair[1].node])
        number = drawn.step.mutant.number
        want = RequestedMutant(unit.numbers + 1, Draw(drawn.plan, unit.uses[number]), drawn.step.mutant.text, number)
        unit.uses[number] += 1
    else:
        able = [(unit, plan) for unit in units for plan in unit.open_plans if unit.way(plan) == way]
        unit, plan = min(able, key=lambda pair: (pair[0].numbers, pair[0].turns[pair[1]]))
        want = RequestedMutant(unit.numbers + 1, Draw(plan, unit.turns[plan]))
        unit.turns[plan] += 1
    unit.numbers += 1
    unit.wanted.append(want)


def _first(count: int, record: Mutants) -> tuple[RequestedMutant, ...]:
    """Return the first round's mutants as requests, because that round makes no explicit requests."""
    drawn = ((k, Draw.numbered(k, len(record.plans), min(record.searched, count))) for k in range(1, count + 1))
    return tuple(RequestedMutant(k, draw) for k, draw in drawn if draw is not None)


def _request(unit: _Unit, number: int) -> RoundRequest:
    return RoundRequest(number, tuple(unit.wanted), unit.plans, tuple(drawn.step.mutant.text for drawn in unit.drawn))
