"""Tells the story of a run from its trace and its test case, and writes its title: at most eight words, to which up to
four more are added to tell equal titles apart."""

from __future__ import annotations

from dataclasses import replace
from typing import assert_never

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Change, Expression, Quantity
from foresee_dsl.language.traversal import si_of
from foresee_dsl.simulate.results.goal import GoalSeries
from foresee_dsl.simulate.results.infraction import Infraction, Rule
from foresee_dsl.simulate.results.outcome import touched_at
from foresee_dsl.simulate.results.verdict import Impact, Verdict
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace
from foresee_dsl.simulate.waiting import AHEAD_M, WayAhead
from foresee_dsl.story.contact import contact_class
from foresee_dsl.story.ego import EgoMotion, ego_moments, ego_of
from foresee_dsl.story.facts import Facts
from foresee_dsl.story.grounds import grounds_of
from foresee_dsl.story.opponent import Opponent
from foresee_dsl.story.place import StoryPlace, kind_of, place_of
from foresee_dsl.story.story import ContactClass, Moment, Story, seen_for
from foresee_dsl.story.wording import full_name, kmh, metres, name_of, quoted, short, what_is, with_side

BRIEF_STOP_S = 1.0
"""An ego that has stood for less than this is said to have just stopped, s. Ours."""
SEEN_SHORTLY_S = 3.0
"""The sentence states how long the ego saw the opponent if that is shorter than this, s. Ours: three times what a
driver needs."""


def tell(trace: Trace, case: TestCase, bundle: SumoBundle | None = None) -> Story:
    """Return what happened in a run of a test case; `bundle`: the compiled test case, if it is at hand.

    Raises:
        InputError, CompileError: the test case cannot be compiled.
    """
    whole = Facts.of(trace, case) if bundle is None else Facts(trace, case, bundle)
    facts = whole.at_nearest() if whole.verdict is Verdict.PASS else whole.at_failure()
    contact, impact = contact_class(facts), facts.impact
    at = touched_at(facts.trace, impact) if impact else facts.xy(0, facts.last)
    place = place_of(facts, at, facts.last)
    ego = ego_of(facts, place, whole)
    other = Opponent(facts, facts.opponent, place, contact) if facts.opponent else None
    broken, steered = whole.infraction, contact is ContactClass.STRUCK_BY_STEERED
    goal = whole.goal
    return Story(
        moments=_moments(whole, ego_moments(whole, facts.last), other, impact),
        sentence=_of_rule(broken, ego)
        if broken is not None
        else _of_goal(goal, ego, other)
        if goal is not None
        else _sentence(facts, ego, other, place),
        opponent=facts.info(other.actor).id if other else "",
        opponent_kind=other.kind if other else "",
        contact=contact,
        ego_manoeuvre=ego.manoeuvre(steered=steered) if broken is None else broken.rule.value.replace("_", " "),
        opponent_manoeuvre=other.manoeuvre if other else "",
        place=place.name,
        touch=_touch(contact, impact),
        mutation="; ".join(_changed(change, facts) for change in facts.changes),
        title=_title_of(facts, ego, other, contact, place),
        grounds=grounds_of(facts, ego, other, place),
    )


def _moments(
    facts: Facts, ego: tuple[Moment, ...], other: Opponent | None, impact: Impact | None
) -> tuple[Moment, ...]:
    moments = [*ego, *(other.moments() if other else ())]
    moments += [Moment(broken.time_s, "ego", "rule", f"the ego {_clause(broken)}") for broken in facts.infractions]
    moments += [Moment(0.0, change.actor, "mutation", _changed(change, facts)) for change in facts.changes]
    if impact is not None:
        struck = replace(impact, with_=quoted(impact.with_)).struck
        text = f"contact, {with_side(impact.side)}, relative speed {impact.relative_mps:.1f} m/s: {struck}"
        moments.append(Moment(facts.end_s, "ego", "contact", text))
    elif facts.verdict is not None:
        if other is not None and facts.verdict is Verdict.PASS:
            text = f"{name_of(facts.info(other.actor))} is nearest, {metres(other.ahead_m(other.facts.last))} away"
            moments.append(Moment(other.facts.end_s, facts.info(other.actor).id, "nearest", text))
        ends = "the ego leaves the road" if facts.verdict is Verdict.F1 else f"the run ends: {facts.verdict.label}"
        moments.append(Moment(facts.end_s, "ego", "ends", ends))
    return tuple(sorted(moments, key=lambda moment: moment.time_s))


def _of_rule(broken: Infraction, ego: EgoMotion) -> str:
    """Return the sentence of a run that failed by a traffic rule."""
    going = f", {ego.going}," if ego.going else ""
    return f"the ego{going} {_clause(broken)} at {broken.time_s:.2f} s; it {_drives(ego)} then"


def _of_goal(goal: GoalSeries, ego: EgoMotion, other: Opponent | None) -> str:
    """Return the sentence of a run that failed by the goal of its campaign."""
    going = f", {ego.going}," if ego.going else ""
    amount = "" if goal.worst is None else f" by {goal.short}"
    what = f"the ego{going} {_drives(ego)}, and breaks {quoted(goal.name)}{amount}"
    return f"{other.clause()}; {what}" if other is not None else what


def _clause(broken: Infraction) -> str:
    """Return a broken rule in words, with its names in quotes, such as `runs red at 'king_oak'`."""
    return replace(broken, other=broken.other and quoted(broken.other), place=quoted(broken.place)).clause


def _touch(contact: ContactClass, impact: Impact | None) -> str:
    """Return the side of the ego that was touched.

    It is "" if the side is a matter of chance, because the ego stood or an actor was steered into it.
    """
    alike = (ContactClass.STRUCK_BY_STEERED, ContactClass.HIT_WHILE_STANDING)
    return "" if impact is None or contact in alike else with_side(impact.side)


def _sentence(facts: Facts, ego: EgoMotion, other: Opponent | None, place: StoryPlace) -> str:
    impact = facts.impact
    if other is None or (impact is None and facts.verdict is not Verdict.PASS):
        return _alone(facts, ego, place)
    where = f" {place.text}" if place.text and place.kind != "crossing" else ""
    return f"{other.clause()}; {_ego_clause(facts, ego, other, impact)}{where}"


def _ego_clause(facts: Facts, ego: EgoMotion, other: Opponent, impact: Impact | None) -> str:
    going = f", {ego.going}," if ego.going else ""
    if impact is None:
        return f"the ego{going} {_drives(ego)}, and they come as near as {metres(other.ahead_m(facts.last))}"
    parts = [text for text in (_sees(facts, ego, other), _drives(ego, other)) if text]
    return f"the ego{going} {', '.join(parts)} and {_ends(ego, impact)}"


def _ends(ego: EgoMotion, impact: Impact) -> str:
    """Return the contact as the end of the sentence: who hit whom, with which side, and at which speed."""
    speed = f"at a relative speed of {impact.relative_mps:.1f} m/s"
    side, theirs = with_side(impact.side), with_side(impact.other_side)
    match impact.struck_by:
        case "ego":
            return f"hits it with its {side} {speed}"
        case "other":
            return f"is hit on its {side} {speed}"
        case "both":
            return f"they collide, {side} against {theirs}, {speed}"
        case "neither" if ego.state == "stands":
            return f"is grazed on its {side} {speed}"
        case "neither":
            return f"grazes it with its {side} {speed}"
        case _:
            assert_never(impact.struck_by)


def _sees(facts: Facts, ego: EgoMotion, other: Opponent) -> str:
    if other.sighting.since_s is None:
        if other.sighting.lost_s is not None:
            return f"last sees it {facts.end_s - other.sighting.lost_s:.1f} s before the contact"
        return "does not see it"
    before = other.sighting.before_s(facts.end_s)
    if not other.sighting.from_start and before < SEEN_SHORTLY_S:
        return f"sees it {'again ' if other.sighting.again else ''}{before:.1f} s before the contact"
    unmoved = ego.state not in ("stands", "creeps") and not ego.braking_mps2
    if not unmoved:
        return ""
    whole_run = other.sighting.from_start and other.sighting.searched_s >= facts.end_s
    return "has it in sight all the time" if whole_run else f"has had it in sight for {seen_for(before)}"


def _drives(ego: EgoMotion, other: Opponent | None = None) -> str:
    braking = f"with up to {ego.braking_mps2:.1f} m/s^2"
    match ego.state:
        case "stands" if ego.stood_s >= BRIEF_STOP_S or (
            other is not None and other.came_to_a_standing_ego(ego.stood_s)
        ):
            return f"has stood for {ego.stood_s:.1f} s"
        case "stands":
            return f"brakes to a stand {braking}" if ego.braking_mps2 else "has just stopped"
        case "brakes" | "creeps" if ego.braking_mps2:
            return f"brakes from {kmh(ego.from_mps)} {braking}"
        case "creeps":
            return f"creeps at {kmh(ego.speed_mps)}" if ego.fastest_mps > 0.5 else "hardly moves"
        case "accelerates" if kmh(ego.from_mps) != kmh(ego.speed_mps):
            return f"accelerates from {kmh(ego.from_mps)} to {kmh(ego.speed_mps)}"
        case _:
            return f"drives on at {kmh(ego.speed_mps)}"


def _alone(facts: Facts, ego: EgoMotion, place: StoryPlace) -> str:
    """Return the sentence of a run without an opponent, or of one that failed without a contact."""
    going = f", {ego.going}," if ego.going else ""
    match facts.verdict:
        case Verdict.STUCK:
            return f"the ego{going} stands for {ego.stood_s:.0f} s, {_waiting(facts)}"
        case Verdict.F1:
            return f"the ego{going} leaves the road at {kmh(ego.speed_mps)} {place.text}".rstrip()
        case _:
            return str(facts.trace.meta.get("reason", "")) or f"the ego{going} {ego.state}"


def _changed(change: Change, facts: Facts) -> str:
    """Return the effect of a change in words, such as `walker is 1.38 times as fast`."""
    actor = quoted(change.actor)
    if not isinstance(change.now, Quantity) or not isinstance(change.was, Quantity):
        return f"{actor} has the {change.property} {_written(change.now)} instead of {_written(change.was)}"
    now, was = change.now.si, change.was.si
    more, amount, side = now > was, abs(now - was), "left" if now > was else "right"
    start = f" from {change.start.si:.2f} s" if isinstance(change.start, Quantity) else ""
    # An actor of a clip may be on its way already when the clip begins: the delay makes it wait before it goes on.
    starts = "goes on" if _moves_at_first(facts, change.actor) else "starts"
    words = {
        "timing": f"is {now / was if was else 0:.2f} times as fast",
        "steer": f"is steered to the {side}{start}",
        "brakes": f"brakes with {now:.1f} m/s^2{start}",
        "line": f"keeps {amount:.2f} m farther {side}",
        "delay": f"{starts} {amount:.2f} s {'later' if more else 'earlier'}",
        "moving": f"begins {amount:.1f} m {'farther on' if more else 'farther back'}",
        "speed": f"drives {now * 3.6:.0f} instead of {was * 3.6:.0f} km/h",
    }
    if change.property in words:
        return f"{actor} {words[change.property]}"
    return f"{actor}.{change.property} is {_written(change.now)} instead of {_written(change.was)}"


def _moves_at_first(facts: Facts, actor: str) -> bool:
    """Return whether an actor moves at the first frame of a run."""
    trace = facts.trace
    ids = [info.id for info in trace.actors]
    return actor in ids and bool(trace.states[0, ids.index(actor), SPEED] > STANDS_MPS)  # False where it is absent


def _written(value: Quantity | str | Expression) -> str:
    """Return a value as text: the name of a model (`car.suv`) unchanged, any other value as a number in SI units."""
    return short(str(value)) if isinstance(value, str) else f"{si_of(value):g}"


# ---- what a standing ego may wait for --------------------------------------------------------------------------------


def _waiting(facts: Facts) -> str:
    """Return, in words, what is ahead of the ego at the end of a run."""
    way = facts.way_ahead(facts.last)
    leader = way.leader()
    if leader is None:
        return f"{_junction(facts, way)}, with no actor within {AHEAD_M:.0f} m in front of it"
    gap = metres(max(leader.gap_m, 0.0))
    return f"{_junction(facts, way)}, with {full_name(facts.info(leader.column))} {gap} in front of it"


def _junction(facts: Facts, way: WayAhead) -> str:
    """Return the next junction on the ego's route in words: its distance, its signal's colour, and for how long the
    signal has had that colour.
    """
    passage, room_m = next(way.junctions(), (None, 0.0))
    if passage is None:
        return f"no junction is within {AHEAD_M:.0f} m"
    where = f"{metres(room_m)} before" if room_m > 0 else "inside"
    text = f"{where} the {kind_of(facts.network, passage.junction)} {quoted(passage.junction)}"
    colour = way.colour(passage.movement)
    if not colour:
        return text
    first = facts.last
    while first > 0 and facts.colour(passage.movement, first - 1) == colour:
        first -= 1
    return f"{text}, whose signal is {colour} for the last {(facts.last - first) * STEP_S:.1f} s"


_TITLE_WORDS = 8
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


def _title_of(facts: Facts, ego: EgoMotion, other: Opponent | None, contact: ContactClass, place: StoryPlace) -> str:
    """Return the title of a story: who hit whom, and what both were doing."""
    if facts.infraction is not None:
        return _RULES[facts.infraction.rule]
    going = f"ego {ego.going.replace('to the ', '')}".strip()
    if other is None or facts.impact is None:
        return (
            _title_alone(facts, ego, going, place) if contact is not ContactClass.GOAL else _title_of_goal(facts, other)
        )
    noun = _noun(other)
    match contact:
        case ContactClass.STRUCK_BY_STEERED:
            return _fitting(f"{noun} steered into the {going}", f"{noun} steered into the ego")
        case ContactClass.HIT_WHILE_STANDING:
            return _fitting(f"{_doing(other)} hits the standing ego", f"{noun} hits the standing ego")
        case ContactClass.EGO_DROVE_INTO:
            hits = f"hits {_doing(other)}"
            return _fitting(f"{going} {hits}", f"ego {hits}", f"ego hits {noun}")
        case _:
            pair = f"{_doing(other)} collide"
            return _fitting(f"{going} and {pair}", f"ego and {pair}", f"ego and {noun} collide")


def _title_of_goal(facts: Facts, other: Opponent | None) -> str:
    """Return the title of a run that broke the goal of its campaign."""
    breaks = f"ego breaks {facts.goal.name if facts.goal is not None else 'the goal'}"
    return _fitting(f"{breaks}, {_doing(other)}", breaks) if other is not None else breaks


def _title_alone(facts: Facts, ego: EgoMotion, going: str, place: StoryPlace) -> str:
    if facts.verdict is Verdict.F1:
        return f"{going} leaves the road"
    verb = "stands" if ego.state == "stands" else "drives"
    return _fitting(f"{going} {verb} {place.text}".rstrip(), f"ego {verb} {place.text}".rstrip(), f"{going} {verb}")


def _fitting(*titles: str) -> str:
    """Return the first title that has at most `_TITLE_WORDS` words; without one, the last title."""
    return next((title for title in titles if len(title.split()) <= _TITLE_WORDS), titles[-1])


def _noun(other: Opponent) -> str:
    """Return the opponent in a word, such as `cyclist`."""
    noun = what_is(other.facts.info(other.actor))
    return _NOUNS.get(noun, noun)


def _doing(other: Opponent) -> str:
    """Return the opponent and what it does in at most four words, such as `cyclist beside it`."""
    noun = _noun(other)
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
