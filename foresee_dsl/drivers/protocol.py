"""The driver protocol: what a driver is told, what it sees each step, and what it answers.

Coordinates are SUMO's: x east, y north, metres; headings counter-clockwise from east, radians; speeds m/s. Positions
are the centre of the footprint unless stated otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SignalColour = Literal["red", "amber", "green", "off"]
ActorClass = Literal["car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian", "obstacle"]


@dataclass(frozen=True, slots=True)
class VehicleLimits:
    """What a vehicle can do (from its catalogue entry and the weather).

    Attributes:
        steer_max_rad: largest front-wheel angle. steer_rate_rad_s: how fast it turns.
        friction: tyre-road coefficient after weather; bounds |acceleration| and v * yaw rate to friction * 9.81.
        front_overhang_m: from the front axle to the front bumper.
    """

    model: str
    length_m: float
    width_m: float
    wheelbase_m: float
    front_overhang_m: float
    max_speed_mps: float
    acceleration_mps2: float
    braking_mps2: float
    emergency_braking_mps2: float
    steer_max_rad: float
    steer_rate_rad_s: float
    friction: float = 0.9


@dataclass(frozen=True)
class Foe:
    """A stream of traffic that crosses or joins the ego's route inside a junction.

    Attributes:
        path: [N, 2] centreline of the other movement through the junction, with 60 m of its approach in front of it.
        entry_s: length along `path` where it enters the junction.
        conflict_s: (first, last) length along the EGO's route that the other movement overlaps.
        conflict_path_s: the same along `path`.
        has_priority: True where the ego must yield to it while both may go (permissive left, minor road, crossing
            pedestrians).
        pedestrian: True for a crossing.
    """

    path: FloatArray
    entry_s: float
    conflict_s: tuple[float, float]
    conflict_path_s: tuple[float, float]
    has_priority: bool
    pedestrian: bool = False


@dataclass(frozen=True)
class JunctionPassage:
    """One junction on the route: the lengths along the route of its stop line and of its end, and its foes.

    `signal` is the key into `Observation.signals`; None: no signal. `turn`: "straight", "left", "right", "back".
    """

    junction: str
    stop_s: float
    exit_s: float
    turn: str
    signal: str | None
    foes: tuple[Foe, ...] = ()


@dataclass(frozen=True)
class Mission:
    """What the driver is asked to do, given once.

    Attributes:
        centreline: [N, 2] the lane centres to follow, at most 1 m apart, from behind the start to beyond the goal.
        s: [N] length along it. speed_limit_mps: [N].
        left_m, right_m: [N] free width on either side of the centreline that belongs to lanes of the ego's direction.
        start_s, goal_s: lengths along it.
    """

    centreline: FloatArray
    s: FloatArray
    speed_limit_mps: FloatArray
    left_m: FloatArray
    right_m: FloatArray
    start_s: float
    goal_s: float
    junctions: tuple[JunctionPassage, ...] = ()
    step_s: float = 0.05


@dataclass(frozen=True, slots=True)
class EgoState:
    """What the vehicle knows of itself (x, y: centre of the footprint; steer: front-wheel angle, left positive)."""

    x: float
    y: float
    heading_rad: float
    speed_mps: float
    acceleration_mps2: float
    yaw_rate_rad_s: float
    steer_rad: float


@dataclass(frozen=True, slots=True)
class SeenActor:
    """Another road user as seen now. `track` is a number that it keeps while it is seen; it has no other meaning."""

    track: int
    kind: ActorClass
    x: float
    y: float
    heading_rad: float
    speed_mps: float
    length_m: float
    width_m: float


class Window(NamedTuple):
    """A part of a picture: its first row and column, and how many."""

    top: int
    left: int
    rows: int
    columns: int


class Views(Protocol):
    """Pictures of one step for learned drivers, drawn on request by packages that add views (docs/reference/rasters.md
    has the layout); each raises a `ForeseeError` where no installed package draws it."""

    def birds_eye(self, window: Window | None = None) -> NDArray[np.uint8]:
        """Return the map, the seen actors and the signals from above, [channels, rows, columns]; or a part of it."""
        ...

    def forward(self) -> NDArray[np.uint8]:
        """Return what a camera behind the windscreen shows (near objects hide far ones), [channels, rows, columns]."""
        ...

    def draw(self, view: str) -> NDArray[np.uint8]:
        """Return the picture of any installed view by its name, [channels, rows, columns]."""
        ...


@dataclass(frozen=True, slots=True)
class Observation:
    """What the driver sees at one step.

    Attributes:
        time_s: now. ego: its own state, as its localisation measures it.
        actors: the object list of the sensors, as they were at `measured_s`.
        signals: a colour for the ego's movement by `JunctionPassage.signal`; what is out of range or view is absent.
        measured_s: when the actors were measured; sensors and fusion take time, so it lies before `time_s`. None: now.
        views: rasters; None where none are drawn.
    """

    time_s: float
    ego: EgoState
    actors: tuple[SeenActor, ...]
    signals: dict[str, SignalColour]
    measured_s: float | None = None
    views: Views | None = field(default=None, compare=False)  # drawn from the rest


@dataclass(frozen=True, slots=True)
class Control:
    """steer: -1 (right) to 1 (left) of the largest angle; throttle and brake: 0 to 1 of what the vehicle can do."""

    steer: float
    throttle: float
    brake: float


@runtime_checkable
class Driver(Protocol):
    """The software under test. `name` and `version` go into every result."""

    name: str
    version: str

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Forget everything and start a new mission."""
        ...

    def step(self, observation: Observation) -> Control:
        """Answer one observation (20 a second)."""
        ...


@dataclass(frozen=True, slots=True)
class Reason:
    """One reason for what a driver does at a step.

    Attributes:
        rule: in a word or two: `signal`, `right of way`, `pedestrian`, `distance`, ...
        text: in words, without naming the object: `has priority at mill_oak`.
        track, signal: the object's number in the object list, the key of a signal; None: it is about neither.
        acceleration_mps2: what this reason alone asks for, m/s^2. distance_m: from the ego's front to the object, or
            to where it waits; None: not known.
    """

    rule: str
    text: str
    track: int | None = None
    signal: str | None = None
    acceleration_mps2: float | None = None
    distance_m: float | None = None


@runtime_checkable
class Explaining(Protocol):
    """A driver that can say why it did what it did; optional. A run never asks, `foresee show --step` does."""

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer of `step`, the strongest first; it must change no later answer."""
        ...


@runtime_checkable
class OwnDeadline(Protocol):
    """A driver that waits for something else, such as a process, and has a deadline of its own for each answer."""

    step_deadline_s: float


@runtime_checkable
class WatchesFirst(Protocol):
    """A driver that remembers, and drives a clip as its parent's run only after it has watched for so long, s; at a
    clip's beginning it watches while the ego follows its recorded states."""

    handover_s: float


@runtime_checkable
class Closing(Protocol):
    """A driver with a resource of its own, such as a process, which it must release after each run."""

    def close(self) -> None:
        """Release it; called once after each run, however that ended."""
        ...
