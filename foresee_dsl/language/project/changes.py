"""Applies lines such as `change X.Y: WAS => NOW` to a scenario: reads the old value, checks the new one and writes
it."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from decimal import Decimal
from typing import TypeVar, cast

from pydantic import ValidationError

from foresee_dsl.helps import HelpText, write
from foresee_dsl.language import model as m
from foresee_dsl.language.logic import weaker
from foresee_dsl.language.meaning import same_value
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.printer import value_text
from foresee_dsl.language.project.catalogues import check_model, cruise_speed_mps
from foresee_dsl.language.project.concretise import complaint, same_kind
from foresee_dsl.language.traversal import mapped, parts

_ItemT = TypeVar("_ItemT", bound=m.Item)
Participant = m.Ego | m.Actor
_Value = m.ParamValue | m.Ref | m.Expression


def changed_body(
    change: m.Change,
    body: tuple[m.ScenarioItem, ...],
    collector: Collector,
    *,
    models: Mapping[str, m.VehicleModel] | None = None,
    place: str = "the clip",
    parameters: Container[str] = (),
) -> tuple[m.ScenarioItem, ...]:
    """Return a scenario's statements with one `change` line applied; all other statements are the same objects.

    If the name is unknown, WAS is not the present value, or NOW does not fit, the error is added to `collector` and the
    statements come back unchanged.

    Args:
        models: every model that may be named; None if the caller checks models.
        place: the changed file, in words for messages.
        parameters: the names of parameters that NOW may refer to.
    """
    named = isinstance(change.now, str) and change.now in parameters
    now: _Value = m.Ref(name=str(change.now)) if named else change.now
    if isinstance(now, m.EXPRESSIONS) and (problem := _mixed(now, body)):
        collector.add(change, "now", "FS062", *problem)
        return body
    try:
        if change.actor in m.OWNERS:
            old, new = _of_scenario(change, now, body, place)
        else:
            old, new = _of_actor(change, now, body, models, place)
    except _RefusedError as refused:
        collector.add(change, refused.field, refused.code, refused.message, refused.help)
        return body
    except ValidationError as error:
        message = f"{_label(change)} cannot be {value_text(change.now)}: {complaint(error)}"
        collector.add(change, "now", "FS124", message)
        return body
    model = new.model if isinstance(new, Participant) and change.property == "model" else None
    if models is not None and isinstance(new, Participant) and isinstance(model, str):
        check_model(model, new.kind, models, collector, place=(change, "now"))
        new = _at_its_own_pace(new, models.get(str(change.was)), models.get(model))
    return tuple(new if item is old else item for item in body) if old is not None else (*body, new)


def weakened(before: tuple[m.ScenarioItem, ...], after: tuple[m.ScenarioItem, ...]) -> str | None:
    """Return the name of an expectation that is easier to meet after a change than before; None if there is none."""
    old = {item.name: item for item in before if isinstance(item, m.Expect) and item.name}
    pairs = ((old[item.name], item) for item in after if isinstance(item, m.Expect) and item.name in old)
    return next((now.name for was, now in pairs if now is not was and weaker(was, now)), None)


class _RefusedError(Exception):
    """Raised for a change that cannot be applied; it holds the field of the change that is wrong, and the reason."""

    def __init__(self, field: str, code: str, message: str, help: HelpText = "") -> None:
        super().__init__(message)
        self.field, self.code, self.message, self.help = field, code, message, help


def _label(change: m.Change) -> str:
    return f"{change.actor}.{change.property}"


def _mixed(now: m.Expression, body: tuple[m.ScenarioItem, ...]) -> tuple[str, HelpText] | None:
    """Return the message and the help if the dimensions of an expression do not fit; otherwise None."""
    from foresee_dsl.language.arithmetic.dimensions import Dimensions

    dimensions = Dimensions({item.name: item.type for item in body if isinstance(item, m.Param)})
    dimensions.of(now)
    return next(((mismatch.message, mismatch.help) for mismatch in dimensions.mismatches), None)


def _check_was(change: m.Change, has: _Value, place: str) -> None:
    was = m.Ref(name=change.was) if isinstance(has, m.Ref) and isinstance(change.was, str) else change.was
    if not same_value(has, was):
        text = value_text(has)
        message = f"{_label(change)} is {text} in {place} now, not {value_text(change.was)}"
        raise _RefusedError("was", "FS123", message, f"write `change {_label(change)}: {text} => ...`")


def _of_actor(
    change: m.Change,
    now: _Value,
    body: tuple[m.ScenarioItem, ...],
    models: Mapping[str, m.VehicleModel] | None,
    place: str,
) -> tuple[m.ScenarioItem, m.ScenarioItem]:
    """Return an actor before and after a change."""
    actors = {item.name: item for item in body if isinstance(item, m.Ego | m.Actor)}
    if change.actor not in actors:
        help = did_you_mean(change.actor, actors)
        raise _RefusedError("actor", "FS037", f"there is no actor '{change.actor}'", help)
    actor, rule = actors[change.actor], m.PROPERTIES.get(change.property)
    if rule is None:
        help = did_you_mean(change.property, m.PROPERTIES)
        raise _RefusedError(
            "property", "FS006", f"an actor has no property '{change.property}' that a change can name", help
        )
    if isinstance(actor, m.Ego) and not rule.for_ego:
        message = f"the ego's {change.property} cannot change, because the driver under test drives it"
        raise _RefusedError("actor", "FS124", message, "name another actor")
    if isinstance(actor, m.Actor) and actor.first(m.Track) is not None:
        _check_beside_track(change, rule)
    if change.property == "style" and not any(isinstance(item, m.Route | m.EdgeRoute) for item in actor.body):
        message = f"{change.actor} does not drive along a route, so it cannot have a style"
        raise _RefusedError("actor", "FS124", message, "name a vehicle on a route")
    has = value_of(actor, change.property)
    if has is None:
        message = f"{actor.name} has no {change.property} that can change"
        head = "ego" if isinstance(actor, m.Ego) else f"{actor.kind} {actor.name}"
        help = f"replace its whole statement: `change {head}: ...`" if models is None else ""
        raise _RefusedError("property", "FS124", message, help)
    _check_was(change, has, place)
    if isinstance(now, m.Quantity) and change.property != "model" and not rule.accepts(now.si):
        raise _RefusedError("now", "FS124", f"{_label(change)} cannot be {value_text(now)}", rule.needs)
    return actor, _changed(actor, change, now, rule, keeps_times=models is None)


def _check_beside_track(change: m.Change, rule: m.Property) -> None:
    """Refuse a change of what the recorded track of an actor decides."""
    if rule.statement is not None and rule.statement[0] not in m.BESIDE_TRACK:
        message = f"{change.actor} follows its track, so its {change.property} cannot change"
        raise _RefusedError("property", "FS124", message, "change its timing, delay, line, brakes or model")
    if change.property == "line" and (change.start is not None or change.duration is not None):
        message = f"{change.actor} follows its track, so its line cannot have times"
        raise _RefusedError("start" if change.start is not None else "duration", "FS124", message, "leave them out")


def _at_its_own_pace(actor: Participant, was: m.VehicleModel | None, now: m.VehicleModel | None) -> Participant:
    """Return a clip's actor, after a change of model, with a cruise speed in proportion to the new model's.

    A clip states every actor's cruise speed, which its model determined: a pedestrian who walked 10 % faster than the
    old model's cruise speed walks 10 % faster than the new one's, at most at the new model's top speed. A scenario
    states a cruise speed only where the author means that speed, so it stays.
    """
    cruise = actor.first(m.CruiseSpeed)
    if actor.state is None or cruise is None or not isinstance(cruise.speed, m.Quantity) or was is None or now is None:
        return actor
    old, new, top = cruise_speed_mps(was), cruise_speed_mps(now), now.max_speed
    wanted = cruise.speed.si * (new / old if old and new else 1.0)
    if isinstance(top, m.Quantity):
        wanted = min(wanted, top.si)
    if math.isclose(wanted, cruise.speed.si, rel_tol=1e-9):
        return actor
    return _replaced(actor, m.CruiseSpeed(speed=m.Quantity.of(wanted, "speed", 4)))


# ---- statements other than actors -----------------------------------------------------------------------------------


def _of_scenario(
    change: m.Change, now: _Value, body: tuple[m.ScenarioItem, ...], place: str
) -> tuple[m.ScenarioItem | None, m.ScenarioItem]:
    """Return a statement before a change (None if the change adds it) and after it."""
    item = _owner(change, body)
    if item is None and change.actor != "weather":
        raise _not_there(change, body, place)
    has = _read(change, item)
    if has is None:
        message = (
            f"the expectation '{change.property}' does not compare a measure with one value, so no value can change"
        )
        help = (
            f"replace the whole expectation in a scenario that extends this one: `change expect {change.property}: ...`"
        )
        raise _RefusedError("property", "FS124", message, help)
    _check_was(change, has, place)
    if change.actor == "weather" and isinstance(now, m.Quantity) and not 0 <= now.si <= 1:
        message = f"{_label(change)} cannot be {value_text(now)}"
        raise _RefusedError("now", "FS124", message, "write a number from 0 (none) to 1 (the strongest)")
    if isinstance(has, m.Quantity | str) and isinstance(now, m.Quantity | str) and not same_kind(has, now):
        message = f"{_label(change)} is {value_text(has)}, so it cannot change to {value_text(now)}"
        raise _RefusedError("now", "FS124", message, "give it a value of the same kind")
    return item, _written(change, now, item)


def _not_there(change: m.Change, body: tuple[m.ScenarioItem, ...], place: str) -> _RefusedError:
    if change.actor == "end":
        return _RefusedError("property", "FS126", f"{place} has no `end`", "write " + write("add end after 60 s"))
    if change.actor == "param":
        names = [item.name for item in body if isinstance(item, m.Param)]
        help = did_you_mean(change.property, names) or "it has no parameters"
        return _RefusedError("property", "FS126", f"{place} has no parameter '{change.property}'", help)
    named = [item.name for item in body if isinstance(item, m.Expect) and item.name is not None]
    help = did_you_mean(change.property, named) or "give the expectation a name where it is written: `expect safe: ...`"
    return _RefusedError("property", "FS126", f"{place} has no expectation called '{change.property}'", help)


def _owner(change: m.Change, body: tuple[m.ScenarioItem, ...]) -> m.ScenarioItem | None:
    for item in body:
        match change.actor, item:
            case ("weather", m.Weather()) | ("end", m.End()):
                return item
            case ("expect", m.Expect(name=name)) | ("param", m.Param(name=name)) if name == change.property:
                return item
    return None


def _read(change: m.Change, item: m.ScenarioItem | None) -> _Value | None:
    if isinstance(item, m.Expect):
        compared = [part for part in parts(item.condition) if isinstance(part, m.Comparison)]
        return compared[0].right if len(compared) == 1 else None
    has: _Value | None = getattr(item, _field(change), None)
    return has if has is not None else m.Quantity(value=Decimal(0))


def _written(change: m.Change, now: _Value, item: m.ScenarioItem | None) -> m.ScenarioItem:
    if item is None:
        return m.Weather.model_validate({change.property: now})
    if isinstance(item, m.Expect):
        new = mapped(item.condition, lambda part: _with(part, right=now) if isinstance(part, m.Comparison) else part)
        return _with(item, condition=new)
    return _with(item, **{_field(change): now})


def _field(change: m.Change) -> str:
    """Return the field of a statement, other than an expectation, that a change replaces."""
    return {"param": "default", "end": "after"}.get(change.actor, change.property)


def _with(item: _ItemT, /, **fields: object) -> _ItemT:
    """Return a validated copy with other fields (`model_copy` does not validate)."""
    same = {name: getattr(item, name) for name in type(item).model_fields}
    return type(item).model_validate(same | fields)


# ---- actors ---------------------------------------------------------------------------------------------------------


def _replaced(actor: Participant, item: m.ActorItem) -> Participant:
    return _with(actor, body=(*(other for other in actor.body if not isinstance(other, type(item))), item))


def value_of(actor: Participant, name: str) -> _Value | None:
    """Return an actor's value of a property (one of `PROPERTIES`) before any change; None if it has no value."""
    rule = m.PROPERTIES[name]
    if rule.statement is None:
        return _value(getattr(actor, name))
    if name == "speed" and actor.state is not None:
        return _value(actor.state.speed)
    kind, field = rule.statement
    item = actor.first(kind)
    if rule.words and item is None:
        return rule.words[0]
    return _value(getattr(item, field)) if item is not None else rule.default


def _changed(actor: Participant, change: m.Change, now: _Value, rule: m.Property, *, keeps_times: bool) -> Participant:
    """Return the actor with a property changed.

    A change without times keeps those of a scenario's statement (`keeps_times`); in a clip, it is for the whole clip.
    """
    if rule.statement is None:
        return _with(actor, **{change.property: now})
    if change.property == "speed" and actor.state is not None:
        return _with(actor, state=_with(actor.state, speed=now))
    kind, field = rule.statement
    if rule.words and now == rule.words[0]:
        return _with(actor, body=tuple(item for item in actor.body if not isinstance(item, kind)))
    times = {"start": change.start, "duration": change.duration} if rule.timed else {}
    if keeps_times and not any(times.values()):
        times = {name: getattr(actor.first(kind), name, None) for name in times}
    return _replaced(actor, cast(m.ActorItem, kind.model_validate({field: now} | times)))


def _value(value: object) -> _Value | None:
    return value if isinstance(value, str | m.Quantity | m.Ref | m.Expression) else None
