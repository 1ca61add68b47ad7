"""CARLA's blueprints, which come as SUMO vTypes, as a catalogue of models."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

from foresee_dsl.exchange.naming import distinct_name
from foresee_dsl.language.model import Catalogue, Doc, Quantity, VehicleModel

CATALOGUE = "carla_models.foresee"
"""The catalogue's file."""
_SUMO_CLASSES = {
    "car": ("passenger", "evehicle", "taxi", "authority", "private"),
    "van": ("emergency", "delivery"),
    "truck": ("truck", "trailer"),
    "bus": ("bus", "coach"),
    "motorcycle": ("motorcycle", "moped"),
    "bicycle": ("bicycle",),
    "pedestrian": ("pedestrian",),
}
_CLASSES = {sumo: ours for ours, classes in _SUMO_CLASSES.items() for sumo in classes}
"""Our class for each of SUMO's vehicle classes."""
_EGO = ("car.lincoln_mkz2017", "car.lincoln_mkz", "car.tesla_model3", "car.sedan")
"""Model of the ego, the first that there is: CARLA's leaderboard drives a Lincoln MKZ (route_scenario.py)."""
_MIXED = (
    *("car.compact", "car.sedan", "car.suv", "van.delivery", "truck.light", "bus.midi"),
    *("motorcycle.street", "motorcycle.scooter", "bicycle.city", "bicycle.racing"),
)
"""Background traffic of all kinds."""


def catalogue_of(types: Sequence[Mapping[str, str]], left_out: Counter[str]) -> Catalogue:
    """Return a catalogue of vehicle types; everything but size and class is the class's default.

    Args:
        types: attributes of vTypes. left_out: gets those that cannot be taken over, with counts.
    """
    models: dict[str, VehicleModel] = {}
    for type_ in types:
        group = _CLASSES.get(type_.get("vClass", "passenger"))
        sizes = {key: _size(type_.get(key, "")) for key in ("length", "width", "height")}
        if group is None or sizes["length"] is None or sizes["width"] is None:
            left_out["blueprints of another class, or without a size"] += 1
            continue
        variant = type_.get("id", "").removeprefix("vehicle.").replace(".", "_")
        known = {name.partition(".")[2] for name in models if name.startswith(f"{group}.")}
        name = f"{group}.{distinct_name(variant, 'model', known)}"
        models[name] = VehicleModel(
            name=name,
            length=sizes["length"],
            width=sizes["width"],
            height=sizes["height"],
            source=f"CARLA's blueprint {type_.get('id', '')}: its size; the rest is the class's default",
        )
    doc = Doc(text="CARLA's vehicles: sizes of their bounding boxes.")
    return Catalogue(name="carla", body=(doc, *models.values()))


def vehicles_of(catalogue: Catalogue) -> tuple[str, ...]:
    """Return the names of a catalogue's models."""
    return tuple(item.name for item in catalogue.body if isinstance(item, VehicleModel))


def ego_of(models: Mapping[str, VehicleModel] | Sequence[str]) -> str:
    """Return the model that the ego drives, of those that there are."""
    return next(name for name in _EGO if name in models or name == _EGO[-1])


def mix_of(catalogue: Catalogue | None) -> tuple[str, ...]:
    """Return the models of background traffic: the catalogue's where there is one, else bundled ones of all kinds."""
    own = [name for name in vehicles_of(catalogue) if not name.startswith("pedestrian")] if catalogue else []
    classes = {name.partition(".")[0] for name in own}
    return (*own, *(name for name in _MIXED if name.partition(".")[0] not in classes))


def _size(text: str) -> Quantity | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return Quantity.of(value, "length", 2) if math.isfinite(value) and 0.1 < value < 40 else None
