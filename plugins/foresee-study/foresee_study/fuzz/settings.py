"""What a fuzzing run does, and the figures by which it mutates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

NEAREST_M, FARTHEST_M = 5.0, 40.0
"""How far from the ego's start an actor begins, m: DriveFuzz's own figures (its `constants.py`)."""
PATCH_SHARE = 0.25
"""Share of the mutations that put a slippery patch: DriveFuzz's `PROB_PUDDLE`."""
WEATHER_SHARE = 0.25
"""Share of the mutations that change the weather. Ours: the half of the mutations that is left is about actors."""
MOVE_SHARE = 0.5
"""Of the mutations about actors, where some were added before: the share that moves one of them. Ours."""
WALKER_SHARE = 0.5
"""Share of people among added actors: DriveFuzz draws vehicles and walkers alike."""
ROAD_SHARE = 0.5
"""Share of the people that begin on the road; the others are on sidewalks. Ours: DriveFuzz's are anywhere."""
CLASSES: Mapping[str, float] = MappingProxyType(
    {"car": 0.7, "bicycle": 0.1, "motorcycle": 0.1, "van": 0.05, "truck": 0.05}
)
"""Which vehicles are drawn. Ours: about the mix of the vehicles of CARLA 0.9.10, of which DriveFuzz draws."""
LEAST_MPS, RUNS_MPS = 1.0, 4.0
"""Slowest speed of an actor that moves at all, and fastest of one that walks straight on, m/s. Ours: DriveFuzz's
walkers go up to 10 m/s, which only sprinters do; 4 m/s is a jog."""
TURNED_RAD = 0.26
"""A vehicle that drives straight on is turned from its lane by at most this. Ours: 15 degrees, a car that drifts off
its lane; DriveFuzz's linear cars point anywhere."""
LINEAR_M, LINEAR_LEAST_M = 100.0, 10.0
"""Longest and shortest path of a vehicle that drives straight on, m (ours: it ends beside the road, or there)."""
WALK_M = 30.0
"""Length of a pedestrian's straight path, m. Ours: across the widest street and onto the other sidewalk."""
ROAMS_S = 60.0
"""An actor that follows lanes or sidewalks has a way for this many seconds: the longest run without an `end`."""
ROOM_M = 1.0
"""Free space around an added actor at the beginning, m; as of background traffic's pedestrians."""
QUEUE_M = 8.0
"""Free lane in front of and behind a vehicle that drives from the beginning, m. Ours: a car's length and braking from
25 km/h."""
FIRST_S = 2.0
"""A collision with an added actor before this is refused. Ours: a driver's reaction time of 1 s (as of the careful
driver), and as much to brake."""
TRIES, PLACES_TRIED = 6, 60
"""How many times a mutation is drawn anew before it counts as impossible, and places of an actor in each. Ours: of
489 first draws in bundled scenarios one was impossible."""
FRICTION = (0.05, 0.4)
"""Friction of a drawn patch: from wet ice to wet leaves (Wong, Theory of Ground Vehicles, table 1.3, has 0.1 for ice
and 0.2 for packed snow); DriveFuzz multiplies by 0 to 2, of which only what is below 1 is slippery."""
RADIUS_M = (1.0, 5.0)
"""Radius of a drawn patch, m: DriveFuzz's puddles reach 5 m (`PUDDLE_MAX_SIZE` of 500 cm)."""


@dataclass(frozen=True)
class FuzzSettings:
    """Settings of a fuzzing run; the defaults are DriveFuzz's.

    Attributes:
        cycles: how often the mutant with the lowest score is mutated again, at most. mutations: of a cycle.
        seed: of all random choices, and of the runs. together: each mutation adds or moves an actor and changes the
            weather, and one in four puts a patch as well, as DriveFuzz's program does; else it is one of the three.
    """

    driver: str = "pdm"
    cycles: int = 10
    mutations: int = 8
    seed: int = 0
    together: bool = False
