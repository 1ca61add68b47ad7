"""The entities of a foreign scenario: their names as actors, and their models, bundled or new."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, cast
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.bundle import ActorKind, ModelSpec
from foresee_dsl.compile.catalogue import CLASS_DEFAULTS, spec_of
from foresee_dsl.compile.placement.statements import WHEELS
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import Catalogue, Doc, Quantity, VehicleModel
from foresee_dsl.language.project.loading import bundled_models
from foresee_dsl.language.units import Dimension
from foresee_exchange.naming import distinct_name, name_of, number, quantity, sentence
from foresee_exchange.openscenario.losses import Losses, SourceError
from foresee_exchange.openscenario.reading.source import Source
from foresee_exchange.openscenario.reading.ways.trajectories import SpeedProfile
from foresee_exchange.openscenario.writing.participants import BRAKING, CATEGORIES, CRUISE, MODEL, STEER_RATE, WALKS

_KINDS = {category: kind for kind, category in CATEGORIES.items()}
_EGO_NAMES = ("ego", "hero", "ego_vehicle", "egovehicle", "host", "subject", "sut")
_SAME = 1e-4
"""Sizes that differ by less than this are equal, m (ours: below the rounding of written values)."""
_LARGEST_M = 100.0
"""Largest size of a body that the language allows, m; larger bodies are reduced to it."""
_WEAKEST = 0.01
"""A speed or acceleration below this counts as missing, m/s or m/s^2 (ours)."""
_WIDEST_STEER_RAD = math.radians(79)
"""Wheels of our models must turn by less than 80 degrees."""
_COMPARED = ("length_m", "width_m", "height_m", "wheelbase_m", "front_overhang_m", "max_speed_mps", "acceleration_mps2",
             "emergency_braking_mps2", "max_steer_rad")  # fmt: skip


@dataclass(frozen=True)
class Entity:
    """One entity.

    Attributes:
        ref: its name in the source. name: its name in the scenario, `ego` for the vehicle under test.
        model: `class.variant`. centre_m: distance of its centre ahead of its reference point, m.
        bundled: whether its model is a bundled one.
    """

    ref: str
    name: str
    model: str
    spec: ModelSpec
    centre_m: float
    bundled: bool = False

    @property
    def most_mps(self) -> float:
        """Return the highest speed that may be ordered, m/s; unlimited for generated models, which are adapted to the
        orders.
        """
        return self.spec.max_speed_mps if self.bundled else math.inf

    @property
    def kind(self) -> ActorKind:
        """Return the class of the entity, such as `car`."""
        return self.spec.kind


@dataclass(frozen=True)
class Participants:
    """All imported entities by their names in the source, and the catalogue of models that are not bundled."""

    entities: Mapping[str, Entity]
    catalogue: Catalogue | None


def read_participants(source: Source, losses: Losses, *, name: str, ego: str = "") -> Participants:
    """Read the entities of a scenario; `name` is the name of the new catalogue.

    `ego`: the entity under test; by default the one with such a name, otherwise the first vehicle. `ExchangeError` if
    there is none, or an entity is incomplete.
    """
    objects: dict[str, Element] = {}
    for entity in source.root.iterfind("Entities/ScenarioObject"):
        element = _object(source, entity, losses)
        if element is not None:
            objects[entity.get("name", "")] = element
    chosen = _ego(objects, ego)
    if chosen is None:
        vehicles = ", ".join(_drivable(objects))
        there_are = f"; its vehicles are {vehicles}" if vehicles else ""
        missing = f"no vehicle '{ego}' that can be driven{there_are}" if ego else "no vehicle that can be driven"
        raise SourceError(f"{source.path} has {missing}")
    models: dict[str, VehicleModel] = {}
    entities: dict[str, Entity] = {}
    taken = {"ego"}
    for ref, element in objects.items():
        ours = "ego" if ref == chosen else distinct_name(ref, "actor", taken)
        taken.add(ours)
        model = _model(element, models, losses)
        bundled = model.name in bundled_models()
        entities[ref] = Entity(ref, ours, model.name, spec_of(model), _centre(element), bundled)
    doc = Doc(text=sentence(f"The participants of {source.path.name}."))
    return Participants(entities, Catalogue(name=name, body=(doc, *models.values())) if models else None)


def possible_egos(source: Source) -> list[str]:
    """Return the vehicles that may be the ego: the one with such a name, otherwise all vehicles in turn."""
    losses = Losses()
    objects = {e.get("name", ""): _object(source, e, losses) for e in source.root.iterfind("Entities/ScenarioObject")}
    elements = {ref: element for ref, element in objects.items() if element is not None}
    first = _ego(elements, "")
    if first is None or name_of(first, "x").removesuffix("_x") in _EGO_NAMES:
        return [first or ""]
    return _drivable(elements)


class Requirements(NamedTuple):
    """What a scenario requires of a model: speed, m/s, and the strongest acceleration and braking, m/s^2."""

    speed_mps: float
    rises_mps2: float = 0.0
    falls_mps2: float = 0.0


def strengthened(catalogue: Catalogue, requirements: Mapping[str, Requirements]) -> Catalogue:
    """Return a catalogue in which the models meet the requirements, which are given by the models' names."""
    body: list[Doc | VehicleModel] = []
    for item in catalogue.body:
        if not isinstance(item, VehicleModel) or item.name not in requirements:
            body.append(item)
            continue
        wanted, can, new = requirements[item.name], spec_of(item), dict[str, Quantity]()
        if wanted.speed_mps > can.max_speed_mps:
            new["max_speed"] = quantity(_rounded_up(wanted.speed_mps), "speed")
        for key, value, has in (
            ("acceleration", wanted.rises_mps2, can.acceleration_mps2),
            ("braking", wanted.falls_mps2, can.braking_mps2),
            ("emergency_braking", wanted.falls_mps2, can.emergency_braking_mps2),
        ):
            if value > has > 0:
                new[key] = quantity(_rounded_up(value), "acceleration")
        body.append(item.model_copy(update=new))
    return catalogue.model_copy(update={"body": tuple(body)})


def _rounded_up(value: float) -> float:
    return math.ceil(value * 10) / 10


def _object(source: Source, entity: Element, losses: Losses) -> Element | None:
    """Return the vehicle, pedestrian or thing of an entity, or None if its kind is not supported."""
    reference = entity.find("CatalogReference")
    element = source.entry(reference) if reference is not None else None
    if element is None:
        element = next((e for e in entity if e.tag in ("Vehicle", "Pedestrian", "MiscObject")), None)
    name = f"'{entity.get('name', '')}'"
    if element is None:
        losses.lose("entities defined elsewhere", name)
        return None
    if element.tag == "Vehicle" and element.get("vehicleCategory") not in _KINDS:
        losses.lose(f"entities: {element.get('vehicleCategory')}", name)
        return None
    return element


def _ego(objects: Mapping[str, Element], wanted: str) -> str | None:
    vehicles = _drivable(objects)
    if wanted:
        return wanted if wanted in vehicles else None
    named = [ref for ref in vehicles if name_of(ref, "x").removesuffix("_x") in _EGO_NAMES]
    return next(iter([*named, *vehicles]), None)


def _drivable(objects: Mapping[str, Element]) -> list[str]:
    """Return the vehicles that can be the ego."""
    return [ref for ref, e in objects.items() if e.tag == "Vehicle" and e.get("vehicleCategory") != "bicycle"]


def _centre(element: Element) -> float:
    centre = element.find("BoundingBox/Center")
    return number(centre, "x", 0.0) if centre is not None and element.tag == "Vehicle" else 0.0


def _model(element: Element, models: dict[str, VehicleModel], losses: Losses) -> VehicleModel:
    """Return the bundled model that equals an entity, or a new one (the same for equal entities)."""
    kind: ActorKind = "pedestrian" if element.tag == "Pedestrian" else "obstacle"
    if element.tag == "Vehicle":
        kind = _KINDS[element.get("vehicleCategory", "")]
    new_model = _new_model(element, kind, losses)
    bundled = bundled_models().get(_property(element, MODEL))
    if bundled is not None and _same(spec_of(bundled), spec_of(new_model)):
        return bundled
    for model in models.values():
        if model.model_copy(update={"name": new_model.name}) == new_model and model.name.startswith(f"{kind}."):
            return model
    variants = {model.name.partition(".")[2] for model in (*models.values(), *bundled_models().values())}
    variant = distinct_name(element.get("name", "").rpartition(".")[2], kind, variants)
    models[variant] = new_model.model_copy(update={"name": f"{kind}.{variant}"})
    return models[variant]


def _new_model(element: Element, kind: ActorKind, losses: Losses) -> VehicleModel:
    size = element.find("BoundingBox/Dimensions")
    if size is None:
        raise SourceError(f"the entity '{element.get('name')}' has no size")
    values: dict[str, Quantity] = {
        key: quantity(min(max(number(size, key), 0.05), _LARGEST_M), "length") for key in ("length", "width", "height")
    }
    defaults = CLASS_DEFAULTS[kind]
    if (mass := number(element, "mass", 0.0)) > 0:
        values["mass"] = quantity(mass, "mass")
    if kind in WHEELS:
        values |= _abilities(element, kind)
    if kind == "pedestrian":
        values |= {
            key: quantity(value, "speed" if key == "max_speed" else "acceleration")
            for key, name in WALKS.items()
            if (value := _float(_property(element, name))) is not None
        }
    if kind != "obstacle":
        usual = min(
            defaults.braking_mps2, values["emergency_braking"].si if "emergency_braking" in values else math.inf
        )
        values["braking"] = quantity(_float(_property(element, BRAKING)) or usual, "acceleration")
        if (cruise := _float(_property(element, CRUISE))) is not None:
            values["cruise_speed"] = quantity(cruise, "speed")
    name = {"name": f"{kind}.any"}
    plain = VehicleModel.model_validate(name | {k: v for k, v in values.items() if k not in _AXLES})
    whole = VehicleModel.model_validate(name | values)
    try:
        spec_of(whole)
    except CompileError:
        losses.left_out["axles that do not fit their box (usual ones are taken)"] += 1
        return plain
    return whole


_AXLES = ("wheelbase", "rear_overhang", "max_steer")


def _abilities(element: Element, kind: ActorKind) -> dict[str, Quantity]:
    """Return a vehicle's limits of speed and acceleration, and the places of its axles."""
    values: dict[str, Quantity] = {}
    power, axles, centre = element.find("Performance"), element.find("Axles"), element.find("BoundingBox/Center")
    defaults = CLASS_DEFAULTS[kind]
    if power is not None:
        for key, name, usual in (
            ("max_speed", "maxSpeed", defaults.max_speed_mps),
            ("acceleration", "maxAcceleration", defaults.acceleration_mps2),
            ("emergency_braking", "maxDeceleration", defaults.emergency_braking_mps2),
        ):
            value = number(power, name, usual)
            dimension: Dimension = "speed" if key == "max_speed" else "acceleration"
            values[key] = quantity(value if value > _WEAKEST else usual, dimension)
    front, rear = (axles.find(f"{end}Axle") for end in ("Front", "Rear")) if axles is not None else (None, None)
    if front is not None and rear is not None and centre is not None:
        size = cast("Element", element.find("BoundingBox/Dimensions"))
        rear_x = number(rear, "positionX", 0.0)
        values["wheelbase"] = quantity(number(front, "positionX") - rear_x, "length")
        values["rear_overhang"] = quantity(rear_x - number(centre, "x") + number(size, "length") / 2, "length")
        steer = number(front, "maxSteering", 0.0)
        if steer > 0:
            values["max_steer"] = quantity(min(steer, _WIDEST_STEER_RAD), "angle")
    if (rate := _float(_property(element, STEER_RATE))) is not None:
        values["steer_rate"] = quantity(rate, "angular_rate")
    return values


def _same(a: ModelSpec, b: ModelSpec) -> bool:
    return a.kind == b.kind and all(abs(getattr(a, key) - getattr(b, key)) < _SAME for key in _COMPARED)


def _property(element: Element, name: str) -> str:
    items = element.iterfind("Properties/Property")
    return next((item.get("value", "") for item in items if item.get("name") == name), "")


def _float(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0 < value < math.inf else None


@dataclass
class EntityState:
    """The state of an entity while its actions are read.

    Attributes:
        speed_mps: its speed, m/s; None if unknown.
        lane: its lane's id; None if its road is unknown. ahead: whether it faces in the road's direction. on_lanes:
            whether it follows lanes and can change them.
        way: the routing action that determines its way.
        profile: the speeds of its trajectory, which actions apply once the trajectory begins.
        most_mps: the highest speed ordered so far, m/s.
        rises_mps2, falls_mps2: the strongest acceleration and braking that the orders need, m/s^2.
    """

    entity: Entity
    speed_mps: float | None = None
    lane: int | None = None
    ahead: bool = True
    on_lanes: bool = False
    way: Element | None = None
    profile: SpeedProfile | None = None
    most_mps: float = 0.0
    rises_mps2: float = 0.0
    falls_mps2: float = 0.0

    def __post_init__(self) -> None:
        self.most_mps = max(self.most_mps, self.speed_mps or 0.0)

    def changes(self, was: float, to: float, over_s: float, *, within_limits: bool) -> None:
        """Record a change of speed that its model must be able to do; `within_limits`: braking is at most as strong as
        that of the file's vehicle."""
        rises, falls = (to - was) / over_s, (was - to) / over_s
        if within_limits:
            rises, falls = 0.0, min(falls, self.entity.spec.emergency_braking_mps2)
        self.rises_mps2, self.falls_mps2 = max(self.rises_mps2, rises), max(self.falls_mps2, falls)
