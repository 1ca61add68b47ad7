"""Observations as messages of the service `egodriver.EgodriverService` (alpasim), and its plans as trajectories.

The frames are the service's: `local` is the network's coordinates, `rig` is the middle of the rear axle on the ground,
x ahead and y to the left. What the service has no messages for is in `renderer_data`, as autoware_carla_scenario sends
it (`CarlaRendererData` of the package carla-driver-interface).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from carla_driver_interface import protocol
from carla_driver_interface.geometry import Pose, waypoints_to_proto
from carla_driver_interface.geometry import Trajectory as Plan

from foresee_bridges.route import RouteTracker, in_frame, rear_axle
from foresee_dsl.drivers.protocol import ActorClass, Mission, Observation, SeenActor, Trajectory, VehicleLimits

ROUTE_M, ROUTE_STEP_M = 100.0, 2.0
"""Length of the route ahead that is sent, and distance of its points, m: those of the package's own test loop."""
HEIGHT_M = 1.5
"""Height of the boxes of seen actors, m. Ours: the object list has no heights."""
_TYPES: dict[ActorClass, str] = {"pedestrian": "walker.pedestrian", "obstacle": "static.prop"}
_LIGHTS = {"red": "RED", "amber": "YELLOW", "green": "GREEN", "off": "OFF"}


def microseconds(time_s: float) -> int:
    """Return a time in microseconds."""
    return round(time_s * 1e6)


class Messages:
    """Makes the messages of one run."""

    def __init__(self, session: str, mission: Mission, vehicle: VehicleLimits) -> None:
        self._session, self._vehicle = session, vehicle
        self._route = RouteTracker(mission)
        self._frame = 0

    def egomotion(self, observation: Observation) -> Any:  # noqa: ANN401  generated classes
        """Return the ego's pose and motion at a step."""
        ego = observation.ego
        pose = Pose.from_xyz_yaw(*rear_axle(ego, self._vehicle), 0.0, ego.heading_rad)
        message = protocol.RolloutEgoTrajectory(session_uuid=self._session)
        message.trajectory.CopyFrom(Plan([microseconds(observation.time_s)], [pose]).to_proto())
        state = message.dynamic_states.add()
        state.linear_velocity.x, state.angular_velocity.z = ego.speed_mps, ego.yaw_rate_rad_s
        state.linear_acceleration.x = ego.acceleration_mps2
        state.linear_acceleration.y = ego.speed_mps * ego.yaw_rate_rad_s
        return message

    def route(self, observation: Observation) -> Any:  # noqa: ANN401
        """Return the route ahead in the rig frame."""
        axle = rear_axle(observation.ego, self._vehicle)
        place = self._route.place(*axle)
        marks = place.s + np.arange(0.0, ROUTE_M, ROUTE_STEP_M)
        points = in_frame(
            self._route.points(marks[marks <= self._route.mission.s[-1]]), *axle, observation.ego.heading_rad
        )
        waypoints = waypoints_to_proto(np.column_stack((points, np.zeros(len(points)))))
        route = protocol.Route(timestamp_us=microseconds(observation.time_s), waypoints=waypoints)
        return protocol.RouteRequest(session_uuid=self._session, route=route)

    def drive(self, observation: Observation, query_s: float) -> Any:  # noqa: ANN401
        """Return the request for a plan that holds until `query_s`."""
        self._frame += 1
        return protocol.DriveRequest(
            session_uuid=self._session,
            time_now_us=microseconds(observation.time_s),
            time_query_us=microseconds(query_s),
            renderer_data=protocol.pack_renderer_data(self._renderer_data(observation)),
        )

    def _renderer_data(self, observation: Observation) -> Any:  # noqa: ANN401
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        place = self._route.place(*rear_axle(observation.ego, self._vehicle))
        centre_s = place.s + self._vehicle.rear_axle_m
        data = protocol.CarlaRendererData(
            snapshot_timestamp_us=microseconds(max(measured_s, 0.0)),
            frame_id=self._frame,
            speed_limit_mps=float(self._route.speed_limits(np.array([centre_s]))[0]),
        )
        junction = self._route.next_junction(centre_s)
        colour = observation.signals.get(junction.signal) if junction is not None and junction.signal else None
        state = f"TRAFFIC_LIGHT_STATE_{_LIGHTS[colour] if colour is not None else 'UNKNOWN'}"
        data.ego_traffic_light = getattr(protocol.TrafficLightState, state)
        data.ego_traffic_light_distance_m = junction.stop_s - centre_s if junction is not None and colour else -1.0
        data.actors.extend(_actor(actor) for actor in observation.actors)
        return data

    def trajectory(self, response: Any, now_s: float) -> Trajectory | None:  # noqa: ANN401
        """Return the plan of a response for the centre of the footprint; None if it has fewer than two poses.

        A response begins with the ego's own pose, from which the plan may jump aside, so that pose is left out.
        The plan is continued backwards to `now_s` instead.
        """
        plan = Plan.from_proto(response.trajectory)
        times = np.array(plan.timestamps_us, dtype=np.float64) / 1e6
        planned = times > now_s + 1e-6
        if np.count_nonzero(planned) < 2:
            return None
        times = times[planned]
        headings = np.array([pose.yaw for pose in plan.poses])[planned]
        ahead = np.stack((np.cos(headings), np.sin(headings)), axis=1)
        points = plan.positions[planned, :2] + self._vehicle.rear_axle_m * ahead
        back = (times[0] - now_s) / (times[1] - times[0]) * (points[1] - points[0])
        return Trajectory(
            np.concatenate(([now_s], times)),
            np.concatenate(([points[0] - back], points)),
            np.concatenate((headings[:1], headings)),
        )


def _actor(actor: SeenActor) -> Any:  # noqa: ANN401
    message = protocol.CarlaActorState(
        track_id=str(actor.track), type_id=_TYPES.get(actor.kind, f"vehicle.{actor.kind}")
    )
    pose = Pose.from_xyz_yaw(actor.x, actor.y, HEIGHT_M / 2, actor.heading_rad)
    message.pose_local_to_aabb.CopyFrom(pose.to_proto())
    message.aabb.size_x, message.aabb.size_y, message.aabb.size_z = actor.length_m, actor.width_m, HEIGHT_M
    velocity = message.dynamic_state.linear_velocity
    velocity.x = actor.speed_mps * math.cos(actor.heading_rad)
    velocity.y = actor.speed_mps * math.sin(actor.heading_rad)
    return message
