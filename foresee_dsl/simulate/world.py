"""SUMO with the network of a test case: the only module that imports libsumo.

One SUMO lives in a process (libsumo allows no more). It is started once per network, and emptied for every run (see
`sumo_start`). Vehicles that SUMO drives are here, those that are moved from outside in `moved_bodies`.

Positions are SUMO's: the middle of the front bumper (`bodies` makes footprints of them). Headings are radians
counter-clockwise from east in this package, degrees clockwise from north in SUMO.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import math
from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.errors import SimulationError
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.moved_bodies import MATCH_M, MovedBodies, degrees, edge_and_index
from foresee_dsl.simulate.signals import Signals
from foresee_dsl.simulate.sumo_start import EmptyState, options
from foresee_dsl.simulate.trace import STEP_S

if TYPE_CHECKING:
    from types import ModuleType

ON_LANE_M = 1e-3
"""The same for a vehicle on the middle of a lane inside a junction, where lanes overlap: with 5 m SUMO 1.28 takes any
of them, of another movement too. Ours: the vehicle is on the very shape, and lanes that begin together soon lie further
apart."""
LANE_CHANGE_MODE = 1024 + 512 + 4 + 1
"""Changes lane for its route and to cooperate, gently. Ours: changes for speed or to keep right depend on
accumulators inside SUMO that no clip can restore."""
_LOOKS = "lookAheadSpeed"
LANE_CHANGE_MODEL = {"lcStrategic": "10000", _LOOKS: "10"}
"""Looks for the lane that its route needs from where it is to its end. Ours: SUMO's vehicles look as far as the speed
of their last 10 s takes them, which no clip can state (measured with SUMO 1.28: a bus off by 32 m after 10 s)."""
CLOSE_S, CLOSE_M = 0.1, 0.5
"""SUMO's headway and gap at a standstill of a vehicle that is told which gap to keep. Ours: two steps, so that it can
still brake in time."""
_OBEYS, _IGNORES_PRIORITY, _IGNORES_SIGNALS = 31, 55, 39
"""Speed modes: 31 is SUMO's default; 55 is that without the right of way, before the junction and inside; 39 is 55
without the red light."""
_BRAKES_IN_COMFORT = 4
"""The bit of a speed mode that lets a vehicle brake for a new speed no harder than in comfort."""
_CRAWLS_MPS = 0.1
"""The least that is set as a vehicle's top speed: SUMO refuses 0."""
_ASKS = 8
"""Speed mode: drives what it is told, but asks at a junction whether it may."""


@dataclass(slots=True)
class _Known:
    """What is known of a vehicle that SUMO drives."""

    cruise_mps: float = 0.0
    edge: str = ""  # the last one that is no junction's, with the underscore that lane ids have after it
    lane: str = ""  # that it was on after the last step
    factor: float = 1.0
    top_mps: float = math.nan  # its top speed, as SUMO was told last
    placed: bool = False
    ignores: set[str] = field(default_factory=set)


class Seen(NamedTuple):
    """The vehicles that SUMO drives, after a step.

    Attributes:
        names: N ids; the same object as after the step before where they are the same.
        numbers: 3 N: for each, x, y of the middle of its front bumper, m; and then the N speeds, m/s.
        changed: id and lane of those on another lane than after the step before.
    """

    names: tuple[str, ...]
    numbers: FloatArray
    changed: list[tuple[str, str]]


class World:
    """A loaded network in which vehicles can be placed, driven and read.

    Use `World.shared(bundle)`: it gives this process's one SUMO, freshly emptied.
    """

    _current: World | None = None

    def __init__(self, bundle: SumoBundle) -> None:
        """Start SUMO on a bundle's network; a `SimulationError` where a file is missing, or SUMO refuses it."""
        for file in (bundle.net_file, bundle.types_file):
            if not file.is_file():  # asked first: SUMO 1.28 can end the whole process when a file fails to load
                raise SimulationError(f"{file} is gone; compile the test case again")
        self._sumo = _import_libsumo()
        self._errors: tuple[type[Exception], ...] = (self._sumo.TraCIException, self._sumo.FatalTraCIError)
        self.signals = Signals(self._sumo, bundle)
        self.key = bundle.key
        self._vehicles: dict[str, _Known] = {}
        self._on_road: tuple[str, ...] = ()
        self._names: tuple[str, ...] = ()
        self._lanes: list[str] = []
        self._routes: dict[tuple[str, ...], str] = {}
        self._limits: dict[str, float] = {}
        self._changed_limits: dict[str, float] = {}  # what changed lanes had before
        self._rates: dict[str, tuple[float, float, float]] = {}  # of those that were on slippery ground
        self._usual: dict[str, tuple[float, float]] = {}  # headway and gap of those that were told another one
        self.bodies = MovedBodies(self._sumo, self._errors, self._route)
        try:
            self._sumo.simulation.start(["sumo", *options(bundle)])
            self._empty = EmptyState(self._sumo)
        except self._errors as err:
            raise SimulationError(f"SUMO cannot load {bundle.net_file.name}: {err}") from err
        # Networks and modules stay: looking for cycles in them again and again took 8 % of a run.
        gc.freeze()

    @classmethod
    def shared(cls, bundle: SumoBundle) -> World:
        """Return this process's world on the bundle's network, empty, with the signals at the scene's beginning."""
        world = cls._current
        if world is None or world.key != bundle.key:
            cls.close_shared()
            atexit.unregister(cls.close_shared)
            atexit.register(cls.close_shared)
            with Part.START:
                world = cls._current = cls(bundle)
        world.reset(bundle)
        return world

    @classmethod
    def close_shared(cls) -> None:
        """End this process's SUMO, if one runs."""
        world, cls._current = cls._current, None
        if world is not None:
            world.close()

    def close(self) -> None:
        """End SUMO and remove the kept state."""
        self._sumo.simulation.close()
        self._empty.close()

    # --- a run -----------------------------------------------------------------------------------------------------

    def reset(self, bundle: SumoBundle) -> None:
        """Empty the world and set the signals as the scene says (others at the beginning of their first stage)."""
        begins_s = self._empty.load({actor.model.name for actor in bundle.scene.actors})
        self._vehicles.clear()
        self._on_road, self._names, self._lanes = (), (), []
        self._routes.clear()
        for lane, speed_mps in self._changed_limits.items():  # SUMO keeps them when it loads a state
            self._sumo.lane.setMaxSpeed(lane, speed_mps)
            self._limits.pop(lane.rpartition("_")[0], None)
        self._changed_limits.clear()
        self._usual.clear()
        self._rates.clear()
        self.bodies.clear()
        self.signals = Signals(self._sumo, bundle, begins_s)
        self.signals.start(bundle, STEP_S)

    def step(self) -> None:
        """Let SUMO simulate one step of 0.05 s; a `SimulationError` where it breaks."""
        try:
            with Part.SUMO:
                self._sumo.simulation.step(0)
            with Part.WORLD:
                self.signals.look()
        except self._errors as err:
            raise SimulationError(f"SUMO stopped: {err}") from err

    # --- vehicles --------------------------------------------------------------------------------------------------

    def add_vehicle(self, actor: PlacedActor) -> None:
        """Put an actor that has a route into the world where it is placed, exactly.

        The route's first edge is the one it is on; on a junction, the one before the junction, and that is allowed
        for a vehicle that has just left it, too: SUMO then knows where its rear is. After the next `step`, `settle`
        gives it its speed: SUMO computes one of its own for the placement.

        Raises:
            SimulationError: SUMO refused route or place.
        """
        try:
            known = self._add(actor.id, actor.model.name, actor.route)
            if actor.lane and not actor.lane.startswith(":"):
                known.edge = actor.lane[: actor.lane.rindex("_") + 1]
            known.cruise_mps = actor.cruise_mps
            if actor.cruise_mps > 0:
                self.set_cruise(actor.id, actor.cruise_mps)
        except self._errors as err:
            raise SimulationError(f"SUMO cannot place {actor.id}: {err}") from err
        self.hold(actor)

    def hold(self, actor: PlacedActor) -> None:
        """Keep an actor that was added where it is placed for one more step."""
        try:
            edge, index = edge_and_index(actor.lane)
            angle, keep_route, within_m = degrees(actor.heading_rad), 1, MATCH_M
            if not edge:
                keep_route = 2
            elif actor.lane.startswith(":") or edge != actor.route[0]:
                keep_route, within_m = 2, ON_LANE_M
            self._sumo.vehicle.moveToXY(actor.id, edge, index, actor.x, actor.y, angle, keep_route, within_m)
        except self._errors as err:
            raise SimulationError(f"SUMO cannot place {actor.id}: {err}") from err

    def roll(self, vehicle: str, speed_mps: float, *, free: bool) -> None:
        """Let a vehicle drive exactly a speed, whatever is ahead of it, until `let_go`.

        `free`: it may enter the junction ahead. SUMO counts a vehicle that enters without asking as one that has
        already stopped at its stop sign.
        """
        self._sumo.vehicle.setSpeedMode(vehicle, 0 if free else _ASKS)
        self._sumo.vehicle.setSpeed(vehicle, speed_mps)

    def let_go(self, vehicle: str) -> None:
        """Give a vehicle that rolls back to car-following."""
        self._sumo.vehicle.setSpeed(vehicle, -1.0)
        self._sumo.vehicle.setSpeedMode(vehicle, _OBEYS)

    def settle(self, vehicle: str, speed_mps: float, acceleration_mps2: float) -> None:
        """State what speed a vehicle had during the last step; SUMO continues from it."""
        try:  # noqa: SIM105  at every step: `contextlib.suppress` costs as much as the call
            self._sumo.vehicle.setPreviousSpeed(vehicle, speed_mps, acceleration_mps2)
        except self._errors:  # a body may have come to the end of its route
            pass

    def remove(self, vehicle: str) -> None:
        """Take a vehicle out, if it is in."""
        self._forget(vehicle)
        self.bodies.forget(vehicle)
        with contextlib.suppress(*self._errors):  # it may have left by itself
            self._sumo.vehicle.remove(vehicle)

    def take_over(self, actor: PlacedActor) -> None:
        """From now on a vehicle that SUMO drove is moved from outside."""
        self._forget(actor.id)
        self.bodies.adopt(actor.id, actor.model.name, actor.route[-1:])
        self._sumo.vehicle.setSpeedMode(actor.id, 0)

    def vehicles(self) -> Seen:
        """Return where every vehicle that SUMO drives is now; those that have left the road are forgotten."""
        # Asking for each value is cheaper than SUMO's subscriptions (14 us to 27 us).
        vehicle = self._sumo.vehicle
        on_road = vehicle.getIDList()
        if on_road != self._on_road:
            self._count(on_road)
        names = self._names
        places, speeds = chain.from_iterable(map(vehicle.getPosition, names)), map(vehicle.getSpeed, names)
        numbers = np.fromiter(chain(places, speeds), np.float64, 3 * len(names))
        lanes = list(map(vehicle.getLaneID, names))
        changed = []
        if lanes != self._lanes:
            changed = [pair for pair in zip(names, lanes, strict=True) if self._vehicles[pair[0]].lane != pair[1]]
            self._lanes = lanes
        for name, lane in changed:
            known = self._vehicles[name]
            known.lane = lane
            if known.cruise_mps and not lane.startswith((":", known.edge)):
                self._limit_speed(name, known, lane)
        return Seen(names, numbers, changed)

    def _forget(self, vehicle: str) -> None:
        """Do not count a vehicle among those that SUMO drives any more."""
        if self._vehicles.pop(vehicle, None) is not None:
            self._on_road = ()

    def _count(self, on_road: tuple[str, ...]) -> None:
        """Find out which vehicles are on the road, now that it is not the same any more."""
        self._on_road = on_road
        here = set(on_road)
        for vehicle, known in list(self._vehicles.items()):
            if vehicle in here:
                known.placed = True
            elif known.placed:
                del self._vehicles[vehicle]
        names = tuple(vehicle for vehicle in self._vehicles if vehicle in here)
        if names != self._names:
            self._names = names

    def __contains__(self, vehicle: str) -> bool:
        return vehicle in self._vehicles

    def set_speed(self, vehicle: str, speed_mps: float | None) -> None:
        """Ask a vehicle to drive a speed while that is safe; None gives it back to car-following."""
        self._sumo.vehicle.setSpeed(vehicle, -1.0 if speed_mps is None else speed_mps)

    def set_cruise(self, vehicle: str, speed_mps: float) -> None:
        """Set what a vehicle drives where nothing hinders it, m/s; over the limit of its road if need be."""
        known = self._vehicles[vehicle]
        known.cruise_mps = max(speed_mps, _CRAWLS_MPS)
        self._set_top(vehicle, known, known.cruise_mps)
        self._limit_speed(vehicle, known, known.edge)

    def limit_speed(self, vehicle: str, speed_mps: float) -> None:
        """Let a vehicle drive at most this, which is no more than its cruise speed, until that is set anew."""
        known = self._vehicles.get(vehicle)
        if known is not None:
            self._set_top(vehicle, known, max(speed_mps, _CRAWLS_MPS))

    def _set_top(self, vehicle: str, known: _Known, speed_mps: float) -> None:
        if speed_mps != known.top_mps:
            known.top_mps = speed_mps
            self._sumo.vehicle.setMaxSpeed(vehicle, speed_mps)

    def set_limit(self, lane: str, speed_mps: float) -> None:
        """Give a lane another speed limit, m/s, for the rest of the run."""
        self._changed_limits.setdefault(lane, float(self._sumo.lane.getMaxSpeed(lane)))
        self._sumo.lane.setMaxSpeed(lane, speed_mps)
        self._limits.pop(lane.rpartition("_")[0], None)

    def set_acceleration(self, vehicle: str, acceleration_mps2: float) -> None:
        """Set how fast a vehicle gains speed at most."""
        self._sumo.vehicle.setAccel(vehicle, acceleration_mps2)

    def hold_tyres(self, vehicle: str, most_mps2: float | None) -> None:
        """Let a vehicle speed up and brake with no more than this; None: as its type can."""
        one = self._sumo.vehicle
        rates = self._rates.setdefault(
            vehicle, (float(one.getAccel(vehicle)), float(one.getDecel(vehicle)), float(one.getEmergencyDecel(vehicle)))
        )
        accel, decel, emergency = (min(rate, most_mps2) if most_mps2 is not None else rate for rate in rates)
        one.setAccel(vehicle, accel)
        one.setEmergencyDecel(vehicle, emergency)
        one.setDecel(vehicle, decel)

    def ignore(self, vehicle: str, what: str, *, on: bool = True) -> None:
        """Let a vehicle ignore `signals` (and vehicles that have green there) or `priority`, or obey again."""
        known = self._vehicles[vehicle]
        (known.ignores.add if on else known.ignores.discard)(what)
        self._sumo.vehicle.setSpeedMode(vehicle, _mode(known.ignores))

    def brake(self, vehicle: str, speed_mps: float | None) -> None:
        """Let a vehicle drive at most this in the next step, however hard it brakes for that; None: as before."""
        mode = _mode(self._vehicles[vehicle].ignores)
        self._sumo.vehicle.setSpeedMode(vehicle, mode if speed_mps is None else mode & ~_BRAKES_IN_COMFORT)
        self.set_speed(vehicle, speed_mps)

    def change_lane(self, vehicle: str, side: int) -> None:
        """Ask for a change by one lane: 1 to the next higher index, -1 to the next lower; kept there for 60 s."""
        self._sumo.vehicle.changeLaneRelative(vehicle, side, 60.0)

    def close_up(self, vehicle: str, *, on: bool) -> None:
        """Let a vehicle come as near to others as it is told, or keep the distance of its type again."""
        one = self._sumo.vehicle
        usual = self._usual.setdefault(vehicle, (float(one.getTau(vehicle)), float(one.getMinGap(vehicle))))
        tau_s, room_m = (CLOSE_S, CLOSE_M) if on else usual
        one.setTau(vehicle, tau_s)
        one.setMinGap(vehicle, room_m)

    def keep_to_lane(self, vehicle: str, index: int) -> None:
        """Ask for a change to a lane of the edge, or for staying on it, over the next two steps."""
        self._sumo.vehicle.changeLane(vehicle, index, 2 * STEP_S)

    def look_ahead(self, vehicle: str) -> None:
        """State how far a vehicle looks for the lane that its route needs.

        SUMO 1.28 lets this decay while it drives slowly, and with it how early it brakes for a gap beside it: a bus
        that had stood in its bay for 17 s came 3.3 m farther than in a clip that began 1 s after it had moved off.
        """
        self._sumo.vehicle.setParameter(vehicle, f"laneChangeModel.{_LOOKS}", LANE_CHANGE_MODEL[_LOOKS])

    # --- inside ----------------------------------------------------------------------------------------------------

    def _add(self, vehicle: str, model: str, route: tuple[str, ...]) -> _Known:
        self._sumo.vehicle.add(vehicle, self._route(route), typeID=model)
        self._sumo.vehicle.setLaneChangeMode(vehicle, LANE_CHANGE_MODE)
        for key, value in LANE_CHANGE_MODEL.items():
            self._sumo.vehicle.setParameter(vehicle, f"laneChangeModel.{key}", value)
        known = self._vehicles[vehicle] = _Known(edge=f"{route[0]}_")
        return known

    def _route(self, edges: tuple[str, ...]) -> str:
        name = self._routes.get(edges)
        if name is None:
            name = self._routes[edges] = f"route_{len(self._routes)}"
            self._sumo.route.add(name, list(edges))
        return name

    def _limit_speed(self, vehicle: str, known: _Known, lane: str) -> None:
        """Let a vehicle drive its cruise speed on this edge (not a junction's), over the limit if need be.

        Done anew on every edge, so that it depends on where the vehicle is and not on where it came from.
        """
        known.edge = lane[: lane.rindex("_") + 1]
        factor = max(1.0, known.cruise_mps / self._speed_limit(known.edge[:-1]))
        if factor != known.factor:
            known.factor = factor
            self._sumo.vehicle.setSpeedFactor(vehicle, factor)

    def _speed_limit(self, edge: str) -> float:
        """An edge's limit; that of its fastest lane, as lane 0 may be a sidewalk."""
        limit = self._limits.get(edge)
        if limit is None:
            lanes = range(self._sumo.edge.getLaneNumber(edge))
            limit = self._limits[edge] = max(float(self._sumo.lane.getMaxSpeed(f"{edge}_{k}")) for k in lanes)
        return limit


def _import_libsumo() -> ModuleType:
    try:
        import libsumo
    except ImportError as err:
        raise SimulationError(f"libsumo cannot be loaded: {err}; `foresee doctor` says what to install") from err
    module: ModuleType = libsumo
    return module


def _mode(ignores: set[str]) -> int:
    """Return the speed mode of a vehicle that ignores these rules."""
    return _IGNORES_SIGNALS if "signals" in ignores else _IGNORES_PRIORITY if ignores else _OBEYS
