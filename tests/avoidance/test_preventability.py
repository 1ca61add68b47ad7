"""Would a careful driver have avoided it? Scenes on real SUMO whose answers are worked out by hand.

With the model's figures (0.4 s + 0.75 s until braking, 12.65 m/s^3 up to 7.593 m/s^2 after 0.6 s) shedding a speed v
takes, from the beginning of braking, v * 0.6 - 0.455 + (v - 2.279)^2 / 15.186 metres: 5.2 m for 7 m/s, 9.5 m for 10.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.avoidance.judge import Failure, contact
from foresee_dsl.avoidance.r157.assessing import Preventable, R157Driver, _after_braking
from foresee_dsl.avoidance.r157.risk import Perception
from foresee_dsl.avoidance.replay import Replay
from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing import IDEAL
from foresee_dsl.simulate.trace import Y
from tests.support.scenes import Cruise, LaneKeeper, Town
from tests.support.worlds import COMPACT

JUDGE = R157Driver()

EAST = ("n01_n11", "n11_n21", "n21_n31")
DELAY_S = 0.4 + 0.75


def braking_way_m(shed_mps: float, hardest_mps2: float = 0.774 * 9.81) -> float:
    """The closed form: how much nearer one comes to what is slower by `shed_mps` until the speeds are equal."""
    ramp_s = hardest_mps2 / 12.65
    left = shed_mps - hardest_mps2 * ramp_s / 2
    return shed_mps * ramp_s - 12.65 * ramp_s**3 / 6 + left**2 / (2 * hardest_mps2)


def failing(bundle: SumoBundle, driver: Driver, verdict: Verdict) -> RunResult:
    result = run(bundle, driver, sensors=IDEAL)  # so that the ego is where the sums have it
    assert result.verdict is verdict, result.reason
    return result


def on_path(town: Town, name: str, path: list[tuple[float, float]], speed: float) -> PlacedActor:
    return replace(town.walker(name, path, speed=speed), model=COMPACT)


def cut_in(town: Town, ahead_m: float, **more: object) -> SumoBundle:
    """The ego at 12 m/s; at 5 m/s, one lane to the left, another swings in at 30 degrees from the first second on."""
    ego = town.ego(EAST, 30.0, speed=12.0, lane_index=1)
    x, y, heading = town.network.edges[EAST[0]].lanes[1].line.at(28.0)
    assert abs(heading) < 1e-6
    start = x + 12.0 + ahead_m - 5.0  # the ego has come 12 m when the other has come 5 m
    aside = 3.2
    path = [
        (start, y + aside),
        (start + 5.0, y + aside),
        (start + 5.0 + aside / math.tan(math.pi / 6), y),
        (start + 80.0, y),
    ]
    return town.bundle([ego, on_path(town, "swinger", path, 5.0)], **more)


def test_a_cut_in_is_preventable_where_there_is_room(town: Town) -> None:
    # Seen 2 s before the contact at the latest, braking begins 0.85 s before it: 6 m at 7 m/s, of which 5.2 m are used.
    assert braking_way_m(7.0) == pytest.approx(5.22, abs=0.01)
    assert braking_way_m(7.0) < (2.0 - DELAY_S) * 7.0
    bundle = cut_in(town, 24.0)
    found = JUDGE.judge(Failure.of(failing(bundle, LaneKeeper(12.0), Verdict.F5), bundle))
    assert found.verdict is Preventable.YES, found.why
    assert found.struck == "the ego struck swinger"
    assert found.impact_mps == pytest.approx(7.0, abs=0.3)
    assert found.braked_impact_mps is None
    assert found.braked_s is not None
    assert found.perceived_s is not None
    assert found.braked_s - found.perceived_s == pytest.approx(0.75)


def test_the_same_cut_in_is_unavoidable_on_ice(town: Town) -> None:
    # At 0.2 g the 7 m/s take 12.7 m.
    assert braking_way_m(7.0, 0.2 * 9.81) > 2.0 * 7.0 - DELAY_S * 7.0
    bundle = cut_in(town, 24.0, friction=0.2)
    found = JUDGE.judge(Failure.of(failing(bundle, LaneKeeper(12.0), Verdict.F5), bundle))
    assert found.verdict is Preventable.NO, found.why
    assert found.braked_impact_mps is not None
    assert found.impact_mps is not None
    # Of 7 m/s it sheds what 0.2 g do in the time that is left, at least 0.85 s: 1.5 m/s.
    assert 1.0 < found.impact_mps - found.braked_impact_mps < 5.0


def test_a_cut_in_into_the_last_metres_is_unavoidable(town: Town) -> None:
    # Side by side after 6 m at 7 m/s, which is 0.86 s: less than the 1.15 s until braking begins.
    bundle = cut_in(town, 6.0)
    result = run(bundle, LaneKeeper(12.0))
    found = JUDGE.judge(Failure.of(result, bundle))
    assert found.verdict is Preventable.NO, found.why
    assert found.braked_s is None
    assert found.impact_mps == contact(result).relative_mps


def step_out(town: Town, aside_m: float, **more: object) -> SumoBundle:
    """The ego at 10 m/s; a pedestrian walks along the road at 1.4 m/s, turns square into it `aside_m` from the ego's
    way, and is in the middle of it when the ego comes."""
    ego = town.ego(EAST, 20.0, speed=10.0)
    x, y, _ = town.network.edges[EAST[0]].lanes[1].line.at(18.0)
    meets_s = 5.0
    along = (meets_s - aside_m / 1.4) * 1.4
    spot = x + 10.0 * meets_s
    path = [(spot - along, y - aside_m), (spot, y - aside_m), (spot, y + 20.0)]
    return town.bundle([ego, town.walker("walker", path)], **more)


def test_a_pedestrian_who_steps_out_early_is_preventable(town: Town) -> None:
    # Turns 5 m from the middle: 3.6 s before. Seen at 2.15 s (0.4 + 0.75 + 10 / 10), 10 m are left to stop in 9.5 m.
    assert braking_way_m(10.0) < 10.0
    bundle = step_out(town, 5.0)
    found = JUDGE.judge(Failure.of(failing(bundle, LaneKeeper(10.0), Verdict.F2), bundle))
    assert found.verdict is Preventable.YES, found.why


def test_a_pedestrian_who_steps_out_late_is_not(town: Town) -> None:
    # Turns 1.8 m from the middle, 1.29 s before both would be there; the ego's front is there 0.2 s earlier, after
    # 1.09 s, and braking begins after 1.15 s.
    bundle = step_out(town, 1.8)
    found = JUDGE.judge(Failure.of(failing(bundle, LaneKeeper(10.0), Verdict.F2), bundle))
    assert found.verdict is Preventable.NO, found.why
    assert found.struck == "the ego struck walker"
    assert "before braking can begin" in found.why


def test_who_is_struck_in_the_rear_could_not_have_braked(town: Town) -> None:
    ego = town.ego(EAST, 50.0, speed=2.0)
    x, y, _ = town.network.edges[EAST[0]].lanes[1].line.at(20.0)
    bundle = town.bundle([ego, on_path(town, "tail", [(x, y), (x + 80.0, y)], 12.0)])
    found = JUDGE.judge(Failure.of(failing(bundle, LaneKeeper(2.0), Verdict.F5), bundle))
    assert found.verdict is Preventable.UNKNOWN
    assert found.struck == "tail struck the ego"
    assert found.why == "no risk in front to brake for: tail struck the ego in the rear"
    assert found.perceived_s is None


def test_who_stands_is_struck(town: Town) -> None:
    ego = town.ego(EAST, 50.0, speed=0.0)
    x, y, _ = town.network.edges[EAST[0]].lanes[1].line.at(80.0)
    bundle = town.bundle([ego, on_path(town, "oncoming", [(x, y), (x - 60.0, y)], 8.0)])
    found = JUDGE.judge(Failure.of(failing(bundle, Cruise(0.0), Verdict.F3), bundle))
    assert found.verdict is Preventable.UNKNOWN
    assert found.why == "the ego stood: oncoming struck the ego"
    assert found.impact_mps == pytest.approx(8.0, abs=0.01)


def test_a_stand_that_braking_reaches_before_the_other_strikes_is_not_decided(town: Town) -> None:
    # Head on at 5 and 2 m/s, seen at 14 m. After 1.15 s 6 m are left; the ego stands 0.96 s later, 3 m further on, and
    # the other has come 1.9 m.
    assert braking_way_m(5.0) + 2.0 * 0.96 < 7.0 * (2.0 - DELAY_S)
    ego = town.ego(EAST, 20.0, speed=5.0)
    x, y, _ = town.network.edges[EAST[0]].lanes[1].line.at(65.0)
    bundle = town.bundle([ego, on_path(town, "oncoming", [(x, y), (x - 60.0, y)], 2.0)], end_s=20.0)
    found = JUDGE.judge(Failure.of(failing(bundle, LaneKeeper(5.0), Verdict.F3), bundle))
    assert found.verdict is Preventable.UNKNOWN
    assert found.why.endswith("brings the ego to a stand before oncoming struck the ego")
    assert found.braked_impact_mps == pytest.approx(2.0, abs=0.01)


def test_what_leaves_the_road_alone_is_not_judged(town: Town) -> None:
    class Left(Cruise):
        def step(self, observation):  # type: ignore[no-untyped-def]  # the protocol's
            return replace(super().step(observation), steer=-0.3)

    bundle = town.bundle([town.ego(EAST, 30.0)])
    found = JUDGE.judge(Failure.of(failing(bundle, Left(8.0), Verdict.F1), bundle))
    assert (found.verdict, found.struck, found.impact_mps) == (Preventable.UNKNOWN, "", None)


def test_another_failure_than_the_recorded_one_is_not_judged(town: Town) -> None:
    bundle = step_out(town, 5.0)
    result = failing(bundle, LaneKeeper(10.0), Verdict.F2)
    ego, walker = bundle.scene.actors
    elsewhere = replace(walker, path=np.add(walker.path, (30.0, 0.0)))
    found = JUDGE.judge(Failure.of(result, replace(bundle, scene=replace(bundle.scene, actors=(ego, elsewhere)))))
    assert found.verdict is Preventable.UNKNOWN
    assert found.why.startswith("the replay without braking is not the failure: ")


def test_the_replay_keeps_to_the_recorded_run(town: Town) -> None:
    class Wild(LaneKeeper):
        """Swerves, brakes and accelerates by turns."""

        def step(self, observation):  # type: ignore[no-untyped-def]  # the protocol's
            self.speed_mps = 10.0 + 6.0 * math.sin(3.0 * observation.time_s)
            control = super().step(observation)
            return replace(control, steer=control.steer + 0.05 * math.sin(5.0 * observation.time_s))

    bundle = town.bundle([town.ego(EAST, 10.0), *town.traffic(3)], end_s=8.0)
    recorded = run(bundle, Wild())
    again = run(bundle, Replay(recorded.trace, None, bundle.scene))
    assert recorded.trace.frames == again.trace.frames > 40
    off = np.abs(recorded.trace.states[..., :2] - again.trace.states[..., :2])
    assert np.nanmax(off) < 1e-9


def test_braking_builds_up_as_the_model_says_and_keeps_the_way(town: Town) -> None:
    around = ("n10_n11", "n11_n21", "n21_n31")
    bundle = town.bundle([town.ego(around, 70.0, speed=7.0)], end_s=6.0)
    recorded = run(bundle, LaneKeeper(7.0))
    braked = run(bundle, Replay(recorded.trace, 2.0, bundle.scene)).trace
    frame = 40
    speeds = braked.states[frame:, 0, 3]
    way = float(np.hypot(*np.diff(braked.states[frame:, 0, :2], axis=0).T).sum())
    assert speeds[-1] == 0.0
    assert way == pytest.approx(braking_way_m(float(speeds[0])), abs=0.4)
    assert speeds[0] - speeds[12] == pytest.approx(12.65 * 0.6**2 / 2, abs=0.3)
    line = recorded.trace.states[:, 0, :2]
    aside = [np.hypot(*(line - spot).T).min() for spot in braked.states[:, 0, :2]]
    assert max(aside) < 0.2  # recorded spots are 0.35 m apart


def test_how_the_run_with_braking_may_end(town: Town) -> None:
    failed = failing(cut_in(town, 24.0), LaneKeeper(12.0), Verdict.F5)
    seen, struck = Perception(1.0, at_once=False), failed.impact
    assert struck is not None

    def answer(**ends: object) -> Preventable:
        return _after_braking(seen, struck, replace(failed, **ends)).verdict

    ends = (Verdict.PASS, Verdict.STUCK, Verdict.TIMEOUT)
    clear = {verdict: answer(verdict=verdict, impact=None) for verdict in ends}
    assert set(clear.values()) == {Preventable.YES}
    assert answer(verdict=Verdict.F1, impact=None) is Preventable.UNKNOWN  # off the road
    assert answer() is Preventable.NO
    assert answer(impact=replace(struck, with_="somebody")) is Preventable.UNKNOWN
    assert answer(impact=replace(struck, ego_mps=0.05)) is Preventable.UNKNOWN  # it stood by then


@pytest.mark.parametrize(("off_m", "astray"), [(0.05, False), (0.15, True)])
def test_a_replay_that_comes_elsewhere_is_not_the_failure(town: Town, off_m: float, astray: bool) -> None:
    bundle = cut_in(town, 24.0)
    result = failing(bundle, LaneKeeper(12.0), Verdict.F5)
    states = result.trace.states.copy()
    states[-1, 0, Y] += off_m
    found = Failure.of(replace(result, trace=replace(result.trace, states=states)), bundle).astray
    assert bool(found) is astray
    assert found.endswith(f"and {off_m:.2f} m off") or not astray
