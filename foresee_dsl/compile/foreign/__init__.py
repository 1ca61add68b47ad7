"""Prepares networks and maps that were made with other tools for SUMO."""
