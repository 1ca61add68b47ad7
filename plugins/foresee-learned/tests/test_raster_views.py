"""What a driver gets of the pictures: views of signals and of what is sensed, views of other packages, and the page
docs/reference/rasters.md."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from foresee_learned.rasters import (
    BIRDS_EYE_CHANNELS,
    FORWARD_CHANNELS,
    GROUP_OF,
    GROUPS,
    Canvas,
    RecordedFrames,
    seen_arrays,
    stops_of,
)
from foresee_learned.rasters.layout import BIRDS_EYE, FORWARD, HEIGHTS_M, MAP_BITS, WHOLE

from foresee_dsl.campaign.keys import driver_identity, views_identity
from foresee_dsl.compile.bundle import ActorKind
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
from foresee_dsl.simulate.actors.dynamics import limits_of
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing.views import RunViews, StepViews
from tests.support.rasters import NO_GROUPS, NOBODY, rows_and_columns, street
from tests.support.scenes import Cruise, Town
from tests.support.worlds import ADULT, COMPACT

ABOVE = {name: k for k, name in enumerate(BIRDS_EYE_CHANNELS)}
AHEAD = {name: k for k, name in enumerate(FORWARD_CHANNELS)}

LOOKING = """
class Looking:
    name, version = "looking", "1"

    def reset(self, mission, vehicle, seed):
        pass

    def step(self, observation):
        pass
"""


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


def test_stop_lines_go_across_all_lanes_of_the_direction() -> None:
    wide = replace(mission(), left_m=np.full(151, 4.8), right_m=np.full(151, 1.6))
    (line,) = stops_of(wide)
    assert (line.x, line.y, line.width_m) == (20.0, pytest.approx(1.6), pytest.approx(6.4))
    assert line.heads == ((22.0, -3.0, 2.6), (40.0, 0.0, 5.0))
    assert not len(seen_arrays(())[0])


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
