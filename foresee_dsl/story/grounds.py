"""Collects the facts by which a failure is judged: right of way, and how much time the ego and the opponent had before
the end.
"""

from __future__ import annotations

from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.story.ego import EgoMotion
from foresee_dsl.story.facts import Facts
from foresee_dsl.story.opponent import Opponent
from foresee_dsl.story.place import StoryPlace, movement_near
from foresee_dsl.story.story import Grounds


def grounds_of(facts: Facts, ego: EgoMotion, other: Opponent | None, place: StoryPlace) -> Grounds:
    """Return the grounds of a run that ended at a place."""
    if other is None:
        return Grounds(round(ego.stood_s, 6), round(ego.braked_s, 6), signal=_signal(facts))
    onset = other.began
    return Grounds(
        stood_s=round(ego.stood_s, 6),
        braked_s=round(ego.braked_s, 6),
        seen_s=round(other.sighting.before_s(facts.end_s), 6),
        seen_before=other.sighting.again,
        acts_s=None if onset is None or onset <= 0 else round((facts.last - onset) * STEP_S, 6),
        steered=other.steered,
        stands=other.stands,
        breaks_rule=other.breaks_rule,
        gives_way=_gives_way(facts, ego, other, place),
        hidden_by=other.sighting.hidden_by if other.sudden else "",
        signal=_signal(facts),
    )


def _signal(facts: Facts) -> str:
    """Return the junction with a signal that the ego entered last in the run, and the colour of its signal at that
    time.
    """
    signal = ""
    for start, _, movement in facts.passages(0):
        colour = facts.colour(movement, max(0, start - 1))
        signal = f"{movement.junction} {colour}" if colour and start > 0 else signal
    return signal


def _gives_way(facts: Facts, ego: EgoMotion, other: Opponent, place: StoryPlace) -> str:
    """Return the rule by which the ego has to give way to the opponent, in words; "" if it does not have to.

    Vienna Convention on Road Traffic (1968): a driver who turns gives way to pedestrians and cyclists on the road that
    the driver enters (articles 16.2 and 21.2); at a crossing without signals pedestrians go first (article 21.2); at
    junctions the signs and the network's right of way decide (article 18).
    """
    turns = ego.going in ("turning left", "turning right")
    if other.stands or other.breaks_rule:
        return ""
    if other.kind in ("pedestrian", "bicycle") and place.kind == "crossing":
        return _at_crossing(facts, other, place, turns=turns)
    if other.kind == "bicycle" and turns and " beside " in other.relation:
        return "a driver who turns gives way to a cyclist beside it"
    if other.movement is None:
        return ""
    mine = movement_near(facts, 0, facts.last, place)
    junction = facts.network.junctions.get(other.movement.junction)
    if mine is None or junction is None or mine.junction != other.movement.junction:
        return ""
    first = junction.yields(mine.index, other.movement.index) and not junction.yields(other.movement.index, mine.index)
    return "the opponent has the right of way at the junction" if first else ""


def _at_crossing(facts: Facts, other: Opponent, place: StoryPlace, *, turns: bool) -> str:
    """Return why the ego has to give way to an actor on a crossing, in words; "" if it does not have to."""
    if turns:
        return f"a driver who turns gives way to a {other.kind} on the crossing"
    movement = movement_near(facts, 0, facts.last, place)
    signal = facts.colour(movement, facts.last) if movement is not None else ""
    return "" if signal else f"a {other.kind} goes first on a crossing without signals"
