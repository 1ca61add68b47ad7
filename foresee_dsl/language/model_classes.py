"""The classes of models and of actors; this module imports nothing of the package, so that every part can share it."""

from __future__ import annotations

from typing import Literal, get_args

VehicleClass = Literal["car", "van", "truck", "bus", "motorcycle"]
ModelClass = Literal[VehicleClass, "bicycle", "pedestrian", "obstacle"]

VEHICLE_CLASSES: tuple[VehicleClass, ...] = get_args(VehicleClass)
"""The classes of models for the ego and a `vehicle`; every other kind of actor has the class of its own name."""
CLASSES: tuple[ModelClass, ...] = get_args(ModelClass)
"""Every class of models: the part of a model's name before the dot."""
