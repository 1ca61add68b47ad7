"""Scenario files with the cases of a family, and CARLA's blueprints as a catalogue of models."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.placement.scene import SceneBuilder
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.templates import environment
from foresee_dsl.language.document import PlacementError, TestCase
from foresee_dsl.language.model import Catalogue, Doc, Quantity, Scenario, VehicleModel
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.concretise import concretise
from foresee_dsl.language.project.loading import bundled_models
from foresee_exchange.carla.staging import Case, common, declared, is_of_route, value_of
from foresee_exchange.naming import distinct_name, name_of, sentence

_TEMPLATES = Path(__file__).parents[1] / "templates"
CATALOGUE = "carla_models.foresee"
"""Name of the catalogue's file."""
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
"""The class of our models for each vehicle class of SUMO."""
_EGO = ("car.lincoln_mkz2017", "car.lincoln_mkz", "car.tesla_model3", "car.sedan")
"""Models of the ego by preference: CARLA's leaderboard uses a Lincoln MKZ (route_scenario.py)."""
_MIXED = (
    *("car.compact", "car.sedan", "car.suv", "van.delivery", "truck.light", "bus.midi"),
    *("motorcycle.street", "motorcycle.scooter", "bicycle.city", "bicycle.racing"),
)
"""Models of background traffic, of all kinds."""


def catalogue_of(types: Sequence[Mapping[str, str]], left_out: Counter[str]) -> Catalogue:
    """Return a catalogue of models for SUMO's vehicle types: their sizes and classes come from the types, all other
    values are the defaults of the class."""
    models: dict[str, VehicleModel] = {}
    for type_ in types:
        group = _CLASSES.get(type_.get("vClass", "passenger"))
        sizes = {key: _size(type_.get(key, "")) for key in ("length", "width", "height")}
        if group is None or sizes["length"] is None or sizes["width"] is None:
            left_out["blueprints of another class, or without a size"] += 1
            continue
        variant = type_.get("id", "").removeprefix("vehicle.").replace(".", "_")
        variants = {name.partition(".")[2] for name in models if name.startswith(f"{group}.")}
        name = f"{group}.{distinct_name(variant, 'model', variants)}"
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


def models_with(catalogue: Catalogue | None) -> dict[str, VehicleModel]:
    """Return the bundled models and those of a catalogue, by name."""
    own = catalogue.body if catalogue is not None else ()
    return dict(bundled_models()) | {item.name: item for item in own if isinstance(item, VehicleModel)}


def ego_of(models: Mapping[str, VehicleModel] | Sequence[str]) -> str:
    """Return the ego's model: the first of `_EGO` that is available."""
    return next(name for name in _EGO if name in models or name == _EGO[-1])


def mix_of(catalogue: Catalogue | None) -> tuple[str, ...]:
    """Return the models of background traffic: the catalogue's, and bundled ones for the missing classes."""
    own = [name for name in vehicles_of(catalogue) if not name.startswith("pedestrian")] if catalogue else []
    classes = {name.partition(".")[0] for name in own}
    return (*own, *(name for name in _MIXED if name.partition(".")[0] not in classes))


def _size(text: str) -> Quantity | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return Quantity.of(value, "length", 2) if math.isfinite(value) and 0.1 < value < 40 else None


_NO_LENGTH = "0.00 m"
_TITLES = {
    "open": "routes through traffic",
    "crossing": "no room behind a turn: a pedestrian crosses in front of the ego",
    "walker": "a junction without conflicting traffic: a pedestrian crosses the road behind it",
    "3": "family 3: a pedestrian crosses in front of the ego away from a crossing",
    "4": "family 4: an obstacle and a cyclist behind a turn",
    "7": "family 7: another vehicle runs the red light",
    "8": "family 8: the ego turns left through oncoming traffic",
    "9": "family 9: the ego turns right, and crossing traffic comes to the same road",
}


@dataclass(frozen=True)
class ScenarioFile:
    """A scenario file before it is written.

    Attributes:
        name: its name without `.foresee`. network: the network file that it uses. cases: its cases.
        catalogue: CARLA's models, or None for the bundled ones. sources: the route files.
        town: such as `Town10HD`, or empty.
    """

    name: str
    network: str
    cases: tuple[Case, ...]
    catalogue: Catalogue | None
    sources: tuple[str, ...]
    town: str


def text_of(file: ScenarioFile) -> str:
    """Return a file's text in the standard layout."""
    document = parse(_rendered(file), f"{file.name}.foresee")
    return print_model(document.model, document.comments)


def misplaced(file: ScenarioFile, network: RoadNetwork, signals: Mapping[str, Signal]) -> bool:
    """Return whether the compiler cannot place the actors of a file's first case on its network."""
    document = parse(_rendered(file), f"{file.name}.foresee")
    if not isinstance(document.model, Scenario):
        return True
    scenario = concretise(document.model, file.cases[0].name, document=document)
    models = models_with(file.catalogue)
    case = TestCase(
        id=scenario.name, scenario=scenario, network=Path("map"), models=models, meaning="", source=Path("import")
    )
    try:
        SceneBuilder(case, network, {name: spec_of(model) for name, model in models.items()}, signals).place()
    except PlacementError:
        return True
    return False


def _rendered(file: ScenarioFile) -> str:
    case, town = file.cases[0], file.town or "town"
    names = dict.fromkeys(name for file_case in file.cases for name in file_case.values)
    if all(
        file_case.values["beside"] == _NO_LENGTH for file_case in file.cases
    ):  # in most files every start is in the middle of its lane
        del names["beside"]
    defaults = {name: common(file.cases, name) for name in names}
    family = f"scenario{case.family}" if case.family else "routes"
    title = f"CARLA, {_TITLES[case.variant or case.family]}"
    shape = {"": family, "crossing": "scenario3"}.get(case.variant, case.variant)
    return (
        environment(str(_TEMPLATES), xml=False)
        .get_template(f"{shape}.foresee.j2")
        .render(
            title=f"{town[:1].upper()}{town[1:]} of {title}.",
            source=sentence(", ".join(sorted(set(file.sources))[:3])) or "CARLA's files",
            name=name_of(f"{town.lower()}_{file.name}", "carla"),
            tags=[family, "carla", name_of(town.lower(), "town")],
            network=file.network,
            models_file=CATALOGUE if file.catalogue else "",
            route_params=[declared(name, default) for name, default in defaults.items() if is_of_route(name)],
            family_params=[declared(name, default) for name, default in defaults.items() if not is_of_route(name)],
            ego_model=ego_of(vehicles_of(file.catalogue) if file.catalogue else ()),
            through=[name for name in defaults if name.startswith("through")],
            beside="beside" in defaults,
            signal=case.signal,
            bridge=case.bridge,
            walkers=case.walkers,
            vehicles=mix_of(file.catalogue),
            rows=[{"name": file_case.name, "assignments": _assigned(file_case, defaults)} for file_case in file.cases],
        )
    )


def _assigned(case: Case, defaults: Mapping[str, str]) -> list[str]:
    """Return the assignments of a case: the values that differ from the defaults."""
    values = {name: value_of(case, name) for name in defaults}
    return [f"{name} = {value}" for name, value in values.items() if value != defaults[name]]
