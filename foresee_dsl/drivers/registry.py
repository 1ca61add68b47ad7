"""The installed drivers, found through the entry-point group `foresee_dsl.drivers`.

A driver's address is its name (`pdm`); one that is made from a text has the text after a colon
(`external:python3 my_driver.py`). A name with `+ideal` (`pdm+ideal`) is the same driver with ideal sensors.
"""

from __future__ import annotations

import contextlib
import math
import re
import shlex
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import Any
from urllib.parse import unquote

from foresee_dsl.drivers.consent import IDEAL, ask
from foresee_dsl.drivers.protocol import Driver, WatchesFirst
from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.plugins import PluginGroup, package_of

DRIVERS = PluginGroup("foresee_dsl.drivers", "driver", DriverError, DriverUnavailableError)
_ADDRESS = re.compile(r"(.*? via )?(?P<address>[\w+]+:.*)", re.S)
_OURS = "foresee_"
"""How the modules of this package and of the plug-ins beside it begin: their drivers are cheap to import, and may have
a class method `check` that raises a `DriverError`."""
REFERENCES = ("idm", "frenetix", "pdm")
"""Ours: the planners that come along."""
_NOT_IN_TEXTS = ('"', "\n", "\r")
"""Signs that a text of the language cannot contain."""
_ESCAPES = (("%", "%25"), ('"', "%22"), ("\n", "%0A"), ("\r", "%0D"))
"""Characters that a text of the language cannot contain, and how they are written."""


@dataclass(frozen=True)
class DriverInfo:
    """What a list of drivers shows.

    Attributes:
        version: empty where it cannot be made; `doc` says why. unavailable: nothing is broken, it needs a package or
            weights that are not installed.
    """

    name: str
    version: str
    doc: str
    package: str
    unavailable: bool = False

    shown = "name version about=doc package"


def reference_drivers(address: str) -> tuple[str, ...]:
    """Return the drivers that a driver's failures are driven with where nobody names others.

    They are those of `REFERENCES` that are installed, but for the driver itself, which comes with ideal sensors: where
    that one passes, perception failed, not decision.
    """
    others = (name for name in REFERENCES if name != name_in(address) and _can_be_made(name))
    return (*others, *(() if sees_all(address) else (with_ideal_sensors(address),)))


def _can_be_made(name: str) -> bool:
    try:
        load_driver(name)
    except DriverError:
        return False
    return True


def driver_names() -> tuple[str, ...]:
    """Return the names of all installed drivers, sorted; nothing is imported."""
    return DRIVERS.names()


def name_in(address: str) -> str:
    """Return the name of the driver that an address means."""
    return address.partition(":")[0].removesuffix(IDEAL)


def sees_all(address: str) -> bool:
    """Whether the driver of this address is given ideal sensors."""
    return address.partition(":")[0].endswith(IDEAL)


def with_ideal_sensors(address: str) -> str:
    """Return the address of the same driver with ideal sensors."""
    _, colon, argument = address.partition(":")
    return f"{name_in(address)}{IDEAL}{colon}{argument}"


def find_driver(address: str) -> None:
    """Check that there is a driver of this name, before anything runs; drivers of other packages are not imported.

    Raises:
        DriverError: there is none (the message has close names and the list), or one of ours lacks what it needs.
    """
    entry = DRIVERS.find(name_in(address))
    if entry.module.startswith(_OURS):
        check = getattr(entry.load(), "check", None)
        if check is not None:
            check()


def load_driver(address: str) -> Driver:
    """Import and create a driver.

    Args:
        address: its name, or its name, a colon, and the text that it is made from.

    Raises:
        DriverError: no such driver (the message has close names and the list), its package is broken, it wants a text
            and there is none (or the other way round), or it is a program that was not allowed (`drivers.consent`).
    """
    name = name_in(address)
    _, colon, argument = address.partition(":")
    entry = DRIVERS.find(name)
    ask(address)
    with DRIVERS.loading(entry):
        made = entry.load()
        from_text = getattr(made, "from_argument", None)
        if colon and from_text is None:
            raise DriverError(f"driver {name!r} takes nothing after its name, so {address!r} means no driver")
        driver = made() if from_text is None else from_text(argument)
    if not isinstance(driver, Driver) or not all(isinstance(v, str) for v in (driver.name, driver.version)):
        raise DriverError(
            f"driver {name!r} of package {package_of(entry)} is not a driver: {entry.value} needs the texts `name` and "
            "`version`, and the methods `reset(mission, vehicle, seed)` and `step(observation)`"
        )
    odd = next((text for text in (driver.name, driver.version) if any(sign in text for sign in _NOT_IN_TEXTS)), None)
    if odd is not None:
        raise DriverError(
            f"driver {name!r} of package {package_of(entry)} has {odd!r} as its name or version, which the files of "
            "its failures record: leave out double quotes and line ends"
        )
    return driver


def handover_of(driver: Driver, longest_s: float) -> float:
    """Return how long a driver wants to watch at a clip's beginning, s, at most `longest_s`; most want 0.

    Raises:
        DriverError: it wants what is no number, or less than 0.
    """
    wanted = driver.handover_s if isinstance(driver, WatchesFirst) else 0.0
    if isinstance(wanted, bool) or not isinstance(wanted, int | float) or not 0 <= wanted < math.inf:
        raise DriverError(
            f"the driver {driver.name} has a handover_s of {wanted!r}; write a number of seconds, such as 1.0"
        )
    return max(min(float(wanted), longest_s), 0.0)


def recorded_driver(address: str, version: str) -> str:
    """Return how a mutant's file records its driver: `pdm 1`, `keeper 2 via external:python3 keeper.py`.

    A text of the language has no double quotes: words of a command are quoted with single ones, and any other double
    quote is written as in a web address (`%22`).
    """
    name, colon, argument = address.partition(":")
    if not colon:
        return f"{name} {version}".strip()
    with contextlib.suppress(ValueError):  # no command line: recorded as it is
        argument = shlex.join(shlex.split(argument))
    for sign, written in _ESCAPES:
        argument = argument.replace(sign, written)
    return f"{version or 'unknown'} via {name}:{argument}"


def recorded_address(recorded: str) -> str:
    """Return the address in a text of `recorded_driver`, which loads the same driver again."""
    found = _ADDRESS.fullmatch(recorded.strip())
    return unquote(found["address"]) if found else (recorded.split() or [""])[0]


def describe_drivers() -> list[DriverInfo]:
    """Return name, version, first line of the documentation and package of all installed drivers and of those of
    plug-ins beside this package that are missing, sorted by name."""
    return [_describe(name) for name in sorted((*driver_names(), *DRIVERS.missing()))]


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
    return DriverInfo(name, driver.version, doc[0] if doc else "", package)


def _made_from_text(entry: EntryPoint) -> Any:  # noqa: ANN401  a driver's class, or None
    """Return the class of a driver that is made from a text, which cannot be made to be described."""
    try:
        made = entry.load()
    except Exception:  # load_driver says why
        return None
    return made if hasattr(made, "from_argument") else None
