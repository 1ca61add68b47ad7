"""Creates a planner from its address: a class with arguments, or one of nuPlan's own configuration files."""

from __future__ import annotations

import importlib
import importlib.util
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.files import read_outside, short_hash

USAGE = "write nuplan:MODULE:CLASS, nuplan:FILE.py:CLASS, nuplan:MODULE:CLASS:ARGUMENTS or nuplan:CONFIGURATION.yaml"
NEEDS = (
    "planners of nuPlan need nuplan-devkit, which is on no package index: pip install 'foresee-bridges[nuplan]', and "
    "pip install --no-deps git+https://github.com/motional/nuplan-devkit"
)
_TARGET = "_target_"
"""The key with which hydra's configurations name a class."""


def check_installed() -> None:
    """Raise unless nuplan-devkit is installed.

    Raises:
        DriverUnavailableError: it is not.
    """
    if importlib.util.find_spec("nuplan") is None:
        raise DriverUnavailableError(NEEDS)


def new_planner(argument: str) -> tuple[Any, str]:
    """Return the planner of the address `nuplan:ARGUMENT`, and a digest of the files that describe it.

    Raises:
        DriverError: there is no such file, module or class, or its arguments do not fit.
    """
    if argument.endswith((".yaml", ".yml", ".json")) and argument.count(":") == 0:
        content = _content(argument)
        settings = _parsed(content, argument)
        inner = next(iter(settings.values()), None)
        if _TARGET not in settings and len(settings) == 1 and isinstance(inner, Mapping):
            settings = inner  # nuPlan's files have the planner under its name
        if _TARGET not in settings:
            raise DriverError(f"nuplan:{argument} has no {_TARGET}; {USAGE}")
        return _created(settings, argument), (short_hash(content) if content else "1")
    module, _, rest = argument.partition(":")
    name, _, arguments = rest.partition(":")
    if not module or not name.isidentifier():
        raise DriverError(f"nuplan:{argument} names no planner; {USAGE}")
    content = b""
    if module.endswith(".py"):
        content = _content(module)
        module = _file_module(Path(module)).__name__
    if arguments.endswith((".yaml", ".yml", ".json")):
        content += (text := _content(arguments))
        settings = _parsed(text, argument)
    else:
        content += arguments.encode()
        settings = _parsed(arguments.encode(), argument) if arguments else {}
    return _created({_TARGET: f"{module}.{name}", **settings}, argument), (short_hash(content) if content else "1")


def _created(settings: Mapping[str, Any], argument: str) -> Any:
    """Create the object that a configuration names, and those within it, as hydra does for nuPlan."""
    module, _, name = str(settings[_TARGET]).rpartition(".")
    arguments = {key: value for key, value in settings.items() if not key.startswith("_")}
    try:
        factory = getattr(importlib.import_module(module), name)
        return factory(**{key: _value(value, argument) for key, value in arguments.items()})
    except DriverError:
        raise
    except Exception as err:  # the module and its class may raise anything
        raise DriverError(f"nuplan:{argument} cannot be created: {type(err).__name__}: {err}; {USAGE}") from err


def _value(value: Any, argument: str) -> Any:
    if isinstance(value, Mapping):
        return _created(value, argument) if _TARGET in value else {k: _value(v, argument) for k, v in value.items()}
    if isinstance(value, str) and "${" in value:
        raise DriverError(f"nuplan:{argument}: {value} refers to other configurations; write its value")
    return [_value(part, argument) for part in value] if isinstance(value, list) else value


def _parsed(content: bytes, argument: str) -> Mapping[str, Any]:
    """Return the mapping that YAML, of which JSON is a part, describes."""
    try:
        import yaml

        settings = yaml.safe_load(content)
    except ModuleNotFoundError:
        try:
            settings = json.loads(content)
        except ValueError:
            raise DriverUnavailableError(
                f"nuplan:{argument} needs PyYAML: pip install 'foresee-bridges[nuplan]'"
            ) from None
    except yaml.YAMLError as err:
        raise DriverError(f"nuplan:{argument}: the arguments are not YAML: {' '.join(str(err).split())}") from None
    if not isinstance(settings, Mapping):
        raise DriverError(
            f"nuplan:{argument}: the arguments must be names with values, such as {{target_velocity: 10}}"
        )
    return settings


def _file_module(file: Path) -> ModuleType:
    name, place = file.stem, str(file.resolve())
    module = sys.modules.get(name)
    if module is not None and getattr(module, "__file__", None) == place:
        return module
    spec = importlib.util.spec_from_file_location(name, place)
    if module is not None or spec is None or spec.loader is None:
        raise DriverError(f"nuplan:{file}: a module called {name} is in use already; give the file another name")
    if str(file.resolve().parent) not in sys.path:
        sys.path.insert(0, str(file.resolve().parent))
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as err:  # the module may raise anything
        del sys.modules[name]
        raise DriverError(f"nuplan:{file} cannot be loaded: {type(err).__name__}: {err}") from err
    return module


def _content(path: str) -> bytes:
    try:
        return read_outside(Path(path))
    except OSError as err:
        raise DriverError(f"nuplan:{path}: {err.strerror or err}; {USAGE}") from None
