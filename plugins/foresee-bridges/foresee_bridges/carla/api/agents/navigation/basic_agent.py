"""`BasicAgent`, which needs CARLA's world."""

from foresee_bridges.carla.world import world_class

BasicAgent = world_class("agents.navigation.basic_agent.BasicAgent")
