"""Actors that follow their recorded tracks: where each of them is at every frame, and when it is in the world."""

from __future__ import annotations

import math
from collections.abc import Sequence

from foresee_dsl.compile.bundle import PlacedActor, TrackPlayback
from foresee_dsl.compile.placement.paths import LINE_OVER_M
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.tracks import TrackState
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.path_groups import PathGroup
from foresee_dsl.simulate.actors.states import StateTable
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import World

_DIGITS = 9
"""Decimals of the clock, so that steps do not add up rounding errors. Ours: far below the 6 decimals of a clip."""
_AS_FAST_MPS = 1e-6
"""An actor whose speed differs less than this from its track's speed is as fast as its track, m/s. Ours: rounding."""


class TrackClock:
    """The clock of an actor on its track; nothing else in the run changes it.

    It runs `timing` times as fast as the run's. While the actor is slower than its track, because it brakes or has
    braked, the clock runs slower in proportion.

    Attributes:
        time_s: the time of the track at which the actor is now, s.
    """

    def __init__(self, playback: TrackPlayback) -> None:
        self._playback = playback
        self.time_s, self._now_s = playback.start_s, 0.0
        self._slow_mps = playback.speed_mps
        """Its speed while it is slower than its track; None while it is as fast."""
        self._state: TrackState | None = None

    def step(self) -> None:
        """Advance by a step of the run."""
        playback = self._playback
        self._now_s = round(self._now_s + STEP_S, _DIGITS)
        rate = playback.timing
        if self._now_s <= playback.delay_s + STEP_S / 100:
            rate = 0.0
        elif playback.brakes is not None or self._slow_mps is not None:
            rate = self._rate()
        self.time_s, self._state = round(self.time_s + rate * STEP_S, _DIGITS), None

    @property
    def state(self) -> TrackState:
        """The state of the track at this time."""
        if self._state is None:
            self._state = self._playback.track.at(self.time_s)
        return self._state

    @property
    def waits(self) -> bool:
        """Whether the clock stands because of a delay."""
        return self._now_s < self._playback.delay_s - STEP_S / 100

    @property
    def is_slow(self) -> bool:
        """Whether the actor is slower than its track, because it brakes or has braked."""
        return self._slow_mps is not None

    @property
    def speed_mps(self) -> float:
        """The actor's speed, m/s."""
        if self.waits:
            return 0.0
        full_mps = self._full_mps()
        return full_mps if self._slow_mps is None else math.copysign(min(self._slow_mps, abs(full_mps)), full_mps)

    def _full_mps(self) -> float:
        """Return the speed of an actor that does not brake, m/s."""
        return self.state.speed_mps * self._playback.timing

    def _rate(self) -> float:
        """Return how fast the clock runs in this step; set whether the actor is slower than its track."""
        playback, brakes = self._playback, self._playback.brakes
        full_mps = abs(self._full_mps())
        before_mps = full_mps if self._slow_mps is None else min(self._slow_mps, full_mps)
        began_s = self._now_s - STEP_S
        if brakes is not None and brakes.from_s - STEP_S / 100 <= began_s < brakes.until_s - STEP_S / 100:
            self._slow_mps = max(before_mps - brakes.value * STEP_S, 0.0)
        elif self._slow_mps is not None:
            faster_mps = before_mps + playback.acceleration_mps2 * STEP_S
            self._slow_mps = faster_mps if faster_mps < full_mps - _AS_FAST_MPS else None
        if self._slow_mps is None or full_mps < STANDS_MPS:
            return playback.timing  # a track that stands goes on: the actor stands, too
        return playback.timing * min((before_mps + self._slow_mps) / 2 / full_mps, 1.0)


class TrackActor(PathActor):
    """An actor that is at every frame where its track has it.

    Attributes:
        playback: how it follows its track. clock: the time of the track at which it is now.
        follows: whether it follows its track; False once a trigger has removed it.
    """

    __slots__ = ("_over_m", "clock", "follows", "playback")

    def __init__(self, actor: PlacedActor, playback: TrackPlayback, world: World, edge: str, friction: float) -> None:
        """Place the actor where its track has it at the first frame; it may be absent then."""
        super().__init__(actor, world, edge, friction)
        self.playback, self.clock, self.follows = playback, TrackClock(playback), True
        self._over_m = playback.track.at(playback.moves_over_s).along_m
        state = self._state()
        before = playback.track.at(playback.start_s - STEP_S)
        moves = playback.delay_s <= 0 and playback.track.covers(playback.start_s - STEP_S)
        self._put(state, before.speed_mps * playback.timing if moves else self.clock.speed_mps,
                  before.heading_rad if moves else state.heading_rad)  # fmt: skip
        self.present = playback.is_there

    def step(self) -> None:
        """Move to the next frame; the actor appears and disappears with its track."""
        speed_mps, heading_rad, was_there = self.speed, self.heading, self.present
        self.clock.step()
        there = self.follows and self.playback.track.covers(self.clock.time_s)
        if there:
            state = self._state()
            self.present = True
            same = (speed_mps, heading_rad) if was_there else (self.clock.speed_mps, state.heading_rad)
            self._put(state, *same)
        else:
            self.present = False

    def _state(self) -> TrackState:
        """Return its present state, moved to its line."""
        state, left_m = self.clock.state, self.playback.left_m
        if left_m == 0.0:
            return state
        share = min(max((state.along_m - self._over_m) / LINE_OVER_M, 0.0), 1.0)
        heading = state.heading_rad
        x, y = state.x - share * left_m * math.sin(heading), state.y + share * left_m * math.cos(heading)
        turned = math.atan2(left_m, LINE_OVER_M) if 0.0 < share < 1.0 else 0.0
        return state._replace(x=x, y=y, heading_rad=math.remainder(heading + turned, math.tau))

    def _put(self, state: TrackState, speed_before_mps: float, heading_before_rad: float) -> None:
        speed_mps = self.clock.speed_mps
        acceleration = (speed_mps - speed_before_mps) / STEP_S
        turned = math.remainder(state.heading_rad - heading_before_rad, math.tau)
        self.along = state.along_m
        self.move(state.x, state.y, state.heading_rad, speed_mps, acceleration, turned / STEP_S)


class TrackGroup(PathGroup):
    """The actors of a run that follow recorded tracks; SUMO's vehicles see them as they see actors on paths."""

    def __init__(
        self, actors: Sequence[TrackActor], rows: Sequence[int], table: StateTable, network: RoadNetwork
    ) -> None:
        super().__init__(actors, rows, table, network)
        self._on_tracks, self._rows = tuple(actors), tuple(rows)
        self._show_present()

    def move(self) -> None:
        """Move all actors one step."""
        for actor in self._on_tracks:
            if actor.follows:
                actor.step()
        self._show_present()

    def drop(self, actor: PathActor) -> None:
        """Stop moving an actor, and stop showing it to SUMO."""
        super().drop(actor)
        if isinstance(actor, TrackActor):
            actor.follows = False

    def _show_present(self) -> None:
        """Show SUMO only the actors that are present."""
        for n, (actor, row) in enumerate(zip(self._on_tracks, self._rows, strict=True)):
            self._records["row"][n] = row if actor.present else -1
            if not actor.present and actor.stand_in.is_seen:
                actor.stand_in.hide()
