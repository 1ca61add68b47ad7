"""A recorded run as a simulation that conditions can be asked about again, frame by frame, without SUMO."""

from __future__ import annotations

from typing import cast

import numpy as np

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.drivers.protocol import SignalColour
from foresee_dsl.simulate.actors.moved_actors import Ego, PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor, StateTable
from foresee_dsl.simulate.signals import colour_shown
from foresee_dsl.simulate.trace import STEP_S, Trace, X
from foresee_dsl.simulate.triggers.progress import Progress
from foresee_dsl.simulate.world import World


class _RecordedSignals:
    """What the signals showed at the frame that a replay is at."""

    def __init__(self, bundle: SumoBundle, trace: Trace) -> None:
        self._trace, self.frame = trace, 0
        columns = {junction: k for k, junction in enumerate(trace.signals)}
        self._known = {s.tls: (s, columns[s.junction]) for s in bundle.signals.values() if s.junction in columns}

    def stage(self, tls: str) -> tuple[int, float]:
        """Return the stage that a signal showed (index) and the time since it began."""
        column = self._known[tls][1]
        return int(self._trace.stages[self.frame, column]), float(self._trace.elapsed[self.frame, column])

    def colour(self, tls: str, link: int) -> SignalColour:
        """Return what a signal showed to one of its links."""
        signal = self._known[tls][0]
        stage, elapsed_s = self.stage(tls)
        phase, _ = signal.phase_at(signal.stages[stage], elapsed_s)
        return colour_shown(signal.phases[phase].state, link)


class _NoWorld:
    """What is left of SUMO's world in a replay: its signals."""

    def __init__(self, signals: _RecordedSignals) -> None:
        self.signals = signals


class Replay(Simulation):
    """The actors of a trace, at the frame that `go_to` was last told; it cannot be stepped."""

    def __init__(self, bundle: SumoBundle, trace: Trace) -> None:
        """Stand at the first frame; `bundle`: what was run."""
        self._trace, self._signals = trace, _RecordedSignals(bundle, trace)
        self.world = cast(World, _NoWorld(self._signals))
        self.network, self.scene = bundle.network, bundle.scene
        edge = bundle.scene.ego.route[0]
        self.ego = Ego(bundle.scene.ego, bundle.scene.friction)
        self.actors = [self.ego, *(self._recorded(actor, edge) for actor in bundle.scene.actors[1:])]
        self.by_id = {actor.id: actor for actor in self.actors}
        self.progress = Progress(self.network, self.actors)
        self.state_table = StateTable(self.actors)
        self.go_to(0)

    def go_to(self, frame: int) -> None:
        """Put everybody where they were at a frame."""
        trace = self._trace
        self.frame = self._signals.frame = frame
        self.time_s = round(frame * STEP_S, 6)
        for k, actor in enumerate(self.actors):
            state = trace.states[frame, k]
            if np.isnan(state[X]):
                actor.present = False
                continue
            actor.present = True
            self.state_table.states[k] = state
            lane = int(trace.lanes[frame, k])
            actor.lane = trace.lane_ids[lane] if lane >= 0 else ""
            if isinstance(actor, PathActor):
                actor.along = actor.follower.along_m = float(trace.along[frame, k])

    def _recorded(self, actor: PlacedActor, edge: str) -> Actor:
        if actor.control == "path":
            return PathActor(actor, self.world, edge, self.scene.friction)
        return Actor(actor)
