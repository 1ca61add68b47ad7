"""Imports the module of an agent and creates the agent, as CARLA's leaderboard does."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from foresee_bridges.carla.world import CarlaModule
from foresee_dsl.errors import DriverError

API = Path(__file__).parent / "api"
"""The folder with the parts of `leaderboard`, `srunner` and `agents` that agents import."""
USAGE = "write carla:FILE.py, carla:FILE.py:CLASS or carla:FILE.py:CLASS:CONFIGURATION"
_SERVER = ("localhost", 2000, False)
"""Host, port and `debug` that leaderboard 2.0 passes to agents; a run has no server there."""


def carla_module() -> CarlaModule:
    """Return the module `carla` that agents import: the types of the installed package, or ours, without a world."""
    present = sys.modules.get("carla")
    if isinstance(present, CarlaModule):
        return present
    try:
        types = importlib.import_module("carla")
    except ModuleNotFoundError:
        types = importlib.import_module("foresee_bridges.carla.carla_types")
    sys.modules["carla"] = module = CarlaModule(types)
    return module


def agent_class(file: Path, name: str) -> type:
    """Return an agent's class; an empty `name` means that of the file's `get_entry_point()`.

    The file's folder goes to the front of the module search path, as in the leaderboard, because agents import
    modules that lie beside them.

    Raises:
        DriverError: the file cannot be imported, or names no agent.
    """
    carla_module()
    for folder, at in ((str(API), len(sys.path)), (str(file.resolve().parent), 0)):
        if folder not in sys.path:
            sys.path.insert(at, folder)
    try:
        module = _imported(file)
        agent_type = getattr(module, name or module.get_entry_point())
    except Exception as err:  # the module may raise anything
        missing = "; it has no get_entry_point(), so name its class" if not name else ""
        raise DriverError(
            f"carla:{file} cannot be loaded: {type(err).__name__}: {err}"
            f"{missing if isinstance(err, AttributeError) else ''}; {USAGE}"
        ) from err
    if not (isinstance(agent_type, type) and callable(getattr(agent_type, "run_step", None))):
        raise DriverError(
            f"carla:{file}: {agent_type!r} is not an agent: a class with setup, sensors and run_step; {USAGE}"
        )
    if getattr(agent_type, "get_ros_version", lambda: -1)() != -1:
        raise DriverError(f"carla:{file}: {agent_type.__name__} drives through ROS, which this bridge does not start")
    return agent_type


def new_agent(agent_type: type, configuration: str, plan: tuple[Any, Any]) -> Any:
    """Create an agent and set it up.

    Leaderboard 2.0 creates the agent with the address of CARLA's server, passes the route and calls `setup`. An agent
    of leaderboard 1.0, which is recognised by a constructor with one argument, gets its configuration there, is set up
    by its constructor, and gets the route last.
    """
    parameters = inspect.signature(agent_type).parameters.values()
    required = [p for p in parameters if p.default is p.empty and p.kind <= p.POSITIONAL_OR_KEYWORD]
    if len(required) == 1 and required[0].name != "carla_host":
        agent = agent_type(configuration)
        agent.set_global_plan(*plan)
        return agent
    agent = agent_type(*(_SERVER[: max(len(required), 2)] if parameters else ()))
    agent.set_global_plan(*plan)
    agent.setup(configuration)
    if getattr(agent, "_global_plan", plan) is None:  # `setup` of some agents of leaderboard 1.0 forgets the route
        agent.set_global_plan(*plan)
    return agent


def _imported(file: Path) -> ModuleType:
    name, place = file.stem, str(file.resolve())
    module = sys.modules.get(name)
    if module is not None:
        if getattr(module, "__file__", None) == place:
            return module
        raise ImportError(f"a module called {name} is in use already; give the file another name")
    spec = importlib.util.spec_from_file_location(name, place)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
