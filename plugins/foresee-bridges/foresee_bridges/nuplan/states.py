"""What a planner of nuPlan gets at a step, and the trajectory that it answers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from nuplan.common.actor_state.agent import Agent
from nuplan.common.actor_state.ego_state import EgoState
from nuplan.common.actor_state.oriented_box import OrientedBox
from nuplan.common.actor_state.scene_object import SceneObjectMetadata
from nuplan.common.actor_state.state_representation import StateSE2, StateVector2D, TimePoint
from nuplan.common.actor_state.static_object import StaticObject
from nuplan.common.actor_state.tracked_objects import TrackedObjects
from nuplan.common.actor_state.tracked_objects_types import TrackedObjectType
from nuplan.common.actor_state.vehicle_parameters import VehicleParameters
from nuplan.common.maps.maps_datatypes import TrafficLightStatusData, TrafficLightStatusType
from nuplan.planning.simulation.observation.observation_type import DetectionsTracks

from foresee_bridges.nuplan.geometry import centres, rear_axle, time_s, time_us
from foresee_dsl.drivers import protocol
from foresee_dsl.drivers.protocol import SeenActor, SignalColour, Trajectory, VehicleLimits
from foresee_dsl.errors import DriverError

HEIGHT_M = 1.7
"""Height of boxes, m: the object list has none, and no planner plans with it. Ours."""
_KINDS = {
    **dict.fromkeys(("car", "van", "truck", "bus", "motorcycle"), TrackedObjectType.VEHICLE),
    **{"bicycle": TrackedObjectType.BICYCLE, "pedestrian": TrackedObjectType.PEDESTRIAN},
    "obstacle": TrackedObjectType.GENERIC_OBJECT,
}
_COLOURS = {
    **{"green": TrafficLightStatusType.GREEN, "amber": TrafficLightStatusType.YELLOW},
    **{"red": TrafficLightStatusType.RED, "off": TrafficLightStatusType.UNKNOWN},
}


def vehicle_parameters(vehicle: VehicleLimits) -> VehicleParameters:
    """Return nuPlan's description of the ego vehicle; its centre of gravity is taken to be between the axles."""
    front_m = vehicle.wheelbase_m + vehicle.front_overhang_m
    return VehicleParameters(
        width=vehicle.width_m,
        front_length=front_m,
        rear_length=vehicle.length_m - front_m,
        cog_position_from_rear_axle=vehicle.wheelbase_m / 2,
        wheel_base=vehicle.wheelbase_m,
        vehicle_name=vehicle.model,
        vehicle_type=vehicle.model,
        height=HEIGHT_M,
    )


def ego_state(ego: protocol.EgoState, at_s: float, vehicle: VehicleLimits, parameters: VehicleParameters) -> EgoState:
    """Return the ego's state at its rear axle, where the velocity has no lateral part."""
    return EgoState.build_from_rear_axle(
        rear_axle_pose=StateSE2(*rear_axle(ego.x, ego.y, ego.heading_rad, vehicle), ego.heading_rad),
        rear_axle_velocity_2d=StateVector2D(ego.speed_mps, 0.0),
        rear_axle_acceleration_2d=StateVector2D(ego.acceleration_mps2, 0.0),
        tire_steering_angle=ego.steer_rad,
        time_point=TimePoint(time_us(at_s)),
        vehicle_parameters=parameters,
        angular_vel=ego.yaw_rate_rad_s,
    )


def tracks(actors: Sequence[SeenActor], at_s: float) -> DetectionsTracks:
    """Return the tracked objects; obstacles are static objects, all others agents with a velocity over ground."""
    return DetectionsTracks(TrackedObjects([_object(actor, time_us(at_s)) for actor in actors]))


def _object(actor: SeenActor, at_us: int) -> Agent | StaticObject:
    kind = _KINDS[actor.kind]
    pose = StateSE2(actor.x, actor.y, actor.heading_rad)
    box = OrientedBox(pose, actor.length_m, actor.width_m, HEIGHT_M)
    token = f"{actor.track:016x}"
    metadata = SceneObjectMetadata(at_us, f"{token}_{at_us}", actor.track, token, kind.fullname)
    if kind == TrackedObjectType.GENERIC_OBJECT:
        return StaticObject(kind, box, metadata)
    velocity = StateVector2D(
        actor.speed_mps * math.cos(actor.heading_rad), actor.speed_mps * math.sin(actor.heading_rad)
    )
    return Agent(kind, box, velocity, metadata, angular_velocity=0.0)


def traffic_lights(
    signals: Mapping[str, SignalColour], connectors: Mapping[str, Sequence[str]], at_s: float
) -> list[TrafficLightStatusData]:
    """Return the status of each lane connector whose signal the sensors see; of the others nothing is known."""
    return [
        TrafficLightStatusData(_COLOURS[colour], int(number), time_us(at_s))
        for key, colour in sorted(signals.items())
        for number in connectors.get(key, ())
    ]


def trajectory(answer: Any, vehicle: VehicleLimits) -> Trajectory:
    """Return the trajectory of nuPlan's `AbstractTrajectory`: times, centres and headings of its ego states.

    Speeds follow from the places, as for nuPlan's own tracker: planners such as PDM-Closed leave velocities at 0.

    Raises:
        DriverError: the planner answered with something else.
    """
    try:
        states = answer.get_sampled_trajectory()
        rows = np.array([(state.time_us, *state.rear_axle) for state in states], dtype=np.float64)
    except (AttributeError, TypeError, ValueError) as err:
        raise DriverError(f"the planner returned {answer!r}; it returns a trajectory of ego states") from err
    if len(rows) < 2 or not np.isfinite(rows).all():
        raise DriverError(f"the planner's trajectory needs two or more finite states; it has {len(rows)}")
    heading = rows[:, 3]
    return Trajectory(time_s(rows[:, 0]), centres(rows[:, 1:3], heading, vehicle), heading)
