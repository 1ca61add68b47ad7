"""Judges whose failure it is (the driver's, arguable, unavoidable, or the tool's) and gives the reason in one line.

docs/guide/findings.md explains these judgements for users, with their measured error.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from foresee_dsl.avoidance.anticipating import Anticipation
from foresee_dsl.avoidance.judge import Opinion
from foresee_dsl.avoidance.judges import AnyJudgement
from foresee_dsl.avoidance.r157.assessing import Preventability
from foresee_dsl.avoidance.r157.risk import REACTION_S
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.drivers.registry import sees_all
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.story.story import ContactClass, Story, seen_for
from foresee_dsl.story.wording import quoted

STOOD_S = 0.5
"""An ego that had stood for at least this long has not run into an actor on foot or on a bicycle, s. Ours: a shorter
stop is not a stop to a passenger either (`story.ego`). If the other actor is a vehicle, `REACTION_S` is used instead.
With 0.5 s, the contact with a van that pulled out in sight, into an ego that had accelerated until 1.7 s before,
counted as unavoidable, and three people who reviewed it disagreed.
"""
LOOKED_S = 2.0
"""An actor that breaks a rule or is steered into the ego leaves nothing to decide if it is in sight for less than this,
s. R157's critical time to collision."""


class Whose(StrEnum):
    """Whose failure it is."""

    text: str
    """The answer in words."""
    counted: str
    """The answer in words that follow a number."""

    def __new__(cls, value: str, text: str, counted: str = "") -> Self:
        """Make a member."""
        member = str.__new__(cls, value)
        member._value_, member.text, member.counted = value, text, counted or text
        return member

    DRIVER = "driver", "the driver's fault"
    ARGUABLE = "arguable", "arguable"
    UNAVOIDABLE = "unavoidable", "no driver can be expected to avoid it", "that no driver can be expected to avoid"
    TOOL = "tool", "the tool's or the scenario's own"

    @property
    def rank(self) -> int:
        """The position of this value in reports, 0 first."""
        return list(Whose).index(self)


FOLDED = (Whose.UNAVOIDABLE, Whose.TOOL)
"""Reports at first only count the failures with these judgements, because nothing follows from them for the driver."""


@dataclass(frozen=True)
class Responsibility:
    """The judgement whose failure it is, with the reason in one line."""

    whose: Whose
    reason: str

    @property
    def word(self) -> str:
        """Return whose failure it is, as a word."""
        return self.whose.value

    @property
    def text(self) -> str:
        """Return whose failure it is, in words."""
        return self.whose.text

    @property
    def sentence(self) -> str:
        """Return the judgement with its reason, such as `the driver's fault: skip stands, and the ego drives
        into it`.
        """
        return f"{self.text}: {self.reason}"

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"word": self.whose, "text": self.text, "reason": self.reason}


def responsibility_of(
    story: Story, verdict: Verdict, judgements: Iterable[AnyJudgement], references: Iterable[ReferenceRun]
) -> Responsibility:
    """Return whose failure a run is.

    Args:
        story: what happened in the run. verdict: the verdict of the run, which is a failure. judgements: those of the
            judges. references: runs of other drivers.
    """
    answers, runs = tuple(judgements), tuple(references)
    return next(_rules(story, verdict, answers, runs))


def _rules(
    story: Story, verdict: Verdict, judgements: tuple[AnyJudgement, ...], references: tuple[ReferenceRun, ...]
) -> Iterator[Responsibility]:
    """Yield the answers of all rules that apply, in the order of the rules; the last rule always applies."""
    if verdict is Verdict.GOAL:
        yield _of_goal(story, references)
    if verdict is not Verdict.RULE:
        yield from _not_driving(story)
    yield from _alone(verdict, story.ego_manoeuvre, references)
    by_braking = next((j for j in judgements if isinstance(j, Preventability) and j.avoids), None)
    ahead = next((j for j in judgements if isinstance(j, Anticipation) and j.avoids), None)
    reacting = next((run for run in references if run.avoids and run.how and not sees_all(run.driver)), None)
    avoided = f"{reacting.sentence}, in the same situation" if reacting is not None else ""
    both = ""
    if by_braking is not None:
        both = f"{reacting.driver} and UN Regulation 157's driver avoid it" if reacting is not None else ""
        avoided = avoided or "UN Regulation 157's driver avoids it by braking"
    yield from _steered(story, avoided)
    yield from _by_rule(story, both)
    if avoided:
        yield Responsibility(Whose.DRIVER, avoided)
    yield from _late(story)
    if ahead is not None:
        yield Responsibility(
            Whose.ARGUABLE, f"an anticipating driver avoids it: {ahead.answer.removeprefix('preventable ')}"
        )
    for opinion in judgements:
        if isinstance(opinion, Opinion) and opinion.avoids:
            yield Responsibility(Whose.ARGUABLE, f"{opinion.name} avoids it: {opinion.answer}")
    yield from _unseen(story)


def _alone(verdict: Verdict, rule: str, references: tuple[ReferenceRun, ...]) -> Iterator[Responsibility]:
    """Yield the judgement of a failure without another actor: stuck, a broken rule, or off the road."""
    if verdict is Verdict.STUCK:
        if references and not any(run.passes for run in references):
            yield Responsibility(Whose.TOOL, "no driver gets through: the way may be blocked")
        yield Responsibility(Whose.DRIVER, "it stands although nothing is in its way")
    if verdict is Verdict.RULE:
        yield Responsibility(Whose.DRIVER, f"it breaks a traffic rule: {rule}")
    if verdict is Verdict.F1:
        yield Responsibility(Whose.DRIVER, "it leaves the road")


def _of_goal(story: Story, references: tuple[ReferenceRun, ...]) -> Responsibility:
    """Return the judgement of a run that broke only the goal of its campaign.

    The judges examine contacts, so only another driver can show that the goal could have been kept.
    """
    keeps = next((run for run in references if run.avoids and not sees_all(run.driver)), None)
    if keeps is None:
        return Responsibility(Whose.ARGUABLE, "it breaks the campaign's goal, which no other driver is known to keep")
    if story.grounds.steered:
        return Responsibility(
            Whose.ARGUABLE, f"{quoted(story.opponent)} is steered at the ego; {keeps.driver} keeps the goal"
        )
    return Responsibility(Whose.DRIVER, f"{keeps.driver} keeps the campaign's goal in the same test case")


def _not_driving(story: Story) -> Iterator[Responsibility]:
    """Yield the judgement of a contact in which the ego or the other actor stands."""
    grounds = story.grounds
    if grounds.stands:
        yield Responsibility(Whose.DRIVER, f"{quoted(story.opponent)} stands, and the ego drives into it")
    follows_path = story.opponent_kind in ("pedestrian", "bicycle")
    if not story.opponent or grounds.steered or grounds.stood_s < (STOOD_S if follows_path else REACTION_S):
        return
    if follows_path:
        yield Responsibility(
            Whose.TOOL,
            f"{quoted(story.opponent)} follows its path into an ego that has stood for {grounds.stood_s:.1f} s",
        )
    elif not grounds.gives_way:
        yield Responsibility(Whose.UNAVOIDABLE, f"the ego has stood for {grounds.stood_s:.1f} s")


def _steered(story: Story, avoided: str) -> Iterator[Responsibility]:
    """Yield the judgement of an actor that the mutation steers into the ego.

    It is unavoidable unless the actor is seen early and another driver reacts to it.
    """
    acts_s = story.grounds.acts_s
    if story.grounds.steered:
        when = "" if acts_s is None else f" {acts_s:.1f} s before the contact"
        what = f"{quoted(story.opponent)} is steered into the ego{when}"
        if avoided and acts_s is not None and acts_s >= LOOKED_S:
            yield Responsibility(Whose.ARGUABLE, f"{what}; {avoided}")
        yield Responsibility(Whose.UNAVOIDABLE, what)


def _by_rule(story: Story, both: str) -> Iterator[Responsibility]:
    """Yield the judgement by right of way: the ego or the other actor breaks a rule.

    A rule that the other actor breaks excuses the driver, unless two other drivers avoid the failure (`both`).
    """
    grounds = story.grounds
    if grounds.gives_way and grounds.seen_s >= REACTION_S:
        yield Responsibility(Whose.DRIVER, f"{grounds.gives_way}, in sight for {seen_for(grounds.seen_s)}")
    if grounds.breaks_rule:
        broken = f"{quoted(story.opponent)} comes {grounds.breaks_rule}, in sight for {seen_for(grounds.seen_s)}"
        if both:
            yield Responsibility(Whose.DRIVER, f"{broken}, but {both}")
        yield Responsibility(Whose.ARGUABLE if grounds.seen_s >= LOOKED_S else Whose.UNAVOIDABLE, broken)


def _late(story: Story) -> Iterator[Responsibility]:
    """Yield the driver's fault if the ego brakes later than a driver with a normal reaction time would."""
    grounds = story.grounds
    if grounds.acts_s is not None and story.contact is not ContactClass.HIT_WHILE_STANDING:
        could_s = min(grounds.acts_s, grounds.seen_s)
        if could_s - grounds.braked_s > REACTION_S:
            brakes = f"brakes {could_s - grounds.braked_s:.1f} s later" if grounds.braked_s else "does not brake"
            what = f"{quoted(story.opponent)} is in sight and on its way {could_s:.1f} s before the contact"
            yield Responsibility(Whose.DRIVER, f"{what}, and the ego {brakes}")


def _unseen(story: Story) -> Iterator[Responsibility]:
    """Yield the judgement of the other cases: the actor was seen or moved too late, so only a slower ego could have
    avoided it.
    """
    grounds, other = story.grounds, quoted(story.opponent) if story.opponent else "the other"
    if grounds.seen_s < REACTION_S:
        again = "again " if grounds.seen_before else ""
        seen = f"{other} is in sight {again}only {grounds.seen_s:.1f} s before the contact"
        if story.opponent_kind == "pedestrian":
            yield Responsibility(Whose.ARGUABLE, f"{seen}: only a slower ego avoids it")
        yield Responsibility(Whose.UNAVOIDABLE, seen)
    if grounds.acts_s is not None and grounds.acts_s < REACTION_S:
        yield Responsibility(
            Whose.UNAVOIDABLE, f"{other} begins only {grounds.acts_s:.1f} s before the contact, sooner than a reaction"
        )
    yield Responsibility(Whose.ARGUABLE, f"{other} is in sight for {seen_for(grounds.seen_s)}, but no driver avoids it")
