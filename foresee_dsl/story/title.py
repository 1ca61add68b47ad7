"""Writes the title of a story: at most eight words, to which up to four more are added to tell equal titles apart."""

from __future__ import annotations

from foresee_dsl.simulate.results.goal import GoalSeries
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.rules.infraction import Rule
from foresee_dsl.story.ego import EgoMotion
from foresee_dsl.story.facts import Facts
from foresee_dsl.story.opponent import Opponent
from foresee_dsl.story.place import StoryPlace
from foresee_dsl.story.story import ContactClass
from foresee_dsl.story.wording import what_is

TITLE_WORDS = 8
"""Maximum number of words of a title. Ours: with a test case of four words before it, a line of twelve."""
_RULES = {
    Rule.RED: "ego runs a red light",
    Rule.STOP: "ego does not stop at a stop sign",
    Rule.CROSSING: "ego does not yield on a crossing",
    Rule.PRIORITY: "ego does not give the right of way",
    Rule.SPEED: "ego exceeds the speed limit",
    Rule.SIDE: "ego drives on the wrong side",
    Rule.BLOCKED: "ego blocks a junction",
}
_NOUNS = {"bicycle": "cyclist"}


def title_of(facts: Facts, ego: EgoMotion, other: Opponent | None, contact: ContactClass, place: StoryPlace) -> str:
    """Return the title of a story: who hit whom, and what both were doing."""
    if facts.infraction is not None:
        return _RULES[facts.infraction.rule]
    going = f"ego {ego.going.replace('to the ', '')}".strip()
    if other is None or facts.impact is None:
        return _alone(facts, ego, going, place) if contact is not ContactClass.GOAL else _of_goal(facts, other)
    noun = what_is(facts.info(other.actor))
    noun = _NOUNS.get(noun, noun)
    match contact:
        case ContactClass.STRUCK_BY_STEERED:
            return _fitting(f"{noun} steered into the {going}", f"{noun} steered into the ego")
        case ContactClass.HIT_WHILE_STANDING:
            return _fitting(f"{_doing(other, noun)} hits the standing ego", f"{noun} hits the standing ego")
        case ContactClass.EGO_DROVE_INTO:
            hits = f"hits {_doing(other, noun)}"
            return _fitting(f"{going} {hits}", f"ego {hits}", f"ego hits {noun}")
        case _:
            pair = f"{_doing(other, noun)} collide"
            return _fitting(f"{going} and {pair}", f"ego and {pair}", f"ego and {noun} collide")


def _of_goal(facts: Facts, other: Opponent | None) -> str:
    """Return the title of a run that broke the goal of its campaign."""
    goal = GoalSeries.in_meta(facts.trace.meta)
    breaks = f"ego breaks {goal.name if goal is not None else 'the goal'}"
    if other is None:
        return breaks
    noun = what_is(facts.info(other.actor))
    return _fitting(f"{breaks}, {_doing(other, _NOUNS.get(noun, noun))}", breaks)


def _alone(facts: Facts, ego: EgoMotion, going: str, place: StoryPlace) -> str:
    if facts.verdict is Verdict.F1:
        return f"{going} leaves the road"
    verb = "stands" if ego.state == "stands" else "drives"
    return _fitting(f"{going} {verb} {place.text}".rstrip(), f"ego {verb} {place.text}".rstrip(), f"{going} {verb}")


def _fitting(*titles: str) -> str:
    """Return the first title that has at most `TITLE_WORDS` words; without one, the last title."""
    return next((title for title in titles if len(title.split()) <= TITLE_WORDS), titles[-1])


def _doing(other: Opponent, noun: str) -> str:
    """Return the opponent and what it does in at most four words, such as `cyclist beside it`."""
    acts = (
        (other.stands, f"standing {noun}"),
        (other.steered, f"steered {noun}"),
        (other.sudden, f"{noun} out of hiding"),
        (other.pulls_out, f"{noun} pulling out"),
        (other.breaks_rule == "on red", f"{noun} on red"),
        (bool(other.breaks_rule), f"{noun} not giving way"),
    )
    relations = (
        (" from the left", f"{noun} from the left"),
        (" from the right", f"{noun} from the right"),
        (" beside ", f"{noun} beside it"),
        (" the other way", f"oncoming {noun}"),
        (" towards ", f"oncoming {noun}"),
        (" from behind", f"{noun} from behind"),
        (" ahead ", f"{noun} ahead"),
    )
    comes = f"{other.relation} "
    phrases = (*acts, *((words in comes, text) for words, text in relations))
    return next((text for holds, text in phrases if holds), noun)
