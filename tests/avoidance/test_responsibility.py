"""The one judgement of a failure: each rule by itself, and which comes first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from foresee_dsl.avoidance.anticipating import Answer, Anticipation
from foresee_dsl.avoidance.judge import Opinion
from foresee_dsl.avoidance.judges import AnyJudgement
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.avoidance.responsibility import LOOKED_S, REACTION_S, STOOD_S, Whose, responsibility_of
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.story.story import ContactClass, Grounds, Story

STORY = Story((), "", "van", "van", ContactClass.BOTH_MOVING, "brakes", "pulls out", "the road",
              grounds=Grounds(seen_s=5.0, braked_s=4.0, acts_s=4.5))  # fmt: skip
PREVENTED = Preventability(Preventable.YES, "braking from 1.15 s avoids the contact")
AHEAD = Anticipation(Answer.AHEAD, "drives slower")
REACTS = ReferenceRun("idm", Verdict.PASS, ("brakes 0.8 s earlier",), verdict=Verdict.PASS, duration_s=5.0)
APART = replace(REACTS, how=(), apart="it passes the place 0.9 s earlier")
IDEAL = replace(REACTS, driver="pdm+ideal")


def whose(
    grounds: Grounds, *judgements: AnyJudgement, runs: tuple[ReferenceRun, ...] = (), kind: str = "van",
    verdict: Verdict = Verdict.F4,
) -> Whose:  # fmt: skip
    """Return the judgement of a story with these grounds."""
    story = replace(STORY, grounds=grounds, opponent_kind=kind)
    judgement = responsibility_of(story, verdict, judgements, runs)
    assert judgement.reason and "\n" not in judgement.reason and len(judgement.reason) < 160
    return judgement.whose


STEERED = Grounds(seen_s=5.0, acts_s=0.9, steered=True)


@pytest.mark.parametrize(
    ("grounds", "judgements", "runs", "answer"),
    [
        (STEERED, (PREVENTED,), (REACTS,), Whose.UNAVOIDABLE),
        (replace(STEERED, acts_s=LOOKED_S), (), (REACTS,), Whose.ARGUABLE),
        (replace(STEERED, acts_s=LOOKED_S), (), (APART,), Whose.UNAVOIDABLE),
        (Grounds(stands=True, seen_s=0.1), (), (), Whose.DRIVER),
        (Grounds(seen_s=5.0, gives_way="a driver who turns gives way"), (), (), Whose.DRIVER),
        (Grounds(seen_s=5.0, stood_s=REACTION_S, gives_way="a driver who turns gives way"), (), (), Whose.DRIVER),
        (Grounds(seen_s=5.0, stood_s=REACTION_S), (PREVENTED,), (), Whose.UNAVOIDABLE),
        (Grounds(seen_s=5.0, stood_s=REACTION_S - 0.1), (PREVENTED,), (), Whose.DRIVER),
        (replace(STEERED, acts_s=LOOKED_S, stood_s=STOOD_S), (), (REACTS,), Whose.ARGUABLE),
        (Grounds(seen_s=REACTION_S - 0.1, gives_way="a driver who turns gives way"), (), (), Whose.UNAVOIDABLE),
        (Grounds(seen_s=LOOKED_S, breaks_rule="on red"), (), (REACTS,), Whose.ARGUABLE),
        (Grounds(seen_s=LOOKED_S - 0.1, breaks_rule="on red"), (), (REACTS,), Whose.UNAVOIDABLE),
        (Grounds(seen_s=LOOKED_S - 0.1, breaks_rule="on red"), (PREVENTED,), (REACTS,), Whose.DRIVER),
        (Grounds(seen_s=LOOKED_S - 0.1, breaks_rule="on red"), (PREVENTED,), (APART,), Whose.UNAVOIDABLE),
        (Grounds(seen_s=0.5), (PREVENTED,), (), Whose.DRIVER),
        (Grounds(seen_s=0.5), (), (REACTS,), Whose.DRIVER),
        (Grounds(seen_s=0.5), (), (APART, IDEAL), Whose.UNAVOIDABLE),
        (Grounds(seen_s=0.5), (), (replace(REACTS, how=()),), Whose.UNAVOIDABLE),
        (Grounds(seen_s=0.5), (AHEAD,), (APART,), Whose.ARGUABLE),
        (Grounds(seen_s=0.5), (Opinion("an early bird", "there before", "", avoids=True),), (), Whose.ARGUABLE),
        (Grounds(seen_s=0.5), (Opinion("an early bird", "too late", "", avoids=False),), (), Whose.UNAVOIDABLE),
        (Grounds(seen_s=5.0, acts_s=REACTION_S + 0.5, braked_s=0.4), (), (), Whose.DRIVER),
        (Grounds(seen_s=5.0, acts_s=REACTION_S + 0.5, braked_s=0.6), (), (), Whose.ARGUABLE),
        (Grounds(seen_s=5.0, acts_s=REACTION_S - 0.1), (), (), Whose.UNAVOIDABLE),
    ],
)
def test_each_rule(
    grounds: Grounds, judgements: tuple[AnyJudgement, ...], runs: tuple[ReferenceRun, ...], answer: Whose
) -> None:
    assert whose(grounds, *judgements, runs=runs) is answer


def test_people_on_foot() -> None:
    assert whose(Grounds(seen_s=0.5), kind="pedestrian") is Whose.ARGUABLE  # a slower ego avoids it
    assert whose(Grounds(seen_s=5.0, stood_s=STOOD_S), kind="pedestrian") is Whose.TOOL  # it follows its path
    yields = Grounds(seen_s=5.0, stood_s=STOOD_S, gives_way="a driver who turns gives way")
    assert whose(yields, kind="bicycle") is Whose.TOOL  # a driver that stands has given way
    assert whose(replace(yields, stood_s=STOOD_S - 0.1), kind="bicycle") is Whose.DRIVER


def test_without_another_actor() -> None:
    alone = replace(STORY, opponent="", opponent_kind="", grounds=Grounds(stood_s=20.0))
    stuck = replace(REACTS, verdict=Verdict.STUCK)
    assert responsibility_of(alone, Verdict.STUCK, (), (REACTS,)).whose is Whose.DRIVER
    assert responsibility_of(alone, Verdict.STUCK, (), (stuck,)).whose is Whose.TOOL
    assert (
        responsibility_of(alone, Verdict.STUCK, (), ()).whose is Whose.DRIVER
    )  # no driver showed that the way is blocked
    assert responsibility_of(alone, Verdict.F1, (), ()).whose is Whose.DRIVER
    rule = replace(alone, ego_manoeuvre="runs red")
    judgement = responsibility_of(rule, Verdict.RULE, (), ())
    assert (judgement.whose, judgement.reason) == (Whose.DRIVER, "it breaks a traffic rule: runs red")


def test_the_order() -> None:
    assert [judgement.rank for judgement in Whose] == [0, 1, 2, 3]
    assert [str(judgement) for judgement in Whose] == ["driver", "arguable", "unavoidable", "tool"]
