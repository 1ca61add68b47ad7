"""Programs that files name as drivers start only with the user's consent: an option, or a line in the configuration.

A file that somebody sends must not run a command by being looked at. A driver in another program is recognised by the
colon in its address (`external:python3 mine.py`); other drivers are packages that the user has installed.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from foresee_dsl.errors import DriverError
from foresee_dsl.files import read_outside_text

VARIABLE = "FORESEE_CONFIG"
"""The environment variable that names another configuration file."""
KEY = "run-programs-in"
_SHOWN = 5


def configuration() -> Path:
    """Return the user's configuration file: `$FORESEE_CONFIG`, or `foresee-dsl/config.toml` under `~/.config`."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "foresee-dsl" / "config.toml"


def refuse_programs(named: Iterable[tuple[str, Path]], instead: str) -> None:
    """Refuse to start programs that files name as drivers, but in folders for which the user's configuration allows it.

    Args:
        named: drivers' addresses, each with the file that names it. instead: what the user can do.

    Raises:
        DriverError: there are programs among the drivers, or the configuration cannot be read.
    """
    found = dict.fromkeys((address, file) for address, file in named if ":" in address)
    if not found:
        return
    folders = _granted()
    refused = sorted({address for address, file in found if not any(_lies_in(file, folder) for folder in folders)})
    if refused:
        more = f"; and {len(refused) - _SHOWN} more" if len(refused) > _SHOWN else ""
        raise DriverError(
            f"the files name programs as drivers: {'; '.join(refused[:_SHOWN])}{more}. {instead}; or write "
            f'`{KEY} = ["FOLDER"]` in {configuration()} if you trust all files of a folder'
        )


def _lies_in(file: Path, folder: Path) -> bool:
    return file.resolve().is_relative_to(folder)


def _granted() -> tuple[Path, ...]:
    """Return the folders, links followed, whose files may name programs."""
    import tomllib

    file = configuration()
    try:
        found = tomllib.loads(read_outside_text(file)).get(KEY, [])
    except FileNotFoundError:
        return ()
    except (OSError, ValueError) as err:
        raise DriverError(f"the configuration {file} cannot be read: {err}") from err
    if not isinstance(found, list) or not all(isinstance(folder, str) for folder in found):
        raise DriverError(f'the configuration {file}: {KEY} is a list of folders: {KEY} = ["/home/me/scenarios"]')
    folders = [Path(folder).expanduser() for folder in found]
    for folder in folders:
        if not folder.is_absolute():
            raise DriverError(f"the configuration {file}: {KEY} needs whole paths, and {str(folder)!r} is none")
    return tuple(folder.resolve() for folder in folders)
