"""The order of what a trigger sets off: `then { }` blocks wait for what stands before them.

Every step is an event: `waits` (a `then when` begins to look at its condition), `then` (a block begins), `complete`.
All of them say which trigger and where in it: the numbers of the actions from its block inwards.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from foresee_dsl.language.model import Action, Condition, Then
from foresee_dsl.simulate.triggers.condition_history import Watch

Where = tuple[int, ...]
Doing = Callable[[], bool]
"""Asked whether an action is complete by now."""


class Stage(Protocol):
    """What a sequence needs of those who carry it out."""

    def begin(self, action: Action) -> Doing:
        """Begin an action."""
        ...

    def watch(self, condition: Condition, where: Where) -> Watch:
        """Begin to watch a condition of the step at `where`."""
        ...

    def note(self, what: str, where: Where) -> None:
        """Note a step as an event."""
        ...


class Sequence:
    """One block of actions that has begun; the blocks inside it follow.

    Plain actions begin at once, wherever they stand; each `then` begins when all before it in its block are complete.
    """

    def __init__(self, actions: tuple[Action, ...], stage: Stage, where: Where = ()) -> None:
        """Begin the block's plain actions."""
        self._actions, self._stage, self._where = actions, stage, where
        self._complete: set[int] = set()
        self._inner: dict[int, Sequence] = {}
        self._watches: dict[int, Watch] = {}
        self._doing = {k: stage.begin(action) for k, action in enumerate(actions) if not isinstance(action, Then)}

    @property
    def complete(self) -> bool:
        """Whether all of it has come to its end."""
        return len(self._complete) == len(self._actions)

    def advance(self) -> None:
        """Begin and end what can begin and end at this frame."""
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
                self._stage.note("complete", (*self._where, k))

    def _begins(self, k: int, then: Then) -> bool:
        if not self._complete.issuperset(range(k)):
            return False
        where = (*self._where, k)
        if then.condition is not None:
            if k not in self._watches:
                self._watches[k] = self._stage.watch(then.condition, where)
                self._stage.note("waits", where)
            if not self._watches[k].holds():
                return False
        self._stage.note("then", where)
        self._inner[k] = Sequence(then.actions, self._stage, where)
        return True
