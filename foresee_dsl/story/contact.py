"""How a run ended for people: which class of contact, and whether the mutation steered the other into the ego."""

from __future__ import annotations

import math

from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.language.model import Change, Quantity
from foresee_dsl.simulate.results.outcome import STUCK_SPEED_MPS
from foresee_dsl.simulate.results.verdict import Impact, Verdict
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.story.facts import Facts
from foresee_dsl.story.story import ContactClass

ALONG_RAD = math.pi / 4
"""Courses that differ by less than this are along each other (the same way or the opposite one): what counts as the
same direction in `simulate.results.outcome`."""
TURNS_RAD = math.radians(5)
"""An ego that has turned by more than this in a second turns. Ours: a lane change at 50 km/h turns by 4 degrees."""


def contact_class(facts: Facts) -> ContactClass:
    """Return the class of a run's ending."""
    found = facts.impact
    if found is None:
        return ContactClass.OFF_ROAD if facts.verdict is Verdict.F1 else ContactClass.NONE
    if steered_into(facts, found):
        return ContactClass.STRUCK_BY_STEERED
    if found.ego_mps < STUCK_SPEED_MPS:
        return ContactClass.HIT_WHILE_STANDING
    if found.struck_by == "ego" or found.other_mps < STUCK_SPEED_MPS:
        return ContactClass.EGO_DROVE_INTO
    return ContactClass.BOTH_MOVING


def steering_of(facts: Facts) -> Change | None:
    """Return the change that moved the opponent sideways, if the mutation has one."""
    other = facts.info(facts.opponent).id if facts.opponent else ""
    return next((c for c in facts.changes if c.actor == other and c.property in ("steer", "line")), None)


def steered_into(facts: Facts, found: Impact) -> bool:
    """Say whether the mutation moved the opponent's wheels or line towards the ego, and it struck the ego with that.

    A steered vehicle that moves at the contact has come over to the ego: it did the striking, whichever side touched.
    A line that lies farther to one side only counts where the two drive along each other, the ego does not turn to
    that side by itself, and the other struck it: someone who crosses comes to the ego on any line.
    """
    if facts.opponent is None or found.other_mps < STUCK_SPEED_MPS or not moved_towards(facts):
        return False
    change = steering_of(facts)
    if change is not None and change.property == "steer":
        return True
    turned = facts.turned(facts.opponent, facts.last)
    along = abs(turned) < ALONG_RAD or abs(turned) > math.pi - ALONG_RAD
    ego_turned = abs(wrap(facts.heading(0, facts.last) - facts.heading(0, max(0, facts.last - round(1 / STEP_S)))))
    return along and ego_turned < TURNS_RAD and found.struck_by == "other"


def moved_towards(facts: Facts) -> bool:
    """Say whether the mutation moved the opponent's wheels or line towards the ego, before the run's end."""
    change = steering_of(facts)
    if change is None or facts.opponent is None or steered_from(change) > facts.last:
        return False
    return side_of(change) * _left_of(facts, facts.opponent) > 0


def steered_from(change: Change) -> int:
    """Return the frame from which on a change moves its actor sideways."""
    return round((change.start.si if isinstance(change.start, Quantity) else 0.0) / STEP_S)


def side_of(change: Change) -> float:
    """Return over 0 where a change moves its actor to its left, under 0 to its right."""
    now, was = (value.si if isinstance(value, Quantity) else 0.0 for value in (change.now, change.was))
    return now - was


def _left_of(facts: Facts, actor: int) -> float:
    """Return how far the ego is to the left of the line on which an actor was heading before it was moved, m.

    A line lies elsewhere from the start: the actor's course 1.5 s before the end is taken.
    """
    change = steering_of(facts)
    steered = change is not None and change.property == "steer"
    frame = min(steered_from(change), facts.last) if change and steered else max(0, facts.last - round(1.5 / STEP_S))
    (x, y), (ex, ey) = facts.xy(actor, frame), facts.xy(0, facts.last)
    course = facts.course(actor, frame)
    return (ey - y) * math.cos(course) - (ex - x) * math.sin(course)
