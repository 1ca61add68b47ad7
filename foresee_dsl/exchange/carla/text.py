"""Writes the cases of a family as a scenario file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.placement.scene import SceneBuilder
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.exchange.carla.families import Row, common, is_of_route, param, value_of
from foresee_dsl.exchange.carla.models import CATALOGUE, ego_of, mix_of, vehicles_of
from foresee_dsl.exchange.naming import name_of, sentence
from foresee_dsl.files import data_folder
from foresee_dsl.language.model import Catalogue, Scenario, VehicleModel
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.concretise import concretise
from foresee_dsl.language.project.document import PlacementError, TestCase
from foresee_dsl.language.project.loading import bundled_models

if TYPE_CHECKING:
    from jinja2 import Environment

_NO_LENGTH = "0.00 m"
_TITLES = {
    "open": "routes through traffic",
    "crossing": "where there is no room behind a turn: somebody crosses in front of the ego",
    "walker": "a junction where nobody's way conflicts with the ego's: somebody walks over the road behind it",
    "3": "family 3: somebody crosses in front of the ego where there is no crossing",
    "4": "family 4: an obstacle and a cyclist behind a turn",
    "7": "family 7: another vehicle runs the red light",
    "8": "family 8: the ego turns left through oncoming traffic",
    "9": "family 9: the ego turns right, and crossing traffic comes to the same road",
}


@dataclass(frozen=True)
class FileOfCases:
    """A scenario file to be.

    Attributes:
        name: of the file, without `.foresee`. network: the file that it uses. rows: its cases.
        catalogue: of CARLA's models, or None for the bundled ones. sources: the files that the routes come from.
    """

    name: str
    network: str
    rows: tuple[Row, ...]
    catalogue: Catalogue | None
    sources: tuple[str, ...]
    town: str


def text_of(file: FileOfCases) -> str:
    """Return a file's text, in the one layout."""
    defaults = {name: common(file.rows, name) for name in _names(file.rows)}
    document = parse(_rendered(file, defaults), f"{file.name}.foresee")
    return print_model(document.model, document.comments)


def _names(rows: tuple[Row, ...]) -> list[str]:
    """The parameters that the cases need: in most files nobody starts beside its lane."""
    names = dict.fromkeys(name for row in rows for name in row.values)
    if all(row.values["beside"] == _NO_LENGTH for row in rows):
        del names["beside"]
    return list(names)


def _rendered(file: FileOfCases, defaults: Mapping[str, str]) -> str:
    row, town = file.rows[0], file.town or "town"
    family = f"scenario{row.family}" if row.family else "routes"
    title = f"CARLA, {_TITLES[row.variant or row.family]}"
    declared = {name: _declared(name, default) for name, default in defaults.items()}
    shape = {"": family, "crossing": "scenario3"}.get(row.variant, row.variant)
    template = _environment().get_template(f"{shape}.foresee.j2")
    return template.render(
        title=f"{town[:1].upper()}{town[1:]} of {title}.",
        source=sentence(", ".join(sorted(set(file.sources))[:3])) or "CARLA's files",
        name=name_of(f"{town.lower()}_{file.name}", "carla"),
        tags=[family, "carla", name_of(town.lower(), "town")],
        network=file.network,
        models_file=CATALOGUE if file.catalogue else "",
        route_params=[text for name, text in declared.items() if is_of_route(name)],
        family_params=[text for name, text in declared.items() if not is_of_route(name)],
        ego_model=ego_of(vehicles_of(file.catalogue) if file.catalogue else ()),
        through=[name for name in defaults if name.startswith("through")],
        beside="beside" in defaults,
        signal=row.signal,
        bridge=row.bridge,
        walkers=row.walkers,
        vehicles=mix_of(file.catalogue),
        rows=[{"name": one.name, "assignments": _assigned(one, defaults)} for one in file.rows],
    )


def _assigned(row: Row, defaults: Mapping[str, str]) -> list[str]:
    """What a case says: the values that are not the defaults."""
    values = {name: value_of(row, name) for name in defaults}
    return [f"{name} = {value}" for name, value in values.items() if value != defaults[name]]


def placed_wrongly(file: FileOfCases, network: RoadNetwork, signals: Mapping[str, Signal]) -> bool:
    """Say whether the compiler finds something impossible in a file's first case on its network."""
    document = parse(text_of(file), f"{file.name}.foresee")
    if not isinstance(document.model, Scenario):
        return True
    scenario = concretise(document.model, file.rows[0].name, document=document)
    models = bundled_models()
    if file.catalogue is not None:
        models |= {item.name: item for item in file.catalogue.body if isinstance(item, VehicleModel)}
    return _misfits(scenario, models, network, signals)


def _misfits(
    scenario: Scenario, models: Mapping[str, VehicleModel], network: RoadNetwork, signals: Mapping[str, Signal]
) -> bool:
    case = TestCase(
        id=scenario.name, scenario=scenario, network=Path("map"), models=models, meaning="", source=Path("import")
    )
    specs = {name: spec_of(model) for name, model in models.items()}
    try:
        SceneBuilder(case, network, specs, signals).place()
    except PlacementError:
        return True
    return False


def _declared(name: str, default: str) -> str:
    kind = param(name)
    return f"param {name}: {kind.type} = {default}" + (f" in {kind.within}" if kind.within else "")


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # only where something is imported

    return Environment(
        loader=FileSystemLoader(data_folder("templates") / "carla"),
        undefined=StrictUndefined,
        autoescape=False,  # noqa: S701 - plain text, which is parsed before it is written
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
