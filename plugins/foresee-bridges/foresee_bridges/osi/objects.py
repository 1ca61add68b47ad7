"""The actors of a run as OSI messages: moving and stationary objects, and the data of the host vehicle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from foresee_bridges.osi.library import Numbers, add_reference, osi3, set_size, set_vector, set_yaw
from foresee_dsl.compile.bundle import ModelSpec, PlacedActor
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEER, YAW_RATE, X, Y

_VEHICLES: Mapping[str, str] = {
    "car": "CAR", "van": "DELIVERY_VAN", "truck": "HEAVY_TRUCK", "bus": "BUS", "motorcycle": "MOTORBIKE",
    "bicycle": "BICYCLE",
}  # fmt: skip
"""OSI's types of vehicles by our kinds."""
_CARS: Mapping[str, str] = {
    "car.micro": "SMALL_CAR", "car.compact": "COMPACT_CAR", "car.hatchback": "COMPACT_CAR",
    "car.limousine": "LUXURY_CAR", "obstacle.parked_compact": "COMPACT_CAR",
}  # fmt: skip
"""OSI's types of models that are more exact than those of their kinds."""
_OBSTACLES: Mapping[str, str] = {"obstacle.barrier": "BARRIER"}
"""OSI's types of stationary objects by our models; others are TYPE_OTHER."""
_PARKED, _DOOR = "obstacle.parked_", "obstacle.door"
WHEEL_RADIUS_M: Mapping[str, float] = {"truck": 0.5, "bus": 0.5, "motorcycle": 0.3, "bicycle": 0.35}
CAR_WHEEL_RADIUS_M = 0.325
"""Radii of wheels, m: usual sizes without effect on a run (ours)."""
_WHEELS: Mapping[str, int] = {"motorcycle": 2, "bicycle": 2}


def is_stationary(actor: PlacedActor) -> bool:
    """Return whether an actor is one of OSI's stationary objects: an obstacle that is not a parked vehicle or a door.

    OSI counts parked vehicles as moving objects.
    """
    return actor.model.kind == "obstacle" and not actor.model.name.startswith(_PARKED) and actor.door is None


def rear_axle_m(model: ModelSpec) -> float:
    """Return the distance from the rear axle to the centre of the bounding box, m; 0 for actors without axles."""
    return model.length_m / 2 - model.rear_overhang_m if model.kind in _VEHICLES else 0.0


class MovingActor:
    """The message of a moving object, which is filled anew for each frame."""

    def __init__(self, actor: PlacedActor, number: int) -> None:
        self._model, self._axle_m = actor.model, rear_axle_m(actor.model)
        self.message: Any = osi3().osi_object_pb2.MovingObject()
        self.message.id.value = number
        self.message.model_reference = actor.model.name
        add_reference(self.message.source_reference, "actor", actor.id)
        set_size(self.message.base.dimension, actor.model.length_m, actor.model.width_m, actor.model.height_m)
        self._classify(actor)

    def _classify(self, actor: PlacedActor) -> None:
        model, message, kinds = actor.model, self.message, osi3().osi_object_pb2.MovingObject
        vehicle = _parked_kind(model.name) or _VEHICLES.get(model.kind)
        if model.kind == "pedestrian":
            message.type = kinds.TYPE_PEDESTRIAN
        elif vehicle is None:
            message.type = kinds.TYPE_OTHER
        else:
            message.type = kinds.TYPE_VEHICLE
            types = kinds.VehicleClassification
            message.vehicle_classification.type = getattr(types, f"TYPE_{_CARS.get(model.name, vehicle)}")
            message.vehicle_classification.role = types.ROLE_CIVIL
            if model.kind in _VEHICLES:
                self._add_axles(message.vehicle_attributes)

    def _add_axles(self, attributes: Any) -> None:  # noqa: ANN401
        model = self._model
        radius_m = WHEEL_RADIUS_M.get(model.kind, CAR_WHEEL_RADIUS_M)
        height_m = radius_m - model.height_m / 2
        attributes.number_wheels = _WHEELS.get(model.kind, 4)
        attributes.radius_wheel = radius_m
        set_vector(attributes.bbcenter_to_rear, -self._axle_m, 0.0, height_m)
        set_vector(attributes.bbcenter_to_front, model.wheelbase_m - self._axle_m, 0.0, height_m)

    def fill(self, row: FloatArray, lane: int | None) -> Any:  # noqa: ANN401
        """Set the state of a frame ([7], columns of the trace) and the number of the lane; return the message."""
        base = self.message.base
        heading, speed, yaw_rate = float(row[HEADING]), float(row[SPEED]), float(row[YAW_RATE])
        set_vector(base.position, row[X], row[Y], self._model.height_m / 2)
        set_yaw(base.orientation, heading)
        # The rear axle moves along the heading; the centre lies ahead of it on a rigid body that turns.
        _set_turned(base.velocity, heading, speed, yaw_rate * self._axle_m)
        ahead = float(row[ACCELERATION]) - yaw_rate**2 * self._axle_m
        _set_turned(base.acceleration, heading, ahead, speed * yaw_rate)
        set_yaw_rate(base.orientation_rate, yaw_rate)
        del self.message.moving_object_classification.assigned_lane_id[:]
        if lane is not None:
            self.message.moving_object_classification.assigned_lane_id.add().value = lane
        return self.message


def _parked_kind(model: str) -> str | None:
    if not model.startswith(_PARKED):
        return None
    return _VEHICLES.get(model.removeprefix(_PARKED), "CAR")


def _set_turned(vector: Any, heading: float, ahead: float, left: float) -> None:  # noqa: ANN401
    """Set a vector of the ground plane from its components along and to the left of a heading."""
    c, s = math.cos(heading), math.sin(heading)
    set_vector(vector, ahead * c - left * s, ahead * s + left * c)


def set_yaw_rate(message: Any, yaw_rate: float) -> None:  # noqa: ANN401
    """Set a rate of turning around the vertical axis."""
    message.roll, message.pitch, message.yaw = 0.0, 0.0, float(yaw_rate)


def add_stationary(ground_truth: Any, actor: PlacedActor, row: FloatArray, number: int) -> None:  # noqa: ANN401
    """Add an obstacle to the stationary objects of a ground truth."""
    facts = osi3().osi_object_pb2.StationaryObject.Classification
    message = ground_truth.stationary_object.add()
    message.id.value = number
    message.model_reference = actor.model.name
    add_reference(message.source_reference, "actor", actor.id)
    set_size(message.base.dimension, actor.model.length_m, actor.model.width_m, actor.model.height_m)
    set_vector(message.base.position, row[X], row[Y], actor.model.height_m / 2)
    set_yaw(message.base.orientation, row[HEADING])
    message.classification.type = getattr(facts, f"TYPE_{_OBSTACLES.get(actor.model.name, 'OTHER')}")


def fill_host(message: Any, model: ModelSpec, row: FloatArray, number: int) -> None:  # noqa: ANN401
    """Set the data of the host vehicle: places of its centre and rear axle, and its motion in its own frame."""
    heading, speed, yaw_rate = float(row[HEADING]), float(row[SPEED]), float(row[YAW_RATE])
    back_m = rear_axle_m(model)
    message.host_vehicle_id.value = number
    message.vehicle_basics.curb_weight = model.mass_kg
    set_vector(message.vehicle_localization.position, row[X], row[Y], model.height_m / 2)
    set_yaw(message.vehicle_localization.orientation, heading)
    motion = message.vehicle_motion
    axle = float(row[X]) - back_m * math.cos(heading), float(row[Y]) - back_m * math.sin(heading)
    set_vector(motion.position, *axle, WHEEL_RADIUS_M.get(model.kind, CAR_WHEEL_RADIUS_M))
    set_yaw(motion.orientation, heading)
    set_vector(motion.velocity, speed, 0.0)
    set_vector(motion.acceleration, row[ACCELERATION], speed * yaw_rate)
    set_yaw_rate(motion.orientation_rate, yaw_rate)
    motion.current_curvature = math.tan(float(row[STEER])) / model.wheelbase_m


def numbers_of(actors: tuple[PlacedActor, ...], numbers: Numbers) -> list[int]:
    """Return the numbers of all actors: the ego's is 1."""
    return [numbers.of("actor", actor.id) for actor in actors]
