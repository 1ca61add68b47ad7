"""Makes the mutants of a clip. Each has a few checked changes, and the same seed gives the same mutants."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Sequence
from decimal import Decimal
from enum import StrEnum
from functools import partial
from typing import NamedTuple

import numpy as np

from foresee_dsl import __version__
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.derive import presets
from foresee_dsl.derive.avoidable import avoidable
from foresee_dsl.derive.local_search import Plan, near_changes, weaker_changes
from foresee_dsl.derive.operators import Operator, Situation, operators, predicted_gap_m
from foresee_dsl.derive.presets import MutationPreset
from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.pair_goal import PairGoal
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.campaign_values import DEFAULT_CHILDREN
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import Change, Clip, Ego, Mutant, Origin, Quantity, Recorded, Weather
from foresee_dsl.language.traversal import si_of
from foresee_dsl.simulate.trace import Trace

UNPROMISING = 0.25
"""Share of its mutants that a clip gets if the preset's search finds no candidate. Ours: one of four by default."""
_DRAWS = 32
"""Maximum number of draws for one mutant; a draw that equals an earlier mutant is repeated. Ours: with a hundred
values, a draw equals an earlier one once in a hundred times, and 32 draws in a row practically never do. If the
operators have fewer values than mutants, there are fewer mutants.
"""


def mutate(
    case: TestCase,
    clip: Clip,
    trace: Trace,
    *,
    preset: str | MutationPreset = "focused",
    count: int = DEFAULT_CHILDREN,
    seed: int = 0,
    driver: str = "",
    models: Collection[str] | None = None,
) -> tuple[Mutant, ...]:
    """Make up to `count` children of a clip; no two are equal, and each has an effect.

    Args:
        case: the clip, expanded.
        clip: the clip.
        trace: the clip's own run, unmutated, or its seconds of the parent's run; its first frame is the clip's
            beginning. The risky point, and the actor that it is about, are those of the clip's `risk` line (the middle
            of the run where there is none).
        preset: a preset or its name.
        seed: every draw depends on it, the clip's pin and the child's number, and on nothing else.
        driver: name and version of the driver under test, for the origin.
        models: names of the models of the case that may be swapped in (default: all).

    Returns:
        The children; fewer than `count`, or none, where the operators have no more changes for the targets.

    Raises:
        UnknownPresetError: there is no such preset.
    """
    return Mutator(case, clip, trace, preset=preset, models=models).children(count, seed=seed, driver=driver)


class Mutator:
    """Makes the mutants of one clip, with any number of seeds; arguments and errors are those of `mutate`."""

    def __init__(
        self,
        case: TestCase,
        clip: Clip,
        trace: Trace,
        *,
        preset: str | MutationPreset = "focused",
        models: Collection[str] | None = None,
        plans: Sequence[PlanNames] = (),
        point: RiskyPoint | None = None,
    ) -> None:
        """Find out which operators can act on which actors (in `situation`); that does not depend on the seed.

        `plans`: the `plans` of another mutator of the same clip, to save the time to determine them again. `point`: a
        risky point of `trace` in the place of the clip's; then `trace` may be the run of a mutant of the clip.

        Raises:
            ForeseeError: the clip's `risk` line names an operator that is not installed.
        """
        self._clip, self._preset, self._pin = clip, presets.preset(preset), pin_of(case)
        self._goal = case.goal
        goal = PairGoal.of(case)
        self._pinned = int(self._pin.partition(":")[2], 16)
        self._searched: dict[int, tuple[int, list[Drawn]]] = {}
        self._proposed = (clip.risk.operator or "") if clip.risk and point is None else ""
        self.situation = Situation(
            clip=clip,
            trace=trace,
            frame=_risky_frame(clip, trace) if point is None else point.frame,
            ranked=((clip.risk.actor or "") if clip.risk else "") if point is None else point.actor,
            models={name: spec_of(model) for name, model in case.models.items()},
            swappable=tuple(sorted(models if models is not None else case.models)),
            weather=_weather(case),
            onset_s=_handover_s(clip) if self._proposed else None,
            goal=goal,
        )
        if self._proposed and self._proposed not in operators():
            names = ", ".join(sorted(operators()))
            raise ForeseeError(
                f"clip {clip.name}: its `risk` line has the unknown `by {self._proposed}`; write one of: {names}"
            )
        by_name = operators() if plans else {}
        stated = [tuple((by_name[name], target) for name, target in plan) for plan in plans]
        self._plans = stated or _proposed_first(_plans(self.situation, self._preset, self._proposed), self._proposed)

    @property
    def plans(self) -> tuple[PlanNames, ...]:
        """Return the plans, which the mutants use in turn: names of operators, each with its target."""
        return tuple(tuple((operator.name, target) for operator, target in plan) for plan in self._plans)

    def searched(self, seed: int, most: int) -> int:
        """Return how many mutants the preset's search yields for a seed, at most `most`."""
        return len(self._best(seed, most))

    def children(
        self,
        count: int = DEFAULT_CHILDREN,
        *,
        seed: int = 0,
        driver: str = "",
        seen: Collection[tuple[Change, ...]] = (),
    ) -> tuple[Mutant, ...]:
        """Make up to `count` children, none of which has changes that were `seen`."""
        mutants: list[Mutant] = []
        used = set(seen)
        best = self.searched(seed, count)
        if (
            self._preset.search is not None and not self._goal
        ):  # a clip without a promising candidate gets fewer mutants
            count = best or math.ceil(count * UNPROMISING)
        for k in range(1, count + 1) if self._plans or best else ():
            draw = Draw.numbered(k, len(self._plans), best)
            child = self.child(draw, seed=seed, driver=driver, seen=used) if draw is not None else None
            if child is not None:
                used.add(child.changes)
                mutants.append(child.model_copy(update={"name": f"{self._clip.name}_m{k}"}))
        return tuple(mutants)

    def child(
        self,
        draw: Draw,
        *,
        seed: int,
        driver: str = "",
        seen: Collection[tuple[Change, ...]] = (),
        near: Mutant | None = None,
        how: How | None = None,
    ) -> Mutant | None:
        """Return the mutant of a draw; None if all its changes were `seen`.

        `near`: another mutant of the clip. `how`: how the new one uses its changes; None: they are varied a little.
        """
        drawn = self._drawn(draw, seed, seen) if near is None else self._of(how or How.NEAR, draw, near, seed, seen)
        if drawn is None:
            return None
        names, changes = drawn
        origin = Origin(
            operator=names,
            preset=self._preset.name,
            seed=Quantity(value=Decimal(seed)),
            why=self._why(names, changes),
            tool=__version__,
            driver=driver or None,
            goal=self._goal or None,
        )
        name = self._clip.name
        return Mutant(name=f"{name}_m", parent=f"{name}.foresee", pin=self._pin, body=(*changes, origin))

    def _why(self, names: Sequence[str], changes: Sequence[Change]) -> str | None:
        """Return the proposal of the risky point, and whether the mutant is another one; None if the point has none."""
        if not self._proposed or (risk := self._clip.risk) is None:
            return None
        same = self._proposed in names and any(change.actor == risk.actor for change in changes)
        return risk.text if same else f"its clip was cut for another change: {risk.text}"

    def _drawn(self, draw: Draw, seed: int, seen: Collection[tuple[Change, ...]]) -> Drawn | None:
        if draw.plan == SEARCHED:
            best = self._best(seed, draw.turn + 1)
            return best[draw.turn] if draw.turn < len(best) and best[draw.turn][1] not in seen else None
        return _child(self.situation, self._preset, self._plans[draw.plan], self._rng(draw, seed), seen)

    def _of(self, how: How, draw: Draw, near: Mutant, seed: int, seen: Collection[tuple[Change, ...]]) -> Drawn | None:
        """Return the operators and changes of a mutant that uses another mutant's changes."""
        if how is How.NEAR:
            return self._near(draw, near, seed, seen)
        if how is How.BESIDE:
            return self._beside(draw, near, seed, seen)
        changes = weaker_changes(near.changes, draw.turn) if how is How.WEAKER else near.changes
        names = near.origin.operator if near.origin is not None else ()
        return (names, changes) if changes and changes not in seen else None

    def _beside(self, draw: Draw, near: Mutant, seed: int, seen: Collection[tuple[Change, ...]]) -> Drawn | None:
        """Return the changes of a mutant, and further ones of other properties that bring an actor nearer to the ego in
        that mutant's run, which is this mutator's trace.
        """
        own, names = near.changes, near.origin.operator if near.origin is not None else ()
        changed = {(change.actor, change.property) for change in own}
        plans = [
            plan
            for plan in self._plans
            if not any((target, getattr(operator, "property", "")) in changed for operator, target in plan)
        ]
        if not plans:
            return None
        further = {changes[len(own) :] for changes in seen if changes[: len(own)] == own}
        plan, rng = plans[draw.turn % len(plans)], self._rng(draw, seed, *_entropy(near))
        drawn = _child(self.situation, self._preset, plan, rng, further)
        if drawn is None or any((change.actor, change.property) in changed for change in drawn[1]):
            return None
        return (*names, *drawn[0]), (*own, *drawn[1])

    def _near(self, draw: Draw, near: Mutant, seed: int, seen: Collection[tuple[Change, ...]]) -> Drawn | None:
        by_property = {getattr(operator, "property", ""): operator for operator in operators().values()}
        made_by = tuple((by_property[c.property], c.actor) for c in near.changes if c.property in by_property)
        plan = made_by if draw.plan == SEARCHED else self._plans[draw.plan]
        rng = self._rng(draw, seed, *_entropy(near))
        gap = partial(_gap_m, self.situation)
        drawn = near_changes(self.situation, self._preset, plan, near.changes, rng, seen=seen, gap=gap)
        if drawn is None or draw.plan != SEARCHED or near.origin is None:
            return drawn
        return near.origin.operator, drawn[1]

    def _rng(self, draw: Draw, seed: int, *more: int) -> np.random.Generator:
        entropy = [seed, self._pinned, draw.number(len(self._plans)), *more]
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy)))

    def _best(self, seed: int, most: int) -> list[Drawn]:
        """Return the first mutants of the preset's search.

        The first results do not depend on how many are asked for.
        """
        searched_for, children = self._searched.get(seed, (0, []))
        if searched_for < most:
            children = avoidable(self.situation, self._preset, most, np.random.default_rng([seed, self._pinned]))
            self._searched[seed] = most, children
        return children[:most]


class How(StrEnum):
    """How a mutant comes about."""

    ANEW = "anew"
    """Drawn from the clip, by a plan or by the preset's search."""
    NEAR = "near"
    """The changes of another mutant, varied a little (`derive.local_search`)."""
    WEAKER = "weaker"
    """The changes of another mutant with less strength."""
    BESIDE = "beside"
    """The changes of another mutant, and further ones that a forecast of its run proposes."""
    EARLIER = "earlier"
    """The changes of a mutant of an earlier campaign."""


SEARCHED = -1
"""The value that means the preset's search instead of a plan."""


class Draw(NamedTuple):
    """The draw that a mutant comes from.

    `plan`: index in `Mutator.plans`. `turn`: number of the draw of that plan, from 0.
    """

    plan: int
    turn: int

    @classmethod
    def numbered(cls, k: int, plans: int, searched: int) -> Draw | None:
        """Return the draw of mutant `k` (from 1): first the results of the search, then the plans in turn."""
        if k <= searched:
            return cls(SEARCHED, k - 1)
        return cls((k - 1) % plans, (k - 1) // plans) if plans else None

    def number(self, plans: int) -> int:
        """Return the number of the mutant that comes from this draw (the reverse of `numbered`)."""
        return self.turn + 1 if self.plan == SEARCHED else self.plan + 1 + self.turn * plans


Drawn = tuple[tuple[str, ...], tuple[Change, ...]]
"""The names of operators, and the changes that they have drawn."""
PlanNames = tuple[tuple[str, str], ...]
"""A plan by names: its operators and their targets."""


def _entropy(child: Mutant) -> tuple[int, ...]:
    """Return a hash of a mutant's changes. It makes draws near this mutant differ from draws near another one."""
    text = repr([change.model_dump_json() for change in child.changes])
    return 1, int(hashlib.sha256(text.encode()).hexdigest()[:12], 16)


def _weather(case: TestCase) -> dict[str, Quantity]:
    """Return rain, fog and wetness of the road as ratios; 0 if the case does not state them."""
    stated = case.scenario.first(Weather)
    values = {name: getattr(stated, name, None) for name in ("rain", "fog", "wetness")}
    return {name: has if isinstance(has, Quantity) else Quantity(value=Decimal(0)) for name, has in values.items()}


def _risky_frame(clip: Clip, trace: Trace) -> int:
    """Return the frame of the clip's run at which its risky point lies."""
    at = clip.risk.at if clip.risk else None
    if not isinstance(at, Quantity):
        return trace.frames // 2
    return trace.frame_at(at.si - clip.start_s)


def _handover_s(clip: Clip) -> float:
    """Return for how long the ego follows its recorded states at the clip's beginning, s."""
    ego = next(item for item in clip.body if isinstance(item, Ego))
    return max((si_of(item.time) for item in ego.body if isinstance(item, Recorded)), default=0.0)


def _proposed_first(plans: list[Plan], operator: str) -> list[Plan]:
    """Return the plans with those first that contain the proposed operator."""
    return sorted(plans, key=lambda plan: all(candidate.name != operator for candidate, _ in plan))


def _plans(situation: Situation, preset: MutationPreset, proposed: str) -> list[Plan]:
    """Return the recipes whose operators can all act on their targets. If there is no such recipe, return from each
    recipe the operators that can.

    `proposed`: name of the operator that the risky point proposes for the ranked actor; "" for none.
    """
    by_name = operators()
    ranked = situation.ranked if situation.ranked in situation.columns else ""
    if preset.targets == "letter":
        letter = {n: by_name[n].letter_target(situation) for recipe in preset.recipes for n in recipe}
        targets = letter | ({proposed: ranked} if proposed in letter and ranked else {})
        full = [tuple((by_name[n], targets[n]) for n in recipe) for recipe in preset.recipes]
    else:
        target = ranked if proposed and ranked else _ranked_target(situation, preset, by_name)
        full = [tuple((by_name[n], target) for n in recipe) for recipe in preset.recipes]
    parts = [tuple((o, t) for o, t in plan if t and _acts(situation, preset, o, t)) for plan in full]
    whole = [part for part, plan in zip(parts, full, strict=True) if part == plan]
    return whole or list(dict.fromkeys(part for part in parts if part))


def _ranked_target(situation: Situation, preset: MutationPreset, by_name: dict[str, Operator]) -> str:
    """Return the actor that all operators of the preset change; "" if there is none.

    It is the ranked actor; if that is impossible, the closest actor that can be brought near the ego; if there is none,
    the first actor.
    """
    names = sorted({name for recipe in preset.recipes for name in recipe})
    near = situation.closest(situation.frame, list(situation.columns))
    if situation.ranked in near:
        near = [situation.ranked, *(a for a in near if a != situation.ranked)]
    usable = [a for a in near if _is_target(situation, preset, a)]
    usable = [a for a in usable if any(_acts(situation, preset, by_name[n], a) for n in names)]
    about_goal = situation.goal is not None and situation.goal.actor == situation.ranked
    if preset.reach_m is None or (about_goal and situation.ranked in usable):
        return next(iter(usable), "")
    rng = np.random.default_rng(0)  # a fixed generator, because the target must not depend on the seed
    reachable = (
        actor
        for actor in usable
        if any(
            _gap_m(situation, by_name[n].changes(situation, actor, preset, rng))[0] <= preset.reach_m
            for n in names
            for _ in range(preset.draws)
        )
    )
    return next(reachable, next(iter(usable), ""))


def _is_target(situation: Situation, preset: MutationPreset, actor: str) -> bool:
    too_far = preset.farthest_m is not None and situation.gaps[actor][situation.frame] > preset.farthest_m
    return not too_far and situation.driven_m(actor) >= preset.timing.least_way_m


def _gap_m(situation: Situation, changes: tuple[Change, ...]) -> tuple[float, float]:
    """Return how near changes bring an actor to the recorded ego when they are rolled out, m: the distance between
    footprints, and between centres.

    For the actor of a goal that can be rolled out, the first number is the goal's margin.
    """
    of = {c.actor: tuple(d for d in changes if d.actor == c.actor) for c in changes}
    gaps = (
        predicted_gap_m(situation.trace, situation.columns[a], own, situation.models, situation.goal)
        for a, own in of.items()
    )
    return min(gaps, default=(np.inf, np.inf))


def _acts(situation: Situation, preset: MutationPreset, operator: Operator, target: str) -> bool:
    """Return whether an operator can change a target; this does not depend on the random choices."""
    return bool(operator.changes(situation, target, preset, np.random.default_rng(0)))


def _child(
    situation: Situation,
    preset: MutationPreset,
    plan: Plan,
    rng: np.random.Generator,
    seen: Collection[tuple[Change, ...]],
) -> Drawn | None:
    """Return the operators and changes of one mutant; None if earlier mutants have all changes that can be drawn.

    Of `preset.draws` draws it is the one that comes nearest to the ego when it is rolled out.
    """
    draws: dict[tuple[Change, ...], tuple[str, ...]] = {}
    for _ in range(_DRAWS * preset.draws):
        drawn = [(operator.name, operator.changes(situation, target, preset, rng)) for operator, target in plan]
        changes = tuple(change for _, part in drawn for change in part)
        if changes and changes not in seen:
            draws.setdefault(changes, tuple(name for name, part in drawn if part))
        if len(draws) >= preset.draws:
            break
    if not draws:
        return None
    best = min(draws, key=lambda changes: _gap_m(situation, changes)) if len(draws) > 1 else next(iter(draws))
    return draws[best], best
