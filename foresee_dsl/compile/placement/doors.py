"""Doors that triggers open: which actors have some, and each as a body that is there while it is open."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from foresee_dsl.compile import codes
from foresee_dsl.compile.bundle import DoorOf, ModelSpec, PlacedActor
from foresee_dsl.helps import write
from foresee_dsl.language import model as m
from foresee_dsl.language.project.document import Problem
from foresee_dsl.language.traversal import all_actions, si_of, word_of

DOOR_LENGTH_M = 1.1
"""Length of a door. Ours: front doors of cars with four doors are 1.0 m to 1.2 m long, of coupes up to 1.4 m."""
DOOR_WIDTH_M = 0.15
"""Its thickness with the lining and the mirror's foot. Ours."""
DOOR_OPEN_DEG = 65.0
"""How far it opens. Ours: cars' doors stop at 60 to 70 degrees; its edge is then 1.0 m out from the side."""
HINGE_BEHIND_M = 1.5
"""Its hinge lies so far behind the front, in a vehicle under 4.5 m a third of its length. Ours: behind the front
wheel."""
_SHORT_M = 4.5
_MODEL = "obstacle.door"
_WITH_DOORS = ("car.", "van.", "truck.", "obstacle.parked_")
"""What the names of models with doors begin with. A bus's doors fold or slide."""


def has_doors(model: str) -> bool:
    """Whether the vehicles of a model have doors that stand out when they are open."""
    return model.startswith(_WITH_DOORS)


def door_actions(scenario: m.Scenario) -> Iterator[m.Door]:
    """Yield all actions that open or close a door."""
    for when in scenario.all(m.When):
        yield from (action for action in all_actions(when.actions) if isinstance(action, m.Door))


def door_problems(scenario: m.Scenario, placed: Iterable[PlacedActor]) -> Iterator[Problem]:
    """Yield the doors of actors that have none."""
    models = {actor.id: actor.model.name for actor in placed}
    for name in dict.fromkeys(action.actor for action in door_actions(scenario)):
        model = models.get(name)
        if model is not None and not has_doors(model):
            message = f"{name} ({model}) has no door that could be opened"
            help = "cars, vans and trucks have doors, parked ones too (" + write("obstacle.parked_car") + ")"
            yield Problem("", "when", codes.NO_DOOR, message, help, name)


def doors_of(scenario: m.Scenario, placed: Iterable[PlacedActor]) -> list[PlacedActor]:
    """Return a body for each door that may be opened; where it is does not matter before it is open."""
    by_name: Mapping[str, PlacedActor] = {actor.id: actor for actor in placed}
    first = {id(action) for when in scenario.all(m.When) if _at_once(when) for action in when.actions}
    found: dict[str, PlacedActor] = {}
    for action in door_actions(scenario):
        owner = by_name.get(action.actor)
        if owner is not None:
            side = door_side(action)
            name = m.door_name(owner.id, side)
            opens = action.what == "opens" and id(action) in first
            known = found.get(name)
            of = DoorOf(owner.id, side, opens or (known is not None and known.door is not None and known.door.is_open))
            found[name] = replace(_BODY, id=name, x=owner.x, y=owner.y, door=of)
    return list(found.values())


def _at_once(when: m.When) -> bool:
    """Whether a trigger fires at the first frame by its time: then SUMO's vehicles know of the door from the start."""
    asked = when.condition
    if not isinstance(asked, m.Comparison) or not isinstance(asked.left, m.Measure) or asked.left.what != "time":
        return False
    return asked.op == ">=" and si_of(asked.right) <= 0.0 and when.repeat != "next"


def door_side(action: m.Door) -> str:
    """Return which side's door an action is about."""
    return "left" if action.side is None else word_of(action.side)


def hinge_m(length_m: float) -> float:
    """Return how far a door's hinge lies ahead of the middle of a vehicle, m."""
    return length_m / 2 - (length_m / 3 if length_m < _SHORT_M else HINGE_BEHIND_M)


_BODY = PlacedActor(
    id="",
    model=ModelSpec(
        name=_MODEL,
        kind="obstacle",
        length_m=DOOR_LENGTH_M,
        width_m=DOOR_WIDTH_M,
        wheelbase_m=0.0,
        front_overhang_m=0.0,
        mass_kg=0.0,
        max_speed_mps=0.0,
        acceleration_mps2=0.0,
        braking_mps2=0.0,
        emergency_braking_mps2=0.0,
        max_steer_rad=0.0,
        steer_rate_rad_s=0.0,
        height_m=1.3,
    ),
    control="static",
    x=0.0,
    y=0.0,
    heading_rad=0.0,
    speed_mps=0.0,
)
