"""Make the mutated children of a clip: each a few checked changes, the same for the same seed."""

from __future__ import annotations

from collections.abc import Collection
from decimal import Decimal

import numpy as np

from foresee_dsl import __version__
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.derive import presets
from foresee_dsl.derive.avoidable import avoidable
from foresee_dsl.derive.operators import Operator, Situation, operators, predicted_gap_m
from foresee_dsl.derive.presets import Preset
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import Change, Clip, Mutant, Origin, Quantity, Weather
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.trace import Trace

CHILDREN = 4
"""c, the number of children a risky point (paper, section 4.4)."""
_DRAWS = 32
"""How often a child is drawn anew when it equals an earlier one. Ours: two values of a hundred agree once in a
hundred draws, 32 in a row never; where the operators have fewer values than children, there are fewer children."""


def mutate(
    case: TestCase,
    clip: Clip,
    trace: Trace,
    *,
    preset: str | Preset = "focused",
    count: int = CHILDREN,
    seed: int = 0,
    driver: str = "",
    models: Collection[str] | None = None,
) -> tuple[Mutant, ...]:
    """Make up to `count` children of a clip; no two of them are equal, none is without effect.

    Args:
        case: the clip, expanded.
        clip: the clip.
        trace: the clip's own run, unmutated; its first frame is the clip's beginning. The risky point, and the actor
            that it is about, are those of the clip's `risk` line (the middle of the run where there is none).
        preset: a preset or its name.
        seed: with the clip's pin and the child's number it decides every draw.
        driver: name and version of the driver under test, for the origin.
        models: the names of those of the case's models that may be swapped in (default: all).

    Returns:
        The children; fewer than `count`, or none, where the operators cannot do more to the targets.

    Raises:
        UnknownPresetError: there is no such preset.
    """
    return Mutator(case, clip, trace, preset=preset, models=models).children(count, seed=seed, driver=driver)


class Mutator:
    """Makes children of one clip, with any number of seeds; arguments and errors as those of `mutate`."""

    def __init__(
        self,
        case: TestCase,
        clip: Clip,
        trace: Trace,
        *,
        preset: str | Preset = "focused",
        models: Collection[str] | None = None,
    ) -> None:
        """Find out which operators can act on which actors; that does not depend on the seed."""
        self._clip, self._preset, self._pin = clip, presets.preset(preset), pin_of(case)
        self._situation = Situation(
            clip=clip,
            trace=trace,
            frame=_risky_frame(clip, trace),
            ranked=(clip.risk.actor or "") if clip.risk else "",
            models={name: spec_of(model) for name, model in case.models.items()},
            swappable=tuple(sorted(models if models is not None else case.models)),
            weather=_weather(case),
        )
        self._plans = _plans(self._situation, self._preset)

    def children(self, count: int = CHILDREN, *, seed: int = 0, driver: str = "") -> tuple[Mutant, ...]:
        """Make up to `count` children."""
        plans, pin, clip = self._plans, self._pin, self._clip
        made: list[Mutant] = []
        seen: set[tuple[Change, ...]] = set()
        pinned = int(pin.partition(":")[2], 16)
        found = avoidable(self._situation, self._preset, count, np.random.default_rng([seed, pinned]))
        for k in range(1, count + 1) if plans or found else ():
            drawn: _Drawn | None = None
            if k <= len(found):
                drawn = found[k - 1]
            elif plans:
                rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, pinned, k])))
                drawn = _child(self._situation, self._preset, plans[(k - 1) % len(plans)], rng, seen)
            if drawn is None:
                continue
            names, changes = drawn
            seen.add(changes)
            origin = Origin(
                operator=names,
                preset=self._preset.name,
                seed=Quantity(value=Decimal(seed)),
                tool=__version__,
                driver=driver or None,
            )
            name = f"{clip.name}_m{k}"
            made.append(Mutant(name=name, parent=f"{clip.name}.foresee", pin=pin, body=(*changes, origin)))
        return tuple(made)


_Drawn = tuple[tuple[str, ...], tuple[Change, ...]]
"""The names of operators, and what they change."""
_Plan = tuple[tuple[Operator, str], ...]
"""The operators of one child, each with its target."""


def _weather(case: TestCase) -> dict[str, Quantity]:
    """Return how much it rains, how thick the fog is and how wet the road; 0 where the case says nothing."""
    stated = case.scenario.one(Weather)
    found = {name: getattr(stated, name, None) for name in ("rain", "fog", "wetness")}
    return {name: has if isinstance(has, Quantity) else Quantity(value=Decimal(0)) for name, has in found.items()}


def _risky_frame(clip: Clip, trace: Trace) -> int:
    """Return the frame of the clip's run at which its risky point lies."""
    at = clip.risk.at if clip.risk else None
    if not isinstance(at, Quantity):
        return trace.frames // 2
    return trace.frame_at(at.si - clip.start_s)


def _plans(situation: Situation, preset: Preset) -> list[_Plan]:
    """Return the recipes of a preset that can be done, with their targets; else the parts of them that can."""
    known = operators()
    if preset.targets == "letter":
        full = [tuple((known[n], known[n].letter_target(situation)) for n in recipe) for recipe in preset.recipes]
    else:
        target = _ranked_target(situation, preset, known)
        full = [tuple((known[n], target) for n in recipe) for recipe in preset.recipes]
    parts = [tuple((o, t) for o, t in plan if t and _acts(situation, preset, o, t)) for plan in full]
    whole = [part for part, plan in zip(parts, full, strict=True) if part == plan]
    return whole or list(dict.fromkeys(part for part in parts if part))


def _ranked_target(situation: Situation, preset: Preset, known: dict[str, Operator]) -> str:
    """Return the ranked actor, else the closest one that can be brought near the ego, else the first, or ""."""
    names = sorted({name for recipe in preset.recipes for name in recipe})
    near = situation.closest(situation.frame, list(situation.columns))
    if situation.ranked in near:
        near = [situation.ranked, *(a for a in near if a != situation.ranked)]
    usable = [a for a in near if _is_target(situation, preset, a)]
    usable = [a for a in usable if any(_acts(situation, preset, known[n], a) for n in names)]
    if preset.reach_m is None:
        return next(iter(usable), "")
    rng = np.random.default_rng(0)  # the target does not depend on the seed
    reachable = (
        actor
        for actor in usable
        if any(
            _gap_m(situation, known[n].changes(situation, actor, preset, rng))[0] <= preset.reach_m
            for n in names
            for _ in range(preset.draws)
        )
    )
    return next(reachable, next(iter(usable), ""))


def _is_target(situation: Situation, preset: Preset, actor: str) -> bool:
    too_far = preset.farthest_m is not None and situation.gaps[actor][situation.frame] > preset.farthest_m
    return not too_far and situation.driven_m(actor) >= preset.timing.least_way_m


def _gap_m(situation: Situation, changes: tuple[Change, ...]) -> tuple[float, float]:
    """Return how near the roll-out of changes brings any of their actors to the recorded ego: footprints, centres."""
    of = {c.actor: tuple(d for d in changes if d.actor == c.actor) for c in changes}
    gaps = (predicted_gap_m(situation.trace, situation.columns[a], own, situation.models) for a, own in of.items())
    return min(gaps, default=(np.inf, np.inf))


def _acts(situation: Situation, preset: Preset, operator: Operator, target: str) -> bool:
    """Say whether an operator can do anything to a target: whether it can does not depend on the random choices."""
    return bool(operator.changes(situation, target, preset, np.random.default_rng(0)))


def _child(
    situation: Situation, preset: Preset, plan: _Plan, rng: np.random.Generator, seen: set[tuple[Change, ...]]
) -> _Drawn | None:
    """Draw one child's operators and changes that no earlier child has; None where there are none left.

    Of the preset's number of draws it is the one that comes nearest to the ego.
    """
    found: dict[tuple[Change, ...], tuple[str, ...]] = {}
    for _ in range(_DRAWS * preset.draws):
        drawn = [(operator.name, operator.changes(situation, target, preset, rng)) for operator, target in plan]
        changes = tuple(change for _, made in drawn for change in made)
        if changes and changes not in seen:
            found.setdefault(changes, tuple(name for name, made in drawn if made))
        if len(found) >= preset.draws:
            break
    if not found:
        return None
    best = min(found, key=lambda changes: _gap_m(situation, changes)) if len(found) > 1 else next(iter(found))
    return found[best], best
