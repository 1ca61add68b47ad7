"""The driver `python`: a class in a Python file, `--driver python:my_driver.py:MyDriver`, without a package of its own.

The file is read anew for each run, in foresee's own process. It is a program: a file that names one starts it only with
the user's consent (`drivers.consent`).
"""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from foresee_dsl.drivers.protocol import Driver
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
        version = _version(file)
        try:
            driver = getattr(_module(file), name)()
        except DriverError:
            raise
        except AttributeError as err:
            if err.name != name:
                raise DriverError(f"python:{argument} cannot be created: {err}") from err
            raise DriverError(f"{path} has no class {name}; {USAGE}") from err
        except Exception as err:  # the file may raise anything
            raise DriverError(f"python:{argument} cannot be created: {type(err).__name__}: {err}") from err
        if missing := [method for method in ("reset", "step") if not callable(getattr(driver, method, None))]:
            raise DriverError(
                f"{name} of {path} is not a driver: it has no method {' and no method '.join(missing)}; a driver has "
                "reset(mission, vehicle, seed) and step(observation)"
            )
        driver.name = str(getattr(driver, "name", name))
        driver.version = f"{getattr(driver, 'version', '1')} {version}"
        checked: Driver = driver
        return checked


def _module(file: Path) -> ModuleType:
    """Execute a file and return it as a module; modules beside it can be imported, as by a program."""
    folder = str(file.resolve().parent)
    if folder not in sys.path:
        sys.path.append(folder)  # at the end, so that a file beside the driver replaces no module of foresee
    spec = importlib.util.spec_from_file_location(f"foresee_driver_{file.stem}", file.resolve())
    if spec is None or spec.loader is None:
        raise DriverError(f"{file} is not a Python file; {USAGE}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up while the file is executed
    spec.loader.exec_module(module)
    return module


def _version(file: Path) -> str:
    """Return a hash of a file and of the modules beside it that it imports, also by way of each other."""
    try:
        sources = {file: read_outside(file)}
    except OSError as err:
        raise DriverError(f"the driver {file} cannot be read: {err.strerror or err}; {USAGE}") from None
    waiting = [file]
    while waiting:
        for module in _imports(sources[waiting.pop()]):
            beside = file.parent.joinpath(*module.split("."))
            for source in (beside.with_suffix(".py"), beside / "__init__.py"):
                if source not in sources and source.is_file():
                    sources[source] = read_outside(source)
                    waiting.append(source)
    return short_hash(*(sources[source] for source in sorted(sources)))


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
