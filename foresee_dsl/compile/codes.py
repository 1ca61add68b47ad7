"""Codes of what is impossible on a network: places, routes, meetings. No heavy import: `foresee explain` reads it."""

from __future__ import annotations

from foresee_dsl.language.codes.code import Code

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

CODES = (
    Code(
        ROUTE,
        "a route that the network does not have",
        "There is no such road or edge, one does not lead to the next, or one cannot turn there in this way.",
        "vehicle box: car.compact { route from west left over j5 }",
        "vehicle box: car.compact { route from west straight over j4 left over j5 }",
    ),
    Code(
        UNKNOWN,
        "a junction, signal or stage that the network does not have",
        "Triggers, rules and signals name junctions of the network, and stages of their signals.",
        "runner ignores signals at j44",
        "runner ignores signals at j4",
        "trigger",
    ),
    Code(
        PLACE,
        "a place that the network does not have",
        "The edge is shorter, the route does not go over the junction, or there is no lane that far to the side.",
        "vehicle box: car.compact {\n  route from north straight over j4\n  start at 400 m along north\n}",
        "vehicle box: car.compact {\n  route from north straight over j4\n  start at 40 m along north\n}",
    ),
    Code(
        OFF_ROAD,
        "an actor off the road",
        "Vehicles stand on a lane that they may use, all others near a road. The help names the nearest lane.",
        "obstacle crate: obstacle.crate { start at (60 m, 80 m) }",
        "obstacle crate: obstacle.crate { start at (60 m, 8 m) }",
    ),
    Code(
        OVERLAP,
        "two actors at the same place",
        "Two bodies cannot begin inside each other: it would count as a collision at once.",
        "obstacle crate: obstacle.crate { start at 40 m along ego.route }\n"
        "obstacle more: obstacle.crate { start at 40.1 m along ego.route }",
        "obstacle crate: obstacle.crate { start at 40 m along ego.route }\n"
        "obstacle more: obstacle.crate { start at 50 m along ego.route }",
    ),
    Code(
        GOAL,
        "a goal that the ego cannot reach",
        "The goal lies on the ego's route, and in front of where the ego starts.",
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n  ego: car.sedan {\n'
        "    route from west straight over j4\n    start at 90 m along ego.route\n    goal 40 m along west\n  }\n"
        "  expect never collision(ego)\n}\n",
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n  ego: car.sedan {\n'
        "    route from west straight over j4\n    start at 90 m along ego.route\n    goal 120 m along west\n  }\n"
        "  expect never collision(ego)\n}\n",
        "file",
    ),
    Code(
        TOO_FAST,
        "faster than the model can be",
        "The speed is over the model's `max_speed`. Take another model, or a lower speed.",
        "bicycle rider: bicycle.city {\n  route from north straight over j4\n  speed 80 km/h\n}",
        "bicycle rider: bicycle.city {\n  route from north straight over j4\n  speed 18 km/h\n}",
    ),
    Code(
        NO_WAY,
        "an actor that cannot move as it is told",
        "Pedestrians walk along a path; a route is for what has wheels.",
        "pedestrian walker: pedestrian.adult { route [south] }",
        "pedestrian walker: pedestrian.adult { path [(-30 m, -9 m), (-30 m, 9 m)] }",
    ),
    Code(
        NO_MEETING,
        "two actors that cannot meet at the junction",
        "Both must go over the junction where they are to meet.",
        "when time > 1 s { runner meets ego at j5 after 1 s }",
        "when time > 1 s { runner meets ego at j4 after 1 s }",
    ),
    Code(
        IN_WALL,
        "an actor inside a building, or a path through one",
        "Buildings hide what is behind them; nobody stands in one or walks through its walls.",
        "pedestrian walker: pedestrian.adult { path [(20 m, 8 m), (20 m, 30 m)] }",
        "pedestrian walker: pedestrian.adult { path [(20 m, 8 m), (40 m, 8 m)] }",
    ),
)
"""In order."""
