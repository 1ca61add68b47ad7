"""The space that all searches share: a moment of a run, an actor, a recipe of operators, and a value for each operator.

It holds whatever the rankers may cut and mutate: the moments are those of the exhaustive search, the actors the nearest
ones, as the ranker `reach` examines them, and the values those that the operators of the preset allow.
"""

from __future__ import annotations

import numpy as np

from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.derive.operators import Operator, Situation, operators
from foresee_dsl.derive.operators.situation import Numeric
from foresee_dsl.derive.presets import MutationPreset
from foresee_dsl.derive.reach.rolling import ReachSettings
from foresee_dsl.language.model import Change
from foresee_dsl.simulate.results.goal import USUAL_SCALES
from foresee_study.search.protocol import FAR, OBJECTIVES, Point

Drawn = tuple[tuple[str, ...], tuple[Change, ...]]
"""Names of operators, and their changes."""
POOL = 64
"""Number of draws from which the values of an operator without numbers are collected. Ours: the model swap and the
style have about ten values, all of which are then drawn but for one time in a hundred."""


def dimensions_of(preset: MutationPreset) -> int:
    """Return the number of dimensions: moment, actor, recipe, and a value for each operator of the longest recipe."""
    return 3 + max(len(recipe) for recipe in preset.recipes)


def index_at(value: float, count: int) -> int:
    """Return which of `count` equal parts of [0, 1] contains a value."""
    return min(int(value * count), count - 1)


def changes_at(situation: Situation, preset: MutationPreset, point: Point) -> Drawn | None:
    """Return the changes of a clip that a point stands for, without its moment; None if no actor can be changed."""
    by_name = operators()
    plans: dict[str, list[list[tuple[Operator, str]]]] = {}
    for actor in situation.closest(0, list(situation.columns)):
        if len(plans) == ReachSettings().nearest:
            break
        if recipes := _recipes(situation, preset, actor, by_name):
            plans[actor] = recipes
    if not plans:
        return None
    recipes = list(plans.values())[index_at(point[1], len(plans))]
    recipe = recipes[index_at(point[2], len(recipes))]
    drawn = []
    for (operator, target), value in zip(recipe, point[3:], strict=False):
        values = values_of(operator, situation, target, preset)
        drawn.append((operator.name, values[index_at(value, len(values))]))
    return tuple(name for name, _ in drawn), tuple(change for _, changes in drawn for change in changes)


def _recipes(
    situation: Situation, preset: MutationPreset, actor: str, by_name: dict[str, Operator]
) -> list[list[tuple[Operator, str]]]:
    """Return the recipes that change an actor; a recipe is left out if its last operator cannot act on it.

    With the targets of the paper's wording, the operators before the last one keep their own targets, as in a campaign
    whose ranker proposes an actor.
    """
    recipes = []
    for names in preset.recipes:
        letter = {n: by_name[n].letter_target(situation) for n in names[:-1]} if preset.targets == "letter" else {}
        plan = [(by_name[n], letter.get(n, actor)) for n in names]
        acting = [(o, target) for o, target in plan if target and values_of(o, situation, target, preset)]
        if acting and acting[-1] == plan[-1] and (preset.targets == "letter" or len(acting) == len(plan)):
            recipes.append(acting)
    return recipes


def values_of(
    operator: Operator, situation: Situation, target: str, preset: MutationPreset
) -> list[tuple[Change, ...]]:
    """Return the changes that an operator can make, in the order of their values."""
    if isinstance(operator, Numeric):
        return [operator.to(situation, target, preset, v) for v in sorted(operator.values(situation, target, preset))]
    rng = np.random.default_rng(0)  # the values must not depend on a search's seed
    draws = {operator.changes(situation, target, preset, rng) for _ in range(POOL)} - {()}
    return sorted(draws, key=str)


def run_margins(child: ChildOutcome) -> tuple[float, ...]:
    """Return the margins of a mutant's run, one for each of `OBJECTIVES`; with a goal, that of the goal alone."""
    if child.verdict.is_failure:
        return (0.0,) * len(OBJECTIVES)
    if child.goal is not None:
        return (min(max(1.0 - child.goal.nearness, 0.0), FAR),) * len(OBJECTIVES)
    near = child.near
    misses = (near.distance_m, near.ttc_s, near.pet_s) if near is not None else (None,) * len(OBJECTIVES)
    scales = (USUAL_SCALES["length"], USUAL_SCALES["time"], USUAL_SCALES["time"])
    return tuple(
        FAR if miss is None else min(miss.value / scale, FAR) for miss, scale in zip(misses, scales, strict=True)
    )
