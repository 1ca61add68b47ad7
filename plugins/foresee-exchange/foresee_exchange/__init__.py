"""Formats of other tools: CARLA's routes, OpenDRIVE, OSM and SUMO maps, OpenSCENARIO."""
