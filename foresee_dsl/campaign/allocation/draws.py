"""The mutants of a clip: those that were drawn, the facts about them that decide which mutants follow (their story,
whether it is avoidable, how near a pass came to a failure), the ways in which further ones can be drawn, and what
chooses them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol

from foresee_dsl.campaign.grouping import story_cell
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.steps.requests import RequestedMutant, RoundRequest
from foresee_dsl.campaign.steps.step import StepNode
from foresee_dsl.derive.local_search import WEAKER
from foresee_dsl.derive.mutate import SEARCHED, Draw, How
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import Verdict

if TYPE_CHECKING:
    from numpy.random import Generator

    from foresee_dsl.campaign.steps.child import ChildStep
    from foresee_dsl.derive.mutate import PlanNames

NEAR_M = 2.0
"""A pass in which the footprints come nearer than this to each other is a near miss, m. Ours: about a driver's
clearance to a parked car and its door.
"""
NEAR_S = 1.5
"""A pass in which the time to collision falls below this is a near miss, s. The literature calls this a serious
conflict (see `simulate.results.near_misses`).
"""
NEAR_ENOUGH = 0.5
"""Mutants are drawn near an earlier mutant only if the nearness of that mutant is at least this (a distance of 1 m, or
a time to collision of 0.75 s). Ours: 3 of 92 mutants that were drawn near arbitrary near misses failed, but 15 of the
151 other mutants of the same rounds.
"""
AT_MOST: Mapping[How, int] = {How.NEAR: 2, How.BESIDE: 2, How.WEAKER: len(WEAKER)}
"""Maximum number of mutants that use the changes of one mutant, by how they use them. Ours."""


class DrawMethod(NamedTuple):
    """One way of drawing a mutant: by which operators, and how."""

    operators: tuple[str, ...]
    how: How = How.ANEW

    @property
    def words(self) -> str:
        """Return the way in words, for reports."""
        return f"{_BEFORE[self.how]}{'+'.join(self.operators)}"

    @property
    def made_by(self) -> str:
        """Return, in words, what draws the changes: the operators, or the preset's search."""
        return "the preset's search" if self.operators == SEARCHED_WAY.operators else "+".join(self.operators)


_BEFORE: Mapping[How, str] = {
    How.ANEW: "",
    How.NEAR: "near a child, ",
    How.BESIDE: "added to a child, ",
    How.WEAKER: "weaker than a child, ",
    How.EARLIER: "",
}
SEARCHED_WAY = DrawMethod(("searched",))
"""The way of the mutants that the preset's search proposes, one after the other."""
EARLIER_WAY = DrawMethod(("earlier campaigns",), How.EARLIER)


class ClipGroup(NamedTuple):
    """What a clip has in common with others: the family of its test case, and the rank of its risky point."""

    family: str
    rank: int


@dataclass(frozen=True)
class ChildFacts:
    """The facts about a run mutant that decide its worth.

    Attributes:
        story: the words by which its failure is grouped into a finding; () if the run did not fail.
        avoidable: whether a judge answers that the failure could have been avoided.
        nearness: for a pass, 0 (far) to 1 (almost touching, or almost breaking the campaign's goal); otherwise 0. A
            failure that keeps the goal counts as such a pass.
        miss: for such a pass, how near it came, in words; otherwise "".
    """

    story: tuple[str, ...]
    avoidable: bool
    nearness: float
    miss: str = ""

    @classmethod
    def of(cls, child: ChildOutcome, family: str, goal: str = "") -> ChildFacts:
        """Return the facts about a mutant's record. The same story in two families counts as two stories.

        `goal`: that of the campaign.
        """
        if goal and (child.goal is None or child.goal.held):
            nearness = child.goal.nearness if child.goal is not None else 0.0
            return cls((), avoidable=False, nearness=nearness, miss="keeping its goal narrowly")
        if not child.verdict.is_failure:
            passed = child.verdict is Verdict.PASS
            return cls((), avoidable=False, nearness=nearness_of(child.near) if passed else 0.0, miss=_miss(child.near))
        return cls(
            story=story_cell(family, child.story) if child.story is not None else (family, child.verdict.value),
            avoidable=any(judgement.avoids for judgement in child.judgements),
            nearness=0.0,
        )


def nearness_of(near: NearMisses | None) -> float:
    """Return how near a run came to a contact, 0 to 1: by distance or by time, whichever is nearer."""
    return max(*_nearness(near), 0.0)


def _nearness(near: NearMisses | None) -> tuple[float, float]:
    if near is None:
        return 0.0, 0.0
    gap = 1.0 - near.distance_m.value / NEAR_M if near.distance_m is not None else 0.0
    time = 1.0 - near.ttc_s.value / NEAR_S if near.ttc_s is not None else 0.0
    return gap, time


def _miss(near: NearMisses | None) -> str:
    """Return how near a run came to a contact, in words."""
    gap, time = _nearness(near)
    if near is None or max(gap, time) <= 0:
        return ""
    if near.ttc_s is not None and time > gap:
        return f"{near.ttc_s.value:.2f} s before a collision with {near.ttc_s.actor}"
    return f"{near.distance_m.value:.2f} m from {near.distance_m.actor}" if near.distance_m is not None else ""


class PastChild(NamedTuple):
    """A mutant of an earlier round.

    Attributes:
        clip: pin of its clip. group: what its clip has in common with others. way: its way of drawing.
        facts: the facts about it. avoided: whether a judge or a reference driver avoids its failure.
    """

    clip: str
    group: ClipGroup
    way: DrawMethod
    facts: ChildFacts
    avoided: bool = False


class DrawnChild(NamedTuple):
    """A drawn mutant. `node`: the step that runs it. `request`: the request that it was drawn for."""

    node: StepNode
    step: ChildStep
    round: int
    request: RequestedMutant


class DrawOption(NamedTuple):
    """A mutant that can be drawn: from which unit, by which plan, and the mutant whose changes it uses, if any."""

    unit: SeededClip
    plan: int
    base: DrawnChild | None = None


@dataclass
class SeededClip:
    """A clip with one of the seeds of mutation, and the mutants that were drawn from it with this seed."""

    clip: StepNode
    step: MutantsStep
    plans: tuple[PlanNames, ...]
    drawn: list[DrawnChild] = field(default_factory=list)
    searched: int = 0
    """Number of mutants that the preset's search proposes for the clip."""
    turns: Counter[int] = field(default_factory=Counter)
    """Number of independent draws requested so far, by plan."""
    uses: Counter[tuple[How, int]] = field(default_factory=Counter)
    """Number of draws requested that use the changes of a mutant, by how and by the mutant's number."""
    dry: set[int] = field(default_factory=set)
    """The plans that have no further mutants."""
    numbers: int = 0
    """Total number of draws that were requested."""
    wanted: list[RequestedMutant] = field(default_factory=list)

    @property
    def group(self) -> ClipGroup:
        """Return what the clip has in common with others."""
        return ClipGroup(self.clip.case.family, self.step.draft.rank)

    def way(self, plan: int, how: How = How.ANEW) -> DrawMethod:
        """Return the way of a plan."""
        if how is How.EARLIER:
            return EARLIER_WAY
        names = SEARCHED_WAY.operators if plan == SEARCHED else tuple(name for name, _ in self.plans[plan])
        return DrawMethod(names, how)

    @property
    def open_plans(self) -> list[int]:
        """Return the plans (ways to draw mutants) that are not exhausted: the preset's search, then the others."""
        if self.turns[SEARCHED] < self.searched:
            return [SEARCHED]
        return [plan for plan in range(len(self.plans)) if plan not in self.dry]

    def count(self, request: RequestedMutant) -> None:
        """Count a requested draw."""
        self.numbers = max(self.numbers, request.number)
        if request.how is How.ANEW:
            self.turns[request.draw.plan] = max(self.turns[request.draw.plan], request.draw.turn + 1)
        else:
            self.uses[request.how, request.near_number] += 1

    def missed(self, request: RequestedMutant) -> None:
        """Count a requested draw that gave no mutant: no further one is requested in the same way."""
        if request.how is How.ANEW:
            self.dry.add(request.draw.plan)
        elif request.how is not How.EARLIER:
            self.uses[request.how, request.near_number] += AT_MOST[request.how]

    def round_request(self, number: int) -> RoundRequest:
        """Return the request of a round for the wanted mutants."""
        return RoundRequest(number, tuple(self.wanted), self.plans, tuple(d.step.mutant.text for d in self.drawn))


class ClipDraws:
    """The mutants of one clip with all seeds, and the ways in which further ones can be drawn."""

    def __init__(self, units: list[SeededClip], facts: Mapping[StepNode, ChildFacts]) -> None:
        """`facts`: the facts about the mutants that have run."""
        self.units, self._facts = units, facts

    @property
    def pin(self) -> str:
        """Return the pin of the clip, which identifies it."""
        return self.units[0].step.draft.pin

    @property
    def group(self) -> ClipGroup:
        """Return what the clip has in common with others."""
        return self.units[0].group

    @property
    def ways(self) -> tuple[DrawMethod, ...]:
        """Return the ways of the plans that are not exhausted, sorted."""
        return tuple(sorted({unit.way(plan) for unit in self.units for plan in unit.open_plans}))

    def anew(self, way: DrawMethod) -> DrawOption:
        """Return the next independent draw of one of `ways`."""
        able = [(unit, plan) for unit in self.units for plan in unit.open_plans if unit.way(plan) == way]
        return DrawOption(*min(able, key=lambda pair: (pair[0].numbers, pair[0].turns[pair[1]])))

    def bases(self, how: How) -> Iterator[DrawOption]:
        """Yield the mutants whose changes a further mutant may use in a way: for `weaker` failures, otherwise near
        misses.

        A mutant that adds changes to another one is not added to.
        """
        for unit in self.units:
            for drawn in unit.drawn:
                if unit.uses[how, drawn.request.number] >= AT_MOST[how]:
                    continue
                if how is How.BESIDE and drawn.request.how is How.BESIDE:
                    continue
                facts = self._facts.get(drawn.node)
                if facts and (facts.story if how is How.WEAKER else facts.nearness >= NEAR_ENOUGH):
                    yield DrawOption(unit, drawn.request.draw.plan, drawn)

    def best_bases(
        self, how: How, useful: Callable[[DrawOption], bool] = lambda _: True
    ) -> dict[DrawMethod, DrawOption]:
        """Return, for each way, the `useful` base that came nearest, the first one drawn of equals."""
        best: dict[DrawMethod, DrawOption] = {}
        for option in filter(useful, self.bases(how)):
            way = option.unit.way(option.plan, how)
            if way not in best or self.nearness(option) > self.nearness(best[way]):
                best[way] = option
        return best

    def facts(self, option: DrawOption) -> ChildFacts:
        """Return the facts about an option's base."""
        if option.base is None:
            raise ValueError("an independent draw uses no other mutant's changes")
        return self._facts[option.base.node]

    def nearness(self, option: DrawOption) -> float:
        """Return how near an option's base came to a failure, 0 to 1."""
        return self.facts(option).nearness

    def why_near(self, option: DrawOption) -> str:
        """Return, in words, what the mutant did whose changes a further one uses; "" for an independent draw."""
        if option.base is None:
            return ""
        facts = self.facts(option)
        return f"{option.base.step.name} {'failed' if facts.story else f'passed, {facts.miss}'}"

    def want(self, option: DrawOption, how: How, why: str) -> None:
        """Request a mutant."""
        unit, plan, base = option
        number = unit.numbers + 1
        if base is None:
            request = RequestedMutant(number, Draw(plan, unit.turns[plan]), why=why)
        else:
            near = base.step.mutant
            turn = unit.uses[how, near.number]
            request = RequestedMutant(number, Draw(plan, turn), how, near.text, near.number, near.suffix, why)
        unit.count(request)
        unit.wanted.append(request)


def clip_draws(units: Collection[SeededClip], facts: Mapping[StepNode, ChildFacts]) -> list[ClipDraws]:
    """Return the clips of units, in the order of the units."""
    by_clip: dict[str, list[SeededClip]] = {}
    for unit in units:
        by_clip.setdefault(unit.step.draft.pin, []).append(unit)
    return [ClipDraws(own, facts) for own in by_clip.values()]


class RoundBudget(NamedTuple):
    """The frame of a round.

    Attributes:
        number, of: index of the round, from 1, and number of rounds. children: number of its mutants. most: largest
            number of mutants of one clip in it and with one seed. rng: random choices of this round.
    """

    number: int
    of: int
    children: int
    most: int
    rng: Generator


class Method(Protocol):
    """An allocation in rounds; its choices may depend on nothing but its arguments.

    Attributes:
        rounds: number of rounds, the first included, in which each clip gets one mutant. words: what gets the mutants
            of the later rounds.
    """

    rounds: int
    words: str

    def give_out(self, clips: Sequence[ClipDraws], past: Sequence[PastChild], budget: RoundBudget) -> None:
        """Request the mutants of a round from the clips, fewer than `budget.children` if there are no more.

        `clips`: in an order that depends only on content hashes. `past`: all mutants so far, in the order of their
        rounds.
        """
        ...
