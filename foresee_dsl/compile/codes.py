"""Codes of errors that show only on the network, about places, routes and meetings; `grammars/codes.toml` explains
each."""

from __future__ import annotations

ROUTE = "FS250"
UNKNOWN = "FS251"
PLACE = "FS252"
OFF_ROAD = "FS253"
OVERLAP = "FS254"
GOAL = "FS255"
TOO_FAST = "FS256"
NO_WAY = "FS257"
NO_MEETING = "FS258"
IN_WALL = "FS259"
BROKEN = "FS260"
TRACK = "FS261"
NO_DOOR = "FS265"
NEVER_NEAR = "FS330"
NOBODY_SLIPS = "FS331"
BESIDE_ALL_ROADS = "FS332"
