"""The orders in force: each stays until it is complete or another order to the same actor replaces it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.language import model as m
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.orders.pair import Gap
from foresee_dsl.simulate.orders.speed import BOUND_FROM_M, Braking, Command, Halt, Meeting
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.trigger_record import ActorOrders, add
from foresee_dsl.simulate.triggers.trigger import IsComplete


class StandingOrders:
    """All orders to actors that are in force; it carries them out in each step.

    Attributes:
        new: ids of the actors that got a speed order since this list was last emptied.
        recorded: the states of each actor's orders, in order of time; see `trigger_record`.
    """

    def __init__(self, simulation: Simulation, recorder: Recorder) -> None:
        """Begin without orders."""
        self._simulation, self._recorder = simulation, recorder
        self.new: list[str] = []
        self.recorded: dict[str, list[ActorOrders]] = {}
        self._commands: dict[str, Command] = {}
        self._latest: dict[tuple[str, str], object] = {}
        """The latest order of each kind to each actor."""
        self._starts: dict[str, float] = {}
        self._sideways: dict[str, Command] = {}
        self._bound: list[tuple[SimulatedActor, str, str]] = []
        self._bound_on: set[tuple[str, str, str]] = set()
        self._braking: dict[str, Braking] = {}

    def any(self) -> bool:
        """Return whether an order is in force."""
        return bool(self._commands or self._starts or self._bound or self._sideways or self._braking)

    # --- giving orders ---------------------------------------------------------------------------------------------

    def give(self, actor: SimulatedActor, command: Command) -> IsComplete:
        """Give a speed order; return a function that says whether the order is complete or was replaced."""
        before = self._commands.get(actor.id)
        if isinstance(before, Gap | Braking):
            before.release()
        self._commands[actor.id] = command
        self.new.append(actor.id)
        return self.note(actor, "speed", command.complete)

    def note(self, actor: SimulatedActor, kind: str, complete: IsComplete) -> IsComplete:
        """Register the actor's latest order of a kind (`speed`, `sideways` or `path`) without carrying it out; return a
        function that says whether it is complete or was replaced.
        """
        order = self._latest[kind, actor.id] = object()
        return lambda: self._latest[kind, actor.id] is not order or complete()

    def end(self, actor: SimulatedActor) -> None:
        """End an actor's speed order, if the actor has one."""
        self._commands.pop(actor.id, None)

    def give_sideways(self, actor: SimulatedActor, order: Command) -> IsComplete:
        """Give an order about an actor's lateral position in its lane; see `give`."""
        self._sideways[actor.id] = order
        return self.note(actor, "sideways", order.complete)

    def start(self, actor: SimulatedActor, at_s: float) -> IsComplete:
        """Let an actor start at this time."""
        self._starts[actor.id] = at_s
        return lambda: self._simulation.time_s >= at_s - STEP_S / 100

    def brake(self, actor: SimulatedActor, braking: Braking) -> None:
        """Let an actor brake, regardless of its other orders."""
        self._braking[actor.id] = braking

    def ignore_near(self, actor: SimulatedActor, what: str, junction: str) -> None:
        """Let an actor ignore a rule near a junction."""
        self._bound.append((actor, what, junction))

    # --- their effect ----------------------------------------------------------------------------------------------

    def take_effect(self) -> None:
        """Carry out the orders of earlier steps, before the triggers are evaluated in this step."""
        if self._starts:
            self._start_due(self._simulation.time_s)
        if self._bound:
            self._keep_bounds()
        if self._commands:
            self.update(list(self._commands))

    def take_late_effect(self) -> None:
        """Carry out the lateral orders and the braking, after the triggers were evaluated in this step."""
        if self._sideways:
            for name, order in list(self._sideways.items()):
                self._update_sideways(name, order)
        if self._braking:
            self._brake()

    def update(self, names: Iterable[str]) -> None:
        """Carry out the speed orders of these actors."""
        for name in list(dict.fromkeys(names)):
            command = self._commands.get(name)
            if command is None or (name in self._braking and self._braking[name].acts):
                continue
            active = command.update(self._simulation.time_s)
            if not active:
                del self._commands[name]
            if isinstance(command, Meeting):
                self._record_meeting(name, command.keeps_mps, over=not active)
            elif isinstance(command, Halt) and command.stands_s != self.recorded[name][-1].stands_s:
                self._recorder.event(self._simulation.time_s, name, "stands", {})
                stands = replace(self.recorded[name][-1], time_s=self.now_s, stands_s=command.stands_s)
                add(self.recorded[name], stands)

    def _start_due(self, time_s: float) -> None:
        for name in [name for name, at in self._starts.items() if time_s >= at - STEP_S / 100]:
            del self._starts[name]
            self._simulation.order_speed(self._simulation.by_id[name], self._simulation.cruise_mps[name])

    def _keep_bounds(self) -> None:
        """Let actors ignore a rule exactly while they are near the junction of their order."""
        for actor, what, junction in self._bound:
            if not actor.present:
                continue
            key = (actor.id, what, junction)
            near = self._near(actor, junction)
            if near != (key in self._bound_on):
                (self._bound_on.add if near else self._bound_on.discard)(key)
                self._simulation.ignore(actor, what, on=near)

    def _near(self, actor: SimulatedActor, junction: str) -> bool:
        progress = self._simulation.progress
        span = progress.span(actor, junction)
        if span is None:
            return False
        front = progress.front(actor, self._simulation.frame)
        return front - actor.length <= span[1] and span[0] - front <= BOUND_FROM_M

    def _brake(self) -> None:
        for name, braking in list(self._braking.items()):
            acted = braking.acts
            if not braking.update(self._simulation.time_s):
                del self._braking[name]
            if braking.acts and not acted:
                self._recorder.event(self._simulation.time_s, name, "brakes", {})

    # --- what is recorded ------------------------------------------------------------------------------------------

    def record_path(self, actor: SimulatedActor, path: tuple[XY, ...], joins: tuple[str, ...]) -> None:
        """Record the path that an actor was ordered to follow, and the edges that it joins at the path's end."""
        states = self.recorded[actor.id]
        add(states, replace(states[-1], time_s=self.now_s, path=path, joins=joins))

    def record(self, action: m.Action, actor: str) -> None:
        """Record an order to an actor."""
        states = self.recorded.setdefault(actor, [])
        add(states, (states[-1] if states else ActorOrders()).after(action, self.now_s))

    @property
    def now_s(self) -> float:
        """Return the simulation time, s, without the rounding errors of adding steps."""
        return round(self._simulation.time_s, 6)

    def _record_meeting(self, actor: str, keeps_mps: float | None, *, over: bool) -> None:
        orders = self.recorded[actor][-1]
        if over or keeps_mps != orders.keeps_mps:
            speed, keeps_mps = (None, None) if over else (orders.speed, keeps_mps)
            add(self.recorded[actor], replace(orders, time_s=self.now_s, speed=speed, keeps_mps=keeps_mps))

    def _update_sideways(self, name: str, order: Command) -> None:
        """Carry out a lateral order, and record the line at which the vehicle then is."""
        actor = self._simulation.sumo_vehicles[name]
        if not actor.present or not order.update(self._simulation.time_s):
            del self._sideways[name]
        if self.recorded[name][-1].line_m != actor.line_m:
            add(self.recorded[name], replace(self.recorded[name][-1], time_s=self.now_s, line_m=actor.line_m))
