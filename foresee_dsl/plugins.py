"""Plug-ins: what installed packages offer by name through an entry-point group."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from foresee_dsl.errors import ForeseeError


@dataclass(frozen=True)
class PluginGroup:
    """One kind of plug-in.

    Attributes:
        name: the entry-point group: a package adds to it with `[project.entry-points."NAME"]`.
        noun: what one of its plug-ins is, for messages: `driver`.
        error: is raised where there is no such plug-in, or it is broken.
    """

    name: str
    noun: str
    error: type[ForeseeError]

    def names(self) -> tuple[str, ...]:
        """Return the names of all installed plug-ins, sorted; nothing is imported."""
        return tuple(sorted({entry.name for entry in entry_points(group=self.name)}))

    def find(self, name: str) -> EntryPoint:
        """Return the entry point of a plug-in; nothing is imported.

        Raises:
            ForeseeError: (of the kind `error`) no package offers it, or several do. Close names are in the message.
        """
        return _found(self, name, tuple(sys.path))

    @contextmanager
    def loading(self, entry: EntryPoint) -> Iterator[None]:
        """Report whatever goes wrong inside as a fault of the plug-in's package, with `error`."""
        try:
            yield
        except self.error:
            raise
        except Exception as err:  # a plug-in may fail in any way; the message names its package
            raise self.error(
                f"{self.noun} {entry.name!r} of package {package_of(entry)} cannot be loaded: "
                f"{type(err).__name__}: {err}"
            ) from err

    def load(self, name: str) -> Any:  # noqa: ANN401 - whatever the package offers
        """Import what a plug-in's entry point names.

        Raises:
            ForeseeError: (of the kind `error`) see `find`; or it cannot be imported.
        """
        entry = self.find(name)
        with self.loading(entry):
            return entry.load()


def package_of(entry: EntryPoint) -> str:
    """Return the name of the package that offers an entry point."""
    return entry.dist.name if entry.dist is not None else "unknown"


@lru_cache(maxsize=64)
def _found(group: PluginGroup, name: str, path: tuple[str, ...]) -> EntryPoint:  # noqa: ARG001 - `path` keys the cache
    """Find a plug-in; looking through all packages takes 5 ms, and a worker loads a driver for each run."""
    found = sorted(entry_points(group=group.name, name=name), key=package_of)
    if len(found) > 1 and len({entry.value for entry in found}) > 1:
        packages = ", ".join(package_of(entry) for entry in found)
        raise group.error(
            f"{group.noun} {name!r} is offered by more than one package: {packages}; uninstall all but one"
        )
    if found:
        return found[0]
    names = group.names()
    close = difflib.get_close_matches(name, names, n=3)
    hint = f", did you mean {' or '.join(repr(c) for c in close)}?" if close else ";"
    raise group.error(f"unknown {group.noun} {name!r}{hint} installed: {', '.join(names) or 'none'}")
