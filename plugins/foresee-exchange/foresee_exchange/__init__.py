"""Formats of other tools, for import and export: CARLA's routes, OpenDRIVE, OSM and SUMO maps, OpenSCENARIO."""
