"""The pictures: pixels worked out by hand, shapely as the judge of areas, and a real town."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

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
)
from foresee_learned.rasters.colours import coloured, write_png
from foresee_learned.rasters.fill import box_pixels, filled, toggle_outlines
from foresee_learned.rasters.ground import GroundMap
from foresee_learned.rasters.layout import BIRDS_EYE, FORWARD, MAP_BITS
from PIL import Image

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.protocol import (
    Mission,
    Window,
)
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.mission import mission_of
from tests.support.rasters import NO_GROUPS, NOBODY, rows_and_columns, street

ABOVE = {name: k for k, name in enumerate(BIRDS_EYE_CHANNELS)}
AHEAD = {name: k for k, name in enumerate(FORWARD_CHANNELS)}
VEHICLE, TWO_WHEELER, PEDESTRIAN, OBSTACLE = (np.array([k]) for k in range(4))


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
