"""What agents ask of CARLA's world, which a run does not have: each raises an error that says what is missing."""

from __future__ import annotations

from types import ModuleType
from typing import NoReturn

from foresee_dsl.errors import DriverError

GIVEN = (
    "an agent gets its sensors (GNSS, IMU, speedometer, OpenDRIVE map, camera, lidar) and the route of set_global_plan"
)
WORLD_TYPES = (
    *("Actor", "ActorBlueprint", "ActorList", "BlueprintLibrary", "Client", "ClientSideSensor", "DebugHelper"),
    *("Junction", "Landmark", "LaneInvasionSensor", "Map", "Sensor", "ServerSideSensor", "TrafficLight"),
    *("TrafficManager", "TrafficSign", "Vehicle", "Walker", "WalkerAIController", "Waypoint", "World"),
    *("WorldSettings", "WorldSnapshot"),
)
"""The classes of carla 0.9.16 that only a connection to CARLA's server gives."""


class NeedsWorldError(DriverError):
    """An agent asked for CARLA's world."""


def refuse(what: str) -> NoReturn:
    """Raise the error about `what`, such as `carla.Client`.

    Raises:
        NeedsWorldError: always.
    """
    raise NeedsWorldError(f"the agent uses {what}, which needs CARLA's server; {GIVEN}")


class _Refusing(type):
    def __call__(cls, *_: object, **__: object) -> NoReturn:
        refuse(cls.__doc__ or cls.__name__)

    def __getattr__(cls, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)
        refuse(f"{cls.__doc__}.{name}")


def world_class(what: str) -> type:
    """Return a class that may be imported and named in annotations; to create it, or to read from it, raises."""
    return _Refusing(what.rpartition(".")[2], (), {"__doc__": what})


class CarlaModule(ModuleType):
    """The module that an agent's `import carla` finds: CARLA's types without its world.

    It takes the types from the installed package `carla`, or from `carla_types.py`.
    """

    def __init__(self, types: ModuleType) -> None:
        super().__init__("carla", "CARLA's types, without a world.")
        self.__path__ = list(getattr(types, "__path__", []))  # for `import carla.libcarla`
        self.__dict__.update({name: value for name, value in vars(types).items() if not name.startswith("_")})
        self.__dict__.update({name: world_class(f"carla.{name}") for name in WORLD_TYPES})

    def __getattr__(self, name: str) -> object:
        if name.startswith("_"):
            raise AttributeError(name)
        if name[0].isupper():
            return world_class(f"carla.{name}")
        refuse(f"carla.{name}")
