"""The variables of an FMU that drives: names, units and meanings, and the values of the inputs at a step.

Names that begin with a message's field path are ASAM OSI's (3.8): `host_vehicle_data` as in `osi3.SensorView`, and
`moving_object` as in `osi3.SensorData`, whose coordinates are relative to the middle of the host's rear axle. OSI has
no numbers for a route in points or for a vehicle's limits; those names are ours.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from foresee_bridges.route import RouteTracker, in_frame, rear_axle
from foresee_dsl.drivers.protocol import (
    ActorClass,
    EgoState,
    FloatArray,
    Mission,
    Observation,
    SeenActor,
    SignalColour,
    VehicleLimits,
)

FAR_M = 200.0
"""Distance that stands for none: no stop line, no vehicle ahead, m. Ours: farther than any sensor here sees."""
LOOK_AHEAD_S, LOOK_AHEAD_M = 1.0, 6.0
"""The look-ahead point is this time ahead at the ego's speed, s, and at least this far, m. Ours: usual values of pure
pursuit (Coulter, CMU-RI-TR-92-01, discusses the choice)."""
BEND_MPS2, BEND_BRAKING_MPS2 = 2.5, 2.0
"""Lateral acceleration in bends and braking before them for `route.bend_speed`, m/s^2. Ours: comfortable values of
passenger cars."""
BEND_STEP_M = 3.0
"""Distance of the points that give the curvature, m. Ours: shorter ones amplify the roundings of maps."""
POINTS, POINT_STEP_M = 30, 2.0
"""Number and distance of the points of the route, m. Ours: they reach 60 m, as in the object list for policies."""
LEAD_MARGIN_M = 0.3
"""An object counts as ahead on the route if its footprint comes within this of the ego's width, m. Ours."""
COLOURS: Mapping[SignalColour, int] = MappingProxyType({"red": 2, "amber": 3, "green": 4, "off": 1})
"""Numbers of `osi3.TrafficLight.Classification.Color`: COLOR_RED, COLOR_YELLOW, COLOR_GREEN; off: COLOR_OTHER."""
OBJECT_TYPES: Mapping[ActorClass, int] = MappingProxyType({"pedestrian": 3, "obstacle": 1})
"""Numbers of `osi3.MovingObject.Type`: TYPE_PEDESTRIAN, TYPE_OTHER; all others are TYPE_VEHICLE."""
VEHICLE = 2
"""Number of `osi3.MovingObject.Type.TYPE_VEHICLE`."""


class Variable(NamedTuple):
    """The unit and the meaning of a variable; `1`: a number without unit."""

    unit: str
    meaning: str


INPUTS: Mapping[str, Variable] = MappingProxyType(
    {
        "host_vehicle_data.vehicle_localization.position.x": Variable("m", "centre of the footprint, east"),
        "host_vehicle_data.vehicle_localization.position.y": Variable("m", "centre of the footprint, north"),
        "host_vehicle_data.vehicle_localization.orientation.yaw": Variable("rad", "heading, counter-clockwise from x"),
        "host_vehicle_data.vehicle_motion.position.x": Variable("m", "middle of the rear axle, east"),
        "host_vehicle_data.vehicle_motion.position.y": Variable("m", "middle of the rear axle, north"),
        "host_vehicle_data.vehicle_motion.velocity.x": Variable("m/s", "speed along the heading"),
        "host_vehicle_data.vehicle_motion.acceleration.x": Variable("m/s2", "acceleration along the heading"),
        "host_vehicle_data.vehicle_motion.orientation_rate.yaw": Variable("rad/s", "yaw rate"),
        "host_vehicle_data.vehicle_motion.current_curvature": Variable("1/m", "curvature of the rear axle's way"),
        "vehicle.wheel_angle": Variable("rad", "angle of the front wheels, left positive"),
        "sensor.delay": Variable("s", "age of the object list"),
        "route.lateral_deviation": Variable("m", "rear axle to the left of the route"),
        "route.heading_deviation": Variable("rad", "heading minus the route's direction"),
        "route.curvature": Variable("1/m", "curvature of the route at the rear axle, left positive"),
        "route.look_ahead.x": Variable("m", "look-ahead point on the route, ahead of the rear axle"),
        "route.look_ahead.y": Variable("m", "look-ahead point, to the left of the rear axle"),
        "route.steering_angle": Variable("rad", "wheel angle whose circle leads through the look-ahead point"),
        "route.speed_limit": Variable("m/s", "speed limit"),
        "route.bend_speed": Variable("m/s", "speed limit, or less where a bend or a lower limit ahead needs it"),
        "route.speed_error": Variable("m/s", "`route.bend_speed` minus the speed"),
        "route.stop_distance": Variable("m", "front bumper to the next stop line; 200: none"),
        "route.goal_distance": Variable("m", "along the route to the goal; 200: farther"),
        "route.signal.color": Variable("1", "signal at that stop line: 2 red, 3 amber, 4 green, 1 off, 0 none in view"),
        "lead.distance": Variable("m", "front bumper to the nearest object on the route; 200: none"),
        "lead.speed": Variable("m/s", "that object's speed along the route"),
        "number_of_moving_objects": Variable("1", "number of objects in the object list"),
    }
)
"""Inputs that are single numbers."""

SERIES: Mapping[str, Variable] = MappingProxyType(
    {
        "moving_object.header.existence_probability": Variable("1", "1 for an object, 0 for an unused place"),
        "moving_object.header.tracking_id": Variable("1", "number of the object's track"),
        "moving_object.candidate.type": Variable("1", "2 vehicle, 3 pedestrian, 1 other"),
        "moving_object.base.position.x": Variable("m", "its centre, ahead of the rear axle"),
        "moving_object.base.position.y": Variable("m", "its centre, to the left of the rear axle"),
        "moving_object.base.orientation.yaw": Variable("rad", "its heading relative to the ego's"),
        "moving_object.base.velocity.x": Variable("m/s", "its velocity minus the ego's, ahead"),
        "moving_object.base.velocity.y": Variable("m/s", "its velocity minus the ego's, to the left"),
        "moving_object.base.dimension.length": Variable("m", "length"),
        "moving_object.base.dimension.width": Variable("m", "width"),
        "route.point.x": Variable("m", "points of the route, 2 m apart, ahead of the rear axle"),
        "route.point.y": Variable("m", "points of the route, to the left of the rear axle"),
        "route.point.speed_limit": Variable("m/s", "speed limit at each point"),
    }
)
"""Inputs that are arrays: objects, the nearest first, and points of the route. An element is written with its number
from 1 behind the first word or pair of words: `moving_object[1].base.position.x`, `route.point[1].x`."""

PARAMETERS: Mapping[str, Variable] = MappingProxyType(
    {
        "vehicle.length": Variable("m", "length"),
        "vehicle.width": Variable("m", "width"),
        "vehicle.wheelbase": Variable("m", "distance between the axles"),
        "vehicle.front_overhang": Variable("m", "front axle to front bumper"),
        "vehicle.max_speed": Variable("m/s", "largest speed"),
        "vehicle.max_acceleration": Variable("m/s2", "largest acceleration"),
        "vehicle.max_deceleration": Variable("m/s2", "deceleration of full braking"),
        "vehicle.max_wheel_angle": Variable("rad", "largest angle of the front wheels"),
        "vehicle.friction": Variable("1", "friction coefficient of the road"),
        "seed": Variable("1", "the run's seed"),
        "step_size": Variable("s", "time of a step"),
    }
)
"""Values that are constant during a run: parameters or inputs of the FMU."""

OUTPUTS: Mapping[str, Variable] = MappingProxyType(
    {
        "control.steering_angle": Variable("rad", "wanted angle of the front wheels, left positive"),
        "control.steer": Variable("1", "the same as a share of the largest angle, from -1 to 1"),
        "control.acceleration": Variable("m/s2", "wanted acceleration; negative: braking"),
        "control.throttle": Variable("1", "share of the largest acceleration, from 0 to 1"),
        "control.brake": Variable("1", "share of full braking, from 0 to 1"),
    }
)
"""What an FMU answers: one of the first two, and `control.acceleration` or both pedals."""

Values = dict[str, float | FloatArray]


def parameters(mission: Mission, vehicle: VehicleLimits, seed: int) -> dict[str, float]:
    """Return the values of all `PARAMETERS`."""
    values = (
        vehicle.length_m, vehicle.width_m, vehicle.wheelbase_m, vehicle.front_overhang_m, vehicle.max_speed_mps,
        vehicle.acceleration_mps2, vehicle.emergency_braking_mps2, vehicle.steer_max_rad, vehicle.friction,
        float(seed), mission.step_s,
    )  # fmt: skip
    return dict(zip(PARAMETERS, values, strict=True))


class InputValues:
    """Computes the inputs of the steps of one mission.

    Args:
        wanted: the names whose values are needed; the objects and the vehicle ahead are left out if none of theirs is.
    """

    def __init__(self, mission: Mission, vehicle: VehicleLimits, wanted: Collection[str] = (*INPUTS, *SERIES)) -> None:
        self._vehicle = vehicle
        self._route = RouteTracker(mission)
        self._curvatures = _curvatures(self._route)
        self._bend_speeds = _bend_speeds(mission, self._curvatures)
        self._needs_lead = any(name.startswith("lead.") for name in wanted)
        self._needs_objects = any("moving_object" in name for name in wanted)

    def at(self, observation: Observation) -> Values:
        """Return the values of the inputs at a step: numbers (`INPUTS`) and arrays (`SERIES`)."""
        axle = rear_axle(observation.ego, self._vehicle)
        values = {**self._host(observation, axle), **self._route_ahead(observation, axle)}
        if self._needs_objects:
            values.update(self._objects(observation, axle))
        return values

    def _host(self, observation: Observation, axle: tuple[float, float]) -> Values:
        ego, measured_s = observation.ego, observation.measured_s
        host = "host_vehicle_data"
        return {
            f"{host}.vehicle_localization.position.x": ego.x,
            f"{host}.vehicle_localization.position.y": ego.y,
            f"{host}.vehicle_localization.orientation.yaw": ego.heading_rad,
            f"{host}.vehicle_motion.position.x": axle[0],
            f"{host}.vehicle_motion.position.y": axle[1],
            f"{host}.vehicle_motion.velocity.x": ego.speed_mps,
            f"{host}.vehicle_motion.acceleration.x": ego.acceleration_mps2,
            f"{host}.vehicle_motion.orientation_rate.yaw": ego.yaw_rate_rad_s,
            f"{host}.vehicle_motion.current_curvature": math.tan(ego.steer_rad) / self._vehicle.wheelbase_m,
            "vehicle.wheel_angle": ego.steer_rad,
            "sensor.delay": 0.0 if measured_s is None else observation.time_s - measured_s,
        }

    def _route_ahead(self, observation: Observation, axle: tuple[float, float]) -> Values:
        ego, route, vehicle = observation.ego, self._route, self._vehicle
        place = route.place(*axle)
        front_s = place.s + vehicle.wheelbase_m + vehicle.front_overhang_m
        look_m = max(LOOK_AHEAD_M, LOOK_AHEAD_S * ego.speed_mps)
        marks: FloatArray = place.s + POINT_STEP_M * np.arange(POINTS, dtype=np.float64)
        points = in_frame(route.points(np.append(marks, place.s + look_m)), *axle, ego.heading_rad)
        look_x, look_y = points[-1].tolist()
        circle = 2 * look_y / max(look_x**2 + look_y**2, 1e-6)
        bend_mps = float(np.interp(place.s, route.mission.s, self._bend_speeds))
        junction = route.next_junction(front_s)
        seen = observation.signals.get(junction.signal) if junction is not None and junction.signal else None
        lead = self._lead(observation, front_s) if self._needs_lead else (FAR_M, 0.0)
        return {
            "route.lateral_deviation": place.left_m,
            "route.heading_deviation": math.remainder(ego.heading_rad - place.heading_rad, math.tau),
            "route.curvature": float(np.interp(place.s, route.mission.s, self._curvatures)),
            "route.look_ahead.x": look_x,
            "route.look_ahead.y": look_y,
            "route.steering_angle": math.atan(circle * vehicle.wheelbase_m),
            "route.speed_limit": float(route.speed_limits(marks[:1])[0]),
            "route.bend_speed": bend_mps,
            "route.speed_error": bend_mps - ego.speed_mps,
            "route.stop_distance": min(junction.stop_s - front_s, FAR_M) if junction is not None else FAR_M,
            "route.goal_distance": min(route.mission.goal_s - place.s - vehicle.rear_axle_m, FAR_M),
            "route.signal.color": float(COLOURS[seen]) if seen is not None else 0.0,
            "lead.distance": lead[0],
            "lead.speed": lead[1],
            "route.point.x": points[:-1, 0],
            "route.point.y": points[:-1, 1],
            "route.point.speed_limit": route.speed_limits(marks),
        }

    def _lead(self, observation: Observation, front_s: float) -> tuple[float, float]:
        """Return the distance from the front bumper to the nearest object on the route, m, and its speed along it."""
        lead = FAR_M, 0.0
        for actor in observation.actors:
            place = self._route.place_near(actor.x, actor.y, front_s + FAR_M / 2, FAR_M / 2)
            turned = actor.heading_rad - place.heading_rad
            half_m = abs(math.sin(turned)) * actor.length_m / 2 + abs(math.cos(turned)) * actor.width_m / 2
            long_m = abs(math.cos(turned)) * actor.length_m / 2 + abs(math.sin(turned)) * actor.width_m / 2
            distance_m = place.s - long_m - front_s
            beside_m = abs(place.left_m) - half_m - self._vehicle.width_m / 2
            if beside_m < LEAD_MARGIN_M and -self._vehicle.length_m < distance_m < lead[0] and place.s > front_s:
                lead = max(distance_m, 0.0), actor.speed_mps * math.cos(turned)
        return lead

    def _objects(self, observation: Observation, axle: tuple[float, float]) -> Values:
        ego = observation.ego
        actors = sorted(observation.actors, key=lambda a: (math.hypot(a.x - ego.x, a.y - ego.y), a.track))
        rows = np.array([_object_row(actor, ego) for actor in actors]).reshape(len(actors), 7)
        places = in_frame(np.array([(a.x, a.y) for a in actors]).reshape(-1, 2), *axle, ego.heading_rad)
        columns = (np.ones(len(actors)), rows[:, 0], rows[:, 1], places[:, 0], places[:, 1], *rows[:, 2:].T)
        names = [name for name in SERIES if name.startswith("moving_object.")]
        return {"number_of_moving_objects": float(len(actors)), **dict(zip(names, columns, strict=True))}


def _object_row(actor: SeenActor, ego: EgoState) -> tuple[float, ...]:
    """Return track, type, heading relative to the ego, relative velocity ahead and to the left, length, width."""
    turned = actor.heading_rad - ego.heading_rad
    return (
        float(actor.track), float(OBJECT_TYPES.get(actor.kind, VEHICLE)), math.remainder(turned, math.tau),
        actor.speed_mps * math.cos(turned) - ego.speed_mps, actor.speed_mps * math.sin(turned),
        actor.length_m, actor.width_m,
    )  # fmt: skip


def _curvatures(route: RouteTracker) -> FloatArray:
    """Return the curvature of the route at its points, 1/m, left positive."""
    at_s = route.mission.s
    before, after = (route.points(at_s + side * BEND_STEP_M) for side in (-1, 1))
    here = route.mission.centreline
    directions = [np.arctan2(leg[:, 1], leg[:, 0]) for leg in (here - before, after - here)]
    turned = np.angle(np.exp(1j * (directions[1] - directions[0])))
    curvatures: FloatArray = np.where(
        (at_s - at_s[0] < BEND_STEP_M) | (at_s[-1] - at_s < BEND_STEP_M), 0.0, turned / BEND_STEP_M
    )
    return curvatures


def _bend_speeds(mission: Mission, curvatures: FloatArray) -> FloatArray:
    """Return the speeds at the route's points from which every bend and lower limit ahead is reached in time, m/s."""
    squares = np.minimum(mission.speed_limit_mps**2, BEND_MPS2 / np.maximum(np.abs(curvatures), 1e-6))
    ahead = np.minimum.accumulate((squares + 2 * BEND_BRAKING_MPS2 * mission.s)[::-1])[::-1]
    speeds: FloatArray = np.sqrt(np.maximum(ahead - 2 * BEND_BRAKING_MPS2 * mission.s, 0.0))
    return speeds
