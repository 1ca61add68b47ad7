"""The entities of a foreign scenario: their names as actors, and their models, of the catalogue or new ones."""

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
from foresee_dsl.exchange.naming import distinct_name, name_of, number, quantity, sentence
from foresee_dsl.exchange.openscenario.reading.losses import Losses
from foresee_dsl.exchange.openscenario.reading.source import Source
from foresee_dsl.exchange.openscenario.writing.participants import BRAKING, CATEGORIES, CRUISE, MODEL, STEER_RATE, WALKS
from foresee_dsl.exchange.outcome import SourceError
from foresee_dsl.language.model import Catalogue, Doc, Quantity, VehicleModel
from foresee_dsl.language.project.loading import bundled_models
from foresee_dsl.language.units import Dimension

_KINDS = {category: kind for kind, category in CATEGORIES.items()}
_EGO_NAMES = ("ego", "hero", "ego_vehicle", "egovehicle", "host", "subject", "sut")
_SAME = 1e-4
"""Sizes that differ by less are the same: below what is written (ours)."""
_LARGEST_M = 100.0
"""The language has nothing larger; a larger thing is that large."""
_WEAKEST = 0.01
"""A speed, or acceleration, that is less is none (ours)."""
_WIDEST_STEER_RAD = math.radians(79)
"""Wheels of our models turn less than 80 degrees."""
_COMPARED = ("length_m", "width_m", "height_m", "wheelbase_m", "front_overhang_m", "max_speed_mps", "acceleration_mps2",
             "emergency_braking_mps2", "max_steer_rad")  # fmt: skip


@dataclass(frozen=True)
class Entity:
    """One entity.

    Attributes:
        ref: its name there. name: its name here, `ego` for the vehicle under test. model: `class.variant`.
        centre_m: from its reference point forward to the middle of its box. bundled: its model is one of ours.
    """

    ref: str
    name: str
    model: str
    spec: ModelSpec
    centre_m: float
    bundled: bool = False

    @property
    def most_mps(self) -> float:
        """The most that it may be told to drive: models that are made for a scenario can what it asks of them."""
        return self.spec.max_speed_mps if self.bundled else math.inf

    @property
    def kind(self) -> ActorKind:
        """Its class."""
        return self.spec.kind


@dataclass(frozen=True)
class Participants:
    """All entities that were taken over, by their names there, and the catalogue of what is not bundled."""

    entities: Mapping[str, Entity]
    catalogue: Catalogue | None


def read_participants(source: Source, losses: Losses, *, name: str, ego: str = "") -> Participants:
    """Read the entities of a scenario; `name` is that of the new catalogue.

    `ego`: the entity under test; by default the one that is called so, else the first vehicle. An `ExchangeError` where
    there is none, or an entity is incomplete.
    """
    objects: dict[str, Element] = {}
    for entity in source.root.iterfind("Entities/ScenarioObject"):
        found = _object(source, entity, losses)
        if found is not None:
            objects[entity.get("name", "")] = found
    chosen = _ego(objects, ego)
    if chosen is None:
        missing = f"no vehicle '{ego}'" if ego else "no vehicle that could be driven"
        raise SourceError(f"{source.path} has {missing}")
    models: dict[str, VehicleModel] = {}
    entities: dict[str, Entity] = {}
    taken = {"ego"}
    for ref, found in objects.items():
        ours = "ego" if ref == chosen else distinct_name(ref, "actor", taken)
        taken.add(ours)
        model = _model(found, models, losses)
        bundled = model.name in bundled_models()
        entities[ref] = Entity(ref, ours, model.name, spec_of(model), _centre(found), bundled)
    doc = Doc(text=sentence(f"What takes part in {source.path.name}."))
    return Participants(entities, Catalogue(name=name, body=(doc, *models.values())) if models else None)


def possible_egos(source: Source) -> list[str]:
    """Return who may be the ego: the vehicle that is called so; if there is none, all vehicles in turn."""
    losses = Losses()
    objects = {e.get("name", ""): _object(source, e, losses) for e in source.root.iterfind("Entities/ScenarioObject")}
    found = {ref: element for ref, element in objects.items() if element is not None}
    first = _ego(found, "")
    if first is None or name_of(first, "x").removesuffix("_x") in _EGO_NAMES:
        return [first or ""]
    return [ref for ref, e in found.items() if e.tag == "Vehicle" and e.get("vehicleCategory") != "bicycle"]


class Asked(NamedTuple):
    """What a scenario asks of a model: the highest speed, m/s, and the hardest it is to speed up and brake, m/s^2."""

    speed_mps: float
    rises_mps2: float = 0.0
    falls_mps2: float = 0.0


def made_stronger(catalogue: Catalogue, asked: Mapping[str, Asked]) -> Catalogue:
    """Return a catalogue in which models can do what is asked of them, by the models' names."""
    body: list[Doc | VehicleModel] = []
    for item in catalogue.body:
        if not isinstance(item, VehicleModel) or item.name not in asked:
            body.append(item)
            continue
        wanted, can, new = asked[item.name], spec_of(item), dict[str, Quantity]()
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
    """Return the vehicle, pedestrian or thing of an entity, or None where it is of a kind that we do not have."""
    reference = entity.find("CatalogReference")
    found = source.entry(reference) if reference is not None else None
    if found is None:
        found = next((e for e in entity if e.tag in ("Vehicle", "Pedestrian", "MiscObject")), None)
    name = f"'{entity.get('name', '')}'"
    if found is None:
        losses.lose("entities defined elsewhere", name)
        return None
    if found.tag == "Vehicle" and found.get("vehicleCategory") not in _KINDS:
        losses.lose(f"entities: {found.get('vehicleCategory')}", name)
        return None
    return found


def _ego(objects: Mapping[str, Element], wanted: str) -> str | None:
    vehicles = [ref for ref, e in objects.items() if e.tag == "Vehicle" and e.get("vehicleCategory") != "bicycle"]
    if wanted:
        return wanted if wanted in vehicles else None
    named = [ref for ref in vehicles if name_of(ref, "x").removesuffix("_x") in _EGO_NAMES]
    return next(iter([*named, *vehicles]), None)


def _centre(found: Element) -> float:
    centre = found.find("BoundingBox/Center")
    return number(centre, "x", 0.0) if centre is not None and found.tag == "Vehicle" else 0.0


def _model(found: Element, models: dict[str, VehicleModel], losses: Losses) -> VehicleModel:
    """Return the bundled model that an entity is, or one made for it (the same for equal ones)."""
    kind: ActorKind = "pedestrian" if found.tag == "Pedestrian" else "obstacle"
    if found.tag == "Vehicle":
        kind = _KINDS[found.get("vehicleCategory", "")]
    made = _made(found, kind, losses)
    bundled = bundled_models().get(_property(found, MODEL))
    if bundled is not None and _same(spec_of(bundled), spec_of(made)):
        return bundled
    for model in models.values():
        if model.model_copy(update={"name": made.name}) == made and model.name.startswith(f"{kind}."):
            return model
    variants = {model.name.partition(".")[2] for model in (*models.values(), *bundled_models().values())}
    variant = distinct_name(found.get("name", "").rpartition(".")[2], kind, variants)
    models[variant] = made.model_copy(update={"name": f"{kind}.{variant}"})
    return models[variant]


def _made(found: Element, kind: ActorKind, losses: Losses) -> VehicleModel:
    size = found.find("BoundingBox/Dimensions")
    if size is None:
        raise SourceError(f"the entity '{found.get('name')}' has no size")
    values: dict[str, Quantity] = {
        key: quantity(min(max(number(size, key), 0.05), _LARGEST_M), "length") for key in ("length", "width", "height")
    }
    defaults = CLASS_DEFAULTS[kind]
    if (mass := number(found, "mass", 0.0)) > 0:
        values["mass"] = quantity(mass, "mass")
    if kind in WHEELS:
        values |= _abilities(found, kind)
    if kind == "pedestrian":
        values |= {
            key: quantity(value, "speed" if key == "max_speed" else "acceleration")
            for key, name in WALKS.items()
            if (value := _float(_property(found, name))) is not None
        }
    if kind != "obstacle":
        usual = min(
            defaults.braking_mps2, values["emergency_braking"].si if "emergency_braking" in values else math.inf
        )
        values["braking"] = quantity(_float(_property(found, BRAKING)) or usual, "acceleration")
        if (cruise := _float(_property(found, CRUISE))) is not None:
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


def _abilities(found: Element, kind: ActorKind) -> dict[str, Quantity]:
    """Return what a vehicle can, and where its axles are."""
    values: dict[str, Quantity] = {}
    power, axles, centre = found.find("Performance"), found.find("Axles"), found.find("BoundingBox/Center")
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
        size = cast("Element", found.find("BoundingBox/Dimensions"))
        rear_x = number(rear, "positionX", 0.0)
        values["wheelbase"] = quantity(number(front, "positionX") - rear_x, "length")
        values["rear_overhang"] = quantity(rear_x - number(centre, "x") + number(size, "length") / 2, "length")
        steer = number(front, "maxSteering", 0.0)
        if steer > 0:
            values["max_steer"] = quantity(min(steer, _WIDEST_STEER_RAD), "angle")
    if (rate := _float(_property(found, STEER_RATE))) is not None:
        values["steer_rate"] = quantity(rate, "angular_rate")
    return values


def _same(a: ModelSpec, b: ModelSpec) -> bool:
    return a.kind == b.kind and all(abs(getattr(a, key) - getattr(b, key)) < _SAME for key in _COMPARED)


def _property(found: Element, name: str) -> str:
    items = found.iterfind("Properties/Property")
    return next((item.get("value", "") for item in items if item.get("name") == name), "")


def _float(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0 < value < math.inf else None
