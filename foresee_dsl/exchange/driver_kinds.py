"""The kinds of drivers that `foresee init` writes: each is a folder with the files of a small driver that works.

The folder has a file `kind.toml`, and any other files, which are copied into the project; one that ends with `.j2` is a
template. The bundled kinds are the folders of `templates/init/drivers`. A package adds a kind by an entry point of the
group `foresee_dsl.driver_kinds`, whose value is the (light) package that is the folder.
"""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import data_folder, read_outside_text, templates
from foresee_dsl.plugins import PluginGroup, package_of


class DriverKindError(ForeseeError):
    """There is no such kind of driver, or its folder is broken."""


DRIVER_KINDS = PluginGroup("foresee_dsl.driver_kinds", "kind of driver", DriverKindError)
_DESCRIPTION = "kind.toml"
_NOT_COPIED = (_DESCRIPTION, "__init__.py")
_TEMPLATE = ".j2"


@dataclass(frozen=True)
class DriverKind:
    """A kind of driver.

    Attributes:
        about: one line for the list. driver: the address of the driver in the project.
        build: commands that build it. needs: programs that these commands call. ignore: names for `.gitignore`.
        install: requirement that pip installs before; "" if foresee alone is enough.
    """

    name: str
    folder: Path
    about: str
    driver: str
    build: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    install: str = ""

    @property
    def missing(self) -> tuple[str, ...]:
        """Return the programs of `needs` that are not in the search path."""
        return tuple(program for program in self.needs if shutil.which(program) is None)

    def sources(self) -> dict[str, Path]:
        """Return the files of the driver: the path in the project, and the file or template."""
        listed = sorted(file for file in self.folder.rglob("*") if file.is_file() and "__pycache__" not in file.parts)
        return {
            file.relative_to(self.folder).as_posix().removesuffix(_TEMPLATE): file
            for file in listed
            if file.relative_to(self.folder).as_posix() not in _NOT_COPIED
        }

    def texts(self, values: Mapping[str, object]) -> dict[str, str]:
        """Return the text of each file of the driver by its path in the project; templates get the values."""
        environment = templates(str(self.folder), markup=False)
        return {
            name: environment.get_template(file.relative_to(self.folder).as_posix()).render(values)
            if file.suffix == _TEMPLATE
            else read_outside_text(file)
            for name, file in self.sources().items()
        }


def driver_kinds() -> dict[str, DriverKind]:
    """Return all kinds by name: the bundled ones, then those of other packages.

    Raises:
        DriverKindError: the folder of a package is broken.
    """
    bundled = data_folder("templates") / "init" / "drivers"
    kinds = {folder.name: _kind(folder.name, folder) for folder in sorted(bundled.iterdir()) if folder.is_dir()}
    for entry in DRIVER_KINDS.entries():
        if entry.name in kinds:
            raise DriverKindError(
                f"package {package_of(entry)} adds a kind of driver {entry.name!r}, which exists already: uninstall it"
            )
        with DRIVER_KINDS.loading(entry):
            kinds[entry.name] = _kind(entry.name, Path(str(files(entry.load()))))
    return kinds


def _kind(name: str, folder: Path) -> DriverKind:
    file = folder / _DESCRIPTION
    try:
        description = tomllib.loads(read_outside_text(file))
        lists = {key: tuple(description.get(key, ())) for key in ("build", "needs", "ignore")}
        return DriverKind(
            name, folder, description["about"], description["driver"], install=description.get("install", ""), **lists
        )
    except (OSError, ValueError, KeyError) as err:
        raise DriverKindError(f"the kind of driver {name!r} has no sound {file}: {err!r}") from err
