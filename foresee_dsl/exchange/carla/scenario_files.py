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
from foresee_dsl.exchange.carla.models import CATALOGUE, ego_of, mix_of, vehicles_of
from foresee_dsl.exchange.carla.staging import Case, common, declared, is_of_route, value_of
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
class ScenarioFile:
    """A scenario file to be.

    Attributes:
        name: of the file, without `.foresee`. network: the file that it uses. cases: what it holds.
        catalogue: of CARLA's models, or None for the bundled ones. sources: the files that the routes come from.
        town: as in `Town10HD`, or empty.
    """

    name: str
    network: str
    cases: tuple[Case, ...]
    catalogue: Catalogue | None
    sources: tuple[str, ...]
    town: str


def text_of(file: ScenarioFile) -> str:
    """Return a file's text, in the one layout."""
    document = parse(_rendered(file), f"{file.name}.foresee")
    return print_model(document.model, document.comments)


def misplaced(file: ScenarioFile, network: RoadNetwork, signals: Mapping[str, Signal]) -> bool:
    """Say whether the compiler finds something impossible in a file's first case on its network."""
    document = parse(text_of(file), f"{file.name}.foresee")
    if not isinstance(document.model, Scenario):
        return True
    scenario = concretise(document.model, file.cases[0].name, document=document)
    models = bundled_models()
    if file.catalogue is not None:
        models |= {item.name: item for item in file.catalogue.body if isinstance(item, VehicleModel)}
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
    names = dict.fromkeys(name for one in file.cases for name in one.values)
    if all(one.values["beside"] == _NO_LENGTH for one in file.cases):  # in most files every start is on its lane
        del names["beside"]
    defaults = {name: common(file.cases, name) for name in names}
    family = f"scenario{case.family}" if case.family else "routes"
    title = f"CARLA, {_TITLES[case.variant or case.family]}"
    shape = {"": family, "crossing": "scenario3"}.get(case.variant, case.variant)
    return (
        _environment()
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
            rows=[{"name": one.name, "assignments": _assigned(one, defaults)} for one in file.cases],
        )
    )


def _assigned(case: Case, defaults: Mapping[str, str]) -> list[str]:
    """What a case says: the values that are not the defaults."""
    values = {name: value_of(case, name) for name in defaults}
    return [f"{name} = {value}" for name, value in values.items() if value != defaults[name]]


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
