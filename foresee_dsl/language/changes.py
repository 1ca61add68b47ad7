"""What a mutant's `change` lines may change: how each property is read and written, and which values it takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeVar

from pydantic import ValidationError

from foresee_dsl.language.catalogues import check_model
from foresee_dsl.language.concretise import Reporter, complaint, value_text
from foresee_dsl.language.meaning import same_value
from foresee_dsl.language.model import (
    Actor,
    ActorItem,
    Change,
    Delay,
    Ego,
    ParamValue,
    Quantity,
    State,
    Steers,
    Timing,
    VehicleModel,
)
from foresee_dsl.language.project_codes import BAD_CHANGE, WRONG_WAS

_T = TypeVar("_T")
Participant = Ego | Actor


def changed(change: Change, actor: Participant, models: Mapping[str, VehicleModel], reporter: Reporter) -> Participant:
    """Return the actor with one `change` line applied; as it was, and the mistake noted, where that cannot be.

    Args:
        change: the line.
        actor: as the clip (and the lines before) have it.
        models: every model that may be named.
        reporter: takes the mistakes: a WAS that is not what the actor has, a NOW that does not fit.
    """
    rule = _PROPERTIES[change.property]
    label = f"{change.actor}.{change.property}"
    if isinstance(actor, Ego) and not rule.for_ego:
        message = f"the ego's {change.property} cannot change: the driver under test drives it"
        reporter.add(change, "actor", BAD_CHANGE, message, "name another actor")
        return actor
    has = rule.read(actor)
    if has is None:
        reporter.add(change, "property", BAD_CHANGE, f"{actor.name} has no {change.property} that could change")
        return actor
    if not same_value(has, change.was):
        message = f"{label} is {value_text(has)} in the clip now, not {value_text(change.was)}"
        reporter.add(change, "was", WRONG_WAS, message, f"write `change {label}: {value_text(has)} => ...`")
        return actor
    if isinstance(change.now, str):
        if change.property == "model":
            check_model(change.now, actor.kind, models, reporter, place=(change, "now"))
    elif change.property != "model" and not rule.accepts(change.now.si):
        reporter.add(change, "now", BAD_CHANGE, f"{label} cannot be {value_text(change.now)}", rule.needs)
        return actor
    try:
        return rule.write(actor, change)
    except ValidationError as error:
        reporter.add(change, "now", BAD_CHANGE, f"{label} cannot be {value_text(change.now)}: {complaint(error)}")
        return actor


@dataclass(frozen=True)
class _Property:
    """What a `change` line may change: how it is read and written, and which values it takes."""

    read: Callable[[Participant], ParamValue | None]
    write: Callable[[Participant, Change], Participant]
    accepts: Callable[[float], bool] = lambda _: True
    needs: str = ""
    for_ego: bool = False


def _rebuilt(item: Participant, **fields: object) -> Participant:
    """Copy with other fields, validated (`model_copy` does not validate)."""
    kept = {name: getattr(item, name) for name in type(item).model_fields}
    return type(item).model_validate(kept | fields)


def _item_of(actor: Participant, kind: type[_T]) -> _T | None:
    return next((item for item in actor.body if isinstance(item, kind)), None)


def _replaced(actor: Participant, item: ActorItem) -> Participant:
    return _rebuilt(actor, body=(*(other for other in actor.body if not isinstance(other, type(item))), item))


def _value(found: object) -> ParamValue | None:
    return found if isinstance(found, Quantity | str) else None


def _read_steer(actor: Participant) -> ParamValue | None:
    steers = _item_of(actor, Steers)
    return _value(steers.value) if steers else Quantity(value=Decimal(0))


def _read_timing(actor: Participant) -> ParamValue | None:
    timing = _item_of(actor, Timing)
    return _value(timing.factor) if timing else Quantity(value=Decimal(1))


def _read_delay(actor: Participant) -> ParamValue | None:
    delay = _item_of(actor, Delay)
    return _value(delay.time) if delay else Quantity(value=Decimal(0), unit="s")


def _write_speed(actor: Participant, change: Change) -> Participant:
    if actor.state is None:
        return actor
    kept = {name: getattr(actor.state, name) for name in State.model_fields}
    return _rebuilt(actor, state=State.model_validate(kept | {"speed": change.now}))


def _write_steer(actor: Participant, change: Change) -> Participant:
    fields = {"value": change.now, "start": change.start, "duration": change.duration}
    return _replaced(actor, Steers.model_validate(fields))


_PROPERTIES: Mapping[str, _Property] = {
    "model": _Property(
        read=lambda actor: _value(actor.model),
        write=lambda actor, change: _rebuilt(actor, model=change.now),
        for_ego=True,
    ),
    "speed": _Property(
        read=lambda actor: _value(actor.state.speed) if actor.state else None,
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
        write=lambda actor, change: _replaced(actor, Timing.model_validate({"factor": change.now})),
        accepts=lambda factor: factor > 0,
        needs="timing is a ratio over zero",
    ),
    "delay": _Property(
        read=_read_delay,
        write=lambda actor, change: _replaced(actor, Delay.model_validate({"time": change.now})),
        accepts=lambda delay: delay >= 0,
        needs="a delay is zero or more",
    ),
}
