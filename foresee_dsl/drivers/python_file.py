"""The driver `python`: a class in a Python file, `--driver python:my_driver.py:MyDriver`, without a package of its own.

The file is read anew for each run, in foresee's own process. It is a program: a file that names one starts it only with
the user's consent (`drivers.consent`). Drivers of plug-ins that are code in a file load it with `module_of_file` too.

Modules beside the file that it imports are part of the driver: its version covers them. Two drivers may have modules of
one name (`params`), so each driver's own are those that can be imported from when it is loaded until another driver is.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import inspect
import sys
import sysconfig
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

from foresee_dsl.drivers.protocol import Driver, checked_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.files import read_outside, short_hash

USAGE = "write python:FILE.py:CLASS, such as --driver python:my_driver.py:MyDriver"


class PythonFileDriver:
    """A class in a Python file, in this process: --driver python:my_driver.py:MyDriver."""

    name, version = "python", "1"

    @staticmethod
    def from_argument(argument: str) -> Driver:
        """Create the driver of the address `python:ARGUMENT`: an object of the class in the file.

        Its version ends with a hash of the file and of the files beside it that it imports, so that results of another
        version are not taken for its own. A class without `name` and `version` gets its own name and 1.

        Raises:
            DriverError: there is no such file or class, the file cannot be executed, or the class is not a driver.
        """
        path, _, name = argument.rpartition(":")
        file = Path(path)
        if file.suffix != ".py" or not name.isidentifier():
            raise DriverError(f"python:{argument} names no class of a file; {USAGE}")
        try:
            module, version = module_of_file(file, USAGE)
            driver_type = getattr(module, name, None)
            if not callable(driver_type):
                raise DriverError(f"{path} has no class {name}; {USAGE}")
            if needed := _needed_by(driver_type):
                raise DriverError(f"{name} of {path} is created without arguments; give {needed} a default value")
            driver: Any = driver_type()
        except DriverError:
            raise
        except Exception as err:  # the file may raise anything
            raise DriverError(f"python:{argument} cannot be created: {type(err).__name__}: {err}") from err
        checked = checked_driver(driver, f"{name} of {path}", named=False)
        driver.name = str(getattr(driver, "name", name))
        driver.version = f"{getattr(driver, 'version', '1')} {version}"
        return checked


def module_of_file(file: Path, usage: str) -> tuple[ModuleType, str]:
    """Execute a driver's file anew, which can import the modules beside it.

    Args:
        usage: what to write instead, for the error of a file that cannot be read.

    Returns:
        The module, and a hash of the file and of the modules beside it that it imports.

    Raises:
        DriverError: the file cannot be read, or another module has the name of one beside it.
        Exception: the file raises it.
    """
    sources = _sources(file, usage)
    version = short_hash(*(sources[source] for source in sorted(sources)))
    _use(file, version, sources)
    return _module(file, usage), version


def _needed_by(driver_type: Callable[..., object]) -> str:
    """Return the arguments that a class cannot be created without, in words."""
    try:
        parameters = inspect.signature(driver_type).parameters.values()
    except (TypeError, ValueError):  # a class of a library in C may have no signature
        return ""
    return ", ".join(
        p.name for p in parameters if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    )


@dataclass
class _Beside:
    """The modules beside a driver's file that it imports; a finder of Python's import system.

    Attributes:
        folder: the folder of the file. version: hash of the file and these modules. names: their names, for a module in
            a package the package's. modules: what was imported, while another driver drives.
    """

    folder: Path
    version: str
    names: frozenset[str]
    modules: dict[str, ModuleType] = field(default_factory=dict)

    def find_spec(self, name: str, path: object = None, _target: object = None) -> ModuleSpec | None:
        """Find a module beside the file; `path` is None unless the module is inside a package."""
        return PathFinder.find_spec(name, [str(self.folder)]) if path is None and name in self.names else None

    def put_away(self) -> None:
        """Let no other driver import these modules; who has imported them keeps them."""
        if self in sys.meta_path:
            sys.meta_path.remove(self)
        loaded = [(name, sys.modules[name]) for name in self.names if name in sys.modules]
        own = {name for name, module in loaded if self.has(getattr(module, "__spec__", None))}
        self.modules |= {name: sys.modules.pop(name) for name in (*sys.modules,) if name.partition(".")[0] in own}

    def put_back(self) -> None:
        """Let the driver import these modules, also while it drives.

        Raises:
            DriverError: a module of the process, of Python or of an installed package has one of the names.
        """
        for name in sorted(self.names):
            if not self._is_free(name):
                raise DriverError(
                    f"the driver in {self.folder} imports {name}, and another module called {name} is in use already; "
                    "give the file beside the driver another name"
                )
        sys.modules.update(self.modules)
        self.modules.clear()
        sys.meta_path.insert(0, self)

    def has(self, spec: ModuleSpec | None) -> bool:
        """Return whether a module is a file or a package of this folder."""
        if spec is None:  # a program made the module
            return False
        places = (*(spec.submodule_search_locations or ()), *([spec.origin] if spec.origin else ()))
        return any(Path(place).parent.resolve() == self.folder for place in places)

    def _is_free(self, name: str) -> bool:
        if name in sys.modules:
            return False
        installed = [folder for folder in sys.path if folder in sysconfig.get_paths().values()]
        spec = PathFinder.find_spec(name, installed)
        return name not in sys.stdlib_module_names and (spec is None or spec.origin is None or self.has(spec))


_all: dict[Path, _Beside] = {}
"""The modules beside the files of all drivers that were loaded in this process, by file."""


def _use(file: Path, version: str, sources: Mapping[Path, bytes]) -> None:
    """Let a driver import the modules beside its file, and not those that another driver or an older version imported.

    Raises:
        DriverError: another module has one of their names.
    """
    for other in _all.values():
        other.put_away()
    file = file.resolve()
    own = _all.get(file)
    if own is None or own.version != version:
        importlib.invalidate_caches()
        names = {source.relative_to(file.parent).parts[0].removesuffix(".py") for source in sources if source != file}
        own = _all[file] = _Beside(file.parent, version, frozenset(names - {__name__.partition(".")[0]}))
        own.put_away()
        own.modules.clear()
    own.put_back()


def _module(file: Path, usage: str) -> ModuleType:
    """Execute a file and return it as a module; modules beside it can be imported, as by a program."""
    folder = str(file.resolve().parent)
    if folder not in sys.path:  # for modules whose names the file computes
        sys.path.append(folder)  # at the end, so that a file beside the driver replaces no module of foresee
    spec = importlib.util.spec_from_file_location(f"foresee_driver_{file.stem}", file.resolve())
    if spec is None or spec.loader is None:
        raise DriverError(f"{file} is not a Python file; {usage}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up while the file is executed
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # a stored one hides edits of the same second
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = writes
    return module


def _sources(file: Path, usage: str) -> dict[Path, bytes]:
    """Return the contents of a file and of the modules beside it that it imports, also by way of each other."""
    try:
        sources = {file.resolve(): read_outside(file)}
    except OSError as err:
        raise DriverError(f"the driver {file} cannot be read: {err.strerror or err}; {usage}") from None
    waiting = [file := file.resolve()]
    while waiting:
        for module in _imports(sources[waiting.pop()]):
            beside = file.parent.joinpath(*module.split("."))
            for source in (beside.with_suffix(".py"), beside / "__init__.py"):
                if source not in sources and source.is_file():
                    sources[source] = read_outside(source)
                    waiting.append(source)
    return sources


def _imports(source: bytes) -> Iterator[str]:
    """Yield the modules that a source imports, and what it imports from them, as `package.module`."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):  # executing the file reports it
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (".".join(filter(None, (node.module, alias.name))) for alias in node.names)
            if node.module:
                yield node.module
