"""Who is in sight and how it is measured, on scenes with answers worked out by hand: the ego at (0, 0) looks east."""

from __future__ import annotations

import copy
import math
import pickle
from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest
import shapely

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.drivers.protocol import SeenActor
from foresee_dsl.kernels.boxes import corners
from foresee_dsl.simulate.sensing import IDEAL, STANDARD, SensorSettings
from foresee_dsl.simulate.sensing.objects import ObjectList
from foresee_dsl.simulate.sensing.settings import NO_DROPOUTS, NO_NOISE
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.weather import CLEAR, Air
from tests.support.worlds import ADULT, COMPACT, CRATE, VAN

CAR = replace(COMPACT, length_m=4.4, width_m=1.8, height_m=1.5)
DELIVERY = replace(VAN, length_m=5.9, width_m=2.0, height_m=2.4)
LORRY = replace(VAN, name="truck.box", kind="truck", length_m=10.0, width_m=2.5, height_m=3.8)
PERSON = replace(ADULT, length_m=0.5, width_m=0.6, height_m=1.75)
CHILD = replace(ADULT, length_m=0.4, width_m=0.4, height_m=1.2)
BOX = replace(CRATE, height_m=1.0)
QUIET = replace(STANDARD, noise=NO_NOISE, dropouts=NO_DROPOUTS)
AT_ZERO = (0.0, 0.0, 0.0)


def seen(
    *scene: tuple[ModelSpec, float, float],
    settings: SensorSettings = STANDARD,
    buildings: tuple[tuple[tuple[float, float], ...], ...] = (),
    air: Air = CLEAR,
    heading: float = 0.0,
) -> list[int]:
    """Indices of those in sight; all point east."""
    sight = Sight(Bodies.of([model for model, _, _ in scene]), buildings, settings, air)
    return sight.seen(0.0, 0.0, heading, np.array([(x, y, 0.0) for _, x, y in scene])).tolist()


def test_a_child_behind_a_parked_car_is_hidden_and_an_adult_is_seen_by_the_head() -> None:
    # The car's top is at 1.5 m up to x = 12.2. A line from 1.6 m down to 1.14 m at 13 m is at 1.17 m there; one up to
    # 1.66 m is over it all the way.
    assert seen((CAR, 10.0, 0.0), (CHILD, 13.0, 0.0)) == [0]
    assert seen((CAR, 10.0, 0.0), (PERSON, 13.0, 0.0)) == [0, 1]
    assert seen((CAR, 10.0, 0.0), (CHILD, 13.0, 4.0)) == [0, 1]


def test_half_of_a_person_over_a_car_is_not_enough_for_who_asks_for_more() -> None:
    assert seen((CAR, 10.0, 0.0), (PERSON, 13.0, 0.0), settings=replace(STANDARD, seen_share=0.5)) == [0, 1]
    assert seen((CAR, 10.0, 0.0), (PERSON, 13.0, 0.0), settings=replace(STANDARD, seen_share=0.6)) == [0]


def test_a_van_hides_a_person_until_two_corners_show() -> None:
    # The van's near corner is at (9.05, 1): its shadow ends at y = 2.182 for x = 19.75, at y = 2.238 for x = 20.25.
    assert seen((DELIVERY, 12.0, 0.0), (PERSON, 20.0, 0.0)) == [0]
    assert seen((DELIVERY, 12.0, 0.0), (PERSON, 20.0, 1.9)) == [0], "one corner of five, at y = 2.2"
    assert seen((DELIVERY, 12.0, 0.0), (PERSON, 20.0, 2.0)) == [0, 1], "two corners, at y = 2.3"


def test_a_lorry_beside_the_ego_hides_who_is_beyond_it() -> None:
    assert seen((LORRY, 1.0, 4.0), (CAR, 1.0, 8.0), (CAR, 1.0, -8.0)) == [0, 2]


def test_who_is_nearer_is_not_hidden_by_who_is_farther() -> None:
    assert seen((CHILD, 8.0, 0.0), (LORRY, 20.0, 0.0)) == [0, 1]


def test_the_ego_looks_over_cars_at_cars_that_are_not_right_behind_them() -> None:
    # Points at 1.425 m and 0.75 m. Over a car at 20 m: its back edge is at 22.2 m, where a line to 1.425 m at 60 m is
    # at 1.535 m. To a car at 26 m, whose marks are at 23.8 m to 28.2 m, it is at most at 1.46 m.
    assert seen((CAR, 20.0, 0.0), (CAR, 60.0, 0.0)) == [0, 1]
    assert seen((CAR, 20.0, 0.0), (CAR, 26.0, 0.0)) == [0]


def test_a_crate_hides_nobody_who_stands() -> None:
    assert seen((BOX, 10.0, 0.0), (CHILD, 11.0, 0.0)) == [0, 1], "the upper half"


HOUSE = ((10.0, 2.0), (30.0, 2.0), (30.0, 20.0), (10.0, 20.0))


@pytest.mark.parametrize("outline", [HOUSE, HOUSE[::-1], (*HOUSE, HOUSE[0])])
def test_buildings_hide_everything_behind_them(outline: tuple[tuple[float, float], ...]) -> None:
    # The shadow's lower edge is the line through (10, 2) before x = 30, which is y = x / 5 there, and then (30, 2).
    who = [(LORRY, 40.0, 10.0), (CAR, 50.0, 1.0), (LORRY, 5.0, 20.0)]
    assert seen(*who, buildings=(outline,)) == [1, 2]
    assert seen(*who, buildings=(outline,), settings=replace(STANDARD, seen_share=0.0)) == [0, 1, 2]


def test_walls_are_looked_up_again_when_the_ego_has_gone_on() -> None:
    sight = Sight(Bodies.of([CAR]), (HOUSE,))
    for x, expected in ((-400.0, []), (-20.0, []), (35.0, [0]), (-20.0, []), (5.0, [])):
        assert sight.seen(x, 10.0, 0.0, np.array([(40.0, 10.0, 0.0)])).tolist() == expected


def test_ranges_are_by_class() -> None:
    who = [(PERSON, 54.9, 0.0), (PERSON, -55.1, 0.0), (CAR, 0.0, 79.9), (CAR, 0.0, -80.1), (LORRY, -70.0, 70.0)]
    assert seen(*who) == [0, 2, 4]
    assert seen(*who, settings=IDEAL) == [0, 1, 2]


def test_a_narrow_field_of_view_is_about_the_egos_heading() -> None:
    narrow = replace(STANDARD, field_of_view_rad=math.radians(90))
    who = [(CAR, 20.0, 19.0), (CAR, 20.0, -21.0), (CAR, -20.0, 0.0), (CAR, 0.0, 20.0)]
    assert seen(*who) == [0, 1, 2, 3]
    assert seen(*who, settings=narrow) == [0]
    assert seen(*who, settings=narrow, heading=math.pi / 2) == [3]
    assert seen(*who, settings=narrow, heading=math.radians(60)) == [0, 3]
    assert seen(*who, settings=narrow, heading=math.pi) == [2]


def test_who_is_not_there_is_not_seen() -> None:
    sight = Sight(Bodies.of([CAR, LORRY, CAR]), ())
    poses = np.array([(30.0, 0.0, 0.0), (math.nan, math.nan, math.nan), (40.0, 9.0, 0.0)])
    assert sight.seen(*AT_ZERO, poses).tolist() == [0, 2]
    assert not len(Sight(Bodies.of([]), ()).seen(*AT_ZERO, np.empty((0, 3))))


def test_boxes_hide_what_points_on_the_lines_say() -> None:
    rng = np.random.default_rng(4)
    wrong = checked = 0
    for _ in range(800):
        box = np.array([[*rng.uniform(-15, 15, 2), rng.uniform(-4, 4), rng.uniform(1, 9), rng.uniform(0.5, 3)]])
        point, rise, top = rng.uniform(-25, 25, 2), rng.uniform(-1.6, 3), rng.uniform(-1.2, 2.5)
        sight = Sight(Bodies(("car",), box[:, 3:], np.array([STANDARD.eye_m + top])), ())
        (clear,) = sight.clear(0.0, 0.0, box[:, :3], np.array([[*point, STANDARD.eye_m + rise]]))
        way = np.linspace(0, 1, 4001)[:, None]
        inside = shapely.contains_xy(shapely.Polygon(corners(box)[0]), way * point)
        cut = not clear
        wrong += cut != bool((inside & (way[:, 0] * rise < top)).any())
        checked += int(cut)
    assert wrong <= 1, "a line through a corner falls between the points"
    assert checked > 25


def test_walls_hide_what_shapely_says() -> None:
    rng = np.random.default_rng(5)
    ell = np.array([(0, 0), (12, 0), (12, 5), (5, 5), (5, 14), (0, 14)], dtype=np.float64)
    counts = [0, 0]
    for _ in range(200):
        outline = ell * rng.choice([-1, 1], 2) + rng.uniform(-40, 40, 2)
        polygon = shapely.Polygon(outline)
        eye, points = rng.uniform(-60, 60, 2), rng.uniform(-60, 60, (20, 2))
        if polygon.contains(shapely.Point(eye)):
            continue
        sight = Sight(Bodies.of([]), [tuple(map(tuple, outline.tolist()))], replace(STANDARD, signal_range_m=200.0))
        clear = sight.clear(*eye, np.empty((0, 3)), np.column_stack([eye + points, np.ones(len(points))]))
        for way, free in zip(points, clear, strict=True):
            through = shapely.LineString([eye, eye + way]).intersection(polygon).length > 1e-9
            assert free != through
            counts[int(free)] += 1
    assert min(counts) > 100


# --- weather --------------------------------------------------------------------------------------------------------


def test_fog_and_rain_shorten_the_ranges() -> None:
    thick = Air(fog=1.0)  # 50 m of visibility: an extinction of 0.06 / m
    far = thick.object_range_m(80.0)
    assert far * math.exp(0.06 * far) == pytest.approx(80.0)
    assert 20.0 < far < 30.0
    shower = Air(rain=1.0)  # 1.076 * 50 ** 0.67 = 14.8 dB/km, 0.0034 / m
    assert shower.extinction == pytest.approx(0.0034, abs=5e-5)
    assert shower.object_range_m(80.0) == pytest.approx(64.5, abs=0.5)
    assert Air().object_range_m(80.0) == pytest.approx(80.0, abs=1e-5)
    assert seen((CAR, 30.0, 0.0), (CAR, 15.0, 5.0), air=thick) == [1]
    assert seen((CAR, 30.0, 0.0), (CAR, 15.0, 5.0), air=thick, settings=IDEAL) == [0, 1]


def test_sun_rain_and_fog_shorten_the_signals_range() -> None:
    assert [round(air.signal_range_m(100.0)) for air in (Air(), Air(sun=1.0), Air(rain=1.0), Air(fog=1.0))] == [
        100,
        50,
        70,
        50,
    ]


# --- the object list ------------------------------------------------------------------------------------------------


def object_list(
    *models: ModelSpec,
    settings: SensorSettings = STANDARD,
    seed: int = 0,
    names: tuple[str, ...] = (),
    air: Air = CLEAR,
) -> ObjectList:
    names = names or tuple(f"actor_{k}" for k in range(len(models)))
    return ObjectList(Bodies.of(models), names, Sight(Bodies.of(models), (), settings, air), settings, seed)


def measured(objects: ObjectList, frames: range, x: float, y: float, speed: float = 0.0):  # type: ignore[no-untyped-def]  # rows of SeenActor
    states = np.array([(x, y, 0.0, speed)])
    return [objects.measure(frame, AT_ZERO, AT_ZERO, states) for frame in frames]


def test_without_noise_all_is_exact_and_the_nearest_come_first() -> None:
    states = np.array([(30.0, 4.0, 3.0, 7.5), (5.0, -8.0, -1.0, 1.2)])
    first, second = object_list(CAR, PERSON, settings=QUIET).measure(0, AT_ZERO, AT_ZERO, states)
    assert (first.kind, second.kind) == ("pedestrian", "car")
    assert (second.x, second.y, second.heading_rad, second.speed_mps) == pytest.approx((30.0, 4.0, 3.0, 7.5))
    assert (second.length_m, second.width_m) == (4.4, 1.8)


def state_table(
    frames: int, gap: float, speed: float = 0.0, *, settings: SensorSettings = STANDARD, air: Air = CLEAR
) -> list[SeenActor]:
    """What is measured of 400 cars in the same place, which hide nobody, in some frames."""
    objects = object_list(*[CAR] * 400, settings=replace(settings, seen_share=0.0), air=air)
    states = np.tile((gap, 0.0, 0.0, speed), (400, 1))
    return [actor for frame in range(frames) for actor in objects.measure(frame, AT_ZERO, AT_ZERO, states)]


def spread(actors: list[SeenActor], field: str) -> tuple[float, float]:
    values = np.array([getattr(actor, field) for actor in actors])
    return float(values.mean()), float(values.std())


def test_errors_grow_with_the_distance_and_are_as_large_as_said() -> None:
    noise = STANDARD.noise
    for gap in (10.0, 50.0):
        found = state_table(60, gap, 4.0, settings=replace(STANDARD, dropouts=NO_DROPOUTS))
        along, across = noise.radial_m + noise.radial_share * gap, noise.lateral_m + noise.lateral_rad * gap
        assert spread(found, "x") == pytest.approx((gap, along), rel=0.05)
        assert spread(found, "y") == pytest.approx((0.0, across), rel=0.05, abs=0.02)
    assert spread(found, "heading_rad")[1] == pytest.approx(noise.heading_rad, rel=0.05)
    assert spread(found, "speed_mps") == pytest.approx((4.0, 0.03 + 0.03 * 4.0), rel=0.05)
    assert spread(found, "length_m") == pytest.approx((4.4, 4.4 * noise.size_share), rel=0.1)


def test_lateral_errors_are_across_the_line_of_sight() -> None:
    only = replace(NO_NOISE, lateral_rad=0.01)
    settings = replace(STANDARD, noise=only, dropouts=NO_DROPOUTS)
    for (actor,) in measured(object_list(CAR, settings=settings), range(200), 30.0, 40.0):
        assert (actor.x - 30.0) * 30.0 + (actor.y - 40.0) * 40.0 == pytest.approx(0.0, abs=1e-9)


def test_what_stands_hardly_moves() -> None:
    speeds = [a.speed_mps for row in measured(object_list(CAR), range(1000), 10.0, 0.0, 0.0) for a in row]
    assert min(speeds) == 0.0
    assert max(speeds) < 0.15
    assert np.mean(speeds) < 0.02


def test_more_is_missed_far_away_and_in_rain() -> None:
    def share(gap: float, air: Air = CLEAR) -> float:
        return 1.0 - len(state_table(40, gap, air=air)) / (40 * 400)

    assert share(8.0) == pytest.approx(0.01, abs=0.005)
    assert share(64.0) == pytest.approx(0.01 + 0.40 * 0.8**4, abs=0.012)
    shower = Air(rain=1.0)
    assert share(60.0, shower) == pytest.approx(0.01 + 0.40 * (60.0 / shower.object_range_m(80.0)) ** 4, abs=0.012)


def test_a_miss_lasts_as_long_as_said() -> None:
    objects = object_list(*[CAR] * 100, settings=replace(STANDARD, seen_share=0.0, noise=NO_NOISE))
    states = np.array([(72.0 + k / 1000, 0.0, 0.0, 0.0) for k in range(100)])
    there = np.zeros((200, 100), dtype=bool)
    for frame in range(200):
        places = [actor.x for actor in objects.measure(frame, AT_ZERO, AT_ZERO, states)]
        there[frame, np.rint((np.array(places) - 72.0) * 1000).astype(int)] = True
    lengths = {int(n) % 4 for car in there.T for n in np.diff(np.flatnonzero(np.diff(car)))}
    assert 0.5 < there.mean() < 0.9
    assert lengths == {0}, "whole times of 0.2 s"


def test_a_track_stays_over_a_gap_of_a_second_and_is_new_after_a_longer_one() -> None:
    objects = object_list(CAR, settings=QUIET)

    def at(frame: int, gap: float = 20.0) -> list[int]:
        return [a.track for (a,) in measured(objects, range(frame, frame + 1), gap, 0.0)]

    first = at(0)
    assert at(20) == first
    assert at(40) == first
    later = at(61)
    assert later != first
    assert at(62) == later


def test_no_track_is_given_twice_and_they_say_nothing_about_the_order() -> None:
    objects = object_list(*[CAR] * 40, settings=IDEAL)
    numbers: list[int] = []
    for k in range(100):
        states = np.array([(10.0 + j, 0.0, 0.0, 0.0) for j in range(40)])
        numbers += [a.track for a in objects.measure(30 * k, AT_ZERO, AT_ZERO, states)]
    assert len(set(numbers)) == len(numbers) == 4000
    assert abs(np.corrcoef(numbers[:1000], np.arange(1000))[0, 1]) < 0.1


def test_seeds_and_actors_have_their_own_noise() -> None:
    def row(seed: int, name: str, frame: int = 7):  # type: ignore[no-untyped-def]  # SeenActor
        return replace(
            measured(object_list(CAR, seed=seed, names=(name,)), range(frame, frame + 1), 20.0, 3.0)[0][0], track=0
        )

    assert row(1, "a") == row(1, "a")
    assert len({row(1, "a"), row(2, "a"), row(1, "b"), row(1, "a", 8)}) == 4


def test_an_object_is_moved_and_turned_with_the_egos_own_error() -> None:
    objects = object_list(CAR, settings=QUIET)
    (actor,) = objects.measure(0, AT_ZERO, (1.0, 2.0, math.pi / 2), np.array([(10.0, 0.0, 0.0, 0.0)]))
    assert (actor.x, actor.y, actor.heading_rad) == pytest.approx((1.0, 12.0, math.pi / 2))


def test_others_do_not_change_who_of_the_rest_is_missed() -> None:
    # A clip has fewer actors than its parent.
    far = np.array([(70.0 + k / 10, 0.0, 0.0, 0.0) for k in range(30)])
    open_air = replace(STANDARD, seen_share=0.0)
    many = object_list(*[CAR] * 30, settings=open_air)
    few = object_list(*[CAR] * 10, settings=open_air, names=tuple(f"actor_{k}" for k in range(20, 30)))
    for frame in range(0, 100, 7):
        there = [replace(a, track=0) for a in many.measure(frame, AT_ZERO, AT_ZERO, far)]
        again = [replace(a, track=0) for a in few.measure(frame, AT_ZERO, AT_ZERO, far[20:])]
        assert again == there[len(there) - len(again) :]
        assert 0 < len(again) < len(there)


def test_what_is_seen_is_an_object_of_the_protocol() -> None:
    (actor,) = object_list(CAR).measure(0, AT_ZERO, AT_ZERO, np.array([(10.0, 0.0, 0.0, 3.0)]))
    values = [getattr(actor, field.name) for field in fields(SeenActor)]
    assert [type(value) for value in values] == [int, str, *[float] * 6]
    assert type(actor) is SeenActor
    for twin in (SeenActor(*values), pickle.loads(pickle.dumps(actor)), copy.deepcopy(actor)):
        assert twin == actor
        assert hash(twin) == hash(actor)
    with pytest.raises(FrozenInstanceError):
        actor.x = 0.0  # type: ignore[misc]  # it must not work


def test_settings_may_be_whole_numbers() -> None:
    whole = replace(
        STANDARD,
        field_of_view_rad=6,
        seen_share=0,
        signal_range_m=50,
        noise=replace(NO_NOISE, radial_m=1),
        dropouts=replace(NO_DROPOUTS, steepness=4),
    )
    (actor,) = object_list(CAR, settings=whole).measure(0, (0, 0, 0), (0, 0, 0), np.array([(10.0, 0.0, 0.0, 3.0)]))
    assert actor.x != 10.0
