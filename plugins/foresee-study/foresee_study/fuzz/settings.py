"""Settings of a fuzzing run, and the constants that its mutations use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from foresee_dsl.campaign.settings import option

NEAREST_M, FARTHEST_M = 5.0, 40.0
"""Least and greatest distance between the ego's start and an added actor, m: DriveFuzz's values (its
`constants.py`)."""
PATCH_SHARE = 0.25
"""Share of the mutations that add a slippery patch: DriveFuzz's `PROB_PUDDLE`."""
WEATHER_SHARE = 0.25
"""Share of the mutations that change the weather. Ours: the remaining half of the mutations adds or moves actors."""
MOVE_SHARE = 0.5
"""Share of moves among the mutations of actors, once an actor was added; the others add an actor. Ours."""
WALKER_SHARE = 0.5
"""Share of pedestrians among added actors: DriveFuzz draws vehicles and walkers with equal probability."""
ROAD_SHARE = 0.5
"""Share of the added pedestrians that begin on the road; the others begin on sidewalks. Ours: DriveFuzz places them
anywhere."""
CLASSES: Mapping[str, float] = MappingProxyType(
    {"car": 0.7, "bicycle": 0.1, "motorcycle": 0.1, "van": 0.05, "truck": 0.05}
)
"""Probabilities of the classes of added vehicles. Ours: about their shares among the vehicle models of CARLA 0.9.10,
from which DriveFuzz draws."""
LEAST_MPS, RUNS_MPS = 1.0, 4.0
"""Lowest speed of a moving actor, and highest speed of a pedestrian who walks straight on, m/s. Ours: DriveFuzz's
walkers reach 10 m/s, which only sprinters do; 4 m/s is a jog."""
TURNED_RAD = 0.26
"""Largest angle between its lane and a vehicle that drives straight on, rad. Ours: 15 degrees, a car that drifts off
its lane; such cars of DriveFuzz have any direction."""
LINEAR_M, LINEAR_LEAST_M = 100.0, 10.0
"""Longest and shortest path of a vehicle that drives straight on, m. Ours; the path ends earlier where the vehicle has
left the road."""
WALK_M = 30.0
"""Length of the path of a pedestrian who walks straight on, m. Ours: across the widest street and onto the other
sidewalk."""
ROAMS_S = 60.0
"""Duration for which an actor that follows lanes or sidewalks gets a route, s: the longest run without an `end`."""
ROOM_M = 1.0
"""Least distance of an added actor from all others at the beginning, m: that of the pedestrians of background
traffic."""
QUEUE_M = 8.0
"""Free lane in front of and behind a vehicle that drives from the beginning, m. Ours: a car's length plus the braking
distance from 25 km/h."""
FIRST_S = 2.0
"""A mutation is refused if it collides with an added actor earlier than this, s. Ours: a reaction time of 1 s (that of
the careful driver) and 1 s to brake."""
TRIES, PLACES_TRIED = 6, 60
"""Number of draws of a mutation before it counts as impossible, and number of places tried for an actor in each draw.
Ours: of 489 first draws in bundled scenarios one was impossible."""
FRICTION = (0.05, 0.4)
"""Range of the friction of a patch: from wet ice to wet leaves (Wong, Theory of Ground Vehicles, table 1.3, has 0.1 for
ice and 0.2 for packed snow). DriveFuzz multiplies the friction by 0 to 2; only factors below 1 make ground slippery."""
AT_MOST = (1, 1000)
"""Bounds of the numbers of cycles and of mutations. Ours: a typing error must not begin years of work."""
RADIUS_M = (1.0, 5.0)
"""Range of the radius of a patch, m: DriveFuzz's puddles reach 5 m (`PUDDLE_MAX_SIZE` of 500 cm)."""


@dataclass(frozen=True)
class FuzzSettings:
    """Settings of a fuzzing run; the defaults are DriveFuzz's.

    Attributes:
        cycles: maximum number of cycles per test case. Each cycle mutates the mutant that had the lowest score in the
            cycle before.
        mutations: number of mutations per cycle.
        seed: seed of all random choices, and of the runs.
        together: if true, each mutation adds or moves an actor and changes the weather, and one in four also adds a
            slippery patch, as DriveFuzz's program does; if false, each mutation makes one of these three changes.
    """

    driver: str = "pdm"
    cycles: int = field(default=10, metadata=option("Maximum number of cycles per test case.", AT_MOST))
    mutations: int = field(default=8, metadata=option("Number of mutations per cycle.", AT_MOST))
    seed: int = 0
    together: bool = field(
        default=False,
        metadata=option(
            "Each mutation changes both actors and weather, and one in four also the ground; without this option it "
            "changes one of the three.",
        ),
    )
