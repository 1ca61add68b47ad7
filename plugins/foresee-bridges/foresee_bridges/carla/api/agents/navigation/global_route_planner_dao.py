"""`GlobalRoutePlannerDAO`, which needs CARLA's world; CARLA 0.9.10 has it."""

from foresee_bridges.carla.world import world_class

GlobalRoutePlannerDAO = world_class("agents.navigation.global_route_planner_dao.GlobalRoutePlannerDAO")
