"""The compiler: combines network, types, signals and scene, and caches the parts that several test cases share."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor, Signal, SlipperyPatch, SumoBundle
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.nets.cache import cached_net, read_net_once
from foresee_dsl.compile.nets.misfits import MisfitError, located, placed
from foresee_dsl.compile.nets.netconvert import NetconvertError
from foresee_dsl.compile.placement.scene import SceneBuilder
from foresee_dsl.compile.roads.network import RoadNetwork, buildings_of
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.errors import CompileError, Diagnostic, InputError
from foresee_dsl.files import cache_folder, write_whole
from foresee_dsl.language import model as m
from foresee_dsl.language.codes import diagnostic_of
from foresee_dsl.language.document import Document, PlacementError, Problem, TestCase
from foresee_dsl.language.model import Network
from foresee_dsl.language.traversal import walk

_CORRECT = "keep routes away from there, or correct the map"
_Cached = TypeVar("_Cached")
_Key = TypeVar("_Key")


def compile_case(case: TestCase) -> SumoBundle:
    """Compile a test case; see `foresee_dsl.compile.compile_test_case`."""
    net_file = _net_of(case.network, case.network_document)
    builder, specs = _builder(case, net_file)
    try:
        scene = builder.build()
    except PlacementError as err:
        raise diagnose(case, err.problems) from err
    passing = {actor.model.name for actor in scene.actors if actor.passes}
    types_file = _types_of(tuple(specs[name] for name in sorted(specs)), tuple(sorted(passing)))
    network, signals = _read(net_file, case.network)
    return SumoBundle(
        name=case.id,
        net_file=net_file,
        types_file=types_file,
        key=f"{net_file.parent.name}-{types_file.parent.name}",
        network=network,
        signals=dict(signals),
        scene=scene,
    )


def check_case(case: TestCase) -> tuple[Diagnostic, ...]:
    """Place the actors of a test case; return a warning if its foreign map has faults.

    No files are written except a network that is not yet in the cache.

    Raises:
        InputError: a statement is impossible on the network.
    """
    net_file = _net_of(case.network, case.network_document)
    try:
        _builder(case, net_file)[0].place()
    except PlacementError as err:
        raise diagnose(case, err.problems) from err
    faults = _read(net_file, case.network)[0].faults
    if not faults or not isinstance(case.network, Path):
        return ()
    return (_warning(case, case.network.name, faults),)


@dataclass(frozen=True)
class Sketch:
    """A test case whose actors are placed as far as possible; used for pictures, which also show errors.

    Attributes:
        actors: the actors that could be placed, the background traffic last.
        start_s, goal_s: start and goal of the ego along its line, m.
        places: coordinates of places in conditions, m.
        problems: the errors.
        mistakes: the same errors with their places in the text, in the same order.
    """

    network: RoadNetwork
    signals: Mapping[str, Signal]
    actors: tuple[PlacedActor, ...]
    start_s: float
    goal_s: float
    places: Mapping[m.Place, XY]
    problems: tuple[Problem, ...]
    mistakes: tuple[Diagnostic, ...]
    slippery: tuple[SlipperyPatch, ...] = ()


def sketch_case(case: TestCase) -> Sketch:
    """Return a test case whose actors are placed as far as possible.

    Raises:
        InputError: a statement of its network contradicts the roads. CompileError: its network cannot be built.
    """
    net_file = _net_of(case.network, case.network_document)
    network, signals = _read(net_file, case.network)
    builder, _ = _builder(case, net_file)
    placed, start_s, goal_s, problems = builder.attempt()
    background = builder.background(placed)[0] if not problems else []
    actors, mistakes = (*placed, *background), _diagnostics(case, problems)
    return Sketch(network, signals, actors, start_s, goal_s, builder.places, problems, mistakes, builder.slippery)


def network_of(network: Network | Path, document: Document | None = None) -> tuple[RoadNetwork, Mapping[str, Signal]]:
    """Build a network, and return it with its signals; `document` is the file that holds it.

    Raises:
        InputError: a statement contradicts the network's roads. CompileError: the network cannot be built.
    """
    return _read(_net_of(network, document), network)


def warnings_of(case: TestCase) -> tuple[Diagnostic, ...]:
    """Return warnings on what is permitted on the network but probably not intended; none for a case with errors."""
    try:
        problems = _builder(case, _net_of(case.network, case.network_document))[0].warnings()
    except (PlacementError, InputError):
        return ()
    return _diagnostics(case, problems)


def _warning(case: TestCase, network: str, faults: tuple[str, ...]) -> Diagnostic:
    closed = "1 place, which is closed" if len(faults) == 1 else f"{len(faults)} places, which are closed"
    problem = Problem("", "use_network", "FS260",
                      f"the map {network} is broken at {closed}: {'; '.join(faults)}", _CORRECT)  # fmt: skip
    return _diagnostic(case, problem, set())


def _builder(case: TestCase, net_file: Path) -> tuple[SceneBuilder, Mapping[str, ModelSpec]]:
    network, signals = _read(net_file, case.network)
    specs = _specs_of(case.models)
    return SceneBuilder(case, network, specs, signals), specs


def _specs_of(models: Mapping[str, m.VehicleModel]) -> Mapping[str, ModelSpec]:
    cached = _SPECS.get(id(models))
    if cached is None or cached[0] is not models:
        cached = _remember(_SPECS, id(models), (models, {name: spec_of(model) for name, model in models.items()}))
    return cached[1]


_MOST_CACHED = 8
"""Maximum number of networks in memory. Ours: a campaign has a few, and a town takes some megabytes."""
_BUILT: dict[int, tuple[Network, Path]] = {}
"""Net files by the id of their network object, which children share with their parent. The object is kept in the value,
so that Python does not reuse its id."""
_REFUSED: dict[int, tuple[Network, MisfitError]] = {}
"""Networks with mistakes, by their id: each is built only once, however many test cases use it."""
_SPECS: dict[int, tuple[Mapping[str, m.VehicleModel], Mapping[str, ModelSpec]]] = {}
"""Catalogues with all values filled in, by the id of their models object, which is kept for the same reason."""
_READ: dict[str, tuple[RoadNetwork, Mapping[str, Signal]]] = {}
"""Networks and signals by the path of their net file, whose folder is named by the hash of its content."""


def _net_of(network: Network | Path, document: Document | None) -> Path:
    """Return the net file of a network; the mistakes in its statements are placed in `document`."""
    if isinstance(network, Path):
        # imported here: it needs an XML parser, which the check of a written network does not
        from foresee_dsl.compile.foreign.networks import foreign_net

        return foreign_net(network)
    cached = _BUILT.get(id(network))
    if cached is None or cached[0] is not network or not cached[1].exists():
        refused = _REFUSED.get(id(network))
        if refused is not None and refused[0] is network:
            raise located(refused[1], network, document)
        try:
            net = cached_net(("network", network.model_dump_json()), lambda out: _build(network, out))
        except MisfitError as err:
            _remember(_REFUSED, id(network), (network, err))
            raise located(err, network, document) from err
        except NetconvertError as err:
            raise type(err)(placed(str(err), network, document)) from err
        cached = _remember(_BUILT, id(network), (network, net))
    return cached[1]


def _build(network: Network, out: Path) -> None:
    from foresee_dsl.compile.nets.network_builder import (
        build_network,
    )  # slow import (templates, XML), only for new networks

    build_network(network, out)


def _read(net_file: Path, network: Network | Path) -> tuple[RoadNetwork, Mapping[str, Signal]]:
    cached = _READ.get(str(net_file))
    if cached is None:
        written = None if isinstance(network, Path) else network
        topology, signals = read_net_once(net_file, written)
        cached = _remember(_READ, str(net_file), (RoadNetwork.of(topology, buildings_of(network), written), signals))
    return cached


def _remember(cache: dict[_Key, _Cached], key: _Key, value: _Cached) -> _Cached:
    while len(cache) >= _MOST_CACHED:
        del cache[next(iter(cache))]
    cache[key] = value
    return value


@lru_cache(maxsize=32)
def _types_of(specs: tuple[ModelSpec, ...], passing: tuple[str, ...]) -> Path:
    """Write the vehicle types to the cache under the hash of their content, whole or not at all; return the file."""
    from foresee_dsl.compile.sumo_files import types_of  # slow import (templates), which a check does not need

    text = types_of(specs, passing)
    try:
        file = cache_folder("types") / hashlib.sha256(text.encode()).hexdigest()[:16] / "types.add.xml"
        write_whole(file, text)
    except OSError as err:
        message = f"the cache of vehicle types cannot be used ({err}); FORESEE_CACHE can name another"
        raise CompileError(message) from err
    return file


# ---- places in the text of errors that show only on the network ------------------------------------------------------


def diagnose(case: TestCase, problems: tuple[Problem, ...]) -> InputError:
    """Convert the compiler's problems to an error with places in the text.

    A problem of an actor is placed at the actor's statement of the kind at fault; if there is none, at the actor; in a
    mutant, at the `change` line of the actor, also if the problem is about an action on the actor. A problem of the
    scenario is placed at the scenario's statement of the kind at fault. If the statement is in another file (the clip
    of a mutant), the message says so.
    """
    return InputError(tuple(sorted(_diagnostics(case, problems), key=lambda d: d.start)))


def _diagnostics(case: TestCase, problems: Iterable[Problem]) -> tuple[Diagnostic, ...]:
    named: set[tuple[int, str]] = set()
    return tuple(_diagnostic(case, problem, named) for problem in problems)


def _diagnostic(case: TestCase, problem: Problem, named: set[tuple[int, str]]) -> Diagnostic:
    document = case.document
    if document is None:
        return diagnostic_of(problem.code, problem.message, problem.help, case.id)
    item, field = _place(document, problem)
    if item is not None and (problem.about or problem.part is not None):
        item, field = _named(document, item, problem, named) or (item, field)
    message = problem.message
    if item is None and problem.actor and isinstance(document.model, m.Mutant):
        message = message + f" (as written in '{document.model.parent}')"
    return document.diagnostic(item, field, problem.code, message, problem.help)


def _place(document: Document, problem: Problem) -> tuple[m.Item | None, str]:
    body: tuple[m.Item, ...] = document.model.body
    if isinstance(document.model, m.Mutant):
        actor, of = (problem.actor, problem.item) if problem.actor else (problem.about, "model")
        changes = [item for item in body if isinstance(item, m.Change) and item.actor == actor]
        exact = (item for item in changes if item.property == of)
        return next(exact, changes[0] if changes else None), ""
    if not problem.actor:
        return next((item for item in body if getattr(item, "kind", "") == problem.item), None), ""
    for item in body:
        if isinstance(item, m.Ego | m.Actor) and item.name == problem.actor:
            return _within(item, problem.item)
        if isinstance(item, m.Traffic) and problem.actor.rpartition("_")[0] == item.name:
            return item, ""
    return None, ""


def _within(actor: m.Ego | m.Actor, kind: str) -> tuple[m.Item, str]:
    """Return an actor's statement of a kind; if there is none, the actor and its field `model`, `state` or `name`."""
    aliases = {"route": ("route", "edge_route"), "goal": ("goal", "clip_goal")}.get(kind, (kind,))
    statement = next((item for item in actor.body if item.kind in aliases), None)
    if statement is not None:
        return statement, ""
    if kind == "state" and actor.state is not None:
        return actor.state, ""
    return actor, kind if kind in ("model", "state") else "name"


def _named(
    document: Document, first: m.Item, problem: Problem, named: set[tuple[int, str]]
) -> tuple[m.Item, str] | None:
    """Return the statement and field of the name at fault: the first place that no other problem has."""
    alike = (
        [item for item in document.model.body if getattr(item, "kind", "") == problem.item]
        if not problem.actor
        else [first]
    )
    for item in (part for statement in alike for part in walk(statement)):
        if problem.field[0] not in ("", getattr(item, "kind", "")):
            continue
        for field in type(item).model_fields if not problem.field[1] else problem.field[1:]:
            value = getattr(item, field, None)
            same = value == (problem.about or problem.part) or _stands_for(document, value, problem.about)
            if same and (id(item), field) not in named:
                named.add((id(item), field))
                return item, field
    return None


def _stands_for(document: Document, value: object, word: str) -> bool:
    """Return whether a value is a parameter whose default, or whose value in a case, is a word."""
    if not isinstance(value, m.Ref) or not isinstance(document.model, m.Scenario):
        return False
    defaults = (param.default for param in document.model.all(m.Param) if param.name == value.name)
    case_values = (v.value for case in document.model.all(m.Case) for v in case.values if v.name == value.name)
    return any(default == word for default in (*defaults, *case_values))
