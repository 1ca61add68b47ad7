"""The base class of agents."""

from foresee_bridges.carla.agent_base import AutonomousAgent, Track

__all__ = ["AutonomousAgent", "Track"]
