"""The cache of nets: each net is built once for its content, and its XML is parsed once."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import cast

from foresee_dsl import disk_cache
from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.nets.netconvert import tool_version
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.compile.templates import template_sources
from foresee_dsl.errors import CompileError
from foresee_dsl.files import cache_folder
from foresee_dsl.language.model import Network

FORMAT = 1
"""Number of the format of cached nets, a part of the cache key; increase it when our code builds a different net from
the same input."""

NET = "net.net.xml"
_SUM = "sha256"


def content_key(key_parts: Iterable[str | bytes]) -> str:
    """Return the cache key (32 hex digits) of these parts, the versions of the installed tools and the templates."""
    digest = hashlib.sha256()
    tools: tuple[str | bytes, ...] = (f"{FORMAT} {tool_version()}", *template_sources())
    for part in (*tools, *key_parts):
        data = part.encode() if isinstance(part, str) else part
        digest.update(f"{len(data)}:".encode())  # the length in front makes ("ab", "c") and ("a", "bc") differ
        digest.update(data)
    return digest.hexdigest()[:32]


def cached_net(key_parts: Iterable[str | bytes], build: Callable[[Path], None]) -> Path:
    """Return the file of a net in the cache; if it is missing or damaged, `build` writes it to the path that it
    receives.

    Entries are written completely or not at all, so processes may share the cache. The name of the parent folder is the
    key.

    `key_parts` holds everything on which the net depends, apart from the tools.
    """
    key = content_key(key_parts)
    try:
        base = cache_folder("nets")
        entry = base / key
        if _is_whole(entry):
            return entry / NET
        fresh = Path(tempfile.mkdtemp(prefix=f".{key}.", dir=base))
        try:
            build(fresh / NET)
            (fresh / _SUM).write_text(_sum(fresh / NET), encoding="ascii")
            _put(fresh, entry)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
    except OSError as err:
        raise CompileError(
            f"the cache of networks cannot be used ({err}); FORESEE_CACHE can name another folder"
        ) from err
    return entry / NET


def read_net_once(net_file: Path, network: Network | None) -> tuple[Topology, Mapping[str, Signal]]:
    """Return the parts and signals of a net in the cache, as `read_net` and `signals_of` return them.

    They are cached as a pickle under the name of the net's folder, because parsing the XML takes longer than placing
    the actors of a scenario.
    """
    place = disk_cache.entry("read", (net_file.parent.name,))
    parts = disk_cache.load(place)
    if parts is None:
        from foresee_dsl.compile.nets.net_reader import topology_of  # slow import (XML), only for new nets
        from foresee_dsl.compile.nets.safe_xml import parse_net
        from foresee_dsl.compile.nets.signals import signals_of

        root = parse_net(net_file)
        topology = topology_of(root)
        parts = topology, signals_of(root, topology, network)
        disk_cache.store(place, parts)
    return cast(tuple[Topology, Mapping[str, Signal]], parts)


def _put(fresh: Path, entry: Path) -> None:
    """Move a finished folder to its place, unless another process has done so; a damaged entry is replaced."""
    for _ in range(10):  # a further round means that another process has interfered
        try:
            fresh.rename(entry)
        except OSError:
            if _is_whole(entry):
                return
            trash = Path(tempfile.mkdtemp(prefix=".damaged.", dir=entry.parent))
            try:
                entry.rename(trash / "entry")
            except FileNotFoundError:
                pass  # another process has moved it away already
            finally:
                shutil.rmtree(trash, ignore_errors=True)
        else:
            return
    raise CompileError(f"the cache entry {entry} cannot be replaced")


def _is_whole(entry: Path) -> bool:
    try:
        return (entry / _SUM).read_text(encoding="ascii") == _sum(entry / NET)
    except (OSError, ValueError):
        return False


def _sum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
