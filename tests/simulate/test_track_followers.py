"""Actors on recorded tracks in real SUMO: where they are, when they are there, how they leave, and what is measured."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.tracks import read_tracks
from foresee_dsl.drivers.idm import IdmDriver
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEP_S, Trace, X, Y
from tests.support.recorded import SCENARIO, Sample, samples, write_case
from tests.support.scenes import Cruise

TRACKS = {"v117": "117", "v118": "118", "p9": "p9", "parked": "parked"}


def driven(folder: Path, **how: object) -> RunResult:
    return run(compile_test_case(load_test_case(write_case(folder, **how))), IdmDriver(), seed=0)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recorded")


@cache
def replay(folder: Path) -> Trace:
    return driven(folder).trace


def states(trace: Trace, actor: str) -> np.ndarray:
    return trace.states[:, trace.index(actor)]


@pytest.mark.parametrize("actor", TRACKS)
def test_an_actor_is_at_each_frame_where_its_track_has_it(actor: str, folder: Path) -> None:
    trace = replay(folder)
    track = read_tracks(folder / "cut.tracks.csv")[TRACKS[actor]]
    compared = 0
    for time_s, row in zip(trace.time_s, states(trace, actor), strict=True):
        if not track.covers(time_s):
            assert np.isnan(row).all()
        elif actor != "v118" or time_s <= 4.0:
            x, y, heading, speed, _ = track.at(time_s)
            assert math.hypot(row[X] - x, row[Y] - y) < 1e-3
            assert abs(math.remainder(row[HEADING] - heading, math.tau)) < 1e-6
            assert row[SPEED] == pytest.approx(speed)
            compared += 1
    assert compared >= 41
    at_samples = {round(t, 3): (x, y) for t, name, x, y, *_ in samples() if name == TRACKS[actor]}
    off = [
        math.hypot(x - row[X], y - row[Y])
        for t, row in zip(trace.time_s, states(trace, actor), strict=True)
        for x, y in (at_samples.get(round(float(t), 3), (math.nan, math.nan)),)
        if actor != "v118" or t <= 4.0
    ]
    assert np.nanmax(off) < 1e-3


def test_an_actor_is_there_only_between_its_first_and_its_last_sample(folder: Path) -> None:
    trace = replay(folder)
    there = {name: trace.time_s[~np.isnan(states(trace, name)[:, X])] for name in TRACKS}
    assert (there["v118"][0], there["v118"][-1]) == (2.0, 8.0)
    assert (there["p9"][0], there["p9"][-1]) == (0.0, 4.0)
    assert len(there["parked"]) == trace.frames


def test_the_egos_track_gives_its_start_its_speed_and_its_goal(folder: Path) -> None:
    bundle = compile_test_case(load_test_case(write_case(folder)))
    ego, scene = bundle.scene.ego, bundle.scene
    half = ego.model.length_m / 2
    assert (ego.x - half, ego.y, ego.heading_rad, ego.speed_mps) == (20.0, -4.95, 0.0, 10.0)
    assert scene.goal_s - scene.start_s == pytest.approx(80.0)
    text = SCENARIO.replace('track "112"', 'track "112"; start at 60 m along ego.route; start speed 5 m/s')
    ego = compile_test_case(load_test_case(write_case(folder, scenario=text))).scene.ego
    assert ego.x > 55
    assert ego.speed_mps == 5.0
    write_case(folder)


def test_a_vehicle_leaves_its_track_and_drives_on_its_lane(folder: Path) -> None:
    trace = replay(folder)
    row = states(trace, "v118")
    leaves = trace.frame_at(4.0)
    assert np.abs(np.diff(row[leaves - 2 : leaves + 4, X]) - 11.0 * STEP_S).max() < 0.05  # no jump
    assert row[-1, SPEED] > 12.0  # it speeds up to the limit, which its track never did
    assert abs(row[-1, Y] + 1.65) < 0.01
    assert trace.lane_ids[trace.lanes[-1, trace.index("v118")]] == "main_1"
    assert np.isnan(trace.along[-1, trace.index("v118")])


def test_a_vehicle_that_is_not_there_yet_leaves_its_track_when_it_appears(folder: Path) -> None:
    text = SCENARIO.replace("when time >= 4 s", "when time >= 1 s")
    trace = driven(folder, scenario=text).trace
    row, first = states(trace, "v118"), trace.frame_at(2.0)
    assert np.isnan(row[first - 1, X])
    assert (row[first, X], row[first, SPEED]) == (pytest.approx(5.0), pytest.approx(11.0))
    assert row[first + 20, SPEED] > 11.5


def test_a_vehicle_beside_its_lanes_stays_on_its_track_until_it_is_on_one(folder: Path) -> None:
    rows = [(t, n, x, y - max(0.0, 6.0 - t) * 2 if n == "118" else y, h, v) for t, n, x, y, h, v in samples()]
    trace = driven(folder, rows=[row for row in rows if row[1] != "parked" or row[0] >= 0]).trace
    track = read_tracks(folder / "cut.tracks.csv")["118"]
    row = states(trace, "v118")
    early = trace.frame_at(4.0)
    assert row[early, Y] == pytest.approx(track.at(4.0).y)
    left = np.flatnonzero(np.isnan(trace.along[:, trace.index("v118")]) & ~np.isnan(row[:, X]))
    assert left.size
    assert trace.time_s[left[0]] >= 4.0


def test_the_deviation_of_the_ego_fires_triggers(folder: Path) -> None:
    text = SCENARIO.replace("when time >= 4 s", "when ego.deviation > 2 m")
    result = run(compile_test_case(load_test_case(write_case(folder, scenario=text))), Cruise(0.0), seed=0)
    trace = result.trace
    left = next(event.time_s for event in trace.events if event.what == "leaves_track")
    track = read_tracks(folder / "cut.tracks.csv")["112"]
    away = [math.dist(states(trace, "ego")[k, [X, Y]], track.at(t)[:2]) for k, t in enumerate(trace.time_s)]
    first = next(t for t, far in zip(trace.time_s, away, strict=True) if far > 2.0)
    assert left == pytest.approx(first)


def test_sumo_vehicles_brake_for_an_actor_on_its_track(folder: Path) -> None:
    behind = """
  vehicle behind: car.sedan { route [main]; start at 60 m along behind.route; start speed 50 km/h; speed 50 km/h }
"""
    slow: list[Sample] = [(float(t), "117", 85.0 + 3 * t, -1.65, 0.0, 3.0) for t in range(9)]
    rows = sorted([row for row in samples() if row[1] not in ("117", "118")] + slow)
    text = SCENARIO.replace('  vehicle v118: car.suv { track "118"; then joins [main] }\n', behind)
    text = text.replace("  when time >= 4 s { v118 leaves track }\n", "").replace("start at 60 m", "start at main_lane")
    text = text.replace("start at main_lane along behind.route", "start at 60 m along main offset 3.3 m")
    trace = driven(folder, rows=rows, scenario=text).trace
    row = states(trace, "behind")
    assert row[:, ACCELERATION].min() < -1.0
    assert row[-1, SPEED] < 6.0
    gap = states(trace, "v117")[:, X] - row[:, X]
    assert gap.min() > 4.5


def test_an_order_to_an_actor_on_its_track_has_no_effect_before_it_leaves(folder: Path) -> None:
    text = SCENARIO.replace("when time >= 4 s {", "when time >= 2.5 s { v118 stops }\n  when time >= 4 s {")
    changed = states(driven(folder, scenario=text).trace, "v118")
    write_case(folder)
    np.testing.assert_array_equal(changed, states(replay(folder), "v118"))


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        (
            "when time > 1 s { v117 leaves track }",
            "FS305",
            "'v117' follows its track to the end, so it cannot leave it",
        ),
        ("when time > 1 s { v117 stops }", "FS305", "'v117' follows its track to the end, so it cannot do this"),
        ("when v117.deviation > 1 m { v117 leaves }", "FS042", "only the ego deviates from its track: v117 follows"),
    ],
)
def test_what_an_actor_on_a_track_cannot_do(text: str, code: str, message: str, tmp_path: Path) -> None:
    file = write_case(tmp_path, scenario=SCENARIO.replace("when time >= 4 s {", f"{text}\n  when time >= 4 s {{"))
    found = check_paths([str(file)]).diagnostics
    assert [(d.code, message in d.message) for d in found] == [(code, True)]


def test_an_ego_without_a_track_has_no_deviation(tmp_path: Path) -> None:
    text = SCENARIO.replace('    track "112"\n', "").replace("time >= 4 s", "ego.deviation > 1 m")
    (found,) = check_paths([str(write_case(tmp_path, scenario=text))]).diagnostics
    assert found.message == "the ego has no recorded track from which it could deviate"
