"""What was read from a net, kept: reading the XML again takes longer than placing a scenario's actors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import cast

from foresee_dsl import disk_cache
from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.nets.net_parts import NetParts, read_net
from foresee_dsl.language.model import Network

_Read = tuple[NetParts, Mapping[str, Signal]]


def read_net_once(net_file: Path, network: Network | None) -> _Read:
    """Return the parts and signals of a net in the cache, as `read_net` and `read_signals` give them.

    Args:
        net_file: in the cache of nets; its folder's name is the key of its content.
        network: what it was built from; None for a foreign one.

    Raises:
        CompileError: see `read_net` and `read_signals`.
    """
    place = disk_cache.entry("read", (net_file.parent.name,))
    known = disk_cache.load(place)
    if known is None:
        from foresee_dsl.compile.nets.signals import read_signals  # only for a net that is new

        known = read_net(net_file), read_signals(net_file, network)
        disk_cache.store(place, known)
    return cast("_Read", known)
