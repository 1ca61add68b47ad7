"""Evaluates one `when` of a run: it fires when its condition begins to hold, and goes through its actions.

Every step is an event: `trigger`, `rearmed` (the condition of an `every` has ceased to hold), `holds` and `lapses` (the
condition of a `for` begins or ceases to hold), `waits` (a `then when` begins to evaluate its condition), `then` (a
block begins), `complete`. All events contain the trigger and the place in it. The state is recorded too, for clips.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from foresee_dsl.language.model import Action, Condition, Then, When
from foresee_dsl.simulate.trigger_record import BlockState, HoldingTime, Place, TriggerState, add
from foresee_dsl.simulate.triggers.condition_history import Watch
from foresee_dsl.simulate.triggers.conditions import Conditions

IsComplete = Callable[[], bool]
"""Function that returns whether an action is complete."""
Act = Callable[[Action], IsComplete]
"""Function that begins an action and returns a function that says whether it is complete."""
Note = Callable[[str, dict[str, Any]], None]
"""Function that records an event with its details."""


class Trigger:
    """A `when` of the scenario in a run.

    When an `every` fires while its sequence is still running, the sequence starts again: orders of the old sequence
    continue until another order replaces them, but its remaining steps are dropped. While the condition has no outcome,
    nothing changes.

    Attributes:
        begin: begins an action.
    """

    def __init__(self, index: int, when: When, conditions: Conditions, begin: Act, note: Note) -> None:
        self._index, self._when, self._conditions = index, when, conditions
        self.begin, self._note = begin, note
        self.states: list[TriggerState] = []
        """The recorded states of the trigger, in order of time."""
        self._changed = True
        self._watch: Watch | None = self.watch(when.condition, ())
        # A trigger fires when its condition holds and did not hold at the frame before.
        self._held = when.repeat == "next"
        self._fired_s: float | None = None
        self._follows = any(isinstance(action, Then) for action in when.actions)
        self._sequence: Sequence | None = None
        self.record()

    def look(self) -> None:
        """Evaluate the condition at this frame; fire if it begins to hold."""
        if self._watch is None:
            return
        held = self._watch.truth()
        if held is None or held is self._held:  # the condition neither begins nor ceases to hold
            return
        fires, ceased = held, not held
        self._held = held
        if ceased:
            self._event("rearmed")
        if fires:
            if self._when.repeat in (None, "once"):
                self._watch = None
            self._event("trigger")
            self._fired_s = self.now_s
            sequence = Sequence(self._when.actions, self, ())
            self._sequence = sequence if self._follows else None

    def advance(self) -> None:
        """Begin the actions of the sequence that can begin at this frame, and note those that are complete."""
        if self._sequence is not None:
            self._sequence.advance()
            if self._sequence.complete:
                self._sequence = None

    def record(self) -> None:
        """Record the state of the trigger if it has changed since the last frame."""
        if self._changed:
            runs = self._watch.runs if self._watch is not None else {}
            sequence = self._sequence.state() if self._sequence is not None else None
            add(self.states, TriggerState(self.now_s, self._fired_s, self._held, runs, sequence))
            self._changed = False

    # --- what its sequence needs -----------------------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """The time of the current frame, s."""
        return round(self._conditions.time_s, 6)

    def watch(self, condition: Condition, place: Place) -> Watch:
        """Begin to watch a condition of the trigger (or of the step at `place`)."""

        def note(part: int, run: HoldingTime | None) -> None:
            detail = {} if run is None else asdict(run)
            self._event("lapses" if run is None else "holds", where=list(place), part=part, **detail)

        return Watch(condition, self._conditions, note)

    def note(self, what: str, place: Place) -> None:
        """Record a step of the trigger as an event."""
        self._event(what, where=list(place))

    def _event(self, what: str, **detail: Any) -> None:  # noqa: ANN401  JSON values
        self._note(what, {"index": self._index, **detail})
        self._changed = True


class Sequence:
    """A block of actions that has begun, with the blocks inside it.

    Plain actions begin at once, wherever they stand; each `then` begins when all actions before it in its block are
    complete.
    """

    def __init__(self, actions: tuple[Action, ...], trigger: Trigger, place: Place) -> None:
        """Begin the block's plain actions."""
        self._actions, self._trigger, self._place = actions, trigger, place
        self._began_s = trigger.now_s
        self._complete: set[int] = set()
        self._inner: dict[int, Sequence] = {}
        self._watches: dict[int, Watch] = {}
        plain = (k for k, action in enumerate(actions) if not isinstance(action, Then))
        self._doing = {k: trigger.begin(actions[k]) for k in plain}

    @property
    def complete(self) -> bool:
        """Whether all actions of the block are complete."""
        return len(self._complete) == len(self._actions)

    def state(self) -> BlockState:
        """Return the current state of the block."""
        waits = {k: watch.runs for k, watch in self._watches.items() if k not in self._inner}
        inner = {k: block.state() for k, block in self._inner.items() if k not in self._complete}
        return BlockState(self._began_s, frozenset(self._complete), waits, inner)

    def advance(self) -> None:
        """Begin the actions that can begin at this frame, and note those that are complete."""
        for k, action in enumerate(self._actions):
            if k in self._complete:
                continue
            if isinstance(action, Then):
                if k not in self._inner and not self._begins(k, action):
                    continue
                self._inner[k].advance()
                done = self._inner[k].complete
            else:
                done = self._doing[k]()
            if done:
                self._complete.add(k)
                self._trigger.note("complete", (*self._place, k))

    def _begins(self, k: int, then: Then) -> bool:
        if not self._complete.issuperset(range(k)):
            return False
        place = (*self._place, k)
        if then.condition is not None:
            if k not in self._watches:
                self._watches[k] = self._trigger.watch(then.condition, place)
                self._trigger.note("waits", place)
            if not self._watches[k].held():
                return False
        self._trigger.note("then", place)
        self._inner[k] = Sequence(then.actions, self._trigger, place)
        return True
