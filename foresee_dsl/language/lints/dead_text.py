"""Lints about text without effect: conditions and parts of conditions that are certain, and steps that no run
reaches."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from foresee_dsl.helps import remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.lints.certain import About, Limits, always, earliest_s, never
from foresee_dsl.language.lints.roads import Roads, junctions_of
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.model.scenario import DEFAULT_END_S
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import all_actions, parts, walk
from foresee_dsl.language.units import ROUNDING_S

_ENDS_A_STOP = (m.Stops, m.StopsAt, m.BrakesFor, m.ChangesSpeed, m.Meets, m.KeepsGap, m.MatchesSpeed, m.Synchronises,
                m.Reverses, m.Leaves)  # fmt: skip
"""Actions that replace an earlier stop of their actor, or remove the actor, so that the stop is complete."""
_HELP = "change the condition, or " + remove("remove the actions that wait for it")


def certain_conditions(lints: Collector, case: TestCase) -> None:
    """Report triggers and expectations whose result is certain before the run."""
    actions: dict[str, list[m.Action]] = {}  # by actor
    for action in (action for when in case.scenario.all(m.When) for action in all_actions(when.actions)):
        actions.setdefault(getattr(action, "actor", ""), []).append(action)
    limits = _limits_of(case, actions)
    for when in case.scenario.all(m.When):
        _dead_triggers(lints, when, limits, actions)
    for expect in case.scenario.all(m.Expect):
        _decided(lints, expect, limits)


def _limits_of(case: TestCase, actions: Mapping[str, Sequence[m.Action]]) -> Limits:
    """Return what the lints know about a test case's run before it starts: its end, and facts about each actor.

    `actions` are all actions of its triggers, by actor.
    """
    end = case.scenario.first(m.End)
    end_s = end.after.si if end is not None and isinstance(end.after, m.Quantity) else DEFAULT_END_S
    roads = Roads(case.network) if isinstance(case.network, m.Network) else None
    return Limits(
        end_s,
        {a.name: _about(a, case.models, roads, actions.get(a.name, ())) for a in case.scenario.actors},
    )


def _about(
    actor: m.Ego | m.Actor, models: Mapping[str, m.VehicleModel], roads: Roads | None, actions: Sequence[m.Action]
) -> About:
    if isinstance(actor, m.Actor) and actor.all(m.Track):
        return About(backwards=True)  # its track may hold any speed and lead anywhere
    kinds = {type(action) for action in actions}
    model = models.get(actor.model) if isinstance(actor.model, str) else None
    ways = [item for item in actor.body if isinstance(item, m.Route | m.EdgeRoute | m.AnyPath)]
    top = model.max_speed if model is not None else None
    sizes = [size.si for size in (model.length, model.width) if isinstance(size, m.Quantity)] if model else []
    return About(
        moves=bool(ways),
        top_mps=top.si if isinstance(top, m.Quantity) else None,
        model=str(actor.model),
        length_m=math.hypot(*sizes) if len(sizes) == 2 else math.inf,
        junctions=_junctions(ways[0], roads) if roads and len(ways) == 1 and m.FollowsPath not in kinds else None,
        backwards=m.Reverses in kinds,
    )


def _junctions(way: m.Route | m.EdgeRoute | m.AnyPath, roads: Roads) -> frozenset[str] | None:
    """Return the junctions that an actor on a route may reach, including those at which its first road begins; None if
    unknown."""
    reached = junctions_of(way, roads)
    if reached is None:
        return None
    first = way.start if isinstance(way, m.Route) else way.edges[0] if isinstance(way, m.EdgeRoute) else ""
    begins = (roads.edges[edge][0] for edge in (str(first), f"{first}_back") if edge in roads.edges)
    return frozenset((*reached, *begins))


def _dead_triggers(lints: Collector, when: m.When, limits: Limits, others: Mapping[str, Sequence[m.Action]]) -> None:
    """Report a trigger that cannot fire or has steps that no run reaches; `others` are all actions of the scenario, by
    actor."""
    reason = never(when.condition, limits)
    if reason:
        _never_happens(lints, when, reason)
        return  # no run reaches the steps after it either
    _dead_parts(lints, when.condition, limits)
    _dead_steps(lints, when.actions, earliest_s(when.condition), limits, others)


def _dead_steps(
    lints: Collector,
    actions: Sequence[m.Action],
    begins_s: float,
    limits: Limits,
    others: Mapping[str, Sequence[m.Action]],
) -> None:
    """Report the steps of a block that no run reaches; `begins_s` is the earliest time at which the block begins, s."""
    done_s, endless = begins_s, ""
    for action in actions:
        if not isinstance(action, m.Then):
            if isinstance(action, m.Wait) and isinstance(action.duration, m.Quantity):
                done_s = max(done_s, begins_s + action.duration.si)  # every other action may be replaced at once
            endless = endless or _endless(action, others)
            continue
        condition = action.condition
        starts_s = max(done_s, earliest_s(condition) if condition is not None else 0.0)
        reason = never(condition, limits) if condition is not None else ""
        if endless:
            reason = f"`{endless}` before it never completes"
        elif not reason and starts_s > limits.end_s + ROUNDING_S:
            reason = f"it begins at {starts_s:g} s at the earliest, but the run ends after {limits.end_s:g} s"
        if reason:
            _never_happens(lints, action, reason)
            return
        if condition is not None:
            _dead_parts(lints, condition, limits)
        _dead_steps(lints, action.actions, starts_s, limits, others)
        done_s = max(done_s, starts_s)


def _endless(action: m.Action, others: Mapping[str, Sequence[m.Action]]) -> str:
    """Return the text of an action that never completes: a stop or braking without a duration that no action ends by
    replacing it or by removing the actor; otherwise an empty text."""
    if not isinstance(action, m.Stops | m.BrakesFor) or action.duration is not None:
        return ""
    ends = (isinstance(o, _ENDS_A_STOP) and o is not action for o in others.get(action.actor, ()))
    return "" if any(ends) else written(action)


def _never_happens(lints: Collector, item: m.When | m.Then, reason: str) -> None:
    field = "condition" if item.condition is not None else ""
    lints.add(item, field, "FS303", f"this can never happen: {reason}", _HELP)


def _decided(lints: Collector, expect: m.Expect, limits: Limits) -> None:
    until = expect.within.si if isinstance(expect.within, m.Quantity) else limits.end_s
    if until > limits.end_s and expect.within is not None:
        message = (
            f"the run ends after {limits.end_s:g} s, which is before the {written(expect.within)} of this "
            "expectation are over"
        )
        help = "write " + write(f"end after {written(expect.within)}") + ", or give the expectation a shorter time"
        lints.add(expect, "within", "FS306", message, help)
    inside = replace(limits, end_s=min(until, limits.end_s))
    cannot, must = never(expect.condition, inside), always(expect.condition, inside)
    if not (cannot or must):
        _dead_parts(lints, expect.condition, inside)
        return
    met = bool(cannot) if expect.mode == "never" else bool(must)
    message = f"this {'always holds' if met else 'can never hold'}: {cannot or must}"
    help = "expect something that a driver can meet or miss, or " + remove("remove it")
    lints.add(expect, "condition", "FS307", message, help)


def _dead_parts(lints: Collector, condition: m.Condition, limits: Limits) -> None:
    """Report those parts of a condition whose result is certain although the result of the whole condition is not."""
    for part in parts(condition):
        if part is condition or isinstance(part, m.Not | m.Sustained):
            continue
        dead, certain = never(part, limits), always(part, limits)
        if dead or certain:
            message = f"`{written(part)}` {'can never hold' if dead else 'always holds'}: {dead or certain}"
            lints.add(part, "", "FS315", message, remove("remove this part") + ", or write what was meant")
            return  # the parts around it are certain for the same reason


def dead_requirements(lints: Collector, scenario: m.Scenario) -> None:
    """Report requirements that every case meets, or that no case meets."""
    limits = Limits(math.inf, {}, {parameter.name: parameter for parameter in scenario.all(m.Param)})
    for require in scenario.all(m.Require):
        dead, certain = never(require.condition, limits), always(require.condition, limits)
        if dead or certain:
            message = f"{'no case meets this' if dead else 'every case meets this'}: {dead or certain}"
            lints.add(require, "condition", "FS315", message, "change the requirement, or " + remove("remove it"))
        else:
            _dead_parts(lints, require.condition, limits)


def odd_measures(lints: Collector, case: TestCase) -> None:
    """Report `sees` for an actor other than the ego, which alone has sensors, and measures between an actor and
    itself."""
    for statement in case.scenario.body:
        for part in walk(statement) if isinstance(statement, m.When | m.Expect) else ():
            if isinstance(part, m.Sees) and part.actor != "ego":
                message = f"'{part.actor}' has no sensors: only the ego sees"
                help = "write " + write(f"{part.other} in sight of {part.actor}")
                lints.add(part, "actor", "FS316", message, help)
            if isinstance(part, m.Measure) and part.actor is not None and part.actor == part.other:
                message = f"`{written(part)}` is measured between '{part.actor}' and itself"
                lints.add(part, "other", "FS315", message, "name two different actors")
