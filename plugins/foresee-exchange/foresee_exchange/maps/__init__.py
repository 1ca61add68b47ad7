"""Import of maps: OpenDRIVE, OpenStreetMap, SUMO."""
