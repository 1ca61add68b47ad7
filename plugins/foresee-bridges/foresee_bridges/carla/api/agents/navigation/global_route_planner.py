"""`GlobalRoutePlanner`, which needs CARLA's world."""

from foresee_bridges.carla.world import world_class

GlobalRoutePlanner = world_class("agents.navigation.global_route_planner.GlobalRoutePlanner")
