"""Plug-ins: objects that installed packages offer by name through an entry-point group."""

from __future__ import annotations

import difflib
import platform
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from foresee_dsl.errors import ForeseeError

BESIDE: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "bridges": {
        "foresee_dsl.drivers": ("carla", "commonroad", "fmi", "grpc", "gym", "nuplan"),
        "foresee_dsl.exporters": ("osi",),
    },
    "exchange": {
        "foresee_dsl.exporters": ("carla-route", "openscenario"),
        "foresee_dsl.importers": ("carla", "opendrive", "openscenario", "osm", "sumo"),
    },
    "frenetix": {"foresee_dsl.drivers": ("frenetix",)},
    "learned": {
        "foresee_dsl.drivers": ("fusion", "fusion_safe"),
        "foresee_dsl.raster_views": ("birds_eye", "forward"),
    },
    "recordings": {
        "foresee_dsl.commands": ("mine",),
        "foresee_dsl.exporters": ("commonroad", "fcd", "levelx"),
    },
    "study": {
        "foresee_dsl.commands": ("fuzz", "study"),
        "foresee_dsl.rankers": ("selforacle", "selforacle_conv"),
    },
}
"""Plug-ins in the repository of this package: the extra that installs `foresee-EXTRA`, and the names it offers by
group. If a requested name's plug-in is missing, the error message contains the command that installs it."""


@dataclass(frozen=True)
class PluginGroup:
    """One kind of plug-in, defined by its entry-point group.

    Attributes:
        name: the entry-point group: a package adds to it with `[project.entry-points."NAME"]`.
        noun: word for one of its plug-ins in messages, such as `driver`.
        error: raised if there is no such plug-in, or it is broken.
        unavailable: raised instead if a plug-in of `BESIDE` offers the name but is not installed; None: `error`.
    """

    name: str
    noun: str
    error: type[ForeseeError]
    unavailable: type[ForeseeError] | None = None

    def entries(self) -> tuple[EntryPoint, ...]:
        """Return the entry points of all installed plug-ins, sorted by name and package; nothing is imported."""
        return tuple(sorted(entry_points(group=self.name), key=lambda entry: (entry.name, package_of(entry))))

    def names(self) -> tuple[str, ...]:
        """Return the names of all installed plug-ins, sorted; nothing is imported."""
        return tuple(dict.fromkeys(entry.name for entry in self.entries()))

    def find(self, name: str) -> EntryPoint:
        """Return the entry point of a plug-in; nothing is imported.

        Raises:
            ForeseeError: (of the kind `error`) no package offers it, or several do. The message suggests similar names.
        """
        return _entry_point(self, name, tuple(sys.path))

    def missing(self) -> tuple[str, ...]:
        """Return the names of this group that plug-ins of `BESIDE` offer and no installed package does, sorted."""
        offered = {name for groups in BESIDE.values() for name in groups.get(self.name, ())}
        return tuple(sorted(offered.difference(self.names())))

    def beside(self, name: str) -> str:
        """Return which plug-in of `BESIDE` offers a name, and how to install it; empty if none does."""
        extras = (extra for extra, groups in BESIDE.items() if name in groups.get(self.name, ()))
        return "".join(f"comes with the plug-in foresee-{extra}, which is {not_installed(extra)}" for extra in extras)

    @contextmanager
    def loading(self, entry: EntryPoint) -> Iterator[None]:
        """Turn every error inside this context into `error`, with the name of the plug-in's package."""
        try:
            yield
        except self.error:
            raise
        except Exception as err:  # a plug-in may fail in any way; the message names its package
            why = _needed(err) or f"cannot be loaded: {type(err).__name__}: {err}"
            raise self.error(f"{self.noun} {entry.name!r} of package {package_of(entry)} {why}") from err

    def load(self, name: str) -> Any:  # noqa: ANN401 - any object that the package offers
        """Import the object that a plug-in's entry point names.

        Raises:
            ForeseeError: (of the kind `error`) see `find`; or it cannot be imported.
        """
        entry = self.find(name)
        with self.loading(entry):
            return entry.load()


def package_of(entry: EntryPoint) -> str:
    """Return the name of the package that offers an entry point."""
    return entry.dist.name if entry.dist is not None else "unknown"


def _needed(err: Exception) -> str:
    """Return which plug-in of `BESIDE` an import needed and did not find; empty for another error."""
    extra = str(err.name).partition(".")[0].removeprefix("foresee_") if isinstance(err, ImportError) else ""
    if extra not in BESIDE:
        return ""
    return f"needs the plug-in foresee-{extra}, which is {not_installed(extra)}"


def not_installed(extra: str) -> str:
    """Return the message that a plug-in of `BESIDE` is not installed. It names the command that installs it, or the
    reason why it cannot be installed here (frenetix has wheels only for Python up to 3.12 on x86_64 Linux and
    macOS)."""
    installs = f"not installed: pip install ./plugins/foresee-{extra} in a checkout of foresee-dsl"
    if extra != "frenetix" or _has_frenetix_wheel(sys.version_info[:2], platform.machine(), sys.platform):
        return installs
    here = f"Python {sys.version_info[0]}.{sys.version_info[1]} on {platform.machine()} {platform.system()}"
    return (
        f"not installed and cannot run here ({here}): its planner, the package frenetix, has wheels for Python up to "
        "3.12 on x86_64 Linux and macOS only"
    )


def _has_frenetix_wheel(python: tuple[int, int], machine: str, system: str) -> bool:
    """Return whether the marker in `plugins/foresee-frenetix/pyproject.toml` lets pip install the package frenetix."""
    return python < (3, 13) and machine == "x86_64" and system in ("linux", "darwin")


@lru_cache(maxsize=64)
def _entry_point(group: PluginGroup, name: str, path: tuple[str, ...]) -> EntryPoint:  # noqa: ARG001 - `path` keys the cache
    """Return a plug-in's entry point, cached: a search through all packages takes 5 ms, and each run loads a driver."""
    entries = sorted(entry_points(group=group.name, name=name), key=package_of)
    if len(entries) > 1 and len({entry.value for entry in entries}) > 1:
        packages = ", ".join(package_of(entry) for entry in entries)
        raise group.error(
            f"{group.noun} {name!r} is offered by more than one package: {packages}; uninstall all but one"
        )
    if entries:
        return entries[0]
    if missing := group.beside(name):
        raise (group.unavailable or group.error)(f"the {group.noun} {name!r} {missing}")
    names = group.names()
    close = difflib.get_close_matches(name, names, n=3)
    hint = f", did you mean {' or '.join(repr(c) for c in close)}?" if close else ";"
    raise group.error(f"unknown {group.noun} {name!r}{hint} installed: {', '.join(names) or 'none'}")
