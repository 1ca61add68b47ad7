"""The compiler: joins network, types, signals and scene, and caches what several test cases share."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from foresee_dsl.compile import codes
from foresee_dsl.compile.bundle import ModelSpec, PlacedActor, Signal, SlipperyPatch, SumoBundle
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.nets.cache import cached_net, read_net_once
from foresee_dsl.compile.placement.scene import SceneBuilder
from foresee_dsl.compile.roads.network import RoadNetwork, buildings_of
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.errors import CompileError, Diagnostic, InputError
from foresee_dsl.files import cache_folder, write_whole
from foresee_dsl.language import model as m
from foresee_dsl.language.model import Network
from foresee_dsl.language.project.document import Document, PlacementError, Problem, TestCase
from foresee_dsl.language.traversal import walk

_CORRECT = "keep routes away from there, or correct the map"
_Cached = TypeVar("_Cached")
_Key = TypeVar("_Key")


def compile_case(case: TestCase) -> SumoBundle:
    """Compile a test case; see `foresee_dsl.compile.compile_test_case`."""
    net_file = _net_of(case.network)
    builder, specs = _builder(case, net_file)
    types_file = _types_of(tuple(specs[name] for name in sorted(specs)))
    try:
        scene = builder.build()
    except PlacementError as err:
        raise diagnose(case, err.problems) from err
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
    """Place the actors of a test case and report what is wrong; nothing is written but a network that is new.

    Returned are warnings: of a map of others that is broken somewhere.
    """
    net_file = _net_of(case.network)
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
    """A test case as far as it can be placed: for pictures, which also show what is wrong.

    Attributes:
        actors: those that have a place, the background traffic last. start_s, goal_s: of the ego, along its line, m.
        places: where the places of conditions are, m. problems: what is wrong; `mistakes`: the same with their places
            in the text, in the same order.
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
    """Place what can be placed of a test case; a `CompileError` only where its network cannot be built."""
    net_file = _net_of(case.network)
    network, signals = _read(net_file, case.network)
    builder, _ = _builder(case, net_file)
    placed, start_s, goal_s, problems = builder.attempt()
    background = builder.background(placed)[0] if not problems else []
    named: set[tuple[int, str]] = set()
    mistakes = tuple(_diagnostic(case, problem, named) for problem in problems)
    everybody = (*placed, *background)
    return Sketch(network, signals, everybody, start_s, goal_s, builder.places, problems, mistakes, builder.slippery)


def network_of(network: Network | Path) -> tuple[RoadNetwork, Mapping[str, Signal]]:
    """Return a network alone, built, with its signals; a `CompileError` where that is impossible."""
    return _read(_net_of(network), network)


def warnings_of(case: TestCase) -> tuple[Diagnostic, ...]:
    """Return what shows on the network and is allowed, but hardly meant; nothing of a case with mistakes."""
    try:
        found = _builder(case, _net_of(case.network))[0].warnings()
    except PlacementError:
        return ()
    named: set[tuple[int, str]] = set()
    return tuple(replace(_diagnostic(case, problem, named), severity="warning") for problem in found)


def _warning(case: TestCase, network: str, faults: tuple[str, ...]) -> Diagnostic:
    closed = "1 place, which is closed" if len(faults) == 1 else f"{len(faults)} places, which are closed"
    problem = Problem("", "use_network", codes.BROKEN,
                      f"the map {network} is broken at {closed}: {'; '.join(faults)}", _CORRECT)  # fmt: skip
    return replace(_diagnostic(case, problem, set()), severity="warning")


def _builder(case: TestCase, net_file: Path) -> tuple[SceneBuilder, Mapping[str, ModelSpec]]:
    network, signals = _read(net_file, case.network)
    specs = _specs_of(case.models)
    return SceneBuilder(case, network, specs, signals), specs


def _specs_of(models: Mapping[str, m.VehicleModel]) -> Mapping[str, ModelSpec]:
    known = _SPECS.get(id(models))
    if known is None or known[0] is not models:
        known = _remember(_SPECS, id(models), (models, {name: spec_of(model) for name, model in models.items()}))
    return known[1]


_MOST_CACHED = 8
"""Networks kept in memory (ours: a campaign has a few, and a town takes some megabytes)."""
_BUILT: dict[int, tuple[Network, Path]] = {}
"""Nets by the identity of their network, which is held so that its id is not used again: children share their
parent's."""
_SPECS: dict[int, tuple[Mapping[str, m.VehicleModel], Mapping[str, ModelSpec]]] = {}
"""Catalogues with every value filled in, by the identity of their models, which are held for the same reason."""
_READ: dict[str, tuple[RoadNetwork, Mapping[str, Signal]]] = {}
"""What was read, by the net file's path; the folder's name is the hash of its content."""


def _net_of(network: Network | Path) -> Path:
    if isinstance(network, Path):
        # imported here: it needs an XML parser, which a check of a network of ours does without
        from foresee_dsl.compile.foreign.networks import foreign_net

        return foreign_net(network)
    known = _BUILT.get(id(network))
    if known is None or known[0] is not network or not known[1].exists():
        net = cached_net(("network", network.model_dump_json()), lambda out: _build(network, out))
        known = _remember(_BUILT, id(network), (network, net))
    return known[1]


def _build(network: Network, out: Path) -> None:
    from foresee_dsl.compile.nets.network_builder import build_network  # templates, XML: only where a network is new

    build_network(network, out)


def _read(net_file: Path, network: Network | Path) -> tuple[RoadNetwork, Mapping[str, Signal]]:
    known = _READ.get(str(net_file))
    if known is None:
        written = None if isinstance(network, Path) else network
        topology, signals = read_net_once(net_file, written)
        known = _remember(_READ, str(net_file), (RoadNetwork.of(topology, buildings_of(network), written), signals))
    return known


def _remember(cache: dict[_Key, _Cached], key: _Key, value: _Cached) -> _Cached:
    while len(cache) >= _MOST_CACHED:
        del cache[next(iter(cache))]
    cache[key] = value
    return value


@lru_cache(maxsize=32)
def _types_of(specs: tuple[ModelSpec, ...]) -> Path:
    """Write the vehicle types to the cache: all or nothing, under the hash of their content."""
    from foresee_dsl.compile.sumo_files import types_of  # templates: checking does without

    text = types_of(specs)
    try:
        file = cache_folder("types") / hashlib.sha256(text.encode()).hexdigest()[:16] / "types.add.xml"
        write_whole(file, text)
    except OSError as err:
        message = f"the cache of vehicle types cannot be used ({err}); FORESEE_CACHE can name another"
        raise CompileError(message) from err
    return file


# ---- mistakes that show only once the network is known: their places in the file -------------------------------------


def diagnose(case: TestCase, problems: tuple[Problem, ...]) -> InputError:
    """Turn the compiler's problems into an error that can be shown with its places.

    A problem of an actor is placed at its statement of the kind at fault, or else at the actor; in a mutant at the
    `change` line for the actor; a problem of the scenario at its statement of that kind. What is written elsewhere (in
    the clip that a mutant changes) is marked so in its message.
    """
    named: set[tuple[int, str]] = set()
    found = [_diagnostic(case, problem, named) for problem in problems]
    return InputError(tuple(sorted(found, key=lambda d: (d.span.line, d.span.column) if d.span else (0, 0))))


def _diagnostic(case: TestCase, problem: Problem, named: set[tuple[int, str]]) -> Diagnostic:
    document = case.document
    if document is None:
        return Diagnostic.of(problem.code, problem.message, problem.help, case.id)
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
        changes = [item for item in body if isinstance(item, m.Change) and item.actor == problem.actor]
        exact = (item for item in changes if item.property == problem.item)
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
    """Return an actor's statement of a kind, or its field of that name, or its first words."""
    aliases = {"route": ("route", "edge_route"), "goal": ("goal", "clip_goal")}.get(kind, (kind,))
    found = next((item for item in actor.body if item.kind in aliases), None)
    if found is not None:
        return found, ""
    if kind == "state" and actor.state is not None:
        return actor.state, ""
    return actor, kind if kind in ("model", "state") else "name"


def _named(
    document: Document, first: m.Item, problem: Problem, named: set[tuple[int, str]]
) -> tuple[m.Item, str] | None:
    """Return where the name at fault stands: at its first place that no other problem has been shown at."""
    alike = (
        [item for item in document.model.body if getattr(item, "kind", "") == problem.item]
        if not problem.actor
        else [first]
    )
    for item in (part for statement in alike for part in walk(statement)):
        if problem.field[0] not in ("", getattr(item, "kind", "")):
            continue
        for field in type(item).model_fields if not problem.field[1] else problem.field[1:]:
            found = getattr(item, field, None)
            same = found == (problem.about or problem.part) or _stands_for(document, found, problem.about)
            if same and (id(item), field) not in named:
                named.add((id(item), field))
                return item, field
    return None


def _stands_for(document: Document, value: object, word: str) -> bool:
    """Whether a value is a parameter that has a word, by default or in a case."""
    if not isinstance(value, m.Ref) or not isinstance(document.model, m.Scenario):
        return False
    defaults = (param.default for param in document.model.all(m.Param) if param.name == value.name)
    given = (v.value for case in document.model.all(m.Case) for v in case.values if v.name == value.name)
    return any(found == word for found in (*defaults, *given))
