"""What a window has to say of actions that are under way: orders to actors, and sequences half-way through."""

from __future__ import annotations

import numpy as np

from foresee_dsl.derive.clipping.conditions import both, restated, seconds
from foresee_dsl.derive.clipping.trigger_state import Progress, Script, Where, trimmed
from foresee_dsl.language.model import (
    Action,
    ChangesLane,
    ChangesSpeed,
    Comparison,
    Condition,
    Measure,
    Meets,
    Quantity,
    Stops,
    Then,
    Wait,
    When,
)
from foresee_dsl.language.traversal import si_of
from foresee_dsl.simulate.actors.moved_actors import STANDS_MPS
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace


def at_once(*actions: Action) -> When:
    """Return a trigger that fires at the first frame."""
    return When(condition=Comparison(left=Measure(what="time"), op=">=", right=seconds(0.0)), actions=actions)


def under_way(script: Script, trace: Trace) -> tuple[tuple[When, ...], frozenset[tuple[str, str]]]:
    """Return triggers that go on with the sequences that have begun.

    Returns:
        The triggers; and what they take up themselves: (actor, `speed`) or (actor, `lane`), so that nobody else does.
    """
    found: list[When] = []
    taken: set[tuple[str, str]] = set()
    for when, progress in zip(script.whens, script.progress, strict=True):
        rest = _Rest(script, trace, progress)
        actions = rest.block(when.actions, ()) if () in progress.began else ()
        while len(actions) == 1 and isinstance(only := actions[0], Then) and only.condition is None:
            actions = only.actions
        if any(isinstance(action, Then) for action in actions):  # orders alone are taken up actor by actor
            found.append(at_once(*actions))
            taken |= rest.taken
    return tuple(found), frozenset(taken)


class _Rest:
    """What is left of one trigger's sequence."""

    def __init__(self, script: Script, trace: Trace, progress: Progress) -> None:
        self._script, self._trace, self._progress = script, trace, progress
        self._now_s = script.moment.time_s
        self.taken: set[tuple[str, str]] = set()

    def block(self, actions: tuple[Action, ...], where: Where) -> tuple[Action, ...]:
        """Return the rest of a block that has begun."""
        found: list[Action] = []
        for k, action in enumerate(actions):
            here = (*where, k)
            if here in self._progress.complete:
                continue
            if not isinstance(action, Then):
                found += self._action(action, here)
            elif here in self._progress.began:
                inner = self.block(action.actions, here)
                # Orders alone need no block of their own: what comes next waits for them here too.
                follows = any(isinstance(step, Then) for step in inner)
                found += [Then(actions=inner)] if follows else inner
            else:
                condition = self._condition(action, here)
                if condition is False:
                    break
                inner = self._script.future(action.actions, self._until()) or (Wait(duration=seconds(0.0)),)
                found.append(Then(condition=None if condition is True else condition, actions=inner))
        return trimmed(found)

    def _condition(self, then: Then, here: Where) -> Condition | bool:
        """Return what a step that has not begun waits for."""
        said: Condition | bool = True
        if then.condition is not None:
            runs = self._progress.runs.get(here, {}) if here in self._progress.waits else None
            said = restated(then.condition, self._script.moment, runs)
        return both(said, self._until())

    def _until(self) -> Condition | bool:
        """Return until when steps of the sequence come: then it starts anew."""
        if self._progress.again_s is None:
            return True
        again = seconds(self._progress.again_s - self._now_s)
        return Comparison(left=Measure(what="time"), op="<", right=again)

    def _action(self, action: Action, here: Where) -> list[Action]:
        """Return what is left of an action that is not complete: the rest of it, or the time until its end."""
        since_s = self._progress.began[here[:-1]]
        if isinstance(action, Wait):
            end_s = since_s + si_of(action.duration)
            return [Wait(duration=seconds(max(0.0, end_s - self._now_s)))]
        left = None if isinstance(action, Then) else self._order(action, since_s)
        if left is not None:
            return [left]
        # It goes on by itself (a lane is half changed, a junction half crossed): its end is known from the run.
        end_s = self._progress.ends.get(here, float(self._trace.time_s[-1]) + STEP_S)
        return [Wait(duration=seconds(end_s - self._now_s))]

    def _order(self, action: Action, since_s: float) -> Action | None:
        """Return an order to give again."""
        if not isinstance(action, ChangesSpeed | Stops | Meets | ChangesLane):
            return None
        trace, frame = self._trace, self._trace.frame_at(self._now_s)
        actor, told = trace.index(action.actor), self._script.of(action.actor)
        left: Action | None = None
        if isinstance(action, ChangesLane):
            left = action if still_to_change(trace, actor, frame, since_s) else None
        elif isinstance(action, Meets):
            meeting = told.command is not None and told.command[0] == action and told.keeps_mps is None
            left = action if meeting and action.actor not in self._script.timed else None
        else:
            left = rest_of(trace, actor, frame, action, since_s)
        if left is not None:
            self.taken.add((action.actor, "lane" if isinstance(action, ChangesLane) else "speed"))
        return left


def rest_of(
    trace: Trace, actor: int, frame: int, action: ChangesSpeed | Stops, since_s: float
) -> ChangesSpeed | Stops | None:
    """Return what is left of a change of speed or a stop, None where it is over."""
    if isinstance(action, Stops):
        return stop_left(trace, actor, frame, action, since_s)
    if not isinstance(action.over, Quantity):
        return action
    left_s = since_s + action.over.si - float(trace.time_s[frame])
    return action.model_copy(update={"over": seconds(left_s)}) if left_s > 1e-6 else None


def stop_left(trace: Trace, actor: int, frame: int, action: Stops, since_s: float) -> Stops | None:
    """Return what is left of a stop, None where it is over: its time counts from when the actor stands."""
    if not isinstance(action.duration, Quantity):
        return action
    began = trace.frame_at(since_s)
    stands = np.flatnonzero(trace.states[began : frame + 1, actor, SPEED] < STANDS_MPS)
    stood_s = float(trace.time_s[frame] - trace.time_s[began + stands[0]]) if stands.size else 0.0
    left_s = action.duration.si - stood_s
    return Stops(actor=action.actor, duration=seconds(left_s)) if left_s > 1e-6 else None


def still_to_change(trace: Trace, actor: int, frame: int, since_s: float) -> bool:
    """Say whether an actor is still on the lane on which it was asked to change."""
    lanes = trace.lanes[trace.frame_at(since_s) : frame + 1, actor]
    return bool(lanes.size and lanes[0] >= 0 and (lanes == lanes[0]).all())
