"""What agents ask of the running world: it raises an error that says what is missing."""

from foresee_bridges.carla.world import world_class

CarlaDataProvider = world_class("srunner.scenariomanager.carla_data_provider.CarlaDataProvider")
