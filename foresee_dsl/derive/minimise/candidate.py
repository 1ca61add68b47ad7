"""A smaller version of a failing mutant: its remaining seconds, actors and changes, and the clip and mutant built from
it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from foresee_dsl.derive.clipping.clip import clip as cut_clip
from foresee_dsl.derive.clipping.triggers import trimmed
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.language.project.changes import value_of
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.traversal import mentioned, si_of
from foresee_dsl.simulate.trace import STEP_S, Trace


@dataclass(frozen=True)
class TrialCandidate:
    """A version of the mutant, described by what remains of it.

    Attributes:
        first, last: first and last frame of its clip in the parent's run.
        changes: the remaining changes, with values and times relative to the unreduced clip.
        actors, signals: names of the actors and signals that are left out. triggers: indices of the triggers that are
            left out, among those that the clip has when it is cut.
    """

    first: int
    last: int
    changes: tuple[m.Change, ...]
    actors: frozenset[str] = frozenset()
    signals: frozenset[str] = frozenset()
    triggers: frozenset[int] = frozenset()

    def has_clip_of(self, other: TrialCandidate) -> bool:
        """Return whether this candidate's clip has all that another one's clip has, and perhaps more."""
        return (
            self.first <= other.first
            and self.last >= other.last
            and self.actors <= other.actors
            and self.signals <= other.signals
            and self.triggers <= other.triggers
        )


@dataclass(frozen=True)
class Subject:
    """A mutant to be minimised.

    Attributes:
        parent: the test case from which the clip was cut. clip, mutant: the unreduced ones.
        trace: the run from which the clip was cut; None if it is not available.
        folder: the folder of the files; paths in the clip are relative to it.
    """

    parent: TestCase
    clip: m.Clip
    mutant: m.Mutant
    trace: Trace | None
    folder: Path

    @property
    def whole(self) -> TrialCandidate:
        """Return the unreduced mutant as a candidate."""
        window = next(item for item in self.clip.body if isinstance(item, m.Window))
        first, last = (round(si_of(value) / STEP_S) for value in (window.start, window.end))
        return TrialCandidate(first, last, self.mutant.changes)

    @property
    def actors(self) -> tuple[str, ...]:
        """Return the names of all actors of the clip except the ego."""
        return tuple(item.name for item in self.clip.body if isinstance(item, m.Actor))

    @property
    def signals(self) -> tuple[str, ...]:
        """Return the ids of the junctions whose signals the clip states."""
        return tuple(str(item.junction) for item in self.clip.body if isinstance(item, m.SignalState))

    @cached_property
    def cut_again(self) -> bool:
        """Return whether the clip can be cut again from the parent's run; only then can it begin or end at
        other times.
        """
        whole = self.whole
        try:
            again = self._cut(whole.first, whole.last)
        except ValueError:
            return False
        return clip_pin(again, again.pin) == clip_pin(self.clip, self.clip.pin)

    def cut(self, first: int, last: int) -> m.Clip:
        """Return the clip of these frames with all its actors.

        Raises:
            ValueError: it cannot be cut there.
        """
        whole = self.whole
        if (first, last) == (whole.first, whole.last):
            return self.clip
        if not self.cut_again:
            raise ValueError("the run from which the clip was cut is not available")
        return self._cut(first, last)

    def _cut(self, first: int, last: int) -> m.Clip:
        if self.trace is None or not 0 <= first < last < self.trace.frames:
            raise ValueError(f"the parent's run has no frames {first} to {last}")
        risk, middle = self.clip.risk, (self.whole.first + self.whole.last) // 2
        at = round(risk.at.si / STEP_S) if risk is not None and isinstance(risk.at, m.Quantity) else middle
        point = RiskyPoint(1, at, at * STEP_S, (risk.actor or "") if risk else "", "none", 0.0, 0.0, 0.0,
                           risk.text if risk else "")  # fmt: skip
        model = cut_clip(
            self.parent,
            self.trace,
            point,
            before_s=(at - first) * STEP_S,
            after_s=(last - at) * STEP_S,
            name=self.clip.name,
            parent=self.clip.parent,
            handover_s=self._handover_s,
        )
        # The risk line stays as it is written; it names its actor only if the clip still contains that actor.
        gone = any(isinstance(item, m.Risk) and item.actor is None for item in model.body)
        again = () if risk is None else (risk.model_copy(update={"actor": None}) if gone else risk,)
        body = (new for item in model.body for new in (again if isinstance(item, m.Risk) else (item,)))
        return model.model_copy(update={"body": tuple(body)})

    @property
    def _handover_s(self) -> float:
        ego = next(item for item in self.clip.body if isinstance(item, m.Ego))
        return max((si_of(item.time) for item in ego.body if isinstance(item, m.Recorded)), default=0.0)


@dataclass(frozen=True)
class BuiltCandidate:
    """A candidate's clip and mutant, as models and as test cases."""

    clip: m.Clip
    mutant: m.Mutant
    clip_case: TestCase
    case: TestCase = field(repr=False)


def build(subject: Subject, candidate: TrialCandidate) -> BuiltCandidate:
    """Return the clip and the mutant of a candidate.

    Raises:
        InputError: the changes do not fit the reduced clip. ValueError: the clip cannot be cut there.
    """
    cut = subject.cut(candidate.first, candidate.last)
    clip = cut.model_copy(update={"body": tuple(_left(cut.body, candidate))})
    clip_case = expand_clip(clip, subject.parent, source=subject.folder / f"{clip.name}.foresee")
    later_s = (candidate.first - subject.whole.first) * STEP_S
    changes = tuple(_moved(change, subject.clip, clip, later_s) for change in candidate.changes)
    others = tuple(item for item in subject.mutant.body if not isinstance(item, m.Change))
    mutant = subject.mutant.model_copy(
        update={"body": (*changes, *others), "parent": f"{clip.name}.foresee", "pin": clip_pin(clip, clip.pin)}
    )
    case = expand_mutant(mutant, clip_case, source=subject.folder / f"{mutant.name}.foresee")
    return BuiltCandidate(clip, mutant, clip_case, case)


def _left(body: Iterable[m.ClipItem], candidate: TrialCandidate) -> Iterable[m.ClipItem]:
    """Yield the statements of a clip that remain without the actors, signals and triggers that are left out."""
    gone, number = candidate.actors, -1
    for item in body:
        match item:
            case m.Actor():
                if item.name not in gone:
                    rules = tuple(i for i in item.body if not (isinstance(i, m.MeetsState) and i.other in gone))
                    yield item if len(rules) == len(item.body) else item.model_copy(update={"body": rules})
            case m.SignalState():
                if str(item.junction) not in candidate.signals:
                    yield item
            case m.When():
                number += 1
                left = without_actors(item, gone)
                if left is not None and number not in candidate.triggers:
                    yield left
            case m.Risk():
                yield item.model_copy(update={"actor": None, "operator": None}) if item.actor in gone else item
            case m.Fidelity():
                pass  # measured again for the smaller clip
            case _:
                yield item


def without_actors(when: m.When, gone: frozenset[str]) -> m.When | None:
    """Return a trigger without its actions on actors that are left out; None if no action remains."""
    if mentioned(when.condition) & gone:
        return None
    actions = _actions_left(when.actions, gone)
    return when if actions == when.actions else when.model_copy(update={"actions": actions}) if actions else None


def _actions_left(actions: tuple[m.Action, ...], gone: frozenset[str]) -> tuple[m.Action, ...]:
    remaining: list[m.Action] = []
    for action in actions:
        if isinstance(action, m.Then):
            if action.condition is not None and mentioned(action.condition) & gone:
                break  # this step and those after it can never begin
            remaining.append(action.model_copy(update={"actions": _actions_left(action.actions, gone) or _NOTHING}))
        elif not {getattr(action, "actor", None), getattr(action, "other", None)} & gone:
            remaining.append(action)
    return trimmed(remaining)


_NOTHING = (m.Wait(duration=m.Quantity.of(0.0, "time", 2)),)


def _moved(change: m.Change, before: m.Clip, after: m.Clip, later_s: float) -> m.Change:
    """Return a change for a clip that begins later. It acts at the same time of the run as before, and its old value is
    the one that the actor has at the clip's new beginning.
    """
    if isinstance(change.start, m.Quantity) and later_s:
        start = m.Quantity.of(max(0.0, change.start.si - later_s), "time", 2)
        change = change.model_copy(update={"start": start})
    was, now = (_present(clip, change) for clip in (before, after))
    if was is None or now is None or was == now or not isinstance(was, m.Quantity) or not isinstance(now, m.Quantity):
        return change
    if not isinstance(change.now, m.Quantity) or change.now.unit != now.unit:
        return change
    return change.model_copy(
        update={"was": now, "now": m.Quantity(value=change.now.value + now.value - was.value, unit=now.unit)}
    )


def _present(clip: m.Clip, change: m.Change) -> object:
    actors = (item for item in clip.body if isinstance(item, m.Ego | m.Actor))
    actor = next((item for item in actors if item.name == change.actor), None)
    return value_of(actor, change.property) if actor is not None else None
