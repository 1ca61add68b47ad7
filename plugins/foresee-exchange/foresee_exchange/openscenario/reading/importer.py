"""Import of an OpenSCENARIO XML file: the common subset becomes a scenario; the rest is reported."""

from __future__ import annotations

import dataclasses
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from pathlib import Path

from foresee_dsl.compile import placement_mistakes
from foresee_dsl.compile.foreign.networks import SUFFIXES
from foresee_dsl.errors import Diagnostic
from foresee_dsl.exchange.outcome import ExchangeError, Imported, import_together, write_text
from foresee_dsl.language import model as m
from foresee_dsl.language.project.loading import load_test_cases
from foresee_exchange.naming import name_of
from foresee_exchange.openscenario.losses import Coordinates, Losses, SourceError
from foresee_exchange.openscenario.reading.entities import (
    Requirements,
    possible_egos,
    read_participants,
    strengthened,
)
from foresee_exchange.openscenario.reading.scenario_reader import NowhereError, ScenarioReader
from foresee_exchange.openscenario.reading.source import Source, declared_names, network_file, read_source
from foresee_exchange.openscenario.reading.variations.distributions import (
    MOST_SETS,
    Values,
    Variation,
    read_variation,
)
from foresee_exchange.openscenario.reading.variations.merging import Part, merged, shape_of


def run(
    file: Path,
    *,
    out: Path,
    ego: str = "",
    road: Path | None = None,
    coordinates: Coordinates = Coordinates.auto,
    partial: bool = False,
    allow_outside: bool = False,
) -> Imported:
    """Write the scenario `NAME.foresee`, its network, and the catalogue `NAME_models.foresee` if it is needed.

    Args:
        file: the `.xosc` file. out: the folder.
        ego: the entity under test; by default the one with such a name, otherwise the first vehicle.
        road: the network (`.xodr`, `.net.xml`), or a folder in which the named network and missing catalogues are
            searched; by default the network that the file names.
        coordinates: handedness of world positions.
        partial: also write a scenario that lacks actions, triggers or participants, with comments.
        allow_outside: the file may name files outside its project folder.

    Raises:
        ExchangeError: the file cannot be read, has no network or vehicle, lacks a catalogue, or a part would be lost.
        InputError: the resulting scenario is impossible; no file is written.
    """
    settings = _Settings(out, ego, road, coordinates, partial, allow_outside)
    variation = read_variation(file, allow_outside=allow_outside)
    if variation is not None:
        return _import_variation(variation, settings)
    reading = _read_playable(file, settings)
    kinds = Counter(actor.kind for actor in reading.scenario.actors)
    taken = {f"of the kind {kind}": count for kind, count in sorted(kinds.items())}
    losses = reading.losses

    def write(folder: Path) -> Imported:
        _write(reading, folder)
        return Imported((), 1, taken, +losses.left_out, tuple(losses.notes), +losses.lost)

    return import_together(out, write)


@dataclasses.dataclass(frozen=True)
class _Settings:
    """The options of an import; see `run`."""

    out: Path
    ego: str
    road: Path | None
    coordinates: Coordinates
    partial: bool
    allow_outside: bool


@dataclasses.dataclass(frozen=True)
class _Reading:
    """The result of reading a file with one set of parameter values: the scenario, its comments, its other files.

    Attributes:
        catalogue: the new models. requirements: what the scenario requires of each new model, by the model's name.
    """

    scenario: m.Scenario
    remarks: Mapping[int, Sequence[str]]
    catalogue: m.Catalogue | None
    requirements: Mapping[str, Requirements]
    losses: Losses
    network_path: Path
    network_name: str
    values: Values = dataclasses.field(default_factory=dict)

    @property
    def kind(self) -> tuple[str, str, str]:
        """Key that readings share if they differ only in their values."""
        return str(self.network_path), shape_of(self.scenario), repr(self.catalogue)


def _read_playable(file: Path, settings: _Settings, values: Values | None = None, name: str = "") -> _Reading:
    """Read a file with some values of its parameters, and check that all actors can be placed; with `partial`, a file
    without variations is read without actors that overlap others.

    Raises:
        ExchangeError: it cannot be read or played on its network, or a part would be lost.
    """
    source = read_source(file, allow_outside=settings.allow_outside, assigned=values)
    source.elsewhere = settings.road if settings.road is not None and settings.road.is_dir() else None
    name = name or name_of(file.name.partition(".")[0], "scenario")
    without: set[str] = set()
    while True:
        reading = _read(source, settings, name, without)
        if reading.losses.lost and not settings.partial:
            raise _LostError(_refusal(file, reading.losses))
        try:
            with tempfile.TemporaryDirectory(prefix="foresee-import-") as folder:
                return dataclasses.replace(_with_places(reading, file, Path(folder)), values=values or {})
        except _OnTopError as err:
            if not settings.partial or values is not None or not err.names - without - {"ego"}:
                raise
            without |= err.names - {"ego"}


def _read(source: Source, settings: _Settings, name: str, without: Set[str]) -> _Reading:
    """Read a file, but leave out the actors that overlap others; `without` has their new names."""
    network_path = network_file(source, settings.road, SUFFIXES)
    suffix = next(suffix for suffix in SUFFIXES if network_path.name.endswith(suffix))
    network_name = name_of(network_path.name.partition(".")[0], "map") + suffix
    nowhere: ExchangeError | None = None
    egos = [settings.ego] if settings.ego else possible_egos(source)
    for chosen in egos:
        losses = Losses()
        try:
            participants = read_participants(source, losses, name=f"{name}_models", ego=chosen)
            work = ScenarioReader(source, participants, network_path, losses, settings.coordinates, without)
            scenario, remarks = work.scenario(name, network_name)
            break
        except NowhereError as err:
            nowhere = err
    else:
        raise nowhere or ExchangeError(f"{source.path} has no ego")
    if len(egos) > 1:
        losses.note(f"the ego is '{chosen}': no vehicle has a name such as Ego or Hero; --ego NAME chooses another one")
    requirements = work.requirements_of_models(scenario)
    return _Reading(scenario, remarks, work.catalogue, requirements, losses, network_path, network_name)


def _with_places(reading: _Reading, file: Path, folder: Path) -> _Reading:
    """Return a reading whose actors can be placed, checked by writing it to an empty folder; a goal beside the ego's
    way is dropped."""
    mistakes = _write(reading, folder)
    if mistakes and all(mistake.code == _GOAL for mistake in mistakes):
        reading.losses.left_out["goals beside the ego's way (it goes to its end)"] += 1
        reading = dataclasses.replace(reading, scenario=_without_goal(reading.scenario))
        mistakes = _write(reading, folder)
    if mistakes:
        messages = "; ".join(dict.fromkeys(f"{d.message}{f' ({d.help})' if d.help else ''}" for d in mistakes))
        refusal = f"{file} cannot be played on its network: {messages}".replace(f"{folder}{os.sep}", "")
        if all(mistake.code == _ON_TOP for mistake in mistakes):
            raise _OnTopError(refusal, {name for mistake in mistakes for name in mistake.names})
        raise ExchangeError(refusal)
    return reading


def _write(reading: _Reading, folder: Path) -> tuple[Diagnostic, ...]:
    """Write the files of a reading; return the errors of placing its test cases."""
    name = reading.scenario.name
    if not (folder / reading.network_name).exists():
        shutil.copyfile(reading.network_path, folder / reading.network_name)
    if reading.catalogue is not None:
        write_text(folder / f"{name}_models.foresee", strengthened(reading.catalogue, reading.requirements))
    write_text(folder / f"{name}.foresee", reading.scenario, reading.remarks)
    return placement_mistakes(load_test_cases([folder / f"{name}.foresee"]))


_MOST_SETS = 200
"""Maximum number of value sets that are read. Ours: half a minute of computing."""


def _import_variation(variation: Variation, settings: _Settings) -> Imported:
    """Import a scenario with each set of values of a variation: one file with parameters and cases per kind of
    resulting scenario."""
    name = name_of(variation.path.name.partition(".")[0], "scenario")
    sets = variation.sets(_MOST_SETS)
    groups: dict[tuple[str, str, str], list[_Reading]] = {}
    faults: dict[str, ExchangeError] = {}
    total = Losses()
    for values in sets:
        try:
            reading = _read_playable(variation.scenario, settings, values, name)
        except _LostError:
            raise
        except ExchangeError as err:
            faults.setdefault(str(err), err)
            total.lost[f"sets of parameter values: {err}"] += 1
        else:
            groups.setdefault(reading.kind, []).append(reading)
    if not groups:
        raise next(iter(faults.values()))
    if total.lost and not settings.partial:
        raise ExchangeError(_refusal(variation.path, total))
    if variation.count > len(sets):
        total.left_out["sets of parameter values (an even choice is written)"] += variation.count - len(sets)
    for unknown in sorted(set().union(*sets) - declared_names(variation.scenario)):
        total.left_out[f"values of '{unknown}', which the scenario does not declare"] += 1
    joined = [
        _joined(name if len(groups) == 1 else f"{name}_{k + 1:02d}", group, variation, whole=len(groups) == 1)
        for k, group in enumerate(groups.values())
    ]
    for reading_losses in (reading.losses for group in groups.values() for reading in group):
        total.notes |= reading_losses.notes
        total.lost |= reading_losses.lost  # the union of counters has the maximum over the sets of values
        total.left_out |= reading_losses.left_out

    def write(folder: Path) -> Imported:
        for reading in joined:
            mistakes = _write(reading, folder)
            if mistakes:
                raise ExchangeError(f"{variation.path} cannot be played on its network: {mistakes[0].message}")
        cases = len(load_test_cases([folder / f"{reading.scenario.name}.foresee" for reading in joined]))
        taken = {"sets of parameter values": sum(map(len, groups.values()))}
        return Imported((), cases, taken, +total.left_out, tuple(total.notes), +total.lost)

    return import_together(settings.out, write)


def _joined(name: str, group: Sequence[_Reading], variation: Variation, *, whole: bool) -> _Reading:
    """Return readings of one kind as one, with parameters and cases; `whole`: whether these are all readings of the
    variation."""
    first = group[0]
    same = {
        key: value for key, value in first.values.items() if all(reading.values.get(key) == value for reading in group)
    }
    doc = ", ".join([variation.description, *(f"{key} = {value}" for key, value in same.items())]).strip(", ")
    parts = [Part(reading.values, reading.scenario, reading.remarks) for reading in group]
    drawn = variation.drawn if whole else {}
    whole_part = merged(parts, doc, drawn, min(variation.runs, MOST_SETS), variation.seed)
    requirements: dict[str, Requirements] = {}
    for reading in group:
        for model, wanted in reading.requirements.items():
            requirements[model] = Requirements(*map(max, wanted, requirements.get(model, wanted)))
    body = tuple(
        m.UseModels(path=f"{name}_models.foresee") if isinstance(item, m.UseModels) else item
        for item in whole_part.scenario.body
    )
    scenario = whole_part.scenario.model_copy(update={"name": name, "body": body})
    catalogue = first.catalogue and first.catalogue.model_copy(update={"name": f"{name}_models"})
    return dataclasses.replace(
        first, scenario=scenario, remarks=whole_part.remarks, catalogue=catalogue, requirements=requirements
    )


def _refusal(file: Path, losses: Losses) -> str:
    what = "; ".join(f"{count} {what}" for what, count in losses.lost.items())
    return (
        f"{file} has parts that the language cannot express, and without them the scenario would be different: "
        f"{what}. No file is written; --partial writes the rest, with a comment at each place"
    )


_GOAL = "FS255"
"""Code of a goal beside the ego's way, or behind its start."""
_ON_TOP = "FS254"
"""Code of an actor that starts on top of another one."""


class _OnTopError(SourceError):
    """Actors overlap others at the beginning."""

    def __init__(self, message: str, names: set[str]) -> None:
        super().__init__(message)
        self.names = names


class _LostError(ExchangeError):
    """A part of the file would be lost, independently of the parameter values."""


def _without_goal(scenario: m.Scenario) -> m.Scenario:
    """Return a scenario without a goal, so that the ego drives to the end of its route."""
    body: list[m.ScenarioItem] = []
    for item in scenario.body:
        if isinstance(item, m.Ego):
            kept = tuple(part for part in item.body if not isinstance(part, m.GoalAt))
            body.append(item.model_copy(update={"body": kept}))
        else:
            body.append(item)
    return scenario.model_copy(update={"body": tuple(body)})
