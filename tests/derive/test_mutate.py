import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.local_search import near_changes
from foresee_dsl.derive.mutate import Draw, Mutator, _risky_frame, mutate
from foresee_dsl.derive.operators import Operator, operators
from foresee_dsl.derive.operators.paper import fits
from foresee_dsl.derive.presets import FOCUSED, PAPER, UnknownPresetError
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import Change
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.simulate.actors.dynamics import GRAVITY_MPS2
from tests.support.handmade_traces import EAST, NORTH, Track, make_trace, straight
from tests.support.situations import MODELS, case_with, crossing, risky, walker
from tests.support.worlds import q


def cut(trace, actor, at_s):
    point = risky(trace, actor, at_s)
    return clip(case_with(), trace, point, before_s=5, after_s=5, name="runs_p1", parent="runs.foresee")


def children(tracks, *, actor="runner", at_s=5.0, **options):
    """Mutate the clip of a 10 s run that begins where the tracks do, with the risky point in its middle."""
    trace = make_trace(tracks)
    trace = replace(
        trace, **{n: getattr(trace, n)[:201] for n in ("time_s", "states", "lanes", "along", "stages", "elapsed")}
    )
    found = clip(
        case_with(), trace, risky(trace, actor, at_s), before_s=5, after_s=5, name="runs_p1", parent="runs.foresee"
    )
    case = expand_clip(found, case_with(), source=case_with().source)
    made = mutate(case, found, trace, **options)
    for mutant in made:
        assert parse(print_model(mutant), "m.foresee").model == mutant
        expand_mutant(mutant, case, source=case_with().source)  # checks every WAS and NOW
    return made


def near(**more):
    """The runner is 20 m from the ego's way and reaches it at 5 s."""
    runner = straight("car", 25, -22, NORTH, 4)
    tracks = crossing(**more)
    tracks["runner"] = Track("car", runner.states, ("south", "north_back"), (), ("south_0",), 4.0)
    return tracks


def changes(made, kind):
    return [c for mutant in made for c in mutant.changes if c.property == kind]


def test_children_are_named_pinned_and_say_where_they_come_from():
    made = children(near(), seed=91, driver="pdm 1")
    assert [m.name for m in made] == ["runs_p1_m1", "runs_p1_m2", "runs_p1_m3", "runs_p1_m4"]
    assert {m.parent for m in made} == {"runs_p1.foresee"}
    assert [m.origin.operator for m in made] == [
        ("steer",),
        ("timing",),
        ("model_swap", "steer"),
        ("model_swap", "timing"),
    ]
    assert (made[0].origin.preset, made[0].origin.driver, made[0].origin.seed.value) == ("focused", "pdm 1", 91)
    assert len(print_model(made[0]).splitlines()) <= 20


def test_the_pin_is_that_of_the_clip():
    trace = make_trace(near())
    found = clip(
        case_with(), trace, risky(trace, "runner", 5.0), before_s=5, after_s=5, name="runs_p1", parent="runs.foresee"
    )
    case = expand_clip(found, case_with(), source=case_with().source)
    assert {m.pin for m in mutate(case, found, trace)} == {pin_of(case)}


def mutator_of(tracks):
    trace = make_trace(tracks)
    found = cut(trace, "runner", 5.0)
    return Mutator(expand_clip(found, case_with(), source=case_with().source), found, trace)


def test_a_child_near_another_changes_the_same_by_a_little():
    mutator = mutator_of(near())
    assert [[name for name, _ in plan] for plan in mutator.plans][:2] == [["steer"], ["timing"]]
    for draw in (Draw(0, 0), Draw(1, 0), Draw(3, 1)):  # steer, timing, model_swap and timing
        first = mutator.child(draw, seed=3)
        second = mutator.child(draw, seed=3, seen={first.changes}, near=first)
        assert second == mutator.child(draw, seed=3, seen={first.changes}, near=first)
        assert second.origin.operator == first.origin.operator and second.changes != first.changes
        for was, now in zip(first.changes, second.changes, strict=True):
            assert was.model_copy(update={"now": now.now}) == now
            if was.property == "timing":
                assert abs(was.now.si - now.now.si) <= (FOCUSED.timing.high - FOCUSED.timing.low) / 2


def test_what_no_operator_makes_becomes_weaker_or_moves():
    brakes = Change(actor="runner", property="brakes", was=q("0 m/s^2"), now=q("6 m/s^2"), start=q("1 s"))
    rng = np.random.default_rng(0)
    names, found = near_changes(None, FOCUSED, (), (brakes,), rng, seen=(), gap=lambda _: (0.0, 0.0))
    assert names == () and found != (brakes,)
    assert 4.8 <= found[0].now.si <= 6 and abs(found[0].start.si - 1) < 0.41
    ignores = Change(actor="runner", property="ignores", was="none", now="signals")
    assert near_changes(None, FOCUSED, (), (ignores,), rng, seen=(), gap=lambda _: (0.0, 0.0)) is None


def test_an_operator_may_say_itself_what_is_near():
    class Own:
        name = "own"

        def changes(self, situation, target, preset, rng):
            return (Change(actor=target, property="timing", was=q("1"), now=q("1.2")),)

        def near(self, change, situation, preset, rng):
            return change.model_copy(update={"now": q("1.21")})

    given = Own().changes(None, "runner", FOCUSED, None)
    rng = np.random.default_rng(0)
    found = near_changes(None, FOCUSED, ((Own(), "runner"),), given, rng, seen=(), gap=lambda _: (0.0, 0.0))
    assert found is not None and found[0] == ("own",) and [c.now.si for c in found[1]] == [1.21]


def test_the_same_seed_gives_the_same_children_and_another_others():
    assert children(near(), seed=1) == children(near(), seed=1)
    assert children(near(), seed=1) != children(near(), seed=2)
    # A child hangs on its own number only.
    assert children(near(), seed=1, count=2) == children(near(), seed=1, count=4)[:2]


def test_no_two_children_are_equal():
    made = children(near(), count=60)
    assert len({m.changes for m in made}) == len(made) == 60


def test_focused_acts_on_the_ranked_actor_around_the_risky_point():
    made = children(near(other=straight("car", 5, 3.4, EAST, 5)), count=40)
    assert {c.actor for m in made for c in m.changes} == {"runner"}
    for change in changes(made, "steer"):
        assert (change.start.si, change.duration.si) == (4.0, 1.0)


def test_focused_steering_stays_within_comfort_and_the_steering_rate():
    spec = spec_of(MODELS["car.compact"])
    for speed in (2.5, 4.0, 15.0):
        tracks = near()
        states = straight("car", 25, -speed * 5 - 2, NORTH, speed).states
        tracks["runner"] = replace(tracks["runner"], states=states)
        shares = [abs(c.now.si) for c in changes(children(tracks, count=12), "steer")]
        assert shares
        for share in shares:
            angle = share * spec.max_steer_rad
            assert speed**2 * math.tan(angle) / spec.wheelbase_m <= FOCUSED.steer.lateral_g * GRAVITY_MPS2 + 1e-9
            assert angle <= FOCUSED.steer.rate_rad_s * FOCUSED.steer.hold_s / 2 + 1e-9
            assert share >= 0.01


def test_timing_stays_within_its_bounds_and_changes_something():
    factors = [c.now.si for c in changes(children(near(), count=60, preset=replace(FOCUSED, draws=1)), "timing")]
    assert 0.6 <= min(factors) < 0.75
    assert 1.25 < max(factors) <= 1.4
    assert min(abs(f - 1) for f in factors) >= 0.05
    assert all(round(f * 100) == pytest.approx(f * 100) for f in factors)


def test_timing_asks_for_no_speed_over_the_models():
    tracks = near()
    tracks["cyclist"] = Track(
        "bicycle", straight("bicycle", 25, -37, NORTH, 7.5).states, ("south",), (), ("south_0",), 7.5
    )
    factors = [c.now.si for c in changes(children(tracks, actor="cyclist", count=8), "timing")]
    assert factors
    assert max(factors) * 7.5 <= 8.0  # bicycle.city


def test_path_followers_are_timed_and_delayed_but_not_steered():
    made = children(near(walker=walker(28, -6, math.pi / 2, 1.4)), actor="walker", count=30)
    kinds = {c.property for m in made for c in m.changes}
    assert kinds == {"timing", "delay", "model", "line", "moving"}
    delays = [c.now.si for c in changes(made, "delay")]
    assert min(delays) >= 0.2
    assert max(delays) <= 1.5
    assert all(round(d / 0.05) == pytest.approx(d / 0.05) for d in delays)


def test_a_moving_cyclist_is_not_frozen_on_the_spot():
    made = children(near(cyclist=walker(28, -20, math.pi / 2, 4, kind="bicycle")), actor="cyclist", count=20)
    assert made
    assert not changes(made, "delay")


def test_standing_and_far_actors_are_no_targets():
    tracks = near(parked=straight("car", 24, 3.4, EAST, 0), far=walker(25, 60, math.pi, 1.0))
    for ranked in ("parked", "far"):
        made = children(tracks, actor=ranked, count=10)
        assert {c.actor for m in made for c in m.changes} == {"runner"}  # the closest that can be mutated


def test_nothing_is_proposed_where_nothing_can_be_done():
    ego = {"ego": crossing()["ego"]}
    assert children(ego | {"parked": straight("car", 24, 3.4, EAST, 0)}, actor="parked") == ()
    assert children(ego | {"box": straight("obstacle", 24, 3.4, EAST, 0)}, actor="box") == ()
    assert children(ego, actor="") == ()


def test_a_point_without_actor_takes_the_closest_at_the_point():
    made = children(near(far=straight("car", -20, 9, EAST, 5)), actor="", count=3)
    assert {c.actor for m in made for c in m.changes} == {"runner"}


def test_paper_steers_the_closest_vehicle_from_the_beginning_and_swaps_the_closest_that_comes_close():
    beside = replace(straight("car", -7, 3.4, EAST, 3), route=("west",), lanes=("west_1",))
    made = children(near(beside=beside), preset="paper", count=30)
    steers, swaps = changes(made, "steer"), changes(made, "model")
    assert {c.actor for c in steers} == {"beside"}  # closest to the ego at the first frame
    assert {(c.start, c.duration) for c in steers} == {(None, None)}
    assert min(c.now.si for c in steers) < -0.5
    assert max(c.now.si for c in steers) > 0.5
    assert {c.actor for c in swaps} == {"runner"}  # closest of those whose closest frame lies in the window
    assert {c.now for c in swaps} == {"car.long"}
    assert all(m.origin.operator == ("model_swap", "steer") for m in made)


def test_models_are_swapped_within_the_class_and_among_those_allowed():
    made = children(near(), preset="paper", count=10, models=["car.compact", "van.delivery"])
    assert made
    assert not changes(made, "model")


def test_an_unknown_preset_is_said_with_the_close_name():
    with pytest.raises(UnknownPresetError, match="did you mean 'focused'"):
        children(near(), preset="focussed")


def test_a_preset_can_be_changed_and_passed():
    only = replace(FOCUSED, name="only_swap", recipes=(("model_swap",),))
    made = children(near(), preset=only)
    assert [c.property for m in made for c in m.changes] == ["model"]  # one value, so one child
    assert made[0].origin.preset == "only_swap"


def test_operators_follow_the_protocol():
    assert {"model_swap", "steer", "timing", "delay"} <= set(operators())
    assert all(isinstance(o, Operator) and o.name == name for name, o in operators().items())
    assert {name for p in (PAPER, FOCUSED) for recipe in p.recipes for name in recipe} <= set(operators())


def test_of_many_draws_the_one_that_comes_nearest_is_taken():
    # The runner passes behind the ego; 1.2 to 1.4 times as fast it comes where the ego is.
    late = near()
    late["runner"] = replace(late["runner"], states=straight("car", 25, -26, NORTH, 4).states)
    timing = replace(FOCUSED, recipes=(("timing",),))
    chosen = [c.now.si for c in changes(children(late, preset=timing, count=8), "timing")]
    blind = [c.now.si for c in changes(children(late, preset=replace(timing, draws=1), count=8), "timing")]
    assert min(chosen) > 1.05
    assert min(blind) < 0.95


def test_who_cannot_be_brought_near_is_left_for_the_closest_who_can():
    # The walker goes along the far pavement, nearer to the ego than the runner at the risky point.
    tracks = near(walker=walker(20, 5, EAST, 1.4))
    assert {c.actor for m in children(tracks, actor="walker") for c in m.changes} == {"runner"}
    kept = children(tracks, actor="walker", preset=replace(FOCUSED, reach_m=None))
    assert {c.actor for m in kept for c in m.changes} == {"walker"}


# --- the validity check --------------------------------------------------------------------------------------------


def queue(gap_m):
    """The runner drives north; another follows it, `gap_m` behind its rear bumper."""
    return make_trace(near(follower=straight("car", 25, -22 - 4 - gap_m, NORTH, 4)))


@pytest.mark.parametrize(("gap_m", "expected"), [(2.1, True), (1.9, False), (1.0, False)])
def test_a_longer_model_must_leave_room_behind(gap_m, expected):
    # car.long is 1.5 m longer; its front stays; half a metre must be left.
    assert fits(queue(gap_m), 1, 0, spec_of(MODELS["car.long"])) is expected


def test_a_model_of_the_same_size_fits_however_small_the_gap():
    assert fits(queue(0.3), 1, 0, replace(spec_of(MODELS["car.compact"]), name="car.twin"))


def test_a_model_must_not_overlap_a_neighbour_beside():
    tracks = near(beside=straight("car", 25 + 1.9, -22, NORTH, 4))
    wide = replace(spec_of(MODELS["car.compact"]), width_m=2.1)
    assert fits(make_trace(tracks), 1, 0, replace(wide, width_m=1.85))
    assert not fits(make_trace(tracks), 1, 0, wide)


def test_a_model_must_be_able_to_drive_the_speed_and_be_of_the_class():
    trace = make_trace(near())
    assert not fits(trace, 1, 0, spec_of(MODELS["car.slow"]))
    assert not fits(trace, 1, 0, spec_of(MODELS["van.delivery"]))


def test_absent_actors_need_no_room():
    trace = queue(0.3)
    states = trace.states.copy()
    states[:, 2] = np.nan
    assert fits(replace(trace, states=states), 1, 0, spec_of(MODELS["car.long"]))


# --- people and bicycles -------------------------------------------------------------------------------------------


def test_somebody_on_foot_gets_pace_line_delay_and_head_start_first():
    made = children(near(walker=walker(28, -6, math.pi / 2, 1.4)), actor="walker")
    assert [m.origin.operator for m in made] == [("timing",), ("line",), ("delay",), ("head_start",)]
    assert {c.actor for m in made for c in m.changes} == {"walker"}


def test_a_bicycle_on_a_lane_gets_a_line_beside_the_vehicles_recipes():
    tracks = near()
    states = straight("bicycle", 25, -32, NORTH, 6).states
    tracks["cyclist"] = Track("bicycle", states, ("south",), (), ("south_0",), 6.0)
    made = children(tracks, actor="cyclist")
    assert [m.origin.operator for m in made] == [("steer",), ("timing",), ("line",), ("model_swap", "steer")]


def test_vehicles_get_no_line_and_no_head_start():
    made = children(near(), count=40)
    assert not changes(made, "line")
    assert not changes(made, "moving")


def test_lines_stay_within_their_bounds_to_both_sides():
    preset = replace(FOCUSED, draws=1, recipes=(("line",),))
    made = children(near(walker=walker(28, -6, math.pi / 2, 1.4)), actor="walker", count=40, preset=preset)
    lines = [c.now.si for c in changes(made, "line")]
    assert len(lines) == 30  # 0.30 m to 1.00 m in steps of 0.05 m, to both sides
    assert {c.was for c in changes(made, "line")} == {q("0.00 m")}
    assert (min(lines), max(lines), min(map(abs, lines))) == pytest.approx((-1.0, 1.0, 0.3))


def test_a_head_start_is_where_it_would_have_been_and_on_nobody():
    preset = replace(FOCUSED, draws=1, recipes=(("head_start",),))
    tracks = near(walker=walker(28, -6, math.pi / 2, 1.4))
    places = [c.now.si for c in changes(children(tracks, actor="walker", count=40, preset=preset), "moving")]
    assert (min(places), max(places)) == pytest.approx((0.28, 1.4), abs=0.01)  # 0.2 s to 1 s at 1.4 m/s
    box = straight("obstacle", 28, -4.9, EAST, 0)  # its side 1.1 m - 0.25 m - 0.25 m ahead of the walker
    fewer = children(tracks | {"box": box}, actor="walker", count=40, preset=preset)
    assert max(c.now.si for c in changes(fewer, "moving")) <= 0.6
    standing = children(near(walker=walker(28, -6, math.pi / 2, 1.4, start_s=2.0)), actor="walker", preset=preset)
    assert not changes(standing, "moving")


def test_another_seed_draws_other_values():
    first, again, other = (
        [change.now for child in children(near(), seed=seed) for change in child.changes] for seed in (1, 1, 2)
    )
    assert first == again != other


def test_recipes_that_are_whole_leave_no_halves_of_others():
    # It rolls at 1 m/s: too slow to be steered, so `model_swap+steer` cannot be done; a swap alone is nobody's recipe.
    tracks = near()
    slow = straight("car", 25, -9, NORTH, 1)
    tracks["runner"] = Track("car", slow.states, ("south", "north_back"), (), ("south_0",), 4.0)
    made = children(tracks, count=12)
    assert {child.origin.operator for child in made}
    assert {child.origin.operator for child in made} <= set(FOCUSED.recipes)


@pytest.mark.parametrize("at_s", [3.0, 5.0, 6.5])
def test_the_risky_point_is_where_the_clip_says(at_s):
    trace = make_trace(near())
    found = clip(case_with(), trace, risky(trace, "runner", at_s), before_s=2, after_s=3, name="p1", parent="r.foresee")
    run = replace(
        trace, **{n: getattr(trace, n)[:101] for n in ("time_s", "states", "lanes", "along", "stages", "elapsed")}
    )
    assert _risky_frame(found, run) == 40


@pytest.mark.parametrize(("mps", "steered"), [(1.9, False), (2.1, True)])
def test_a_target_slower_than_the_presets_least_speed_is_not_steered(mps, steered):
    tracks = near()
    slow = straight("car", 25, -2 - 5 * mps, NORTH, mps)
    tracks["runner"] = Track("car", slow.states, ("south", "north_back"), (), ("south_0",), 4.0)
    assert bool(changes(children(tracks, count=12), "steer")) is steered
