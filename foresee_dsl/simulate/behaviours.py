"""Triggers and what they set off: actors start, stop, change speed or lane, ignore rules, or meet another actor.

Everything that takes effect is noted as an event, with all that is needed to say it again in a clip.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from foresee_dsl.language.model import (
    Action,
    ChangesLane,
    ChangesSpeed,
    Ignores,
    Meets,
    MeetsState,
    Quantity,
    Ref,
    Starts,
    Stops,
)
from foresee_dsl.simulate.actors import STANDS_MPS, Walker
from foresee_dsl.simulate.cast import Cast
from foresee_dsl.simulate.conditions import Conditions
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.state import Mobile
from foresee_dsl.simulate.trace import STEP_S

COMFORT_MPS2 = 3.0
"""How hard an actor brakes that `stops`. Ours: the upper end of comfortable braking (ISO 15622 allows 3.5 m/s^2)."""
COMMITS_M = 15.0
"""It keeps its speed from so far before the junction on. Ours: a second at 50 km/h; a late change gives it away."""
COMMITS_WALKING_M = 2.0
"""The same for pedestrians and bicycles on their path. Ours: their reaction takes one or two paces."""
MET_M = 6.0
"""...until so far inside it, about its middle. Ours: most junctions of two-lane roads are 12 m to 20 m wide."""
CREEPS_MPS = 1.0
"""It does not come to a halt there, where it would stay: the slowest speed that times of arrival are counted with."""
WAITS_MPS = 3.0
"""The other counts as driving at least this fast. Ours: with 1 m/s, an ego that waits and an actor that times itself
by it both creep up to the junction and let each other go (a right turn into traffic took 25 s in scenario 9)."""
HASTE = 1.3
"""It drives at most so many times its cruising speed (the language's definition of `meets`)."""
BOUND_FROM_M = 60.0
"""An actor that ignores a rule at one junction does so from here before it. Ours: SUMO's cars begin to brake for a
red signal within their stopping distance, 35 m at 65 km/h."""


class Command(Protocol):
    """Sets an actor's speed for a while; a later one of the same actor replaces it."""

    def update(self, time_s: float) -> bool:
        """Set the speed for the step that begins now; False when there is nothing left to do."""
        ...


class Director:
    """Watches the triggers of a scene and carries out what they set off.

    Args:
        cast: the actors, at the first frame. recorder: takes the events.
    """

    def __init__(self, cast: Cast, conditions: Conditions, recorder: Recorder) -> None:
        self._cast, self._conditions, self._recorder = cast, conditions, recorder
        self._commands: dict[str, Command] = {}
        self._starts: dict[str, float] = {}
        self._bound: list[tuple[Mobile, str, str]] = []
        self._bound_on: set[tuple[str, str, str]] = set()
        self._fired: set[int] = set()
        self._do: dict[type, Callable[..., None]] = {
            Meets: self._meets,
            Ignores: self._ignores,
            Starts: self._start,
            ChangesSpeed: self._change_speed,
            ChangesLane: self._change_lane,
            Stops: self._stop,
        }
        self._begin()

    def step(self) -> None:
        """Look at the frame that the cast is at; what follows takes effect in the next step."""
        time_s = self._cast.time_s
        for index, when in enumerate(self._cast.scene.whens):
            if index not in self._fired and self._conditions.holds(when.condition):
                self._fired.add(index)
                self._recorder.event(time_s, "", "trigger", {"index": index})
                for action in when.actions:
                    self._act(action)
        for name in [name for name, at in self._starts.items() if time_s >= at - STEP_S / 100]:
            del self._starts[name]
            self._cast.pace(self._cast.by_id[name], self._cast.cruise[name])
        self._keep_bounds()
        for name, command in list(self._commands.items()):
            if not command.update(time_s) and self._commands.get(name) is command:
                del self._commands[name]

    def _begin(self) -> None:
        for actor in self._cast.actors[1:]:
            placed = actor.placed
            if placed.control == "static":
                continue
            if placed.waits:
                self._cast.pace(actor, 0.0)
            elif placed.delay_s > 0:
                self._cast.pace(actor, 0.0)
                self._starts[actor.id] = placed.delay_s
            for what, junction in placed.ignores:
                self._ignore(actor, what, junction)
            for meets in placed.meets:
                self._meet(actor, meets)

    def _act(self, action: Action) -> None:
        actor = self._cast.by_id[action.actor]
        if actor.present:
            self._do[type(action)](actor, action)

    # --- actions ---------------------------------------------------------------------------------------------------

    def _meets(self, actor: Mobile, action: Meets) -> None:
        self._meet(actor, action)

    def _meet(self, actor: Mobile, meets: Meets | MeetsState) -> None:
        gap = _si(meets.gap)
        detail = {"other": meets.other, "junction": meets.junction, "gap_s": gap, "order": meets.order}
        self._recorder.event(self._cast.time_s, actor.id, "meets", detail)
        meeting = _Meeting(self._cast, self._recorder, actor, meets)
        if actor.placed.timing == 1.0:
            self._commands[actor.id] = meeting
            return
        # It would make up for its `timing`: it drives on as it would have driven now, times the factor.
        if not meeting.over():
            self._commands.pop(actor.id, None)
            self._cast.cruise[actor.id] = meeting.asked() * actor.placed.timing
            self._cast.pace(actor, self._cast.cruise[actor.id])

    def _ignores(self, actor: Mobile, action: Ignores) -> None:
        self._ignore(actor, action.what, action.junction)

    def _ignore(self, actor: Mobile, what: str, junction: str | None) -> None:
        self._recorder.event(self._cast.time_s, actor.id, "ignores", {"what": what, "junction": junction})
        if junction is None:
            self._cast.ignore(actor, what)
        else:
            self._bound.append((actor, what, junction))

    def _start(self, actor: Mobile, _: Starts) -> None:
        self._recorder.event(self._cast.time_s, actor.id, "starts", {"delay_s": actor.placed.delay_s})
        self._starts[actor.id] = self._cast.time_s + actor.placed.delay_s

    def _change_speed(self, actor: Mobile, action: ChangesSpeed) -> None:
        to, over = _si(action.to), None if action.over is None else _si(action.over)
        detail = {"to_mps": to, "over_s": over, "from_mps": actor.speed}
        self._recorder.event(self._cast.time_s, actor.id, "changes_speed", detail)
        self._commands[actor.id] = _Ramp(self._cast, actor, to * actor.placed.timing, over or 0.0)

    def _change_lane(self, actor: Mobile, action: ChangesLane) -> None:
        self._recorder.event(self._cast.time_s, actor.id, "changes_lane", {"side": action.side})
        if actor.id in self._cast.world:
            self._cast.world.change_lane(actor.id, 1 if action.side == "left" else -1)

    def _stop(self, actor: Mobile, action: Stops) -> None:
        duration = None if action.duration is None else _si(action.duration)
        self._recorder.event(self._cast.time_s, actor.id, "stops", {"duration_s": duration})
        self._commands[actor.id] = _Stop(self._cast, actor, duration)

    def _keep_bounds(self) -> None:
        """Let actors ignore a rule while they are near the junction that was named, and only there."""
        for actor, what, junction in self._bound:
            if not actor.present:
                continue
            key = (actor.id, what, junction)
            near = self._near(actor, junction)
            if near != (key in self._bound_on):
                (self._bound_on.add if near else self._bound_on.discard)(key)
                self._cast.ignore(actor, what, on=near)

    def _near(self, actor: Mobile, junction: str) -> bool:
        progress, frame = self._cast.progress, self._cast.frame
        span = progress.span(actor, junction)
        if span is None:
            return False
        rear = progress.front(actor, frame) - actor.length
        return rear <= span[1] and progress.to_junction(actor, junction, frame) <= BOUND_FROM_M


class _Ramp:
    """Changes speed linearly; afterwards that is what the actor drives where nothing hinders it."""

    def __init__(self, cast: Cast, actor: Mobile, to_mps: float, over_s: float) -> None:
        self._cast, self._actor, self._to, self._over = cast, actor, to_mps, over_s
        self._since, self._from = cast.time_s, actor.speed

    def update(self, time_s: float) -> bool:
        share = 1.0 if self._over <= 0 else min(1.0, (time_s + STEP_S - self._since) / self._over)
        self._cast.pace(self._actor, self._from + (self._to - self._from) * share)
        if share < 1.0:
            return True
        self._cast.cruise[self._actor.id] = self._to
        return False


class _Stop:
    """Brakes in comfort, stands for a time or for good, then goes on as before."""

    def __init__(self, cast: Cast, actor: Mobile, duration_s: float | None) -> None:
        self._cast, self._actor, self._duration = cast, actor, duration_s
        self._pace = actor.speed
        self._stands_since: float | None = None

    def update(self, time_s: float) -> bool:
        if self._stands_since is None and self._actor.speed < STANDS_MPS:
            self._stands_since = time_s
        if self._over(time_s):
            self._cast.pace(self._actor, self._cast.cruise[self._actor.id])
            return False
        self._pace = max(0.0, self._pace - COMFORT_MPS2 * STEP_S)
        self._cast.pace(self._actor, self._pace)
        return True

    def _over(self, time_s: float) -> bool:
        if self._stands_since is None or self._duration is None:
            return False
        return time_s >= self._stands_since + self._duration - STEP_S / 100


class _Meeting:
    """Sets an actor's speed so that it comes to a point when the other was, or will be, there.

    It plans anew every step, and near the junction keeps the speed that it has until it is well inside. The plan hangs
    on where both are, and that it keeps its speed is an event: a clip that begins in between goes on in the same way.
    """

    def __init__(self, cast: Cast, recorder: Recorder, actor: Mobile, meets: Meets | MeetsState) -> None:
        self._cast, self._recorder, self._actor = cast, recorder, actor
        self._other, self._junction = cast.by_id[meets.other], meets.junction
        self._points = cast.progress.meeting(actor, self._other, meets.junction)
        self._gap_s = _si(meets.gap) * (1 if meets.order == "after" else -1)
        self._committed = False

    def update(self, time_s: float) -> bool:
        if self.over():
            self._recorder.event(time_s, self._actor.id, "met", {"junction": self._junction})
            self._cast.pace(self._actor, self._cast.cruise[self._actor.id])
            return False
        if not self._committed:
            pace, self._committed = self.asked(), self._near()
            self._cast.pace(self._actor, pace)
            if self._committed:
                detail = {"junction": self._junction, "speed_mps": pace}
                self._recorder.event(time_s, self._actor.id, "keeps_speed", detail)
        return True

    def asked(self) -> float:
        """Return what it asks the actor to drive now, without the actor's `timing`, m/s."""
        cast, actor, other, timing = self._cast, self._actor, self._other, self._actor.placed.timing
        cruise = cast.cruise[actor.id] / timing
        fastest = HASTE * cruise
        if self._near():
            return min(max(actor.speed / timing, CREEPS_MPS), fastest)
        if self._points is None or not other.present:
            return cruise
        own = self._points[0] - cast.progress.front(actor, cast.frame)
        theirs = self._points[1] - cast.progress.front(other, cast.frame)
        if own <= 0 or theirs <= 0:
            return cruise
        arrival = theirs / max(other.speed, WAITS_MPS) + self._gap_s
        return min(own / arrival, fastest) if arrival > 0 else fastest

    def over(self) -> bool:
        """Whether the actor is well inside the junction, has left the world, or does not come there."""
        room = self._room()
        return math.isnan(room) or room <= -MET_M or not self._actor.present

    def _near(self) -> bool:
        return self._room() <= (COMMITS_WALKING_M if isinstance(self._actor, Walker) else COMMITS_M)

    def _room(self) -> float:
        return self._cast.progress.to_junction(self._actor, self._junction, self._cast.frame)


def _si(value: Quantity | Ref) -> float:
    if isinstance(value, Ref):
        raise TypeError(f"the parameter {value.name} has no value: the scenario is not concrete")
    return value.si
