"""Import and export of other formats: CARLA's routes, OpenDRIVE, OSM and SUMO maps, OpenSCENARIO."""
