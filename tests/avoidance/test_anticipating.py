"""Would a driver who anticipates have prevented it, and by what? Scenes on real SUMO, one for each answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.avoidance.anticipating import Answer, AnticipatingDriver, Anticipation
from foresee_dsl.avoidance.anticipating.assessing import _Assessment, _ConfirmingRun
from foresee_dsl.avoidance.anticipating.manoeuvre import ManoeuvrePlan, sidestep_s
from foresee_dsl.avoidance.anticipating.settings import (
    LATERAL_JERK_MPS3,
    LATERAL_MPS2,
    MOST_RUNS,
    SLOWED_TO_MPS,
)
from foresee_dsl.avoidance.judge import Failure
from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing import IDEAL
from foresee_dsl.simulate.trace import ACCELERATION
from tests.support.handmade_traces import make_trace, straight
from tests.support.scenes import Cruise, LaneKeeper, Town
from tests.support.worlds import COMPACT, VAN

JUDGE = AnticipatingDriver()

LINE: FloatArray = np.linspace(0.0, 1.0, 2001)
EAST = ("n01_n11", "n11_n21", "n21_n31")


def spot(town: Town, at_m: float) -> tuple[float, float]:
    x, y, _ = town.network.edges[EAST[0]].lanes[1].line.at(at_m)
    return x, y


def assessed(bundle: SumoBundle, driver: Driver, verdict: Verdict) -> Anticipation:
    result = run(bundle, driver, sensors=IDEAL)
    assert result.verdict is verdict, result.reason
    found = JUDGE.judge(Failure.of(result, bundle))
    assert 0 <= found.runs <= MOST_RUNS
    assert found.why
    assert (found.least_m is not None and found.least_m > 0) == found.answer.preventable
    return found


def walks_into_the_way(town: Town, aside_m: float) -> SumoBundle:
    """The ego at 10 m/s; a walker along the road turns into it, and is in the middle of it when the ego comes."""
    x, y = spot(town, 18.0)
    meets = x + 50.0
    along = 7.0 - aside_m
    path = [(meets - along, y - aside_m), (meets, y - aside_m), (meets, y + 20.0)]
    return town.bundle([town.ego(EAST, 20.0, speed=10.0), town.walker("walker", path)])


def test_braking_that_begins_as_soon_as_the_walker_turns_is_comfortable(town: Town) -> None:
    found = assessed(walks_into_the_way(town, 5.0), LaneKeeper(10.0), Verdict.F2)
    assert found.answer is Answer.BRAKING, found.why
    assert found.braking_mps2 == COMFORTABLE_MPS2
    # The walker turns 5 m from the middle, 3.6 s before both are there; R157's model waits until 2.15 s before.
    assert found.seen_s is not None
    assert found.begins_s is not None
    assert found.seen_s == pytest.approx(5.0 - 5.0 / 1.4, abs=0.2)
    assert found.begins_s == pytest.approx(found.seen_s + 1.15)
    assert found.spare_s is not None
    assert found.spare_s > 0.5  # braking harder could have begun later
    assert "avoids it" in found.why


def test_what_lies_on_ice_is_evaded(town: Town) -> None:
    # Seen 50 m away at 14 m/s; with 0.25 g, after 1.15 s, stopping takes 56 m.
    x, y = spot(town, 18.0)
    crate = town.crate("crate", x + 75.0, y - 0.6)
    bundle = town.bundle([town.ego(EAST, 20.0, speed=14.0), crate], friction=0.25)
    found = assessed(bundle, LaneKeeper(14.0), Verdict.F1)
    assert found.answer is Answer.EVADING, found.why
    assert found.sideways_m is not None
    assert found.sideways_m > 0, "to the left, where a lane is"
    assert f"{found.sideways_m:.1f} m to the left" in found.why


def from_behind_a_van(town: Town, at_m: float) -> SumoBundle:
    """The ego at 10 m/s passes a van that stands at the kerb; a walker comes from behind it, in time to be hit."""
    x, y = spot(town, 18.0)
    van = PlacedActor("van", VAN, "static", x + at_m - 4.0, y - 3.1, 0.0, 0.0)
    start = 6.0
    walker = town.walker("walker", [(x + at_m, y - start), (x + at_m, y + 20.0)], speed=start / (at_m / 10.0))
    return town.bundle([town.ego(EAST, 20.0, speed=10.0), van, walker])


def test_who_slows_past_a_van_that_hides_people_avoids_it(town: Town) -> None:
    found = assessed(from_behind_a_van(town, 35.0), LaneKeeper(10.0), Verdict.F2)
    assert found.answer is Answer.AHEAD, found.why
    assert "stopped vehicle" in found.why
    assert found.slower_mps is not None
    # From 36 km/h to 30 at the most for what might come, 20 where people are seen near it.
    assert 0.5 < found.slower_mps < 10.0 - SLOWED_TO_MPS + 3.0


def test_a_cut_in_at_the_last_moment_is_not_preventable(town: Town) -> None:
    x, y = spot(town, 28.0)
    path = [(x + 13.0, y + 3.2), (x + 18.0, y + 3.2), (x + 23.5, y), (x + 93.0, y)]
    swinger = replace(town.walker("swinger", path, speed=5.0), model=COMPACT)
    found = assessed(town.bundle([town.ego(EAST, 30.0, speed=12.0), swinger]), LaneKeeper(12.0), Verdict.F4)
    assert found.answer is Answer.NO, found.why
    assert "sooner than it can react" in found.why


def test_who_stands_prevents_nothing(town: Town) -> None:
    x, y = spot(town, 80.0)
    oncoming = replace(town.walker("oncoming", [(x, y), (x - 60.0, y)], speed=8.0), model=COMPACT)
    found = assessed(town.bundle([town.ego(EAST, 50.0, speed=0.0), oncoming]), Cruise(0.0), Verdict.F3)
    assert (found.answer, found.runs) == (Answer.NO, 0)
    assert found.why == "the ego stood from the first frame on: oncoming struck the ego"


def test_what_is_not_the_recorded_failure_is_not_decided(town: Town) -> None:
    bundle = walks_into_the_way(town, 5.0)
    result = run(bundle, LaneKeeper(10.0), sensors=IDEAL)
    ego, walker = bundle.scene.actors
    elsewhere = replace(walker, path=[(x + 30.0, y) for x, y in walker.path])
    found = JUDGE.judge(Failure.of(result, replace(bundle, scene=replace(bundle.scene, actors=(ego, elsewhere)))))
    assert (found.answer, found.runs) == (Answer.UNDECIDED, 1)
    assert found.why.startswith("the replay without braking is not the failure: ")


@pytest.mark.parametrize("sideways_m", [0.4, 1.2, 3.5])
def test_a_step_to_the_side_keeps_the_limits_of_comfort(sideways_m: float) -> None:
    plan, times = ManoeuvrePlan(0.0, 0.0, sideways_m), sidestep_s(sideways_m) * LINE
    aside, rate, bend = plan.aside_at(times)
    assert aside[-1] == pytest.approx(sideways_m, abs=1e-6)
    assert rate[-1] == pytest.approx(0.0, abs=1e-6)
    assert abs(bend).max() <= LATERAL_MPS2 + 1e-6
    middle = len(times) // 2
    jerk = (bend[middle + 1] - bend[middle - 1]) / (times[middle + 1] - times[middle - 1])
    assert abs(jerk) <= LATERAL_JERK_MPS3 + 1e-6


def asked(town: Town, *, side: str = "front", braked_mps2: float = 0.0, alone: bool = False) -> _Assessment:
    """What is asked about a walker that turns into the ego's way; `alone`: the walker is far off when it is asked."""
    bundle = walks_into_the_way(town, 5.0)
    result = run(bundle, LaneKeeper(10.0), sensors=IDEAL)
    assert result.impact is not None
    states = result.trace.states.copy()
    states[-30:, 0, ACCELERATION] = -braked_mps2
    result = replace(result, trace=replace(result.trace, states=states))
    if alone:
        ego, walker = bundle.scene.actors
        elsewhere = replace(walker, path=[(x + 500.0, y + 500.0) for x, y in walker.path])
        bundle = replace(bundle, scene=replace(bundle.scene, actors=(ego, elsewhere)))
    return _Assessment(Failure.of(result, bundle), replace(result.impact, side=side))


def test_a_drive_that_is_nearly_the_same_and_passes_is_chance(town: Town) -> None:
    found = asked(town, alone=True)._by_driving_ahead(None)
    assert found is not None
    assert (found.answer, "chance decides" in found.why) == (Answer.UNDECIDED, True)


@pytest.mark.parametrize(("braked_mps2", "answer"), [(3.0, Answer.NO), (4.0, Answer.UNDECIDED)])
def test_who_is_hit_from_behind_after_braking_hard_is_not_judged(
    town: Town, braked_mps2: float, answer: Answer
) -> None:
    assert asked(town, side="rear", braked_mps2=braked_mps2)._not(None, None).answer is answer


@pytest.mark.parametrize(("gap_m", "clear"), [(0.09, False), (0.1, True), (2.0, True)])
def test_a_hairs_breadth_prevents_nothing(town: Town, gap_m: float, clear: bool) -> None:
    beside = make_trace({"ego": straight("car", 0, 0, 0.0, 5), "by": straight("car", 0, 1.8 + gap_m + 1e-9, 0.0, 5)})
    passed = replace(run(walks_into_the_way(town, 5.0), LaneKeeper(10.0)), verdict=Verdict.PASS, trace=beside)
    assert _ConfirmingRun(passed).clear is clear
    assert not _ConfirmingRun(replace(passed, verdict=Verdict.F1)).clear
