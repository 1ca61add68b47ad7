"""Roads of recordings as SUMO networks: from lanelets, from files of roads, or guessed from the tracks."""
