"""Takes over an OpenSCENARIO XML file: its common subset becomes a scenario; what is not expressed is said."""

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
from foresee_dsl.exchange.naming import name_of
from foresee_dsl.exchange.openscenario.reading.entities import (
    Asked,
    made_stronger,
    possible_egos,
    read_participants,
)
from foresee_dsl.exchange.openscenario.reading.losses import Losses
from foresee_dsl.exchange.openscenario.reading.scenario_reader import NowhereError, ScenarioReader
from foresee_dsl.exchange.openscenario.reading.source import Source, declared_names, network_file, read_source
from foresee_dsl.exchange.openscenario.reading.variations.distributions import (
    MOST_SETS,
    Values,
    Variation,
    read_variation,
)
from foresee_dsl.exchange.openscenario.reading.variations.merging import Part, merged, shape_of
from foresee_dsl.exchange.outcome import (
    Coordinates,
    ExchangeError,
    Imported,
    SourceError,
    import_together,
    write_text,
)
from foresee_dsl.language import model as m
from foresee_dsl.language.project.loading import load_test_cases


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
    """Write the scenario `NAME.foresee`, its network, and the catalogue `NAME_models.foresee` where it is needed.

    Args:
        file: the `.xosc` file. out: the folder.
        ego: the entity under test; by default the one that is called so, else the first vehicle.
        road: the network (`.xodr`, `.net.xml`), or a folder in which the one that the file names is looked for, and
            catalogues whose folders are missing; by default the one that the file names.
        coordinates: how world positions are meant.
        partial: also write a scenario from which actions, triggers or participants are lost, with comments.
        allow_outside: whether the file may name files outside its project folder.

    Raises:
        ExchangeError: it cannot be read, has no network or no vehicle, lacks a catalogue, or something would be lost.
        InputError: the scenario that comes out is impossible; nothing is written.
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
    """A file that was read, with one set of values for its parameters: the scenario, its comments, and its other files.

    Attributes:
        catalogue: of new models. asked: what each of them is asked to do, by its name.
    """

    scenario: m.Scenario
    remarks: Mapping[int, Sequence[str]]
    catalogue: m.Catalogue | None
    asked: Mapping[str, Asked]
    losses: Losses
    network_path: Path
    network_name: str
    values: Values = dataclasses.field(default_factory=dict)

    @property
    def kind(self) -> tuple[str, str, str]:
        """What readings have in common that differ only in their values."""
        return str(self.network_path), shape_of(self.scenario), repr(self.catalogue)


def _read_playable(file: Path, settings: _Settings, values: Values | None = None, name: str = "") -> _Reading:
    """Read a file with some values of its parameters, and make sure that the actors of what comes out have places; with
    `partial`, a file that nothing varies is read without those that stand on others.

    Raises:
        ExchangeError: it cannot be read or not be played on its network, or something would be lost.
    """
    source = read_source(file, allow_outside=settings.allow_outside, given=values)
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
    """Read a file without some actors, by their names here, which stand on others."""
    network_path = network_file(source, settings.road, SUFFIXES)
    suffix = next(suffix for suffix in SUFFIXES if network_path.name.endswith(suffix))
    network_name = name_of(network_path.name.partition(".")[0], "map") + suffix
    nowhere: ExchangeError | None = None
    for chosen in [settings.ego] if settings.ego else possible_egos(source):
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
    asked = work.asked_of_models(scenario)
    return _Reading(scenario, remarks, work.catalogue, asked, losses, network_path, network_name)


def _with_places(reading: _Reading, file: Path, folder: Path) -> _Reading:
    """Return a reading whose actors have places, as a check in an empty folder says: without its goal where that is
    beside the ego's way."""
    mistakes = _write(reading, folder)
    if mistakes and all("the goal is" in mistake.message for mistake in mistakes):
        reading.losses.left_out["goals beside the ego's way (it goes to its end)"] += 1
        reading = dataclasses.replace(reading, scenario=_without_goal(reading.scenario))
        mistakes = _write(reading, folder)
    if mistakes:
        found = "; ".join(dict.fromkeys(f"{d.message}{f' ({d.help})' if d.help else ''}" for d in mistakes))
        said = f"{file} cannot be played on its network: {found}".replace(f"{folder}{os.sep}", "")
        if all(_ON_TOP in d.message for d in mistakes):
            raise _OnTopError(said, {d.message.partition(_ON_TOP)[0] for d in mistakes})
        raise ExchangeError(said)
    return reading


def _write(reading: _Reading, folder: Path) -> tuple[Diagnostic, ...]:
    """Write the files of a reading; return what is impossible in its test cases."""
    name = reading.scenario.name
    if not (folder / reading.network_name).exists():
        shutil.copyfile(reading.network_path, folder / reading.network_name)
    if reading.catalogue is not None:
        write_text(folder / f"{name}_models.foresee", made_stronger(reading.catalogue, reading.asked))
    write_text(folder / f"{name}.foresee", reading.scenario, reading.remarks)
    return placement_mistakes(load_test_cases([folder / f"{name}.foresee"]))


_MOST_SETS = 200
"""The largest number of sets of values that is read. Ours: half a minute of computing."""


def _import_variation(variation: Variation, settings: _Settings) -> Imported:
    """Import a scenario with each set of values that a file gives its parameters: a file for each kind of scenario that
    comes out, with parameters and cases."""
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
    found = [
        _joined(name if len(groups) == 1 else f"{name}_{k + 1:02d}", group, variation, whole=len(groups) == 1)
        for k, group in enumerate(groups.values())
    ]
    for one in (reading.losses for group in groups.values() for reading in group):
        total.notes |= one.notes
        total.lost |= one.lost  # of each kind as many as one set of values loses
        total.left_out |= one.left_out

    def write(folder: Path) -> Imported:
        for reading in found:
            mistakes = _write(reading, folder)
            if mistakes:
                raise ExchangeError(f"{variation.path} cannot be played on its network: {mistakes[0].message}")
        cases = len(load_test_cases([folder / f"{reading.scenario.name}.foresee" for reading in found]))
        taken = {"sets of parameter values": sum(map(len, groups.values()))}
        return Imported((), cases, taken, +total.left_out, tuple(total.notes), +total.lost)

    return import_together(settings.out, write)


def _joined(name: str, group: Sequence[_Reading], variation: Variation, *, whole: bool) -> _Reading:
    """Return readings of one kind as one, with parameters and cases; `whole`: they are all that the file means."""
    first = group[0]
    same = {key: value for key, value in first.values.items() if all(one.values.get(key) == value for one in group)}
    doc = ", ".join([variation.description, *(f"{key} = {value}" for key, value in same.items())]).strip(", ")
    parts = [Part(one.values, one.scenario, one.remarks) for one in group]
    drawn = variation.drawn if whole else {}
    one = merged(parts, doc, drawn, min(variation.runs, MOST_SETS), variation.seed)
    asked: dict[str, Asked] = {}
    for reading in group:
        for model, wanted in reading.asked.items():
            asked[model] = Asked(*map(max, wanted, asked.get(model, wanted)))
    body = tuple(
        m.UseModels(path=f"{name}_models.foresee") if isinstance(item, m.UseModels) else item
        for item in one.scenario.body
    )
    scenario = one.scenario.model_copy(update={"name": name, "body": body})
    catalogue = first.catalogue and first.catalogue.model_copy(update={"name": f"{name}_models"})
    return dataclasses.replace(first, scenario=scenario, remarks=one.remarks, catalogue=catalogue, asked=asked)


def _refusal(file: Path, losses: Losses) -> str:
    what = "; ".join(f"{count} {what}" for what, count in losses.lost.items())
    return (
        f"{file} holds what the language does not express, and without it something else happens: {what}. Nothing is "
        "written; --partial writes the rest, with a comment at each place"
    )


_ON_TOP = " starts on top of "


class _OnTopError(SourceError):
    """Actors begin on top of others."""

    def __init__(self, message: str, names: set[str]) -> None:
        super().__init__(message)
        self.names = names


class _LostError(ExchangeError):
    """Something would be lost, whatever the values of the parameters are."""


def _without_goal(scenario: m.Scenario) -> m.Scenario:
    """Return a scenario whose ego drives to the end of its route."""
    body: list[m.ScenarioItem] = []
    for item in scenario.body:
        if isinstance(item, m.Ego):
            kept = tuple(part for part in item.body if not isinstance(part, m.GoalAt))
            body.append(item.model_copy(update={"body": kept}))
        else:
            body.append(item)
    return scenario.model_copy(update={"body": tuple(body)})
