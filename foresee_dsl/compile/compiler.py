"""The compiler: joins network, types, signals and scene, and keeps what several test cases share."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from foresee_dsl.compile.bundle import ModelSpec, Signal, SumoBundle
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.nets.cache import cached_net, read_net_once
from foresee_dsl.compile.placement.scene import SceneBuilder
from foresee_dsl.compile.roads.network import RoadNetwork, buildings_of
from foresee_dsl.errors import CompileError
from foresee_dsl.files import cache_folder
from foresee_dsl.language.messages.located import diagnose
from foresee_dsl.language.model import Network
from foresee_dsl.language.project.document import PlacementError, TestCase

_TYPES = "types.add.xml"


def compile_case(case: TestCase) -> SumoBundle:
    """Compile a test case; see `foresee_dsl.compile.compile_test_case`."""
    net_file = _net_of(case.network)
    network, signals = _read(net_file, case.network)
    specs = {name: spec_of(model) for name, model in case.models.items()}
    types_file = _types_of(tuple(specs[name] for name in sorted(specs)))
    try:
        scene = SceneBuilder(case, network, specs, signals).build()
    except PlacementError as err:
        raise diagnose(case, err.problems) from err
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
    """Place the actors of a test case and say what is wrong; nothing is written but a network that is new.

    Raises:
        InputError, CompileError: as `compile_case`.
    """
    network, signals = _read(_net_of(case.network), case.network)
    specs = {name: spec_of(model) for name, model in case.models.items()}
    try:
        SceneBuilder(case, network, specs, signals).place()
    except PlacementError as err:
        raise diagnose(case, err.problems) from err


def _net_of(network: Network | Path) -> Path:
    if isinstance(network, Path):
        from foresee_dsl.compile.foreign.networks import (
            foreign_net,  # reads XML: only where the network is somebody else's
        )

        return foreign_net(network)
    known = _BUILT.get(id(network))
    if known is None or known[0] is not network or not known[1].exists():
        net = cached_net(("network", network.model_dump_json()), lambda out: _build(network, out))
        while len(_BUILT) >= _MOST_READ:
            del _BUILT[next(iter(_BUILT))]
        known = _BUILT[id(network)] = (network, net)
    return known[1]


def _build(network: Network, out: Path) -> None:
    from foresee_dsl.compile.nets.network_builder import build_network  # templates, XML: only where a network is new

    build_network(network, out)


_BUILT: dict[int, tuple[Network, Path]] = {}
"""Nets by their network's identity (it is kept, so that no other gets its id): children share their parent's."""


_READ: dict[str, tuple[RoadNetwork, Mapping[str, Signal]]] = {}
_MOST_READ = 8
"""Networks kept in memory: a campaign has a few, and a town takes some megabytes."""


def _read(net_file: Path, network: Network | Path) -> tuple[RoadNetwork, Mapping[str, Signal]]:
    """Read a net, or find it in memory; the folder's name is the hash of its content."""
    key = str(net_file)
    if key not in _READ:
        while len(_READ) >= _MOST_READ:
            del _READ[next(iter(_READ))]
        parts, signals = read_net_once(net_file, None if isinstance(network, Path) else network)
        _READ[key] = RoadNetwork.of(parts, buildings_of(network)), signals
    return _READ[key]


@lru_cache(maxsize=32)
def _types_of(specs: tuple[ModelSpec, ...]) -> Path:
    """Write the vehicle types to the cache: all or nothing, under the hash of their content."""
    from foresee_dsl.compile.sumo_files import write_types  # templates: checking does without

    try:
        base = cache_folder("types")
        fresh = base / f".{os.getpid()}.{_TYPES}"
        write_types(specs, fresh)
        key = hashlib.sha256(fresh.read_bytes()).hexdigest()[:16]
        (base / key).mkdir(exist_ok=True)
        fresh.replace(base / key / _TYPES)
    except OSError as err:
        raise CompileError(
            f"the cache of vehicle types cannot be used ({err}); FORESEE_CACHE can name another"
        ) from err
    return base / key / _TYPES
