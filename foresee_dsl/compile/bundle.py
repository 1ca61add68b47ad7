"""The records of a compiled test case: files for SUMO, the network's geometry, and the scene at the first frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from foresee_dsl.compile.roads.polyline import XY, Points
from foresee_dsl.documents import every_field
from foresee_dsl.language.model import AtStop, Expect, MeetsState, Place, When
from foresee_dsl.language.model_classes import ModelClass

if TYPE_CHECKING:
    from foresee_dsl.compile.roads.network import RoadNetwork
    from foresee_dsl.compile.roads.route_line import RouteLine
    from foresee_dsl.compile.tracks import FileTrack


@dataclass(frozen=True, slots=True)
class DrivingStyle:
    """Parameters of SUMO's car-following, junction and lane-changing models.

    Each has a constant effect at every step, so a clip that names the style continues as its parent did. SUMO's `sigma`
    and its driver state are not used: they depend on random numbers inside SUMO, which a clip cannot restore.

    Attributes:
        impatience: SUMO's impatience, 0 to 1: how much a vehicle that has to give way counts on the braking of one
            that goes first.
        assertive: SUMO's `lcAssertive`: the gaps that a change of lane requires are divided by it.
        braking_mps2: deceleration with which it plans to stop, at most its model's hardest; None: its model's.
        acceleration_mps2: largest acceleration, at most its model's; None: its model's.
    """

    impatience: float = 0.0
    assertive: float = 1.0
    braking_mps2: float | None = None
    acceleration_mps2: float | None = None


STYLES: Mapping[str, DrivingStyle] = MappingProxyType(
    {
        # Impatience: a vehicle that goes first should not have to brake with more than 3.4 m/s^2 (VCRT articles 1(aa)
        # and 18, AASHTO 3.2.2, as the rule `priority`). Ours: `pdm`, which drives at 40 km/h on the main road, brakes
        # with up to 2.4 m/s^2 if the impatience is 0.45, with 3.6 m/s^2 if it is 0.5, and with 7.2 m/s^2 if it is 1.
        # Lane changes: half of the gaps that SUMO requires by default; ours.
        "takes_gap": DrivingStyle(impatience=0.45, assertive=2.0),
        # UN R157, annex 4, appendix 3: a careful driver brakes with 0.774 g in an emergency. The models themselves plan
        # to brake with about 4.5 m/s^2. (The factor is `kernels.constants.GRAVITY_MPS2`: a check loads no kernels.)
        "brakes_late": DrivingStyle(braking_mps2=0.774 * 9.81),
        # Ours: half of the least that drivers find comfortable, 1.5 m/s^2 to 2 m/s^2 in the literature from 1938 to
        # 2010 (review by C. Murdoch, Hawkins, "Acceleration from rest").
        "creeps": DrivingStyle(acceleration_mps2=0.75),
    }
)
"""The styles by the word that a `style` statement has."""


ActorKind = ModelClass


@dataclass(frozen=True, slots=True)
class ModelSpec:
    """A catalogue entry with every value filled in, SI units (angles in radians).

    Attributes:
        front_overhang_m: distance from the front axle to the front bumper.
        height_m: height of its top (for a rider, of the head) above the road; it hides lower actors behind it.
        cruise_mps: its speed without a `speed` statement; None for the speed limit of the road.
    """

    name: str
    kind: ActorKind
    length_m: float
    width_m: float
    wheelbase_m: float
    front_overhang_m: float
    mass_kg: float
    max_speed_mps: float
    acceleration_mps2: float
    braking_mps2: float
    emergency_braking_mps2: float
    max_steer_rad: float
    steer_rate_rad_s: float
    height_m: float = 1.5
    cruise_mps: float | None = None

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {**every_field(self), "rear_overhang_m": self.rear_overhang_m}

    @property
    def rear_overhang_m(self) -> float:
        """Distance from the rear axle to the rear bumper, m."""
        return self.length_m - self.wheelbase_m - self.front_overhang_m


@dataclass(frozen=True, slots=True)
class Phase:
    """A phase of a signal: the index of its stage, SUMO's state string, its duration, and the time from the beginning
    of the stage to that of the phase.
    """

    stage: int
    state: str
    duration_s: float
    since_stage_s: float


@dataclass(frozen=True, slots=True)
class Signal:
    """The fixed-time program of a junction's signal; `tls` is SUMO's id of the signal.

    In a foreign network with its own programs, each phase is a stage called `phase_N`.
    """

    junction: str
    tls: str
    stages: tuple[str, ...]
    phases: tuple[Phase, ...]

    def phase_at(self, stage: str, elapsed_s: float) -> tuple[int, float]:
        """Return the index of the phase `elapsed_s` after a stage began, and the rest of its duration, s.

        Raises:
            KeyError: the signal does not have the stage.
        """
        members = [k for k, phase in enumerate(self.phases) if self.stages[phase.stage] == stage]
        if not members:
            raise KeyError(stage)
        for k in members:
            until_s = self.phases[k].since_stage_s + self.phases[k].duration_s
            if elapsed_s < until_s - 1e-9:
                return k, until_s - elapsed_s
        return members[-1], 0.0

    def phase_of(self, stage: str, light: str | None) -> int | None:
        """Return the index of a stage's first phase (`light` None), or of its `amber` or all-`red` phase; None without
        such a phase."""
        members = [k for k, phase in enumerate(self.phases) if self.stages[phase.stage] == stage]
        return next((k for k in members if _is_light(self.phases[k].state, light)), None)


def _is_light(state: str, light: str | None) -> bool:
    """Return whether a signal's state is `amber`, or `red` for all movements; True for None, which means any state."""
    letters = set(state.lower())
    if light == "amber":
        return not letters.isdisjoint("yu") and "g" not in letters
    return light is None or letters <= set("rs")


@dataclass(frozen=True, slots=True)
class RecordedState:
    """A recorded state of the ego, `time_s` after the first frame. x, y: middle of the front bumper, m. heading_rad:
    counter-clockwise from east. steer_rad: angle of the front wheels, left positive."""

    time_s: float
    x: float
    y: float
    heading_rad: float
    speed_mps: float
    acceleration_mps2: float
    steer_rad: float


@dataclass(frozen=True, slots=True)
class DoorOf:
    """The vehicle's door that an actor represents: the vehicle's id, the side, and whether the door is open at the
    first frame."""

    actor: str
    side: str
    is_open: bool = False


@dataclass(frozen=True, slots=True)
class TimedValue:
    """A value in SI units that holds from one time of the run to another, s."""

    value: float
    from_s: float
    until_s: float


@dataclass(frozen=True, eq=False)
class TrackPlayback:
    """How an actor follows its track.

    Attributes:
        start_s: time of the track at the run's beginning, s. timing: factor of the track's clock. delay_s: the clock
            stands for this time first. brakes: deceleration for a time of the run, m/s^2.
        speed_mps: the speed at the run's beginning, if it is not the track's.
        acceleration_mps2: with this rate an actor that is slower than its track becomes as fast as its track again.
        left_m: distance that it keeps to the left of its track. moves_over_s: time of the track at which it begins to
            move there.
    """

    track: FileTrack
    start_s: float = 0.0
    timing: float = 1.0
    delay_s: float = 0.0
    brakes: TimedValue | None = None
    speed_mps: float | None = None
    acceleration_mps2: float = 1.0
    left_m: float = 0.0
    moves_over_s: float = 0.0

    @property
    def is_there(self) -> bool:
        """Whether the actor is in the world at the run's beginning."""
        return self.track.covers(self.start_s)


@dataclass(frozen=True)
class PlacedActor:
    """One actor at the first frame.

    Attributes:
        control: `ego` (the driver), `sumo` (car-following in SUMO along `route`), `path` (follows `path` in Python),
            `static` (an obstacle).
        x, y: middle of the FRONT bumper for `ego` and `sumo`, of the footprint for `path` and `static`, m.
        heading_rad: heading, counter-clockwise from east.
        lane: id of the lane on which it starts, "" for none.
        route: ids of its edges, beginning with the edge on which it starts.
        line: the centreline of that route for `ego` and `sumo`, otherwise None.
        path: points of its path, m (`path` actors; otherwise empty). along_m: its position along the path.
        cruise_mps: desired speed. waits: it stands still until a trigger `starts` it.
        delay_s: how much later than otherwise it starts to move.
        timing: factor of its speed along its own path.
        line_m: its distance to the left of its lane's middle (the points of a path include it already).
        strays: another `line_m` for a time. brakes: deceleration for a time, m/s^2. steering: offset of the steering
            for a time, as a share of the largest angle, left positive.
        recorded: the states that the ego follows before its driver takes over, in the order of time.
    """

    id: str
    model: ModelSpec
    control: Literal["ego", "sumo", "path", "static"]
    x: float
    y: float
    heading_rad: float
    speed_mps: float
    acceleration_mps2: float = 0.0
    steer_rad: float = 0.0
    lane: str = ""
    route: tuple[str, ...] = ()
    line: RouteLine | None = None
    path: Points = ()
    along_m: float = 0.0
    cruise_mps: float = 0.0
    waits: bool = False
    delay_s: float = 0.0
    timing: float = 1.0
    line_m: float = 0.0
    strays: TimedValue | None = None
    brakes: TimedValue | None = None
    recorded: tuple[RecordedState, ...] = ()
    steering: TimedValue | None = None
    joins: bool = False
    """True if it continues along `route` at the end of `path`."""
    backs_mps: float = 0.0
    """Speed with which it reverses at the first frame, m/s; if it reverses, `speed_mps` is 0."""
    guided: bool = False
    """True if a trigger makes it follow a path."""
    door: DoorOf | None = None
    """The door that this actor is, which is present only while it is open; None for every other actor."""
    ignores: tuple[tuple[str, str | None], ...] = ()
    """The rules that it ignores: ("signals" or "priority", id of the junction or None for all junctions)."""
    meets: tuple[MeetsState, ...] = ()
    passes: bool = False
    """True if it passes vehicles within its lane (`passes in lane`)."""
    style: str = ""
    """Its driving style, a name in `STYLES`; "" for the style of its model."""
    sublanes: bool = False
    """True if SUMO decides its lateral position, because it or another actor of the scenario passes within its lane."""
    playback: TrackPlayback | None = None
    """How it follows its recorded track; for the ego, the track from which it deviates. None without a track."""
    walk_stops: tuple[tuple[float, float, str, int], ...] = ()
    """Crossings on its path that a pedestrian enters only on green: (begin and end along the path, m; tls; link)."""

    @property
    def accelerates_mps2(self) -> float:
        """Its largest acceleration, with its style and its timing, m/s^2."""
        limit = STYLES[self.style].acceleration_mps2 if self.style else None
        most = self.model.acceleration_mps2 if limit is None else min(limit, self.model.acceleration_mps2)
        return most * min(self.timing, 1.0) ** 2

    @property
    def comes_later(self) -> bool:
        """True if it is not in the world at the first frame, because its track begins later."""
        return self.control == "path" and self.playback is not None and not self.playback.is_there

    @property
    def sumo_type(self) -> str:
        """SUMO's vehicle type of the actor: its model, or the model's variant that passes within its lane."""
        return passing_type(self.model.name) if self.passes else self.model.name


def passing_type(model: str) -> str:
    """Return the vehicle type of the vehicles of a model that pass within their lanes; not a name of a model."""
    return f"{model}-passing"


@dataclass(frozen=True, slots=True)
class SlipperyPatch:
    """A round patch of ground on which the friction coefficient is at most `friction`; positions and radius in m."""

    name: str
    x: float
    y: float
    radius_m: float
    friction: float


@dataclass(frozen=True)
class Scene:
    """The first frame, the triggers and the expectations. Actor 0 is the ego; the others are in the file's order, and
    the background traffic comes last.

    `goal_s` and `start_s` are lengths along the ego's line, m. `signals` holds (junction, stage, elapsed s) of the
    signals that the file sets; other signals begin with their first stage.
    """

    actors: tuple[PlacedActor, ...]
    start_s: float
    goal_s: float
    end_s: float
    whens: tuple[When, ...] = ()
    expects: tuple[Expect, ...] = ()
    signals: tuple[tuple[str, str, float], ...] = ()
    friction: float = 0.9
    rain: float = 0.0
    fog: float = 0.0
    sun: float = 0.0
    """Ratios from 0 to 1 of the `weather` statement; they affect sensors."""
    clip: bool = False
    """True for a clip or a mutant, which begins from exact states in the middle of a run."""
    began_s: float = 0.0
    """Time of a clip's or child's first frame in the run that it was cut from, s; the sensors' noise continues from
    there."""
    must_arrive: bool = False
    """True if an ego that does not arrive before the end is a timeout: in a test case, unless its `end` says
    `anywhere`. If False, a run that ends without a failure passes."""
    notes: tuple[str, ...] = ()
    """Notes for the author that are not errors, such as background traffic for which there is no room."""
    places: Mapping[Place | AtStop, XY] = field(default_factory=dict)
    """Coordinates, m, of the places in conditions and actions that are not written as coordinates."""
    slippery: tuple[SlipperyPatch, ...] = ()

    @property
    def ego(self) -> PlacedActor:
        """The ego, which is actor 0."""
        return self.actors[0]

    @property
    def has_sublanes(self) -> bool:
        """True if SUMO decides the lateral positions of its vehicles, because an actor passes within its lane."""
        return any(actor.sublanes for actor in self.actors)


@dataclass(frozen=True)
class SumoBundle:
    """A compiled test case.

    Attributes:
        net_file: the SUMO network, in the cache. types_file: vehicle types of all models. Equal input gives the same
            bytes in both.
        key: content hash of network and types: runs with the same key can share a loaded SUMO.
    """

    name: str
    net_file: Path
    types_file: Path
    key: str
    network: RoadNetwork
    signals: dict[str, Signal]
    scene: Scene
