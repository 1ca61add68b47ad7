"""Runs as recordings in the formats of others: SUMO's FCD, CommonRoad XML, the tables of levelXdata."""
