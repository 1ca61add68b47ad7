"""The driver `carla`: an agent of CARLA's leaderboard drives, `--driver carla:my_agent.py:MyAgent:configuration`.

An agent is a program: a file that names one starts it only with the user's consent, like any driver with a colon in
its address.
"""

from __future__ import annotations

import importlib
import math
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, Self

import numpy as np

from foresee_bridges.carla.coordinates import GeoReference, wheel_angle_rad, yaw_deg
from foresee_bridges.carla.loading import USAGE, agent_class, carla_module, new_agent
from foresee_bridges.carla.opendrive import map_of
from foresee_bridges.carla.sensors import Scene, readers
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.errors import DriverError
from foresee_dsl.files import read_outside, short_hash

HOP_M = 1.0
"""Distance between two points of the dense route, m (`interpolate_trajectory` of leaderboard 2.0)."""
_TURNS = {"left": "LEFT", "right": "RIGHT", "straight": "STRAIGHT", "back": "LEFT"}
"""Options of turns; CARLA has none for turning back."""
Plan = tuple[list[tuple[dict[str, float], Any]], list[tuple[Any, Any]]]
"""The two arguments of `set_global_plan`: places as latitude, longitude and height, and as `carla.Transform`."""


class AgentDriver:
    """An agent of CARLA's leaderboard that needs sensors and route only: --driver carla:my_agent.py:MyAgent."""

    name, version = "carla", "1"

    def __init__(self, agent_type: type, configuration: str, name: str, version: str) -> None:
        self.name, self.version = name, version
        self._type, self._configuration = agent_type, configuration
        self._agent: Any = None

    @classmethod
    def from_argument(cls, argument: str) -> Self:
        """Create the driver of the address `carla:ARGUMENT`.

        Raises:
            DriverError: the file cannot be read or imported, or has no such agent.
        """
        file, _, rest = argument.partition(":")
        name, _, configuration = rest.partition(":")
        if not file.endswith(".py"):
            raise DriverError(f"carla:{argument} names no agent; {USAGE}")
        version = short_hash(*(_content(path, required=path == file) for path in (file, configuration)))
        return cls(agent_class(Path(file), name), configuration, f"carla:{argument}", version)

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Create the agent, pass it the route, set it up, and read which sensors it wants."""
        self._vehicle, self._step_s = vehicle, mission.step_s
        self._time: Any = importlib.import_module("srunner.scenariomanager.timer").GameTime
        self._time.restart()
        self._frame = 0
        options = importlib.import_module("agents.navigation.local_planner").RoadOption
        self._opendrive, self._reference = map_of(mission)
        plan = plan_of(mission, vehicle, carla_module(), options, self._reference)
        self._agent = new_agent(self._type, self._configuration, plan)
        self._suite = readers(self._agent.sensors())

    def step(self, observation: Observation) -> Control:
        """Read the sensors, ask the agent, and convert its `carla.VehicleControl`."""
        self._frame += 1
        self._time.on_carla_tick(
            SimpleNamespace(
                **{"frame": self._frame, "elapsed_seconds": observation.time_s, "delta_seconds": self._step_s},
                platform_timestamp=observation.time_s,
            )
        )
        scene = Scene(observation, self._reference, self._opendrive)
        data = {name: (self._frame, read(scene, spec)) for name, spec, read in self._suite}
        return control_of(self._agent.run_step(data, observation.time_s), self._vehicle)

    def close(self) -> None:
        """Let the agent release what it holds."""
        agent, self._agent = self._agent, None
        if agent is not None:
            agent.destroy()


def control_of(answer: Any, vehicle: VehicleLimits) -> Control:
    """Return the control of a `carla.VehicleControl`: steer left positive, as a share of the vehicle's largest angle.

    Throttle and brake are shares of what the vehicle can do, as in CARLA; the hand brake brakes fully.

    Raises:
        DriverError: the agent answered with something else, with a number that is not finite, or in reverse gear.
    """
    try:
        steer, throttle, brake = float(answer.steer), float(answer.throttle), float(answer.brake)
    except (AttributeError, TypeError, ValueError) as err:
        raise DriverError(f"the agent's run_step returned {answer!r}; it returns a carla.VehicleControl") from err
    if not all(map(math.isfinite, (steer, throttle, brake))):
        raise DriverError(f"the agent's run_step returned {answer!r}: its numbers must be finite")
    if answer.reverse and throttle > 0:
        raise DriverError("the agent drives in reverse gear, which vehicles of a run do not have")
    wheels_rad = wheel_angle_rad(min(max(steer, -1.0), 1.0), vehicle.wheelbase_m)
    return Control(wheels_rad / vehicle.steer_max_rad, throttle, 1.0 if answer.hand_brake else brake)


def _content(path: str, *, required: bool) -> bytes:
    """Return a file's content; of a configuration that names none, its text."""
    if not required and not Path(path).is_file():
        return path.encode()
    try:
        return read_outside(Path(path))
    except OSError as err:
        raise DriverError(f"carla:{path}: {err.strerror or err}; {USAGE}") from None


def plan_of(mission: Mission, vehicle: VehicleLimits, carla: ModuleType, options: Any, reference: GeoReference) -> Plan:
    """Return the route from the ego's centre to the end of the mission's line, which is beyond the goal.

    Args:
        carla: the module with `Transform`, `Location` and `Rotation`. options: the enumeration `RoadOption`.
    """
    start_s = mission.start_s - vehicle.length_m / 2
    s = np.arange(start_s, mission.s[-1], HOP_M)
    places = np.column_stack([np.interp(s, mission.s, mission.centreline[:, i]) for i in (0, 1)])
    ahead = np.diff(places, axis=0, append=places[-1:])
    ahead[-1] = ahead[-2]
    gps, world = [], []
    for at, (x, y), (dx, dy) in zip(s.tolist(), places.tolist(), ahead.tolist(), strict=True):
        option = options[_option(mission, at)]
        latitude, longitude = reference.gps(x, y)
        gps.append(({"lat": latitude, "lon": longitude, "z": 0.0}, option))
        rotation = carla.Rotation(yaw=yaw_deg(math.atan2(dy, dx)))
        world.append((carla.Transform(carla.Location(x=x, y=-y, z=0.0), rotation), option))
    return gps, world


def _option(mission: Mission, s: float) -> str:
    """Return the name of the option at a length along the route: that of the turn inside a junction."""
    inside = (junction for junction in mission.junctions if junction.stop_s < s < junction.exit_s)
    return next((_TURNS[junction.turn] for junction in inside), "LANEFOLLOW")
