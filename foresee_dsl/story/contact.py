"""Classifies a run's contact as people see it, and finds out whether the mutation steered the opponent into the ego."""

from __future__ import annotations

import math

from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.model import Change, Quantity
from foresee_dsl.simulate.results.verdict import Impact, Verdict
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.story.facts import Facts
from foresee_dsl.story.story import ContactClass

ALONG_RAD = math.pi / 4
"""Two actors drive along each other, in the same or the opposite direction, if their courses differ by less than this,
modulo half a turn, rad. `simulate.results.outcome` uses the same angle for "the same direction"."""
TURNS_RAD = math.radians(5)
"""An ego whose heading changes by more than this within 1 s is turning, rad. Ours: a lane change at 50 km/h changes the
heading by 4 degrees."""

_WITHOUT_CONTACT: dict[Verdict | None, ContactClass] = {
    Verdict.RULE: ContactClass.RULE, Verdict.GOAL: ContactClass.GOAL, Verdict.F1: ContactClass.OFF_ROAD,
}  # fmt: skip
"""The classes of runs that ended without a contact; all others have none."""


def contact_class(facts: Facts) -> ContactClass:
    """Return the class of a run's contact."""
    impact = facts.impact
    if impact is None:
        return _WITHOUT_CONTACT.get(facts.verdict, ContactClass.NONE)
    if steered_into(facts, impact):
        return ContactClass.STRUCK_BY_STEERED
    if impact.ego_mps < STANDS_MPS:
        return ContactClass.HIT_WHILE_STANDING
    if impact.struck_by == "ego" or impact.other_mps < STANDS_MPS:
        return ContactClass.EGO_DROVE_INTO
    return ContactClass.BOTH_MOVING


def steering_of(facts: Facts) -> Change | None:
    """Return the change that moved the opponent sideways; None if the mutation has no such change."""
    other = facts.info(facts.opponent).id if facts.opponent else ""
    return next((c for c in facts.changes if c.actor == other and c.property in ("steer", "line")), None)


def steered_into(facts: Facts, impact: Impact) -> bool:
    """Return whether the opponent struck the ego because the mutation moved its wheels or its line towards the ego.

    If the mutation turned its wheels and it moves at the contact, it struck the ego, no matter which side touched
    first. If the mutation only shifted its line, three conditions must hold: both actors drive along each other, the
    ego does not turn, and the opponent struck the ego. An actor that crosses the ego's way would reach the ego on any
    line.
    """
    if facts.opponent is None or impact.other_mps < STANDS_MPS or not moved_towards(facts):
        return False
    change = steering_of(facts)
    if change is not None and change.property == "steer":
        return True
    course = facts.relative_course(facts.opponent, facts.last)
    along = abs(course) < ALONG_RAD or abs(course) > math.pi - ALONG_RAD
    ego_turned = abs(wrap(facts.heading(0, facts.last) - facts.heading(0, max(0, facts.last - round(1 / STEP_S)))))
    return along and ego_turned < TURNS_RAD and impact.struck_by == "other"


def moved_towards(facts: Facts) -> bool:
    """Return whether the mutation moved the opponent's wheels or line towards the ego before the run's end."""
    change = steering_of(facts)
    if change is None or facts.opponent is None or steered_from(change) > facts.last:
        return False
    return side_of(change) * _left_of(facts, facts.opponent) > 0


def steered_from(change: Change) -> int:
    """Return the first frame at which a change moves its actor sideways."""
    return round((change.start.si if isinstance(change.start, Quantity) else 0.0) / STEP_S)


def side_of(change: Change) -> float:
    """Return a positive number if a change moves its actor to the left, and a negative number if to the right."""
    now, was = (value.si if isinstance(value, Quantity) else 0.0 for value in (change.now, change.was))
    return now - was


def _left_of(facts: Facts, actor: int) -> float:
    """Return the ego's distance to the left of the line along which an actor moved before it was steered, m.

    A change of `line` has no time at which it begins; the actor's course 1.5 s before the end is used instead.
    """
    change = steering_of(facts)
    steered = change is not None and change.property == "steer"
    frame = min(steered_from(change), facts.last) if change and steered else max(0, facts.last - round(1.5 / STEP_S))
    (x, y), (ex, ey) = facts.xy(actor, frame), facts.xy(0, facts.last)
    course = facts.course(actor, frame)
    return (ey - y) * math.cos(course) - (ex - x) * math.sin(course)
