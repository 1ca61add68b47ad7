"""SelfOracle on one real run: what the camera saw, the segments, the alarms, the messages where weights are missing."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from foresee_learned.rasters import FORWARD_CHANNELS
from foresee_study.selforacle.pictures import CLASSES, PALETTE, classes_seen, looked_at, pictures_of, signals_at
from foresee_study.selforacle.ranker import segments_of, waypoints_passed
from foresee_study.selforacle.watcher import watcher_of
from typer.testing import CliRunner

from foresee_dsl.campaign.keys import ranker_identity
from foresee_dsl.cli import app
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.protocol import Learned, NeedsSurroundings, Surroundings
from foresee_dsl.forecast.registry import load_ranker, ranker_within
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.runner import run
from tests.support.handmade_traces import EAST, make_trace, straight


class Noting:
    """The driver pdm, with a note of the signals and some of the pictures that it saw."""

    def __init__(self):
        self.driver = load_driver("pdm")
        self.name, self.version = self.driver.name, self.driver.version
        self.signals, self.views = {}, {}

    def reset(self, mission, vehicle, seed):
        self.driver.reset(mission, vehicle, seed)

    def step(self, observation):
        frame = round(observation.time_s / 0.05)
        self.signals[round(observation.measured_s / 0.05)] = dict(observation.signals)
        if frame % 100 == 0:
            self.views[frame] = observation.views.forward()
        return self.driver.step(observation)


@pytest.fixture(scope="module")
def ridden(scenarios):
    bundle = compile_test_case(load_test_case(str(scenarios / "scenario4.foresee") + "::r02"))
    driver = Noting()
    trace = run(bundle, driver, meta={"driver": "pdm"}).trace
    return bundle, driver, trace


def test_the_signals_of_a_recorded_run_are_those_that_its_driver_saw(ridden):
    bundle, driver, trace = ridden
    surroundings = Surroundings.of(bundle)
    seen = [(frame, key, colour) for frame, colours in driver.signals.items() for key, colour in colours.items()]
    assert {colour for _, _, colour in seen} >= {"red", "green"}
    assert all(signals_at(trace, surroundings, frame)[key] == colour for frame, key, colour in seen)


def test_the_pictures_are_what_the_camera_showed_but_for_the_heights(ridden):
    bundle, driver, trace = ridden
    frames = np.array(sorted(driver.views))
    classes = classes_seen(trace, Surroundings.of(bundle), frames)
    for seen, frame in zip(classes, frames, strict=True):
        planes = driver.views[frame][: CLASSES - 1]
        shown = np.where(planes.any(axis=0), planes.argmax(axis=0), CLASSES - 1)
        assert (seen != shown).mean() < 0.05
    pictures = pictures_of(classes)
    assert pictures.shape == (len(frames), 80, 160, 3)
    assert (pictures[:, [0, 1, 79], :, :] == PALETTE[classes[:, [0, 0, 63]]]).all()
    assert tuple(PALETTE[FORWARD_CHANNELS.index("vehicle")]) == (30, 70, 160)


def test_a_run_is_looked_at_twice_a_second_and_cut_at_its_waypoints(ridden):
    _, _, trace = ridden
    frames = looked_at(trace)
    assert np.allclose(np.diff(trace.time_s[frames]), 0.5)
    passed = waypoints_passed(trace)
    assert (np.diff(passed) >= 0).all()
    driven = np.hypot(*np.diff(trace.states[:, 0, :2], axis=0).T).sum()
    assert passed[-1] - passed[0] == pytest.approx(driven / 2, rel=0.05)  # a waypoint every 2 m
    errors = np.linspace(0.0, 1.0, len(frames))
    segments = segments_of(trace, frames, errors)
    standing = max(segments, key=lambda s: s.last - s.first)
    inside = (frames >= standing.first) & (frames <= standing.last)
    assert inside.sum() > 10  # it waits at a signal: many pictures, one segment
    assert standing.error == pytest.approx(errors[inside].mean())
    assert all(a.last < b.first for a, b in pairwise(segments))


def test_a_route_that_comes_back_is_followed_to_its_end():
    there = straight("car", 0, 0, EAST, 5).states
    back = there[::-1].copy()
    states = np.concatenate((there, back + np.array([0, 3, 0, 0, 0, 0, 0])))
    trace = make_trace({"ego": type(straight("car", 0, 0, EAST, 5))("car", states)})
    passed = waypoints_passed(trace)
    assert passed[0] <= 1 and passed[-1] >= len(trace.waypoints) - 1
    assert np.diff(passed).max() <= 12


@pytest.mark.parametrize("name", ["selforacle", "selforacle_conv"])
def test_the_rankers_ask_for_the_surroundings_and_for_weights(name, monkeypatch, tmp_path):
    ranker = load_ranker(name)
    assert isinstance(ranker, NeedsSurroundings) and isinstance(ranker, Learned)
    with pytest.raises(ForeseeError, match=r"training.selforacle.rides --driver nobody.*FORESEE_WEIGHTS"):
        ranker.weights_hash("nobody")
    monkeypatch.setattr("foresee_study.selforacle.watcher.find_spec", lambda name: None)
    with pytest.raises(ForeseeError, match=r'pip install "foresee-dsl\[learned\]"'):
        ranker.weights_hash("pdm")


def test_only_a_ranker_that_needs_the_surroundings_has_its_test_case_compiled():
    def compiled():
        raise AssertionError("not needed")

    assert ranker_within("foresee", compiled) == load_ranker("foresee")
    with pytest.raises(AssertionError, match="not needed"):
        ranker_within("selforacle", compiled)


@pytest.fixture(scope="module")
def surroundings(ridden):
    return Surroundings.of(ridden[0])


@pytest.mark.parametrize("name", ["selforacle", "selforacle_conv"])
def test_alarms_are_segments_over_the_threshold_the_worst_first(name, ridden, surroundings, monkeypatch, tmp_path):
    trace = ridden[2]
    usual = watcher_of(name, "pdm")
    segments = load_ranker(name).within(surroundings).segments(trace)
    assert segments == load_ranker(name).within(surroundings).segments(trace)  # to the last bit
    # The same network with a threshold that half of this run's segments are over.
    half = float(np.median([s.error for s in segments]))
    (tmp_path / f"{name}_pdm.onnx").write_bytes(usual.weights.content())
    (tmp_path / f"{name}_pdm.json").write_text(json.dumps({"threshold": half}))
    monkeypatch.setenv("FORESEE_WEIGHTS", str(tmp_path))
    assert watcher_of(name, "pdm").sha256 != usual.sha256
    points = load_ranker(name).within(surroundings).rank(trace, before_s=4.0)
    assert points and all(p.time_s >= 4.0 and p.actor == "" for p in points)
    assert [p.rank for p in points] == list(range(1, len(points) + 1))
    assert all(a.score >= b.score > 1 for a, b in pairwise(points))
    assert min(b - a for a, b in pairwise(sorted(p.time_s for p in points))) >= 1.0 - 1e-9
    late = [s for s in segments if s.middle >= 80]
    assert points[0].frame == max(late, key=lambda s: s.error).middle
    assert points[0].score == pytest.approx(max(s.error for s in late) / half, abs=1e-6)


def test_a_strange_picture_is_redrawn_worse_than_a_nominal_one(ridden, surroundings):
    trace = ridden[2]
    watcher = watcher_of("selforacle", "pdm")
    classes = classes_seen(trace, surroundings, looked_at(trace))
    strange = classes.copy()
    strange[:, 10:60, 20:140] = FORWARD_CHANNELS.index("obstacle")
    usual = watcher.errors(pictures_of(classes))
    assert (watcher.errors(pictures_of(strange)) > usual).all()
    assert (watcher.errors(pictures_of(classes[:1])) == usual[:1]).all()  # a picture's error does not depend on others


def test_keys_name_the_weights_that_watch_the_driver(monkeypatch, tmp_path):
    assert ranker_identity("foresee", "pdm") == ranker_identity("foresee", "fusion")
    usual = ranker_identity("selforacle", "pdm")
    assert watcher_of("selforacle", "pdm").sha256 in usual
    (tmp_path / "selforacle_pdm.onnx").write_bytes(watcher_of("selforacle", "pdm").weights.content())
    (tmp_path / "selforacle_pdm.json").write_text('{"threshold": 1.0}')
    monkeypatch.setenv("FORESEE_WEIGHTS", str(tmp_path))
    assert ranker_identity("selforacle", "pdm") != usual
    with pytest.raises(ForeseeError, match="no weights for the driver 'idm'"):
        ranker_identity("selforacle", "idm")


def test_a_recorded_run_is_ranked_with_its_test_case_as_it_was(ridden, scenarios, tmp_path):
    trace = ridden[2]
    address = str(scenarios / "scenario4.foresee") + "::r02"
    meaning = load_test_case(address).meaning
    for name, meta in (("same", meaning), ("edited", "other")):
        replace(trace, meta={**trace.meta, "test_case": address, "meaning": meta}).save(tmp_path / f"{name}.npz")
    ask = ["--ranker", "selforacle", "--before", "1", "--json"]
    found = CliRunner().invoke(app, ["forecast", str(tmp_path / "same.npz"), *ask])
    assert found.exit_code == 0 and json.loads(found.stdout)["ranker"] == "selforacle"
    found = CliRunner().invoke(app, ["forecast", str(tmp_path / "edited.npz"), *ask])
    assert found.exit_code == 1 and "was edited since this run" in found.output
