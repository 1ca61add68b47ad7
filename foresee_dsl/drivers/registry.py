"""Finds and loads the installed drivers, the entry points of the group `foresee_dsl.drivers`.

A driver's address is its name (`pdm`); a driver that takes an argument has it after a colon (`external:python3
my_driver.py`). A name with `+ideal` (`pdm+ideal`) is the same driver with ideal sensors, one with `+ideal_tracking`
with ideal tracking, and so on for each part (`drivers.parts`).
"""

from __future__ import annotations

import contextlib
import math
import re
import shlex
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from foresee_dsl.drivers.consent import ask
from foresee_dsl.drivers.parts import IDEAL, DriverPart, ideal_parts, parts_of, with_ideal, without_ideal
from foresee_dsl.drivers.protocol import Driver, WatchesFirst, checked_driver
from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.plugins import PluginGroup, package_of

DRIVERS = PluginGroup("foresee_dsl.drivers", "driver", DriverError, DriverUnavailableError)
_ADDRESS = re.compile(r"(.*? via )?(?P<address>[\w+]+:.*)", re.S)
_OURS = "foresee_"
"""Prefix of the modules of this package and of the plug-ins in its repository. Their drivers are cheap to import, and
may have a class method `check` that raises a `DriverError`."""
REFERENCES = ("idm", "frenetix", "pdm")
"""The bundled planners that drive the failures of another driver again, for comparison. Ours."""
_NOT_IN_TEXTS = ('"', "\n", "\r")
"""Characters that a text of the language cannot contain."""
_ESCAPES = (("%", "%25"), ('"', "%22"), ("\n", "%0A"), ("\r", "%0D"))
"""Characters that a text of the language cannot contain, and their escapes."""


@dataclass(frozen=True)
class DriverInfo:
    """An entry of the list of drivers.

    Attributes:
        version: empty if the driver cannot be created; then `doc` states the reason. unavailable: whether the driver is
            sound and only needs a package or weights that are not installed.
    """

    name: str
    version: str
    doc: str
    package: str
    unavailable: bool = False

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"name": self.name, "version": self.version, "about": self.doc, "package": self.package}


def reference_drivers(address: str) -> tuple[str, ...]:
    """Return the drivers that by default drive a driver's failures again.

    These are the installed drivers of `REFERENCES` except the driver itself, and the same driver with ideal sensors: if
    that one passes, the perception failed, not the decision.
    """
    others = (name for name in REFERENCES if name != name_in(address) and _can_be_made(name))
    return (*others, *(() if sees_all(address) else (with_ideal_sensors(address),)))


def _can_be_made(name: str) -> bool:
    try:
        load_driver(name)
    except DriverError:
        return False
    return True


def name_in(address: str) -> str:
    """Return the name of the driver in an address, without its argument."""
    return without_ideal(address.partition(":")[0])


def files_in(address: str) -> tuple[Path, ...]:
    """Return the existing files that the argument of an address names: words of a command line, or the file of a
    class (`my_driver.py:MyDriver`).
    """
    argument = address.partition(":")[2]
    try:
        words = shlex.split(argument)
    except ValueError:  # not a command line
        words = [argument]
    places = (next(filter(Path.is_file, map(Path, (word, word.rpartition(":")[0]))), None) for word in words)
    return tuple(file for file in places if file is not None)


def sees_all(address: str) -> bool:
    """Return whether the driver of this address gets ideal sensors."""
    return DriverPart.PERCEPTION in ideal_parts(address)


def with_ideal_sensors(address: str) -> str:
    """Return the address of the same driver with ideal sensors."""
    return with_ideal(address, ideal_parts(address) | {DriverPart.PERCEPTION})


def find_driver(address: str) -> None:
    """Check before a run that the driver of an address exists; drivers of other packages are not imported.

    Raises:
        DriverError: there is no such driver (the message has similar names and the list), or a driver of ours lacks a
            requirement.
    """
    entry = _entry_of(name_in(address))
    if entry.module.startswith(_OURS):
        check = getattr(entry.load(), "check", None)
        if check is not None:
            check()


def _entry_of(name: str) -> EntryPoint:
    """Return the entry point of a driver of this name, which has no suffixes of ideal parts."""
    if IDEAL in name:
        suffixes = ", ".join(with_ideal("", [part]) for part in DriverPart)
        raise DriverError(f"{name!r} names no part of a driver that can be ideal; write one or more of {suffixes}")
    return DRIVERS.find(name)


def load_driver(address: str) -> Driver:
    """Import and create a driver.

    Args:
        address: its name, or its name, a colon, and its argument.

    Raises:
        DriverError: there is no such driver (the message has similar names and the list), its package is broken, its
            argument is missing or not allowed, or it is a program without consent (`drivers.consent`).
    """
    name = name_in(address)
    _, colon, argument = address.partition(":")
    entry = _entry_of(name)
    ask(address)
    with DRIVERS.loading(entry):
        factory = entry.load()
        from_text = getattr(factory, "from_argument", None)
        if colon and from_text is None:
            raise DriverError(f"driver {name!r} takes no argument; write {name!r} instead of {address!r}")
        candidate = factory() if from_text is None else from_text(argument)
    driver = checked_driver(candidate, f"driver {name!r} of package {package_of(entry)} ({entry.value})")
    if missing := ideal_parts(address) - frozenset(parts_of(driver)):
        raise DriverError(
            f"driver {name!r} does not declare its {', '.join(sorted(missing))}, so it cannot be driven as "
            f"{address!r}: it has {', '.join(parts_of(driver))} (docs/reference/drivers.md#parts)"
        )
    odd = next((text for text in (driver.name, driver.version) if any(sign in text for sign in _NOT_IN_TEXTS)), None)
    if odd is not None:
        raise DriverError(
            f"driver {name!r} of package {package_of(entry)} has {odd!r} as its name or version, which the files of "
            "its failures record: leave out double quotes and line ends"
        )
    return driver


def handover_of(driver: Driver, longest_s: float) -> float:
    """Return how long a driver needs to watch at a clip's beginning, s, at most `longest_s`; usually 0.

    Raises:
        DriverError: the driver's value is negative or not a number.
    """
    wanted = driver.handover_s if isinstance(driver, WatchesFirst) else 0.0
    if isinstance(wanted, bool) or not isinstance(wanted, int | float) or not 0 <= wanted < math.inf:
        raise DriverError(
            f"the driver {driver.name} has a handover_s of {wanted!r}; write a number of seconds, such as 1.0"
        )
    return max(min(float(wanted), longest_s), 0.0)


def recorded_driver(address: str, version: str) -> str:
    """Return the text with which a mutant's file records its driver: `pdm 1`, `keeper 2 via external:python3
    keeper.py`.

    A text of the language cannot contain double quotes: words of a command are quoted with single quotes, and any other
    double quote is written as in a web address (`%22`).
    """
    name, colon, argument = address.partition(":")
    if not colon:
        return f"{name} {version}".strip()
    with contextlib.suppress(ValueError):  # not a command line: recorded unchanged
        argument = shlex.join(shlex.split(argument))
    for sign, written in _ESCAPES:
        argument = argument.replace(sign, written)
    return f"{version or 'unknown'} via {name}:{argument}"


def recorded_address(recorded: str) -> str:
    """Return the address in a text of `recorded_driver`; it loads the same driver."""
    match = _ADDRESS.fullmatch(recorded.strip())
    return unquote(match["address"]) if match else (recorded.split() or [""])[0]


def describe_drivers() -> list[DriverInfo]:
    """Return name, version, first line of the documentation and package of all installed drivers, and of the drivers of
    our plug-ins that are not installed, sorted by name."""
    return [_describe(name) for name in sorted((*DRIVERS.names(), *DRIVERS.missing()))]


def _describe(name: str) -> DriverInfo:
    if name in DRIVERS.missing():
        return DriverInfo(name, "", f"the driver {name!r} {DRIVERS.beside(name)}", "", unavailable=True)
    entry = DRIVERS.find(name)
    package = package_of(entry)
    try:
        driver = _made_from_text(entry) or load_driver(name)
    except DriverError as err:
        return DriverInfo(name, "", str(err), package, isinstance(err, DriverUnavailableError))
    kind = driver if isinstance(driver, type) else type(driver)
    doc = (kind.__doc__ or "").strip().splitlines()
    version = getattr(driver, "version", "")  # the class need not have a version, even if its objects have one
    return DriverInfo(name, version if isinstance(version, str) else "", doc[0] if doc else "", package)


def _made_from_text(entry: EntryPoint) -> Any:  # noqa: ANN401  a driver's class, or None
    """Return the class of a driver that takes an argument and so cannot be created for a description; None for other
    drivers.
    """
    try:
        kind = entry.load()
    except Exception:  # `load_driver` reports the reason
        return None
    return kind if hasattr(kind, "from_argument") else None
