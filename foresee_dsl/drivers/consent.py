"""Decides whether a program that a file names as a driver may be started: only with the user's consent, which is an
option or an entry in the configuration file.

Opening a file from someone else must not run a command. A driver in another program has a colon in its address
(`external:python3 mine.py`); other drivers are packages that the user has installed.

`drivers.registry.load_driver` starts no program that is not allowed here, so that no command can forget the check. A
task that runs in another process passes on the programs that were allowed when it was created.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from foresee_dsl.drivers.parts import without_ideal
from foresee_dsl.errors import DriverError
from foresee_dsl.files import read_outside_text

VARIABLE = "FORESEE_CONFIG"
"""The environment variable that names another configuration file."""
KEY = "run-programs-in"
_SHOWN = 5
_ALLOWED: ContextVar[frozenset[str]] = ContextVar("_ALLOWED", default=frozenset())


def configuration() -> Path:
    """Return the user's configuration file: `$FORESEE_CONFIG`, or `foresee-dsl/config.toml` under `~/.config`."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "foresee-dsl" / "config.toml"


def allow(*addresses: str) -> None:
    """Allow the programs of these drivers' addresses to be started, with any sensors. Other drivers need no consent."""
    _ALLOWED.set(_ALLOWED.get() | {_program(address) for address in addresses if is_program(address)})


@contextmanager
def allowing(addresses: Iterable[str]) -> Iterator[None]:
    """Allow these programs within the block.

    Programs that are allowed inside the block are forbidden again after it, too.
    """
    token = _ALLOWED.set(_ALLOWED.get())
    try:
        allow(*addresses)
        yield
    finally:
        _ALLOWED.reset(token)


def allowed() -> frozenset[str]:
    """Return the addresses of the programs that are allowed now."""
    return _ALLOWED.get()


def may_start(address: str) -> bool:
    """Return whether a driver may be created: it is an installed package, or a program to which the user has
    consented.
    """
    return not is_program(address) or _program(address) in _ALLOWED.get()


def ask(address: str) -> None:
    """Raise unless the driver may be created.

    Raises:
        DriverError: the driver is a program that is not allowed; the message explains how to allow it.
    """
    if not may_start(address):
        raise DriverError(
            f"{address} is a program, which starts only with your consent: name it with --driver "
            f"(in Python: foresee_dsl.drivers.consent.allow({address!r}))"
        )


def without_parent(address: str) -> str:
    """Return the note that a mutant's parent is not shown, because running the parent would start a program."""
    return (
        "its parent is not shown: running it would start the program that the trace names as its driver; "
        f"--driver {shlex.quote(address)} allows it"
    )


def refuse_programs(named: Iterable[tuple[str, Path]], instead: str, *, unless: bool = False) -> None:
    """Raise unless every program that a file names as a driver lies in a folder that the user has allowed.

    Args:
        named: addresses of drivers, each with the file that names it. instead: what the user can do, for the message.
        unless: whether the user has consented to all of them (`--run-programs`).

    Raises:
        DriverError: a program is not allowed, or the configuration cannot be read.
    """
    programs = dict.fromkeys((address, file) for address, file in named if not may_start(address))
    if not programs:
        return
    refused = set() if unless else _not_granted(programs)
    if refused:
        addresses = sorted(refused)
        more = f"; and {len(addresses) - _SHOWN} more" if len(addresses) > _SHOWN else ""
        raise DriverError(
            f"the files name programs as drivers: {'; '.join(addresses[:_SHOWN])}{more}. {instead}; or write "
            f'`{KEY} = ["FOLDER"]` in {configuration()} if you trust all files of a folder'
        )
    allow(*(address for address, _ in programs))


def is_program(address: str) -> bool:
    """Return whether a driver's address names something that is started only with consent."""
    return ":" in address


def _program(address: str) -> str:
    name, _, argument = address.partition(":")
    return f"{without_ideal(name)}:{argument}"


def _not_granted(programs: Iterable[tuple[str, Path]]) -> set[str]:
    folders = _granted()
    return {address for address, file in programs if not any(_lies_in(file, folder) for folder in folders)}


def _lies_in(file: Path, folder: Path) -> bool:
    return file.resolve().is_relative_to(folder)


def _granted() -> tuple[Path, ...]:
    """Return the folders whose files may name programs, with links resolved."""
    import tomllib

    file = configuration()
    try:
        entries = tomllib.loads(read_outside_text(file)).get(KEY, [])
    except FileNotFoundError:
        return ()
    except (OSError, ValueError) as err:
        raise DriverError(f"the configuration {file} cannot be read: {err}") from err
    if not isinstance(entries, list) or not all(isinstance(folder, str) for folder in entries):
        raise DriverError(f'the configuration {file}: {KEY} must be a list of folders: {KEY} = ["/home/me/scenarios"]')
    folders = [Path(folder).expanduser() for folder in entries]
    for folder in folders:
        if not folder.is_absolute():
            raise DriverError(
                f"the configuration {file}: {KEY} must have absolute paths; {str(folder)!r} is not absolute"
            )
    return tuple(folder.resolve() for folder in folders)
