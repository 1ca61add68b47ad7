"""Reduces routes."""

from foresee_bridges.carla.agent_base import downsample_route

__all__ = ["downsample_route"]
