"""SUMO with the network of a test case: the only module that imports libsumo.

A process has one SUMO (libsumo does not allow more). It is started once per network and emptied for every run (see
`sumo_start`). This module controls the vehicles that SUMO drives; `moved_bodies` controls the vehicles that are moved
from outside.

Positions are those of the middle of the front bumper, as in SUMO. Headings are radians
counter-clockwise from east in this package, degrees clockwise from north in SUMO.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from foresee_dsl.compile.bundle import STYLES, PlacedActor, SumoBundle
from foresee_dsl.errors import SimulationError
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.moved_bodies import MATCH_M, MovedBodies, degrees, edge_and_index
from foresee_dsl.simulate.signals import Signals
from foresee_dsl.simulate.sumo_start import EmptyState, options
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.vehicle_reader import VehicleReader

if TYPE_CHECKING:
    from types import ModuleType

ON_LANE_M = 1e-3
"""Search radius of moveToXY for a vehicle in the middle of a lane inside a junction, where lanes overlap, m: with 5 m
SUMO 1.28 may take a lane of another movement. Ours: the vehicle is exactly on the shape, and lanes that begin together
soon lie farther apart."""
LANE_CHANGE_MODE = 1024 + 512 + 4 + 1
"""Lane change mode of SUMO's vehicles: they change lane for their route and to cooperate, gently. Ours: changes for
speed or to keep right depend on accumulators inside SUMO that a clip cannot restore."""
_LOOKS = "lookAheadSpeed"
LANE_CHANGE_MODEL = {"lcStrategic": "10000", _LOOKS: "10"}
"""Parameters with which a vehicle considers its whole remaining route for the choice of its lane. Ours: by default SUMO
looks ahead by a distance that depends on the speed of the last 10 s, which a clip cannot restore (measured with SUMO
1.28: a bus was off by 32 m after 10 s)."""
CLOSE_S, CLOSE_M = 0.1, 0.5
"""Headway (s) and standstill gap (m) that SUMO uses for a vehicle with an order to keep a gap. Ours: two steps, so that
the vehicle can still brake in time."""
_OBEYS, _IGNORES_PRIORITY, _IGNORES_SIGNALS = 31, 55, 39
"""Speed modes of SUMO: 31 is the default; 55 ignores the right of way before and inside a junction; 39 also ignores red
lights."""
_BRAKES_IN_COMFORT = 4
"""The bit of SUMO's speed mode that limits braking for a new speed to comfortable braking."""
_CRAWLS_MPS = 0.1
"""Lowest top speed that is set for a vehicle, m/s, because SUMO refuses 0."""
_ASKS = 8
"""Speed mode of a vehicle that drives exactly the set speed but respects the right of way at junctions."""


@dataclass(slots=True)
class _Vehicle:
    """The settings and last state of a vehicle that SUMO drives."""

    cruise_mps: float = 0.0
    edge: str = ""  # the last edge outside junctions, followed by the underscore of its lane ids
    factor: float = 1.0
    top_mps: float = math.nan  # the last top speed set in SUMO
    placed: bool = False
    ignores: set[str] = field(default_factory=set)


BodyMotion = tuple[str, float, float]
"""The id of a vehicle that is moved from outside, and its speed (m/s) and acceleration (m/s^2) after a step."""


class VehicleStates(NamedTuple):
    """The states of the N vehicles that SUMO drives, after a step.

    Attributes:
        names: their ids; the same object as after the previous step if the ids did not change.
        numbers: [3 N] for each vehicle x, y of the middle of its front bumper, m; then the N speeds, m/s.
        changed: id and lane of each vehicle that may be on another lane than after the previous step.
    """

    names: tuple[str, ...]
    numbers: FloatArray
    changed: list[tuple[str, str]]


class World:
    """A network loaded in SUMO, in which vehicles can be placed, driven and read.

    Use `World.shared(bundle)`: it returns this process's only SUMO, emptied.
    """

    _current: World | None = None

    def __init__(self, bundle: SumoBundle) -> None:
        """Start SUMO with a bundle's network; raises `SimulationError` if a file is missing or SUMO refuses it."""
        for file in (bundle.net_file, bundle.types_file):
            if not file.is_file():  # checked first: SUMO 1.28 may end the whole process if a file fails to load
                raise SimulationError(f"{file} is gone; compile the test case again")
        self._sumo = _import_libsumo()
        self._errors: tuple[type[Exception], ...] = (self._sumo.TraCIException, self._sumo.FatalTraCIError)
        self.signals = Signals(self._sumo, bundle)
        self.key = bundle.key
        self.runs = 0
        """Number of runs that this SUMO has begun."""
        self._vehicles: dict[str, _Vehicle] = {}
        self._names: tuple[str, ...] = ()
        self._follows = False  # whether the reader reads the vehicles that are here now
        self._routes: dict[tuple[str, ...], str] = {}
        self._limits: dict[str, float] = {}
        self._changed_limits: dict[str, float] = {}  # the original speed limits of lanes whose limit was changed
        # The usual rates of vehicles that were on slippery ground.
        self._rates: dict[str, tuple[float, float, float]] = {}
        # The usual headway and gap of vehicles with an order to keep a gap.
        self._usual: dict[str, tuple[float, float]] = {}
        self._styled: set[str] = set()  # the types of vehicles with a style
        self._reader = VehicleReader(self._sumo, self._errors)
        self.bodies = MovedBodies(self._sumo, self._errors, self._route, self._reader)
        try:
            self._sumo.simulation.start(["sumo", *options(bundle)])
            self._empty = EmptyState(self._sumo)
        except self._errors as err:
            raise SimulationError(f"SUMO cannot load {bundle.net_file.name}: {err}") from err
        # Networks and modules are never freed: searching them for reference cycles took 8 % of a run.
        gc.freeze()

    @classmethod
    def shared(cls, bundle: SumoBundle) -> World:
        """Return this process's world with the bundle's network, empty, with the signals of the scene's first frame."""
        world = cls._current
        if world is None or world.key != bundle.key:
            cls.close_shared()
            atexit.unregister(cls.close_shared)
            atexit.register(cls.close_shared)
            with Part.START:
                world = cls._current = cls(bundle)
        world.reset(bundle)
        world.runs += 1
        return world

    @property
    def is_shared(self) -> bool:
        """Whether this is the process's SUMO now; after `close_shared` it is not."""
        return World._current is self

    @classmethod
    def close_shared(cls) -> None:
        """End this process's SUMO, if one runs."""
        world, cls._current = cls._current, None
        if world is not None:
            world.close()

    def close(self) -> None:
        """End SUMO and remove the saved state."""
        self._sumo.simulation.close()
        self._empty.close()

    # --- a run -----------------------------------------------------------------------------------------------------

    def reset(self, bundle: SumoBundle) -> None:
        """Empty the world, and set the signals as the scene says; signals that it does not state begin their first
        stage.
        """
        actors = bundle.scene.actors
        begins_s = self._empty.load({name for actor in actors for name in (actor.model.name, actor.sumo_type)})
        self._vehicles.clear()
        self._names, self._follows = (), False
        self._routes.clear()
        # SUMO 1.28 keeps changed speed limits when it loads a state.
        for lane, speed_mps in self._changed_limits.items():
            self._sumo.lane.setMaxSpeed(lane, speed_mps)
            self._limits.pop(lane.rpartition("_")[0], None)
        self._changed_limits.clear()
        self._usual.clear()
        self._styled.clear()
        self._rates.clear()
        self.bodies.clear()
        self.signals = Signals(self._sumo, bundle, begins_s)
        self.signals.start(bundle, STEP_S)

    def step(self) -> None:
        """Let SUMO simulate one step of 0.05 s; raises `SimulationError` if SUMO fails."""
        try:
            with Part.SUMO:
                self._sumo.simulation.step(0)
        except self._errors as err:
            raise SimulationError(f"SUMO stopped: {err}") from err
        self.signals.look()

    def advance(self, motions: Iterable[BodyMotion]) -> VehicleStates:
        """Simulate one step, and return the states of all vehicles that SUMO drives after it.

        `motions`: the speeds of the vehicles that are moved from outside, each of which was placed before this call.

        Raises:
            SimulationError: SUMO failed.
        """
        self.step()
        self.bodies.correct_lane_order()
        settle = self.settle
        for vehicle, speed_mps, acceleration_mps2 in motions:
            settle(vehicle, speed_mps, acceleration_mps2)
        return self.vehicles()

    # --- vehicles --------------------------------------------------------------------------------------------------

    def add_vehicle(self, actor: PlacedActor) -> None:
        """Insert an actor with a route at its exact position.

        The route's first edge is the actor's current edge; on a junction, the edge before it. A vehicle that has just
        left a junction may also begin with the edge before it: SUMO then knows the position of its rear. After the next
        `step`, `settle` must set its speed, because SUMO computes another one from the placement.

        Raises:
            SimulationError: SUMO refused the route or the position.
        """
        try:
            vehicle = self._add(actor.id, self._type_of(actor), actor.route)
            if actor.style:
                assertive = str(STYLES[actor.style].assertive)
                self._sumo.vehicle.setParameter(actor.id, "laneChangeModel.lcAssertive", assertive)
            if actor.lane and not actor.lane.startswith(":"):
                vehicle.edge = actor.lane[: actor.lane.rindex("_") + 1]
            vehicle.cruise_mps = actor.cruise_mps
            if actor.cruise_mps > 0:
                self.set_cruise(actor.id, actor.cruise_mps)
        except self._errors as err:
            raise SimulationError(f"SUMO cannot place {actor.id}: {err}") from err
        self.hold(actor)

    def hold(self, actor: PlacedActor) -> None:
        """Hold an inserted actor at its position for one more step."""
        try:
            edge, index = edge_and_index(actor.lane)
            angle, keep_route, within_m = degrees(actor.heading_rad), 1, MATCH_M
            if not edge:
                keep_route = 2
            elif actor.lane.startswith(":") or edge != actor.route[0]:
                keep_route, within_m = 2, MATCH_M if actor.sublanes else ON_LANE_M
            self._sumo.vehicle.moveToXY(actor.id, edge, index, actor.x, actor.y, angle, keep_route, within_m)
        except self._errors as err:
            raise SimulationError(f"SUMO cannot place {actor.id}: {err}") from err

    def roll(self, vehicle: str, speed_mps: float, *, free: bool) -> None:
        """Let a vehicle drive at exactly this speed, regardless of the traffic ahead, until `let_go`.

        `free`: whether it may enter the junction ahead. SUMO treats a vehicle that enters without regard to the right
        of way as if it had already stopped at its stop sign.
        """
        self._sumo.vehicle.setSpeedMode(vehicle, 0 if free else _ASKS)
        self._sumo.vehicle.setSpeed(vehicle, speed_mps)

    def let_go(self, vehicle: str) -> None:
        """End `roll`: let a vehicle follow SUMO's car-following model again."""
        self._sumo.vehicle.setSpeed(vehicle, -1.0)
        self._sumo.vehicle.setSpeedMode(vehicle, _OBEYS)

    def settle(self, vehicle: str, speed_mps: float, acceleration_mps2: float) -> None:
        """Set the speed that a vehicle had during the last step; SUMO continues from it."""
        try:  # noqa: SIM105  at every step: `contextlib.suppress` costs as much as the call
            self._sumo.vehicle.setPreviousSpeed(vehicle, speed_mps, acceleration_mps2)
        except self._errors:  # a body may have reached the end of its route, where SUMO removes it
            pass

    def remove(self, vehicle: str) -> None:
        """Remove a vehicle if it is there."""
        self._forget(vehicle)
        self.bodies.forget(vehicle)
        with contextlib.suppress(*self._errors):  # the vehicle may have left by itself
            self._sumo.vehicle.remove(vehicle)

    def take_over(self, actor: PlacedActor) -> None:
        """Let a vehicle that SUMO drove be moved from outside from now on."""
        self._forget(actor.id)
        self.bodies.adopt(actor.id, actor.model.name, actor.route[-1:])
        self._sumo.vehicle.setSpeedMode(actor.id, 0)

    def vehicles(self) -> VehicleStates:
        """Return the states of all vehicles that SUMO drives; vehicles that have left the road are dropped."""
        reader = self._reader
        indices = reader.read() if self._follows else None
        while indices is None:
            self._count(self._sumo.vehicle.getIDList())
            indices = reader.read()
        changed = []
        for index in indices:
            name, lane = self._names[index], reader.lane(index)
            state = self._vehicles[name]
            changed.append((name, lane))
            if state.cruise_mps and not lane.startswith((":", state.edge)):
                self._limit_speed(name, state, lane)
        return VehicleStates(self._names, reader.numbers, changed)

    def _forget(self, vehicle: str) -> None:
        """Drop a vehicle from those that SUMO drives."""
        if self._vehicles.pop(vehicle, None) is not None:
            self._follows = False

    def _count(self, on_road: tuple[str, ...]) -> None:
        """Update the vehicles after the set of vehicles on the road has changed."""
        here = set(on_road)
        for vehicle, state in list(self._vehicles.items()):
            if vehicle in here:
                state.placed = True
            elif state.placed:
                del self._vehicles[vehicle]
        names = tuple(vehicle for vehicle in self._vehicles if vehicle in here)
        if names != self._names:
            self._names = names
        self._reader.follow(self._names, on_road)
        self._follows = True

    def __contains__(self, vehicle: str) -> bool:
        return vehicle in self._vehicles

    def set_speed(self, vehicle: str, speed_mps: float | None) -> None:
        """Let a vehicle drive at a speed as long as that is safe; None: it follows the car-following model again."""
        self._sumo.vehicle.setSpeed(vehicle, -1.0 if speed_mps is None else speed_mps)

    def set_cruise(self, vehicle: str, speed_mps: float) -> None:
        """Set the speed that a vehicle drives if nothing slows it down, m/s; it may exceed the speed limit of
        the road.
        """
        state = self._vehicles[vehicle]
        state.cruise_mps = max(speed_mps, _CRAWLS_MPS)
        self.limit_speed(vehicle, state.cruise_mps)
        self._limit_speed(vehicle, state, state.edge)

    def limit_speed(self, vehicle: str, speed_mps: float) -> None:
        """Limit a vehicle's speed, below its cruising speed, until `set_cruise` is called again."""
        state, speed_mps = self._vehicles.get(vehicle), max(speed_mps, _CRAWLS_MPS)
        if state is not None and speed_mps != state.top_mps:
            state.top_mps = speed_mps
            self._sumo.vehicle.setMaxSpeed(vehicle, speed_mps)

    def set_limit(self, lane: str, speed_mps: float) -> None:
        """Change the speed limit of a lane, m/s, for the rest of the run."""
        self._changed_limits.setdefault(lane, float(self._sumo.lane.getMaxSpeed(lane)))
        self._sumo.lane.setMaxSpeed(lane, speed_mps)
        self._limits.pop(lane.rpartition("_")[0], None)

    def set_acceleration(self, vehicle: str, acceleration_mps2: float) -> None:
        """Set a vehicle's maximum acceleration, m/s^2."""
        self._sumo.vehicle.setAccel(vehicle, acceleration_mps2)

    def hold_tyres(self, vehicle: str, most_mps2: float | None) -> None:
        """Limit a vehicle's acceleration and braking to this value, m/s^2; None restores the rates of its type."""
        api = self._sumo.vehicle
        rates = self._rates.setdefault(
            vehicle, (float(api.getAccel(vehicle)), float(api.getDecel(vehicle)), float(api.getEmergencyDecel(vehicle)))
        )
        accel, decel, emergency = (min(rate, most_mps2) if most_mps2 is not None else rate for rate in rates)
        api.setAccel(vehicle, accel)
        api.setEmergencyDecel(vehicle, emergency)
        api.setDecel(vehicle, decel)

    def ignore(self, vehicle: str, what: str, *, on: bool = True) -> None:
        """Let a vehicle ignore `signals` (and vehicles with a green light there) or `priority`, or obey them again."""
        state = self._vehicles[vehicle]
        (state.ignores.add if on else state.ignores.discard)(what)
        self._sumo.vehicle.setSpeedMode(vehicle, _mode(state.ignores))

    def brake(self, vehicle: str, speed_mps: float | None) -> None:
        """Limit a vehicle's speed in the next step, with as much braking as that needs; None ends the limit."""
        mode = _mode(self._vehicles[vehicle].ignores)
        self._sumo.vehicle.setSpeedMode(vehicle, mode if speed_mps is None else mode & ~_BRAKES_IN_COMFORT)
        self.set_speed(vehicle, speed_mps)

    def change_lane(self, vehicle: str, side: int) -> None:
        """Order a change to the next lane, which the vehicle then keeps for 60 s; `side`: 1 to the higher index, -1 to
        the lower one.
        """
        self._sumo.vehicle.changeLaneRelative(vehicle, side, 60.0)

    def close_up(self, vehicle: str, *, on: bool) -> None:
        """Let a vehicle come as near to others as its orders require (`on`), or keep the gap of its type again."""
        api = self._sumo.vehicle
        usual = self._usual.setdefault(vehicle, (float(api.getTau(vehicle)), float(api.getMinGap(vehicle))))
        tau_s, room_m = (CLOSE_S, CLOSE_M) if on else usual
        api.setTau(vehicle, tau_s)
        api.setMinGap(vehicle, room_m)

    def keep_to_lane(self, vehicle: str, index: int) -> None:
        """Order a vehicle to change to a lane of its edge, or to stay on it, for the next two steps."""
        self._sumo.vehicle.changeLane(vehicle, index, 2 * STEP_S)

    def look_ahead(self, vehicle: str) -> None:
        """Tell SUMO again how far a vehicle looks ahead for the lane that its route needs.

        While a vehicle drives slowly, SUMO 1.28 shortens this distance step by step, and with it how early the vehicle
        brakes for a gap beside it: a bus that had stood in its bay for 17 s came 3.3 m farther than in a clip that
        began 1 s after it had moved off.
        """
        self._sumo.vehicle.setParameter(vehicle, f"laneChangeModel.{_LOOKS}", LANE_CHANGE_MODEL[_LOOKS])

    # --- inside ----------------------------------------------------------------------------------------------------

    def _add(self, vehicle: str, model: str, route: tuple[str, ...]) -> _Vehicle:
        self._sumo.vehicle.add(vehicle, self._route(route), typeID=model)
        self._sumo.vehicle.setLaneChangeMode(vehicle, LANE_CHANGE_MODE)
        for key, value in LANE_CHANGE_MODEL.items():
            self._sumo.vehicle.setParameter(vehicle, f"laneChangeModel.{key}", value)
        state = self._vehicles[vehicle] = _Vehicle(edge=f"{route[0]}_")
        return state

    def _type_of(self, actor: PlacedActor) -> str:
        """Return the vehicle type of an actor; for an actor with a style, a copy of its model's type; the copy is made
        once in a run.

        SUMO 1.28 does not use an impatience that is set for a single vehicle at junctions, only that of its type.
        """
        if not actor.style:
            return actor.sumo_type
        name, style, api = f"{actor.sumo_type}-{actor.style}", STYLES[actor.style], self._sumo.vehicletype
        if name not in self._styled:
            self._styled.add(name)
            api.copy(actor.sumo_type, name)
            api.setImpatience(name, style.impatience)
            if style.acceleration_mps2 is not None:
                api.setAccel(name, min(style.acceleration_mps2, actor.model.acceleration_mps2))
            if style.braking_mps2 is not None:
                braking_mps2 = max(
                    min(style.braking_mps2, actor.model.emergency_braking_mps2), actor.model.braking_mps2
                )
                api.setDecel(name, braking_mps2)
                api.setApparentDecel(name, braking_mps2)
        return name

    def _route(self, edges: tuple[str, ...]) -> str:
        name = self._routes.get(edges)
        if name is None:
            name = self._routes[edges] = f"route_{len(self._routes)}"
            self._sumo.route.add(name, list(edges))
        return name

    def _limit_speed(self, vehicle: str, state: _Vehicle, lane: str) -> None:
        """Set the speed factor with which a vehicle reaches its cruising speed on this edge, even above the limit.

        It is set again on every edge outside junctions, so that it depends on the current edge only, not on earlier
        ones.
        """
        state.edge = lane[: lane.rindex("_") + 1]
        factor = max(1.0, state.cruise_mps / self._speed_limit(state.edge[:-1]))
        if factor != state.factor:
            state.factor = factor
            self._sumo.vehicle.setSpeedFactor(vehicle, factor)

    def _speed_limit(self, edge: str) -> float:
        """Return the speed limit of an edge, m/s: that of its fastest lane, because lane 0 may be a sidewalk."""
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
