"""The compiler: joins network, types, signals and scene, and caches what several test cases share."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from foresee_dsl.compile.bundle import ModelSpec, Signal, SumoBundle
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.nets.cache import cached_net, read_net_once
from foresee_dsl.compile.placement.scene import SceneBuilder
from foresee_dsl.compile.roads.network import RoadNetwork, buildings_of
from foresee_dsl.errors import CompileError
from foresee_dsl.files import cache_folder, write_whole
from foresee_dsl.language.messages.located import diagnose
from foresee_dsl.language.model import Network
from foresee_dsl.language.project.document import PlacementError, TestCase

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


def check_case(case: TestCase) -> None:
    """Place the actors of a test case and report what is wrong; nothing is written but a network that is new."""
    try:
        _builder(case, _net_of(case.network))[0].place()
    except PlacementError as err:
        raise diagnose(case, err.problems) from err


def _builder(case: TestCase, net_file: Path) -> tuple[SceneBuilder, Mapping[str, ModelSpec]]:
    network, signals = _read(net_file, case.network)
    specs = {name: spec_of(model) for name, model in case.models.items()}
    return SceneBuilder(case, network, specs, signals), specs


_MOST_CACHED = 8
"""Networks kept in memory (ours: a campaign has a few, and a town takes some megabytes)."""
_BUILT: dict[int, tuple[Network, Path]] = {}
"""Nets by the identity of their network, which is held so that its id is not used again: children share their
parent's."""
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
        topology, signals = read_net_once(net_file, None if isinstance(network, Path) else network)
        known = _remember(_READ, str(net_file), (RoadNetwork.of(topology, buildings_of(network)), signals))
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
