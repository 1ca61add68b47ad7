"""Doors that triggers open: decides which actors have doors, and makes the body of each door, which is present while it
is open."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from foresee_dsl.compile.bundle import DoorOf, PlacedActor
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.helps import write
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Problem
from foresee_dsl.language.traversal import all_actions, si_of, word_of

DOOR_LENGTH_M = 1.1
"""Length of a door, m. Ours: front doors of cars with four doors are 1.0 m to 1.2 m long, of coupes up to 1.4 m."""
DOOR_WIDTH_M = 0.15
"""Thickness of a door with its lining and the foot of the mirror, m. Ours."""
DOOR_OPEN_DEG = 65.0
"""Angle of an open door, deg. Ours: cars' doors stop at 60 to 70 degrees; the door then extends 1.0 m sideways."""
HINGE_BEHIND_M = 1.5
"""Distance of the hinge from the front, m; in a vehicle shorter than 4.5 m, a third of its length. Ours: behind the
front wheel."""
_SHORT_M = 4.5
_MODEL = "obstacle.door"
_WITH_DOORS = ("car.", "van.", "truck.", "obstacle.parked_")
"""Prefixes of the names of models with doors. A bus's doors fold or slide."""


def has_doors(model: str) -> bool:
    """Return whether the vehicles of a model have doors that extend sideways when they are open."""
    return model.startswith(_WITH_DOORS)


def door_actions(scenario: m.Scenario) -> Iterator[m.Door]:
    """Yield all actions that open or close a door."""
    for when in scenario.all(m.When):
        yield from (action for action in all_actions(when.actions) if isinstance(action, m.Door))


def door_problems(scenario: m.Scenario, placed: Iterable[PlacedActor]) -> Iterator[Problem]:
    """Yield a problem for each actor without doors whose door a trigger opens or closes."""
    models = {actor.id: actor.model.name for actor in placed}
    for name in dict.fromkeys(action.actor for action in door_actions(scenario)):
        model = models.get(name)
        if model is not None and not has_doors(model):
            message = f"{name} ({model}) has no door that could be opened"
            help = "cars, vans and trucks have doors, parked ones too (" + write("obstacle.parked_car") + ")"
            yield Problem("", "when", "FS265", message, help, name)


def doors_of(scenario: m.Scenario, placed: Iterable[PlacedActor]) -> list[PlacedActor]:
    """Return a body for each door that may be opened; its position is irrelevant until it is open."""
    by_name: Mapping[str, PlacedActor] = {actor.id: actor for actor in placed}
    first = {id(action) for when in scenario.all(m.When) if _at_once(when) for action in when.actions}
    doors: dict[str, PlacedActor] = {}
    for action in door_actions(scenario):
        owner = by_name.get(action.actor)
        if owner is not None:
            side = door_side(action)
            name = m.door_name(owner.id, side)
            opens = action.what == "opens" and id(action) in first
            former = doors.get(name)
            was_open = former is not None and former.door is not None and former.door.is_open
            of = DoorOf(owner.id, side, opens or was_open)
            doors[name] = replace(_BODY, id=name, x=owner.x, y=owner.y, door=of)
    return list(doors.values())


def _at_once(when: m.When) -> bool:
    """Return whether a trigger fires at time 0; SUMO's vehicles then react to the door from the first frame on."""
    condition = when.condition
    if not isinstance(condition, m.Comparison) or not isinstance(condition.left, m.Measure):
        return False
    if condition.left.what != "time":
        return False
    return condition.op == ">=" and si_of(condition.right) <= 0.0 and when.repeat != "next"


def door_side(action: m.Door) -> str:
    """Return the side of the door that an action moves."""
    return "left" if action.side is None else word_of(action.side)


def hinge_m(length_m: float) -> float:
    """Return the distance of a door's hinge ahead of the middle of a vehicle, m."""
    return length_m / 2 - (length_m / 3 if length_m < _SHORT_M else HINGE_BEHIND_M)


_BODY = PlacedActor(
    id="",
    model=spec_of(
        m.VehicleModel(
            name=_MODEL,
            length=m.Quantity.of(DOOR_LENGTH_M, "length", 2),
            width=m.Quantity.of(DOOR_WIDTH_M, "length", 2),
            height=m.Quantity.of(1.3, "length", 1),
        )
    ),
    control="static",
    x=0.0,
    y=0.0,
    heading_rad=0.0,
    speed_mps=0.0,
)
