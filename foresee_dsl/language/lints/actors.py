"""Lints about what actors are told to do: what they cannot, and speeds that their models do not reach."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import get_args

from foresee_dsl.language import model as m
from foresee_dsl.language.codes import names as c
from foresee_dsl.language.printer import written
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.traversal import walk

_ACTIONS: tuple[type[m.Item], ...] = get_args(get_args(m.Action)[0])
_SLACK = 1.01
"""Speeds that much over the model's are rounding (ours; the compiler's check takes the same)."""


@dataclass(frozen=True)
class Found:
    """A lint before it has its place: the item and its field, the code, what is odd, what to write instead."""

    item: m.Item
    field: str
    code: str
    message: str
    help: str = ""


def actor_lints(case: TestCase) -> Iterator[Found]:
    """Return the lints about one concrete scenario's actors and their actions."""
    actors: dict[str, m.Ego | m.Actor] = {actor.name: actor for actor in case.scenario.actors}
    for actor in actors.values():
        for item in actor.body:
            if isinstance(item, m.StartSpeed | m.CruiseSpeed):
                yield from _too_fast(item, "speed", item.speed, actor, case.models)
    for when in case.scenario.all(m.When):
        for action in walk(when):
            actor_ = actors.get(getattr(action, "actor", ""))
            if actor_ is None or not isinstance(action, _ACTIONS):
                continue
            reason = _cannot(action, actor_)
            if reason:
                yield Found(action, "", c.CANNOT_DO, *reason)
            elif isinstance(action, m.ChangesSpeed):
                yield from _too_fast(action, "to", action.to, actor_, case.models)


def _cannot(action: m.Item, actor: m.Ego | m.Actor) -> tuple[str, str] | None:
    """Return why an actor cannot do something, and what would help; None when it can."""
    if isinstance(actor, m.Ego):
        return "the ego cannot be told what to do: the driver under test drives it", "name another actor"
    if actor.kind == "obstacle":
        return f"'{actor.name}' is an obstacle, which never moves", "name another actor, or remove this"
    ways = {type(item) for item in actor.body} & {m.Route, m.EdgeRoute, m.Path}
    if not ways and actor.state is None:
        help = f"give '{actor.name}' a `path [PLACE, PLACE]`"
        return f"'{actor.name}' has no way to go, so it stands where it is", help
    if isinstance(action, m.ChangesLane) and (actor.kind == "pedestrian" or m.Path in ways):
        return f"'{actor.name}' follows a path, which has no lanes", "bend its `path` instead"
    return None


def _too_fast(
    item: m.Item, field: str, speed: m.Value, actor: m.Ego | m.Actor, models: Mapping[str, m.VehicleModel]
) -> Iterator[Found]:
    model = models.get(actor.model) if isinstance(actor.model, str) else None
    top = model.max_speed if model is not None else None
    if model is None or not isinstance(top, m.Quantity) or not isinstance(speed, m.Quantity):
        return
    if speed.si > top.si * _SLACK:
        message = f"'{actor.name}' is to go {written(speed)}, but {model.name} reaches {written(top)}"
        help = f"use at most `{written(top)}`, or a faster model"
        yield Found(item, field, c.OVER_TOP_SPEED, message, help)
