"""The driver protocol: a driver's mission, its observation at each step, and its answer.

Coordinates are SUMO's: x points east and y north, in metres; headings are counter-clockwise from east, in radians;
speeds are in m/s. Positions are the centre of the footprint unless stated otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.errors import DriverError
from foresee_dsl.language.model_classes import ModelClass

if TYPE_CHECKING:  # only a driver that reads the road map needs its module
    from foresee_dsl.drivers.road_map import RoadMap

FloatArray = NDArray[np.float64]

SignalColour = Literal["red", "amber", "green", "off"]
ActorClass = ModelClass


@dataclass(frozen=True, slots=True)
class VehicleLimits:
    """The limits of a vehicle, from its catalogue entry and the weather.

    Attributes:
        steer_max_rad: largest front-wheel angle.
        steer_rate_rad_s: largest rate of change of this angle.
        friction: tyre-road coefficient in this weather; it limits |acceleration| and v * yaw rate to friction * 9.81.
        front_overhang_m: distance from the front axle to the front bumper.
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

    @property
    def rear_axle_m(self) -> float:
        """Distance of the rear axle behind the centre of the footprint, m."""
        return self.wheelbase_m + self.front_overhang_m - self.length_m / 2


@dataclass(frozen=True)
class Foe:
    """A stream of traffic that crosses or joins the ego's route inside a junction.

    Attributes:
        path: [N, 2] centreline of the other movement through the junction, with 60 m of its approach in front of it.
        entry_s: length along `path` where it enters the junction.
        conflict_s: first and last length along the EGO's route at which the other movement overlaps it.
        conflict_path_s: first and last length along `path` at which it overlaps the ego's route.
        has_priority: whether the ego must yield to it while both may go (permissive left, minor road, crossing
            pedestrians).
        pedestrian: whether it is a pedestrian crossing.
    """

    path: FloatArray
    entry_s: float
    conflict_s: tuple[float, float]
    conflict_path_s: tuple[float, float]
    has_priority: bool
    pedestrian: bool = False


@dataclass(frozen=True)
class JunctionPassage:
    """One junction on the route: the lengths along the route of its stop line and of its end, and the streams that it
    meets there.

    `signal` is the key into `Observation.signals`; None: the junction has no signal. `turn`: "straight", "left",
    "right", "back".
    """

    junction: str
    stop_s: float
    exit_s: float
    turn: str
    signal: str | None
    foes: tuple[Foe, ...] = ()


@dataclass(frozen=True)
class Mission:
    """The task of the driver, passed once at `reset`.

    Attributes:
        centreline: [N, 2] the lane centres to follow, at most 1 m apart, from behind the start to beyond the goal.
        s: [N] length along the centreline, m. speed_limit_mps: [N] speed limit at each point.
        left_m, right_m: [N] free width on both sides of the centreline within lanes of the ego's direction.
        start_s, goal_s: lengths of start and goal along the centreline.
        build_map: builds `road_map` when a driver first reads it; None: there is no map.
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
    build_map: Callable[[], RoadMap] | None = field(default=None, repr=False, compare=False)

    @cached_property
    def road_map(self) -> RoadMap | None:
        """The roads around the mission: lanes with their borders and connections, stop lines, crossings, junctions.

        It is built when it is first read. None for a mission without a map, such as one that a test makes by hand.
        """
        return self.build_map() if self.build_map is not None else None


@dataclass(frozen=True, slots=True)
class EgoState:
    """The ego's measured state (x, y: centre of the footprint; steer: front-wheel angle, left positive)."""

    x: float
    y: float
    heading_rad: float
    speed_mps: float
    acceleration_mps2: float
    yaw_rate_rad_s: float
    steer_rad: float


@dataclass(frozen=True, slots=True)
class SeenActor:
    """A measurement of another road user. It keeps its number `track` while it is seen; the number has no other
    meaning."""

    track: int
    kind: ActorClass
    x: float
    y: float
    heading_rad: float
    speed_mps: float
    length_m: float
    width_m: float


class Window(NamedTuple):
    """A part of a picture: its first row and column, and the numbers of rows and columns."""

    top: int
    left: int
    rows: int
    columns: int


class Views(Protocol):
    """Pictures of one step for learned drivers, drawn when the driver asks for them, by packages that add views.

    docs/reference/rasters.md describes their layout. Each method raises a `ForeseeError` if no installed package draws
    the picture.
    """

    def birds_eye(self, window: Window | None = None) -> NDArray[np.uint8]:
        """Return the map, the measured actors and the signals from above, [channels, rows, columns]; or a part of
        it."""
        ...

    def forward(self) -> NDArray[np.uint8]:
        """Return the view of a camera behind the windscreen (near objects hide far ones), [channels, rows, columns]."""
        ...

    def draw(self, view: str) -> NDArray[np.uint8]:
        """Return the picture of any installed view by its name, [channels, rows, columns]."""
        ...


@dataclass(frozen=True, slots=True)
class Observation:
    """The driver's input at one step.

    Attributes:
        time_s: current time. ego: the ego's state, as its localisation measures it.
        actors: object list of the sensors, measured at `measured_s`.
        signals: colour for the ego's movement, by `JunctionPassage.signal`; signals out of range or view are absent.
        measured_s: time at which the actors were measured; sensors and fusion take time, so it is before `time_s`.
            None: `time_s`.
        views: pictures; None if none are drawn.
    """

    time_s: float
    ego: EgoState
    actors: tuple[SeenActor, ...]
    signals: dict[str, SignalColour]
    measured_s: float | None = None
    views: Views | None = field(default=None, compare=False)  # drawn when they are read, from the other fields


@dataclass(frozen=True, slots=True)
class Control:
    """A driver's answer: steer from -1 (right) to 1 (left) as a share of the largest angle; throttle and brake from 0
    to 1.
    """

    steer: float
    throttle: float
    brake: float


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Where a driver plans the ego to be, as its answer instead of a `Control`.

    The simulator follows it (`drivers.following`), and goes on with it when the driver returns the same object again.

    Attributes:
        time_s: [N] times on the clock of `Observation.time_s`, ascending, N >= 2.
        points: [N, 2] centre of the footprint, m.
        heading_rad: [N] heading of the vehicle; it is used where the points do not move. None: from the points.
        speed_mps: [N] speed, not negative. None: from the points and times.
    """

    time_s: FloatArray
    points: FloatArray
    heading_rad: FloatArray | None = None
    speed_mps: FloatArray | None = None


@runtime_checkable
class Driver(Protocol):
    """The software under test. Its `name` and `version` are part of every result."""

    name: str
    version: str

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Forget everything and start a new mission."""
        ...

    def step(self, observation: Observation) -> Control | Trajectory:
        """Answer one observation; called 20 times per simulated second."""
        ...


def checked_driver(candidate: object, what: str, *, named: bool = True) -> Driver:
    """Return an object that is a driver.

    Args:
        what: the object in the words of the error. named: False if it gets its name and version later.

    Raises:
        DriverError: it lacks a method, or a text.
    """
    texts = ("name", "version") if named else ()
    missing = [f"text {text}" for text in texts if not isinstance(getattr(candidate, text, None), str)]
    missing += [f"method {call}" for call in ("reset", "step") if not callable(getattr(candidate, call, None))]
    if missing:
        raise DriverError(
            f"{what} is not a driver: it has no {' and no '.join(missing)}; a driver has "
            f"{'the texts `name` and `version`, and ' if named else ''}the methods `reset(mission, vehicle, seed)` and "
            "`step(observation)`"
        )
    return cast(Driver, candidate)


@dataclass(frozen=True, slots=True)
class Reason:
    """A reason for a driver's answer at a step.

    Attributes:
        rule: a word or two: `signal`, `right of way`, `pedestrian`, `distance`, ...
        text: the reason in words, without the object's name: `has priority at mill_oak`.
        track, signal: number of the object in the object list, or key of the signal, that the reason is about;
            otherwise None.
        acceleration_mps2: acceleration for this reason alone, m/s^2. distance_m: distance from the ego's front to the
            object, or to the place where the ego waits; None: unknown.
    """

    rule: str
    text: str
    track: int | None = None
    signal: str | None = None
    acceleration_mps2: float | None = None
    distance_m: float | None = None


@runtime_checkable
class Explaining(Protocol):
    """A driver that can explain its answers.

    Implementing it is optional; a run does not call it, `foresee show --step` does.
    """

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer of `step`, the strongest first.

        The call must not change any later answer.
        """
        ...


@runtime_checkable
class Waiting(Protocol):
    """A driver that says in words what it waits for, such as `gives way to track 7`; "" when it waits for nothing.

    Implementing it is optional. The reason of a run that ends as `timeout` or `stuck` adds the words of the last step.
    """

    waits_for: str


@runtime_checkable
class OwnDeadline(Protocol):
    """A driver that waits for something else, such as another process, and therefore has its own deadline for each
    answer.
    """

    step_deadline_s: float


@runtime_checkable
class WatchesFirst(Protocol):
    """A driver with a memory. Before it drives a clip, it must watch for `handover_s` (s) to drive as in the parent's
    run.

    At the clip's beginning the driver watches while the ego follows its recorded states.
    """

    handover_s: float


@runtime_checkable
class Closing(Protocol):
    """A driver with a resource, such as a process, which it must release after each run."""

    def close(self) -> None:
        """Release the resource; called once after each run, regardless of its outcome."""
        ...
