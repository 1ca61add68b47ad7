"""Options of a route, and the planner that needs CARLA's vehicle."""

from foresee_bridges.carla.agent_base import RoadOption
from foresee_bridges.carla.world import world_class

__all__ = ["LocalPlanner", "RoadOption"]

LocalPlanner = world_class("agents.navigation.local_planner.LocalPlanner")
