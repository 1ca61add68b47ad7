"""`BehaviorAgent`, which needs CARLA's world."""

from foresee_bridges.carla.world import world_class

BehaviorAgent = world_class("agents.navigation.behavior_agent.BehaviorAgent")
