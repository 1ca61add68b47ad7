"""The interface between agents and sensors."""

from foresee_bridges.carla.agent_base import SensorInterface

__all__ = ["SensorInterface"]
