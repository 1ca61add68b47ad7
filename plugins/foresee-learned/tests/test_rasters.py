"""The pictures: pixels worked out by hand, shapely as the judge of areas, and a real town."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import shapely
from foresee_learned.rasters import (
    BIRDS_EYE_CHANNELS,
    FORWARD_CHANNELS,
    GROUP_OF,
    GROUPS,
    Canvas,
    Pose,
    RecordedFrames,
    seen_arrays,
    stops_of,
)
from foresee_learned.rasters.colours import coloured, write_png
from foresee_learned.rasters.fill import box_pixels, filled, toggle_outlines
from foresee_learned.rasters.ground import GroundMap
from foresee_learned.rasters.layout import BIRDS_EYE, FORWARD, HEIGHTS_M, MAP_BITS, WHOLE
from PIL import Image

from foresee_dsl.campaign.keys import driver_identity, views_identity
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import ActorKind, SumoBundle
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.drivers.protocol import (
    Control,
    EgoState,
    JunctionPassage,
    Mission,
    Observation,
    SeenActor,
    Views,
    Window,
)
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.actors.dynamics import limits_of
from foresee_dsl.simulate.mission import mission_of
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing.views import RunViews, StepViews
from tests.support.scenes import Cruise, Town
from tests.support.worlds import ADULT, COMPACT

LOOKING = """
class Looking:
    name, version = "looking", "1"

    def reset(self, mission, vehicle, seed):
        pass

    def step(self, observation):
        pass
"""
ABOVE = {name: k for k, name in enumerate(BIRDS_EYE_CHANNELS)}
AHEAD = {name: k for k, name in enumerate(FORWARD_CHANNELS)}
NOBODY = np.empty((0, 6))
NO_GROUPS = np.empty(0, dtype=np.int64)
VEHICLE, TWO_WHEELER, PEDESTRIAN, OBSTACLE = (np.array([k]) for k in range(4))


def street(
    width_m: float = 4.0, turn_rad: float = 0.0, shift: tuple[float, float] = (0.0, 0.0), **more: Any
) -> RoadNetwork:
    """One lane from (-200, 0) to (200, 0), then turned and moved."""
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    ends = tuple((x * c + shift[0], x * s + shift[1]) for x in (-200.0, 200.0))
    lane = Lane("road_0", "road", 0, ends, 400.0, 13.9, width_m, frozenset({"car"}), False)
    parts = {"edges": {}, "junctions": {}, "movements": (), "crossings": {}, "walking_areas": {}, "footways": ()}
    return RoadNetwork(lanes={lane.id: lane}, **parts, **more)


def rows_and_columns(plane: np.ndarray) -> tuple[set[int], set[int]]:
    rows, columns = np.nonzero(plane)
    return set(rows.tolist()), set(columns.tolist())


def box(*values: float) -> np.ndarray:
    return np.array([values])


# ---- filling --------------------------------------------------------------------------------------------------------


def test_a_box_has_the_pixels_whose_middles_are_in_it() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        x, y, angle, length, width = (*rng.uniform(-2, 42, 2), rng.uniform(-4, 4), *rng.uniform(1, 15, 2))
        c, s = math.cos(angle), math.sin(angle)
        _, pixels = box_pixels(box(x, y, c, s, length, width), Window(0, 0, 40, 50))
        column, row = np.meshgrid(np.arange(50) + 0.5, np.arange(40) + 0.5)
        along, across = (column - x) * c + (row - y) * s, (row - y) * c - (column - x) * s
        slack = np.maximum(np.abs(along) - length / 2, np.abs(across) - width / 2)
        expected = set(np.flatnonzero(slack < -2e-3)), set(np.flatnonzero(slack < 2e-3))
        assert expected[0] <= set(pixels) <= expected[1]
        assert len(set(pixels)) == len(pixels)


@pytest.mark.parametrize("quarter", range(8))
def test_neighbouring_boxes_share_no_pixel_and_leave_none_out(quarter: int) -> None:
    """Two boxes side by side, with edges exactly on the middles of pixels."""
    angle = quarter * math.pi / 2 + (1e-16 if quarter > 3 else 0.0)
    c, s = math.cos(angle), math.sin(angle)
    boxes = np.array([(10.5 + 3 * k * c, 10.5 + 3 * k * s, c, s, 3.0, 2.0) for k in (0, 1)])
    index, pixels = box_pixels(boxes, Window(0, 0, 30, 30))
    assert np.bincount(index).tolist() == [6, 6]
    assert len(set(pixels)) == 12


def test_outlines_with_holes_become_areas() -> None:
    shape = shapely.Polygon([(2, 3), (30, 1), (36, 25), (12, 28)], [[(10, 10), (20, 8), (18, 20)]])
    toggles = np.zeros((30, 40), np.uint8)
    rings = [shapely.get_coordinates(ring) for ring in (shape.exterior, *shape.interiors)]
    toggle_outlines(toggles, rings, 4)
    toggle_outlines(toggles, [np.array([(-5.0, -5.0), (60.0, -5.0), (60.0, 60.0), (-5.0, 60.0)])], 1)
    bits = filled(toggles)
    column, row = np.meshgrid(np.arange(40) + 0.5, np.arange(30) + 0.5)
    inside = shapely.contains_xy(shape, column, row)
    edge = shapely.distance(shape.boundary, shapely.points(column, row)) < 2e-3
    assert ((bits & 4 > 0) == inside)[~edge].all()
    assert (bits & 1).all(), "what surrounds the picture fills it"


# ---- the bird's-eye view --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def canvas() -> Canvas:
    return Canvas(street(), ego_size_m=(4.0, 2.0))


def test_a_car_ten_metres_ahead_is_twenty_rows_up(canvas: Canvas) -> None:
    picture = canvas.birds_eye((0.0, 0.0, 0.0), box(10.0, 0.0, 0.0, 8.0, 4.5, 1.8), VEHICLE)
    assert picture.shape == (19, 192, 192) == BIRDS_EYE.shape
    # Its middle is between rows 75 and 76 (96 - 20); 4.5 m are 9 rows, 1.8 m are 3.6 columns around column 96.
    assert rows_and_columns(picture[ABOVE["vehicle"]]) == (set(range(71, 80)), set(range(94, 98)))
    assert picture[ABOVE["vehicle"]].sum() == 9 * 4 * 255
    assert set(picture[ABOVE["velocity_ahead"]][71:80, 94:98].flat) == {128 + 40}
    assert set(picture[ABOVE["velocity_left"]][71:80, 94:98].flat) == {128}
    assert picture[ABOVE["velocity_ahead"]].astype(int).sum() == 168 * 36
    assert rows_and_columns(picture[ABOVE["ego"]]) == (set(range(92, 100)), set(range(94, 98)))
    for empty in ("two_wheeler", "pedestrian", "obstacle", "stop_red", "crossing", "footway", "building", "route"):
        assert not picture[ABOVE[empty]].any()


def test_the_picture_turns_with_the_ego(canvas: Canvas) -> None:
    """It drives north; a van 20 m to its west drives south, a bicycle 30 m to its east drives west."""
    actors = np.array([(80.0, 50.0, -math.pi / 2, 10.0, 6.0, 2.0), (130.0, 50.0, math.pi, 4.0, 2.0, 1.0)])
    picture = canvas.birds_eye((100.0, 50.0, math.pi / 2), actors, np.array([0, 1]))
    assert rows_and_columns(picture[ABOVE["vehicle"]]) == (set(range(90, 102)), set(range(54, 58)))
    assert rows_and_columns(picture[ABOVE["two_wheeler"]]) == ({95, 96}, set(range(154, 158)))
    assert picture[ABOVE["velocity_ahead"], 95, 55] == 128 - 50
    assert picture[ABOVE["velocity_left"], 95, 155] == 128 + 20


def test_the_road_is_under_the_ego(canvas: Canvas) -> None:
    picture = canvas.birds_eye((0.25, 0.25, 0.0), NOBODY, NO_GROUPS)
    # 4 m of road around y = 0 are 8 columns; the ego is half a pixel to the left of the middle.
    assert set(np.flatnonzero(picture[ABOVE["drivable"], 50])) in (set(range(92, 100)), set(range(93, 101)))
    assert picture[ABOVE["drivable"]].sum() == 8 * 192 * 255
    assert (picture[ABOVE["lane_centre"]] > 0).sum(axis=1).tolist() == [1] * 192
    assert (picture[ABOVE["marking"]] > 0).sum(axis=1).tolist() == [2] * 192


def test_the_road_ends_where_it_ends(canvas: Canvas) -> None:
    picture = canvas.birds_eye((190.0, 0.0, 0.0), NOBODY, NO_GROUPS)
    # It ends 10 m ahead, and round: half its width farther.
    assert min(rows_and_columns(picture[ABOVE["drivable"]])[0]) in (71, 72)
    assert min(rows_and_columns(picture[ABOVE["lane_centre"]])[0]) in (75, 76)
    far = canvas.birds_eye((1e7, -1e7, 1.0), NOBODY, NO_GROUPS)
    assert not far[:8].any() and far[ABOVE["ego"]].any(), "off the map there is no ground"


@pytest.mark.parametrize("turn", np.linspace(0, math.pi, 19).tolist())
def test_somebody_on_foot_is_never_lost_between_pixels(canvas: Canvas, turn: float) -> None:
    spots = np.random.default_rng(3).uniform(-40, 40, (30, 2))
    for x, y in spots:
        picture = canvas.birds_eye((0.0, 0.0, 0.3), box(x, y, turn, 1.0, 0.3, 0.5), PEDESTRIAN)
        assert 2 <= (picture[ABOVE["pedestrian"]] > 0).sum() <= 6


def test_absent_and_far_actors_are_not_drawn(canvas: Canvas) -> None:
    actors = np.array([(math.nan,) * 4 + (4.5, 1.8), (500.0, 0.0, 0.0, 1.0, 4.5, 1.8)])
    picture = canvas.birds_eye((0.0, 0.0, 0.0), actors, np.array([0, 0]))
    assert not picture[ABOVE["vehicle"]].any() and not picture[ABOVE["velocity_ahead"]].any()


def test_speeds_beyond_the_scale_stay_at_its_ends(canvas: Canvas) -> None:
    for speed, value in ((40.0, 255), (-40.0, 1), (0.0, 128)):
        picture = canvas.birds_eye((0.0, 0.0, 0.0), box(10.0, 0.0, 0.0, speed, 4.5, 1.8), VEHICLE)
        assert picture[ABOVE["velocity_ahead"], 76, 96] == value


def near(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether every pixel that is set in one is set in the other within a pixel, and the other way round."""

    def grown(plane: np.ndarray) -> np.ndarray:
        padded = np.pad(plane > 0, 1)
        return np.any([padded[r : r + len(plane), c : c + plane.shape[1]] for r in range(3) for c in range(3)], axis=0)

    inner = np.s_[1:-1, 1:-1]
    return bool((grown(other)[inner] >= (one > 0)[inner]).all() and (grown(one)[inner] >= (other > 0)[inner]).all())


@pytest.mark.parametrize(("turn", "shift"), [(0.7, (31.3, -12.9)), (-2.1, (0.4, 700.2)), (math.pi / 2, (5.0, 5.0))])
def test_a_turned_and_moved_world_looks_the_same(turn: float, shift: tuple[float, float]) -> None:
    rng = np.random.default_rng(8)
    actors = np.column_stack(
        (rng.uniform(-45, 45, (12, 2)), rng.uniform(-3, 3, 12), rng.uniform(0, 15, 12), np.full((12, 2), (4.5, 1.8)))
    )
    house = ((20.0, 6.0), (40.0, 6.0), (40.0, 20.0), (20.0, 20.0))
    c, s = math.cos(turn), math.sin(turn)

    def moved(x: Any, y: Any) -> tuple[Any, Any]:
        return c * x - s * y + shift[0], s * x + c * y + shift[1]

    there = actors.copy()
    there[:, 0], there[:, 1] = moved(actors[:, 0], actors[:, 1])
    there[:, 2] += turn
    groups = np.arange(12) % 4
    bodies, bodies_there = (np.column_stack((a[:, [0, 1, 2, 4, 5]], np.full(12, 1.6))) for a in (actors, there))
    one = Canvas(street(buildings=(house,)), ego_size_m=(4.0, 2.0))
    turned = street(turn_rad=turn, shift=shift, buildings=(tuple(moved(*p) for p in house),))
    other = Canvas(turned, ego_size_m=(4.0, 2.0))
    pose, pose_there = (0.0, 0.0, 0.0), (*moved(0.0, 0.0), turn)
    above = one.birds_eye(pose, actors, groups), other.birds_eye(pose_there, there, groups)
    for name in ("drivable", "building", "ego", *GROUPS):
        assert near(above[0][ABOVE[name]], above[1][ABOVE[name]]), name
    assert np.abs(above[0][8:].astype(int) - above[1][8:]).sum() <= above[0][8:].sum() * 0.02, "rounding at most"
    ahead = one.forward(pose, bodies, groups), other.forward(pose_there, bodies_there, groups)
    for name in ("building", *GROUPS):
        assert near(ahead[0][AHEAD[name]], ahead[1][AHEAD[name]]), name
    road = [picture[AHEAD["road"], 36:] | picture[AHEAD["marking"], 36:] for picture in ahead]
    assert near(*road), "within 28 m; farther off a pixel of the picture skips several of the map"


# ---- the forward view -----------------------------------------------------------------------------------------------


def test_a_car_ahead_is_where_a_pinhole_puts_it(canvas: Canvas) -> None:
    """Its rear is 17 m ahead of the camera, which is 0.3 m ahead of the ego's middle; 80 pixels a unit of slope."""
    picture = canvas.forward((0.0, 0.0, 0.0), box(19.3, 0.0, 0.0, 4.0, 1.8, 1.5), VEHICLE)
    assert picture.shape == (13, 64, 160) == FORWARD.shape
    # Half its width is 0.9 / 17 * 80 = 4.2 columns; its top 0.1 / 17 * 80 = 0.5 rows over the horizon (32), its foot
    # 1.4 / 17 * 80 = 6.6 rows under it.
    assert rows_and_columns(picture[AHEAD["vehicle"]]) == (set(range(32, 39)), set(range(76, 84)))
    assert picture[AHEAD["vehicle"]].sum() == 7 * 8 * 255
    assert set(picture[AHEAD["inverse_depth"]][32:39, 76:84].flat) == {30}


def test_the_ground_is_where_a_pinhole_puts_it(canvas: Canvas) -> None:
    picture = canvas.forward((0.0, 0.0, 0.0), NOBODY, NO_GROUPS)
    assert not picture[:, :32].any(), "over the horizon is nothing"
    # Row 45 is 13.5 rows under the horizon: 1.4 * 80 / 13.5 = 8.3 m ahead; 2 m of road either side are 19.3 columns.
    road = picture[AHEAD["road"], 45] + picture[AHEAD["marking"], 45]
    at = set(np.flatnonzero(road))
    assert set(range(61, 99)) <= at <= set(range(58, 102)), "with half a marking beyond its edge"
    assert picture[AHEAD["inverse_depth"], 45, 80] == round(510 / (1.4 * 80 / 13.5))
    assert (picture[AHEAD["ground"], 45, :55] == 255).all()


def test_one_behind_a_van_is_hidden_and_shows_when_the_van_is_away(canvas: Canvas) -> None:
    van, child = (15.0, 1.0, 0.0, 6.0, 2.0, 2.3), (25.0, 1.5, 0.0, 0.4, 0.4, 1.2)
    with_van = canvas.forward((0.0, 0.0, 0.0), np.array([van, child]), np.array([0, 2]))
    without = canvas.forward((0.0, 0.0, 0.0), np.array([child]), PEDESTRIAN)
    assert with_van[AHEAD["vehicle"]].any() and not with_van[AHEAD["pedestrian"]].any()
    assert without[AHEAD["pedestrian"]].any()
    swapped = canvas.forward((0.0, 0.0, 0.0), np.array([child, van]), np.array([2, 0]))
    assert np.array_equal(swapped, with_van), "the order of the arrays does not matter"


def test_one_in_front_of_a_van_covers_it_and_over_a_low_box_one_sees(canvas: Canvas) -> None:
    van, child = (15.0, 0.0, 0.0, 6.0, 2.0, 2.3), (9.0, 0.0, 0.0, 0.4, 0.4, 1.2)
    picture = canvas.forward((0.0, 0.0, 0.0), np.array([van, child]), np.array([0, 2]))
    assert picture[AHEAD["pedestrian"]].any()
    assert not (picture[AHEAD["pedestrian"]] & picture[AHEAD["vehicle"]]).any()
    crate, man = (8.0, 0.0, 0.0, 1.0, 3.0, 0.6), (16.0, 0.0, 0.0, 0.5, 0.5, 1.8)
    over = canvas.forward((0.0, 0.0, 0.0), np.array([crate, man]), np.array([3, 2]))
    rows, _ = rows_and_columns(over[AHEAD["pedestrian"]])
    # The crate's far edge is 8.2 m ahead: 0.8 / 8.2 * 80 = 7.8 rows under the horizon; his feet would be at 39.2.
    assert max(rows) == 38 and not (over[AHEAD["obstacle"]][:39] > 0).any()


def test_buildings_hide_and_fog_ends_the_view() -> None:
    house = ((30.0, -20.0), (40.0, -20.0), (40.0, 20.0), (30.0, 20.0))
    behind, before = (60.0, 0.0, 0.0, 12.0, 2.5, 3.2), (22.0, 3.0, 0.0, 4.5, 1.8, 1.5)
    walled = Canvas(street(buildings=(house,)))
    bodies, groups = np.array([behind, before]), np.array([0, 0])
    picture = walled.forward((0.0, 0.0, 0.0), bodies[:1], VEHICLE)
    assert picture[AHEAD["building"]].any() and not picture[AHEAD["vehicle"]].any()
    assert set(np.flatnonzero(picture[AHEAD["building"], 33])) == set(range(26, 134)), "20 m / 29.7 m: 53.9 columns"
    assert picture[AHEAD["inverse_depth"], 30, 80] == 17, "510 / 29.7"
    assert walled.forward((0.0, 0.0, 0.0), bodies, groups)[AHEAD["vehicle"]].any()
    foggy = walled.forward((0.0, 0.0, 0.0), bodies, groups, range_m=15.0)
    assert not foggy[AHEAD["building"]].any() and not foggy[AHEAD["vehicle"]].any()
    # 15 m is 7.5 rows under the horizon: rows 39 and up are nearer.
    assert rows_and_columns(foggy[AHEAD["inverse_depth"]])[0] == set(range(39, 64))


def test_from_the_side_and_behind(canvas: Canvas) -> None:
    sides = np.array([(5.0, 8.0, 0.0, 4.5, 1.8, 1.5), (-10.0, 0.0, 0.0, 4.5, 1.8, 1.5), (math.nan,) * 3 + (1, 1, 1)])
    assert not canvas.forward((0.0, 0.0, 0.0), sides, np.array([0, 0, 0]))[AHEAD["vehicle"]].any()
    left = canvas.forward((0.0, 0.0, math.radians(40)), sides[:1], VEHICLE)
    assert left[AHEAD["vehicle"]].any()


@pytest.mark.parametrize("x", [60.0, 80.0, 95.0])
def test_far_and_thin_ones_are_still_seen(canvas: Canvas, x: float) -> None:
    for y in np.linspace(-8, 8, 33):
        picture = canvas.forward((0.0, 0.0, 0.0), box(x, y, 0.3, 0.3, 0.3, 1.7), PEDESTRIAN)
        assert 1 <= (picture[AHEAD["pedestrian"]] > 0).sum() <= 6


def test_an_actor_that_the_camera_is_in_fills_the_picture(canvas: Canvas) -> None:
    picture = canvas.forward((0.0, 0.0, 0.0), box(0.0, 0.0, 0.0, 10.0, 3.0, 3.0), VEHICLE)
    assert (picture[AHEAD["vehicle"]] == 255).all() and (picture[AHEAD["inverse_depth"]] == 255).all()


# ---- signals, and what a driver gets --------------------------------------------------------------------------------


def mission(signal: str | None = "tls:0") -> Mission:
    """Straight on for 150 m; a junction from 21 m to 40 m."""
    s = np.arange(0.0, 151.0)
    passage = JunctionPassage("j", 20.0, 40.0, "straight", signal)
    width = np.full(len(s), 1.5)
    return Mission(np.column_stack((s, 0 * s)), s, 0 * s + 10, width, width, 5.0, 140.0, (passage,))


@pytest.mark.parametrize("colour", ["red", "amber", "green", "off", None])
def test_stop_lines_and_lamps_have_the_colour_that_is_seen(colour: Any) -> None:
    made = Canvas.of_mission(street(), mission(), (4.0, 2.0))
    signals = {} if colour is None else {"tls:0": colour}
    above = made.birds_eye((0.0, 0.0, 0.0), NOBODY, NO_GROUPS, signals)
    shown = colour if colour in ("red", "amber", "green") else "other"
    # 20 m ahead, 1 m along the road, 3 m across it.
    assert rows_and_columns(above[ABOVE[f"stop_{shown}"]]) == ({55, 56}, set(range(93, 99)))
    assert sum(above[ABOVE[f"stop_{name}"]].any() for name in ("red", "amber", "green", "other")) == 1
    ahead = made.forward((0.0, 0.0, 0.0), NOBODY, NO_GROUPS, signals)
    for name in ("red", "amber", "green"):
        rows, columns = rows_and_columns(ahead[AHEAD[name]])
        assert (bool(rows), bool(columns)) == (name == colour,) * 2
        if rows:
            # The far head hangs at 40 m, its near side 39.45 m from the camera: 4.1 m over it are 8.3 rows; its
            # underside is seen to its far side, 3.1 m over 39.95 m or 6.2 rows. The other stands at 22 m, 3 m to the
            # right: from 1.7 m over 21.45 m (6.3 rows) down to 0.7 m over 21.95 m (2.6 rows).
            assert rows_and_columns(ahead[AHEAD[name], :, 75:85]) == ({24, 25}, {4, 5})
            rows, columns = rows_and_columns(ahead[AHEAD[name], :, 85:])
            assert (min(rows), max(rows)) == (26, 28) and columns <= {4, 5, 6, 7}


def test_the_route_ends_at_the_goal() -> None:
    made = Canvas.of_mission(street(), mission(None), (4.0, 2.0))
    picture = made.birds_eye((120.0, 0.0, 0.0), NOBODY, NO_GROUPS)
    rows, columns = rows_and_columns(picture[ABOVE["route"]])
    assert min(rows) in (55, 56) and max(rows) == 191 and columns <= {94, 95, 96, 97}
    assert picture[ABOVE["stop_other"]].sum() == 0, "it is 100 m behind"


def ego(x: float = 0.0) -> EgoState:
    return EgoState(x, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0)


def views_of(*seen: SeenActor, at: EgoState | None = None, signals: Any = None, **more: Any) -> StepViews:
    """What a driver gets on a street where one walker is, 20 m ahead and 4 m to the left."""
    at = at or ego()
    run_views = RunViews(street(), mission(), COMPACT, [ADULT], **more)
    return StepViews(run_views, at, seen, signals or {}, (at.x, 0.0, 0.0), np.array([(20.0, 4.0, 0.0, 1.0)]))


def test_the_view_from_above_shows_what_is_sensed_and_the_camera_what_is_there() -> None:
    views = views_of(SeenActor(7, "car", 12.0, -6.0, 0.0, 3.0, 4.5, 1.8))
    protocol: Views = views
    assert protocol.birds_eye().shape == BIRDS_EYE.shape and protocol.forward().shape == FORWARD.shape
    above, ahead = views.birds_eye(), views.forward()
    assert above[ABOVE["vehicle"]].any() and not above[ABOVE["pedestrian"]].any()
    assert ahead[AHEAD["pedestrian"]].any() and not ahead[AHEAD["vehicle"]].any()
    lost = StepViews(views.run, ego(2.0), views.actors, views.signals, views.pose, views.states)
    assert np.array_equal(lost.forward(), ahead), "the camera is where the car is"
    assert not np.array_equal(lost.birds_eye(), above), "the map is where the localisation has it"


@pytest.mark.parametrize("window", [Window(0, 32, 128, 128), Window(60, 90, 40, 20), WHOLE])
def test_a_part_of_the_view_from_above_is_a_part_of_the_whole(window: Window) -> None:
    seen = (
        SeenActor(7, "car", 12.3, -2.1, 0.4, 3.0, 4.5, 1.8),
        SeenActor(8, "pedestrian", 3.0, 16.0, 0.0, 1.0, 0.5, 0.5),
    )
    views = views_of(*seen, at=replace(ego(0.7), heading_rad=0.2), signals={"tls:0": "red"})
    whole = views.birds_eye()[:, window.top : window.top + window.rows, window.left : window.left + window.columns]
    assert whole[ABOVE["vehicle"]].any() and whole[ABOVE["ego"]].any()
    assert np.array_equal(views.birds_eye(window), whole)


def test_nudges_of_the_last_digits_change_no_pixel() -> None:
    """Sines differ in their last digit from machine to machine; pictures may not, also where edges meet middles."""
    house = ((20.0, 6.0), (40.0, 6.0), (40.0, 20.0), (20.0, 20.0))
    made = Canvas.of_mission(street(buildings=(house,)), mission(), (4.5, 2.0))
    actors = np.array([(10.0 + k, 2.5 * k - 8.0, k * math.pi / 4, 5.0, 4.5, 2.0) for k in range(8)])
    bodies, groups = np.column_stack((actors[:, [0, 1, 2, 4, 5]], np.full(8, 1.4))), np.arange(8) % 4
    for pose in ((0.0, 0.0, 0.0), (0.5, 0.25, math.pi / 2), (3.0, -1.0, math.pi), (10.0, 2.0, math.pi / 4)):
        near_by = tuple(value + 3e-15 for value in pose)
        for draw, moving in ((made.birds_eye, actors), (made.forward, bodies)):
            picture = draw(pose, moving, groups, {"tls:0": "red"})
            assert np.array_equal(picture, draw(near_by, moving + 2e-15, groups, {"tls:0": "red"}))
            assert np.array_equal(picture, draw(near_by, moving - 2e-15, groups, {"tls:0": "red"}))


def test_fog_ends_what_the_camera_shows() -> None:
    assert views_of().forward()[AHEAD["pedestrian"]].any()
    assert not views_of(range_m=15.0).forward()[AHEAD["pedestrian"]].any()


def test_the_same_is_drawn_each_time_and_nothing_is_shared() -> None:
    views = views_of(SeenActor(7, "car", 12.0, -6.0, 0.0, 3.0, 4.5, 1.8))
    for draw in (views.birds_eye, views.forward):
        first, before = draw(), draw().copy()
        first[:] = 7
        assert np.array_equal(draw(), before)


def test_every_class_has_its_place() -> None:
    kinds = set(get_args(ActorKind))
    assert set(GROUP_OF) == set(HEIGHTS_M) == kinds
    assert {GROUPS[k] for k in GROUP_OF.values()} == set(GROUPS)
    assert BIRDS_EYE_CHANNELS[:8] == MAP_BITS


# ---- a real town ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bundle(scenarios: Path) -> SumoBundle:
    return compile_test_case(load_test_case(scenarios / "scenario9.foresee::r01"))


def test_the_map_is_the_network(bundle: SumoBundle) -> None:
    """Points all over the town: shapely says where they are. The map may be off by half the diagonal of a pixel."""
    network = bundle.network
    ground = GroundMap.of(network)
    assert GroundMap.of(network) is ground, "drawn once"
    west, south, east, north = network.drivable.bounds
    points = np.random.default_rng(2).uniform((west, south), (east, north), (4000, 2))
    bits = ground.sample((0.0, 0.0, 0.0), points[:, 0], points[:, 1])
    corners = [
        shapely.make_valid(shapely.Polygon(a.polygon)) for a in network.walking_areas.values() if len(a.polygon) > 2
    ]
    crossings = [shapely.LineString(c.lane.shape).buffer(c.lane.width_m / 2, cap_style="flat")
                 for c in network.crossings.values()]  # fmt: skip
    areas = {"drivable": network.drivable, "crossing": shapely.union_all(crossings)}
    areas["building"] = shapely.union_all([shapely.Polygon(outline) for outline in network.buildings])
    for name, area in areas.items():
        inside = shapely.contains_xy(area, points[:, 0], points[:, 1])
        sure = shapely.distance(area.boundary, shapely.points(points)) > 0.18
        drawn = bits >> MAP_BITS.index(name) & 1 > 0
        assert (drawn == inside)[sure].all(), name
        assert not inside.any() or drawn.any()
    footway = ground.bits >> MAP_BITS.index("footway") & 1
    assert footway.sum() * ground.m_per_px**2 > shapely.union_all(corners).area


def test_a_map_that_is_too_large_gets_larger_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("foresee_learned.rasters.ground._MAX_PX", 100_000)
    made = Canvas(street())
    coarse = made.birds_eye((0.0, 0.0, 0.0), NOBODY, NO_GROUPS)
    fine = Canvas(street()).birds_eye((0.0, 0.0, 0.0), NOBODY, NO_GROUPS)
    assert near(coarse[ABOVE["drivable"]], fine[ABOVE["drivable"]])


def turned_poses(mission: Mission) -> list[Pose]:
    ahead = np.diff(mission.centreline, axis=0)
    headings = np.arctan2(ahead[:, 1], ahead[:, 0])
    return [(*mission.centreline[k].tolist(), float(headings[k])) for k in range(0, len(headings) - 1, 10)]


def test_along_a_route_in_the_town(bundle: SumoBundle, tmp_path: Path) -> None:
    goal = mission_of(bundle)
    made = Canvas.of_mission(bundle.network, goal, (4.5, 1.8))
    others = bundle.scene.actors[1:]
    actors = np.array([(a.x, a.y, a.heading_rad, a.speed_mps, a.model.length_m, a.model.width_m) for a in others])
    groups = np.array([GROUP_OF[a.model.kind] for a in others])
    bodies = np.column_stack((actors[:, [0, 1, 2, 4, 5]], [a.model.height_m for a in others]))
    seen = 0
    for k, pose in enumerate(turned_poses(goal)):
        above, ahead = made.birds_eye(pose, actors, groups), made.forward(pose, bodies, groups)
        assert above[ABOVE["drivable"], 90:102, 95:97].all(), "the route is on the road"
        if goal.start_s < k * 10 < goal.goal_s - 50:
            assert above[ABOVE["route"], 95:97, 95:97].all(), "and runs under the ego"
        assert (ahead[:12].astype(bool).sum(axis=0) <= 1).all(), "a pixel shows one thing"
        assert (ahead[:12].any(axis=0) == (ahead[12] > 0)).all(), "and has its depth"
        if min(math.hypot(x - pose[0], y - pose[1]) for x, y, *_ in actors) > 10:  # nobody fills the picture
            assert ahead[AHEAD["road"], 50:].any()
        c, s = math.cos(pose[2]), math.sin(pose[2])
        for (x, y, *_), group in zip(actors, groups, strict=True):
            dx, dy = x - pose[0], y - pose[1]
            row, column = BIRDS_EYE.pixel(c * dx + s * dy, c * dy - s * dx)
            if 3 <= row < 189 and 3 <= column < 189:
                plane = above[ABOVE[GROUPS[group]]]
                assert plane[row - 1 : row + 2, column - 1 : column + 2].any()
                seen += 1
        if k == 4:
            file = tmp_path / "above.png"
            write_png(coloured(above), file, zoom=2)
            check_png(file, coloured(above), zoom=2)
            write_png(coloured(ahead), tmp_path / "ahead.png")
            check_png(tmp_path / "ahead.png", coloured(ahead), zoom=1)
    assert seen > 20


def check_png(file: Path, rgb: np.ndarray, zoom: int) -> None:
    with Image.open(file) as picture:
        assert picture.format == "PNG"
        assert np.array_equal(np.asarray(picture), rgb.repeat(zoom, axis=0).repeat(zoom, axis=1))


def test_colours_know_both_views_only() -> None:
    with pytest.raises(ValueError, match="19 or 13 channels, not 3"):
        coloured(np.zeros((3, 4, 4), np.uint8))


def test_the_pages_example_draws_a_recorded_run(town: Town, root: Path, tmp_path: Path) -> None:
    actors = [town.ego(("n01_n11", "n11_n21"), 40.0), *town.traffic(3, 12)]
    trace = run(town.bundle(actors, end_s=2.0), Cruise(5.0)).trace
    frames = RecordedFrames(trace)
    made = Canvas(town.network, trace.waypoints)
    above = made.birds_eye(frames.pose(30), frames.actors(30), frames.groups)
    ahead = made.forward(frames.pose(30), frames.bodies(30), frames.groups)
    assert above[ABOVE["drivable"]].any() and above[ABOVE["vehicle"]].any() and ahead[AHEAD["road"]].any()
    scope: dict[str, Any] = {}
    exec(examples(root)[2], scope)
    scope["pictures"](town.network, trace, tmp_path)
    assert len(list(tmp_path.glob("*_above.png"))) == len(list(tmp_path.glob("*_ahead.png"))) >= 2


# ---- docs/reference/rasters.md --------------------------------------------------------------------------------------


def examples(root: Path) -> list[str]:
    """The page's programs."""
    return re.findall(
        r"```python\n(.*?)```", (root / "docs" / "reference" / "rasters.md").read_text(encoding="utf-8"), re.S
    )


def test_the_page_lists_the_channels_in_their_order(root: Path) -> None:
    page = (root / "docs" / "reference" / "rasters.md").read_text(encoding="utf-8")
    tables = re.findall(r"\| channel \|.*\n\| ---.*\n((?:\|.*\n)+)", page)
    listed = [re.findall(r"^\| (\d+) \| `(\w+)`", table, re.M) for table in tables]
    for names, rows in zip((BIRDS_EYE_CHANNELS, FORWARD_CHANNELS), listed, strict=True):
        assert [(int(k), name) for k, name in rows] == list(enumerate(names))


def test_the_example_driver_of_the_page_stops_for_what_is_in_its_way(root: Path) -> None:
    scope: dict[str, Any] = {}
    exec(examples(root)[0], scope)
    driver = scope["Careful"]()
    slow = replace(ego(8.0), speed_mps=4.0)

    def answer(*seen: SeenActor, **signals: Any) -> Control:
        views = views_of(*seen, at=slow, signals=signals)
        return driver.step(Observation(0.0, slow, seen, signals, views=views))

    driver.reset(mission(), limits_of(COMPACT), 0)
    assert answer().throttle > 0 and answer().brake == 0
    assert answer(SeenActor(1, "pedestrian", 18.0, 0.5, 0.0, 0.0, 0.5, 0.5)).brake == 1
    assert answer(SeenActor(1, "pedestrian", 18.0, 9.0, 0.0, 0.0, 0.5, 0.5)).brake == 0, "beside its way"
    assert answer(**{"tls:0": "red"}).brake == 1


def test_a_view_that_a_package_registers_is_drawn_by_its_name(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_views.py").write_text(examples(root)[1], encoding="utf-8")
    info = tmp_path / "own_views-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-views\nVersion: 1\n", encoding="utf-8")
    registered = "[foresee_dsl.raster_views]\noccupancy = own_views:occupancy\n"
    (info / "entry_points.txt").write_text(registered, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    views = views_of(SeenActor(1, "pedestrian", 18.0, 0.5, 0.0, 0.0, 0.5, 0.5), at=ego(8.0), signals={})
    picture = views.draw("occupancy")
    assert picture.shape == (1, 192, 192) and picture.any()
    assert np.array_equal(views.draw("forward"), views.forward())
    with pytest.raises(ForeseeError, match="unknown raster view 'occupency', did you mean 'occupancy'"):
        views.draw("occupency")


def test_the_views_are_in_the_key_of_a_driver_of_another_package_and_in_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such a driver may ask for pictures, and nothing in its own code says which."""
    (tmp_path / "looking.py").write_text(LOOKING, encoding="utf-8")
    (tmp_path / "other_views").mkdir()
    (tmp_path / "other_views" / "__init__.py").write_text("def occupancy(step): ...\n", encoding="utf-8")
    info = tmp_path / "looking-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: looking\nVersion: 1\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(
        "[foresee_dsl.drivers]\nlooking = looking:Looking\n"
        "[foresee_dsl.raster_views]\noccupancy = other_views:occupancy\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(tmp_path)
    views_identity.cache_clear()
    before = driver_identity("looking"), driver_identity("pdm"), driver_identity("fusion")
    assert "occupancy" in before[0] and "birds_eye" in before[0] and "birds_eye" not in before[1]
    (tmp_path / "other_views" / "__init__.py").write_text("def occupancy(step): return step\n", encoding="utf-8")
    views_identity.cache_clear()
    after = driver_identity("looking"), driver_identity("pdm"), driver_identity("fusion")
    assert [one == two for one, two in zip(before, after, strict=True)] == [False, True, False]
    views_identity.cache_clear()


def test_stop_lines_go_across_all_lanes_of_the_direction() -> None:
    wide = replace(mission(), left_m=np.full(151, 4.8), right_m=np.full(151, 1.6))
    (line,) = stops_of(wide)
    assert (line.x, line.y, line.width_m) == (20.0, pytest.approx(1.6), pytest.approx(6.4))
    assert line.heads == ((22.0, -3.0, 2.6), (40.0, 0.0, 5.0))
    assert not len(seen_arrays(())[0])
