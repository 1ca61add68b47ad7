"""What `change X.Y: WAS => NOW` may change: how each property is read and written, and which values it takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeVar

from pydantic import ValidationError

from foresee_dsl.language.codes.names import (
    BAD_CHANGE,
    NOT_IN_PARENT,
    UNKNOWN_ACTOR,
    UNKNOWN_PROPERTY,
    WRONG_WAS,
)
from foresee_dsl.language.lints.weaker import weaker
from foresee_dsl.language.meaning import same_value
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model import (
    Actor,
    ActorItem,
    Change,
    Comparison,
    CruiseSpeed,
    Delay,
    Ego,
    End,
    Expect,
    Item,
    Line,
    Param,
    ParamValue,
    Quantity,
    Ref,
    ScenarioItem,
    Steers,
    Timing,
    VehicleModel,
    Walked,
    Weather,
)
from foresee_dsl.language.model.actors import WIDEST_LINE_M
from foresee_dsl.language.project.catalogues import check_model, cruise_speed_mps
from foresee_dsl.language.project.concretise import complaint, same_kind, value_text
from foresee_dsl.language.traversal import mapped, parts

_T = TypeVar("_T")
_ItemT = TypeVar("_ItemT", bound=Item)
Participant = Ego | Actor

OWNERS: Mapping[str, tuple[str, ...]] = {
    "weather": ("rain", "fog", "wetness", "sun"),
    "expect": (),
    "param": (),
    "end": ("after",),
}
"""What a change may name that is no actor, with its properties; empty: the name of one that the file has."""
OF_A_MUTANT = ("weather", "expect")
"""Those that a mutant may change: a clip has no parameters, and ends with its window."""


def changed_body(
    change: Change,
    body: tuple[ScenarioItem, ...],
    findings: Findings,
    *,
    models: Mapping[str, VehicleModel] | None = None,
    place: str = "the clip",
    parameters: Container[str] = (),
) -> tuple[ScenarioItem, ...]:
    """Return a scenario's statements with one `change` line applied; every other one is the same object.

    Args:
        change: the line.
        body: as the clip or scenario (and the lines before) have it.
        findings: takes the mistakes: nothing of that name, a WAS that is not so, a NOW that does not fit. Then the
            statements come back as they were.
        models: every model that may be named; None where another checks them.
        place: what is changed, in words.
        parameters: their names, where NOW may be one.
    """
    named = isinstance(change.now, str) and change.now in parameters
    now: ParamValue | Ref = Ref(name=str(change.now)) if named else change.now
    try:
        if change.actor in OWNERS:
            old, new = _of_scenario(change, now, body, place)
        else:
            old, new = _of_actor(change, now, body, models, place)
    except _RefusedError as refused:
        findings.add(change, refused.field, refused.code, refused.message, refused.help)
        return body
    except ValidationError as error:
        message = f"{_label(change)} cannot be {value_text(change.now)}: {complaint(error)}"
        findings.add(change, "now", BAD_CHANGE, message)
        return body
    if (
        isinstance(new, Ego | Actor)
        and isinstance(new.model, str)
        and change.property == "model"
        and models is not None
    ):
        check_model(new.model, new.kind, models, findings, place=(change, "now"))
        new = _at_its_own_pace(new, models.get(str(change.was)), models.get(new.model))
    return tuple(new if item is old else item for item in body) if old is not None else (*body, new)


def weakened(before: tuple[ScenarioItem, ...], after: tuple[ScenarioItem, ...]) -> str | None:
    """Return the name of an expectation that is easier to meet after a change than before; None where none is."""
    old = {item.name: item for item in before if isinstance(item, Expect) and item.name}
    for item in after:
        if (
            isinstance(item, Expect)
            and item.name in old
            and item is not old[item.name]
            and weaker(old[item.name], item)
        ):
            return item.name
    return None


class _RefusedError(Exception):
    """A change that cannot be made: which of its fields is at fault, and why."""

    def __init__(self, field: str, code: str, message: str, help: str = "") -> None:
        super().__init__(message)
        self.field, self.code, self.message, self.help = field, code, message, help


def _label(change: Change) -> str:
    return f"{change.actor}.{change.property}"


def _check_was(change: Change, has: ParamValue | Ref, place: str) -> None:
    if has.name != change.was if isinstance(has, Ref) else not same_value(has, change.was):
        text = has.name if isinstance(has, Ref) else value_text(has)
        message = f"{_label(change)} is {text} in {place} now, not {value_text(change.was)}"
        raise _RefusedError("was", WRONG_WAS, message, f"write `change {_label(change)}: {text} => ...`")


def _of_actor(
    change: Change,
    now: ParamValue | Ref,
    body: tuple[ScenarioItem, ...],
    models: Mapping[str, VehicleModel] | None,
    place: str,
) -> tuple[ScenarioItem, ScenarioItem]:
    """Return an actor before and after a change."""
    actors = {item.name: item for item in body if isinstance(item, Ego | Actor)}
    if change.actor not in actors:
        help = did_you_mean(change.actor, actors)
        raise _RefusedError("actor", UNKNOWN_ACTOR, f"no actor '{change.actor}'", help)
    actor, rule = actors[change.actor], _PROPERTIES.get(change.property)
    if rule is None:
        help = did_you_mean(change.property, _PROPERTIES)
        raise _RefusedError("property", UNKNOWN_PROPERTY, f"actors have no '{change.property}' to change", help)
    if isinstance(actor, Ego) and not rule.for_ego:
        message = f"the ego's {change.property} cannot change: the driver under test drives it"
        raise _RefusedError("actor", BAD_CHANGE, message, "name another actor")
    has = rule.read(actor)
    if has is None:
        message = f"{actor.name} has no {change.property} that could change"
        help = f"write its statement anew: `change {actor.kind} {actor.name}: ...`" if models is None else ""
        raise _RefusedError("property", BAD_CHANGE, message, help)
    _check_was(change, has, place)
    if isinstance(now, Quantity) and change.property != "model" and not rule.accepts(now.si):
        raise _RefusedError("now", BAD_CHANGE, f"{_label(change)} cannot be {value_text(now)}", rule.needs)
    return actor, rule.write(actor, change, now)


def _at_its_own_pace(actor: Participant, was: VehicleModel | None, now: VehicleModel | None) -> Participant:
    """Return a clip's actor whose model was swapped with the cruise speed that the new model makes of the old one.

    A clip says what everybody drives, which is the old model's doing: who walked 10 % faster than usual does so as
    somebody else too, and nobody drives faster than the new model can. A scenario says a speed because it is meant.
    """
    cruise = _item_of(actor, CruiseSpeed)
    if actor.state is None or cruise is None or not isinstance(cruise.speed, Quantity) or was is None or now is None:
        return actor
    old, new, top = cruise_speed_mps(was), cruise_speed_mps(now), now.max_speed
    wanted = cruise.speed.si * (new / old if old and new else 1.0)
    if isinstance(top, Quantity):
        wanted = min(wanted, top.si)
    if math.isclose(wanted, cruise.speed.si, rel_tol=1e-9):
        return actor
    return _replaced(actor, CruiseSpeed(speed=Quantity.of(wanted, "speed", 4)))


# ---- what is no actor's ---------------------------------------------------------------------------------------------


def _of_scenario(
    change: Change, now: ParamValue | Ref, body: tuple[ScenarioItem, ...], place: str
) -> tuple[ScenarioItem | None, ScenarioItem]:
    """Return a statement before (None: there was none) and after a change."""
    found = _owner(change, body)
    if found is None and change.actor != "weather":
        raise _not_there(change, body, place)
    has = _read(change, found)
    if has is None:
        message = f"'{change.property}' does not compare with one single value"
        help = f"write it anew in a scenario that extends this one: `change expect {change.property}: ...`"
        raise _RefusedError("property", BAD_CHANGE, message, help)
    _check_was(change, has, place)
    if change.actor == "weather" and isinstance(now, Quantity) and not 0 <= now.si <= 1:
        message = f"{_label(change)} cannot be {value_text(now)}"
        raise _RefusedError("now", BAD_CHANGE, message, "weather goes from 0 (none) to 1 (as much as there can be)")
    if not isinstance(has, Ref) and not isinstance(now, Ref) and not same_kind(has, now):
        message = f"{_label(change)} is {value_text(has)}, so it cannot be {value_text(now)}"
        raise _RefusedError("now", BAD_CHANGE, message, "give it a value of the same kind")
    return found, _written(change, now, found)


def _not_there(change: Change, body: tuple[ScenarioItem, ...], place: str) -> _RefusedError:
    if change.actor == "end":
        return _RefusedError("property", NOT_IN_PARENT, f"{place} has no `end`", "write `add end after 60 s`")
    if change.actor == "param":
        known = [item.name for item in body if isinstance(item, Param)]
        help = did_you_mean(change.property, known) or "it has no parameters"
        return _RefusedError("property", NOT_IN_PARENT, f"{place} has no parameter '{change.property}'", help)
    named = [item.name for item in body if isinstance(item, Expect) and item.name is not None]
    help = did_you_mean(change.property, named) or "give it a name where it stands: `expect safe: ...`"
    return _RefusedError("property", NOT_IN_PARENT, f"{place} has no expectation called '{change.property}'", help)


def _owner(change: Change, body: tuple[ScenarioItem, ...]) -> ScenarioItem | None:
    for item in body:
        match change.actor, item:
            case ("weather", Weather()) | ("end", End()):
                return item
            case ("expect", Expect(name=name)) | ("param", Param(name=name)) if name == change.property:
                return item
    return None


def _read(change: Change, found: ScenarioItem | None) -> ParamValue | Ref | None:
    match found:
        case Param(default=default):
            return default
        case End(after=after):
            return after
        case Expect(condition=condition):
            compared = [part for part in parts(condition) if isinstance(part, Comparison)]
            return compared[0].right if len(compared) == 1 else None
        case _:
            has: Quantity | Ref | None = getattr(found, change.property, None)
            return has if has is not None else Quantity(value=Decimal(0))


def _written(change: Change, now: ParamValue | Ref, found: ScenarioItem | None) -> ScenarioItem:
    match found:
        case Param():
            return _with(found, default=now)
        case End():
            return _with(found, after=now)
        case Expect(condition=condition):
            new = mapped(condition, lambda part: _with(part, right=now) if isinstance(part, Comparison) else part)
            return _with(found, condition=new)
        case Weather():
            return _with(found, **{change.property: now})
    return Weather.model_validate({change.property: now})


def _with(item: _ItemT, /, **fields: object) -> _ItemT:
    """Copy with other fields, validated (`model_copy` does not validate)."""
    kept = {name: getattr(item, name) for name in type(item).model_fields}
    return type(item).model_validate(kept | fields)


# ---- what is an actor's ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Property:
    """What a `change` line may change: how it is read and written, and which values it takes."""

    read: Callable[[Participant], ParamValue | Ref | None]
    write: Callable[[Participant, Change, ParamValue | Ref], Participant]
    accepts: Callable[[float], bool] = lambda _: True
    needs: str = ""
    for_ego: bool = False


def _item_of(actor: Participant, kind: type[_T]) -> _T | None:
    return next((item for item in actor.body if isinstance(item, kind)), None)


def _replaced(actor: Participant, item: ActorItem) -> Participant:
    return _with(actor, body=(*(other for other in actor.body if not isinstance(other, type(item))), item))


def _value(found: object) -> ParamValue | Ref | None:
    return found if isinstance(found, Quantity | str | Ref) else None


def _read_steer(actor: Participant) -> ParamValue | Ref | None:
    steers = _item_of(actor, Steers)
    return _value(steers.value) if steers else Quantity(value=Decimal(0))


def _read_timing(actor: Participant) -> ParamValue | Ref | None:
    timing = _item_of(actor, Timing)
    return _value(timing.factor) if timing else Quantity(value=Decimal(1))


def _read_delay(actor: Participant) -> ParamValue | Ref | None:
    delay = _item_of(actor, Delay)
    return _value(delay.time) if delay else Quantity(value=Decimal(0), unit="s")


def _read_line(actor: Participant) -> ParamValue | Ref | None:
    line = _item_of(actor, Line)
    return _value(line.left) if line else Quantity(value=Decimal(0), unit="m")


def _read_moving(actor: Participant) -> ParamValue | Ref | None:
    walked = _item_of(actor, Walked)
    return _value(walked.along) if walked else None


def _read_speed(actor: Participant) -> ParamValue | Ref | None:
    if actor.state is not None:
        return _value(actor.state.speed)
    cruise = _item_of(actor, CruiseSpeed)
    return _value(cruise.speed) if cruise else None


def _write_speed(actor: Participant, _: Change, now: ParamValue | Ref) -> Participant:
    if actor.state is None:
        return _replaced(actor, CruiseSpeed.model_validate({"speed": now}))
    return _with(actor, state=_with(actor.state, speed=now))


def _write_steer(actor: Participant, change: Change, now: ParamValue | Ref) -> Participant:
    fields = {"value": now, "start": change.start, "duration": change.duration}
    return _replaced(actor, Steers.model_validate(fields))


_PROPERTIES: Mapping[str, _Property] = {
    "model": _Property(
        read=lambda actor: _value(actor.model),
        write=lambda actor, _, now: _with(actor, model=now),
        for_ego=True,
    ),
    "speed": _Property(
        read=_read_speed,
        write=_write_speed,
        accepts=lambda speed: speed >= 0,
        needs="a speed is zero or more",
        for_ego=True,
    ),
    "steer": _Property(
        read=_read_steer,
        write=_write_steer,
        accepts=lambda share: -1 <= share <= 1,
        needs="steering is a share of the largest angle, from -1 (right) to 1 (left)",
    ),
    "timing": _Property(
        read=_read_timing,
        write=lambda actor, _, now: _replaced(actor, Timing.model_validate({"factor": now})),
        accepts=lambda factor: factor > 0,
        needs="timing is a ratio over zero",
    ),
    "delay": _Property(
        read=_read_delay,
        write=lambda actor, _, now: _replaced(actor, Delay.model_validate({"time": now})),
        accepts=lambda delay: delay >= 0,
        needs="a delay is zero or more",
    ),
    "line": _Property(
        read=_read_line,
        write=lambda actor, _, now: _replaced(actor, Line.model_validate({"left": now})),
        accepts=lambda left: -WIDEST_LINE_M <= left <= WIDEST_LINE_M,
        needs=f"a line is at most {WIDEST_LINE_M:g} m to the left (positive) or right of the actor's way",
    ),
    "moving": _Property(
        read=_read_moving,
        write=lambda actor, _, now: _replaced(actor, Walked.model_validate({"along": now})),
        accepts=lambda along: along >= 0,
        needs="how far it has come along its path is zero or more",
    ),
}
