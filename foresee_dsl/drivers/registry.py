"""The drivers that are installed: found through the entry-point group `foresee_dsl.drivers`."""

from __future__ import annotations

import difflib
from importlib.metadata import EntryPoint, entry_points
from typing import NamedTuple

from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.errors import DriverError

GROUP = "foresee_dsl.drivers"


class DriverInfo(NamedTuple):
    """What a list of drivers shows. `version` is empty and `doc` says why where a plug-in is broken."""

    name: str
    version: str
    doc: str
    package: str


def driver_names() -> tuple[str, ...]:
    """Return the names of all installed drivers, sorted; nothing is imported."""
    return tuple(sorted({e.name for e in entry_points(group=GROUP)}))


def load_driver(name: str) -> Driver:
    """Import and create a driver.

    Raises:
        DriverError: no such driver (the message has close names and the list), or its package is broken.
    """
    entry = _find(name)
    package = _package(entry)
    try:
        driver = entry.load()()
    except Exception as err:  # a plug-in may fail in any way; whose fault it is must be said
        raise DriverError(
            f"driver {name!r} of package {package} cannot be loaded: {type(err).__name__}: {err}"
        ) from err
    if not isinstance(driver, Driver) or not all(isinstance(v, str) for v in (driver.name, driver.version)):
        raise DriverError(
            f"driver {name!r} of package {package} is not a driver: {entry.value} needs the texts `name` and "
            "`version`, and the methods `reset(mission, vehicle, seed)` and `step(observation)`"
        )
    return driver


def describe_drivers() -> list[DriverInfo]:
    """Return name, version, first line of the documentation and package of all installed drivers, sorted by name."""
    return [_describe(name) for name in driver_names()]


def _describe(name: str) -> DriverInfo:
    package = _package(_find(name))
    try:
        driver = load_driver(name)
    except DriverError as err:
        return DriverInfo(name, "", str(err), package)
    doc = (type(driver).__doc__ or "").strip().splitlines()
    return DriverInfo(name, driver.version, doc[0] if doc else "", package)


def _find(name: str) -> EntryPoint:
    found = sorted(entry_points(group=GROUP, name=name), key=_package)
    if len(found) > 1 and len({e.value for e in found}) > 1:
        packages = ", ".join(_package(e) for e in found)
        raise DriverError(f"driver {name!r} is offered by more than one package: {packages}; uninstall all but one")
    if found:
        return found[0]
    names = driver_names()
    close = difflib.get_close_matches(name, names, n=3)
    hint = f", did you mean {' or '.join(repr(c) for c in close)}?" if close else ";"
    raise DriverError(f"unknown driver {name!r}{hint} installed: {', '.join(names) or 'none'}")


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "unknown"
