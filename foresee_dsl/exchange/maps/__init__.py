"""Maps that were made elsewhere: OpenDRIVE, OpenStreetMap, SUMO."""
