"""The drivers' compiled loops: the same answers as the plain functions that they were made of, and as other tools."""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
from dataclasses import astuple, replace
from pathlib import Path

import numba
import numpy as np
import pytest
from numba import njit
from shapely import Polygon, affinity, box

from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.pdm.situation import ego_record, read_situation
from foresee_dsl.drivers.protocol import Control, EgoState, JunctionPassage, Mission, Observation, SeenActor
from foresee_dsl.kernels import boxes as box_kernels
from foresee_dsl.kernels import compiling
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, compiled, state_of
from foresee_dsl.kernels.pdm import proposals, right_of_way
from foresee_dsl.kernels.pdm import route as route_kernels
from foresee_dsl.kernels.pdm.prediction import TIMES_S
from foresee_dsl.kernels.pdm.records import ACTOR, PREDICTED, ROLLED
from foresee_dsl.kernels.pdm.scoring import conflicts
from foresee_dsl.kernels.pdm.settings import CLEARANCE_M, COLLISION_MARGIN_M
from tests.support.driving import SEDAN, STEP_S, crossing_foe, line, mission

STRAIGHT = math.inf
PLAIN = """
import pickle, sys
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.kernels.pdm.decision import decide
assert not hasattr(decide, "py_func")  # not compiled
task, vehicle, observations = pickle.load(sys.stdin.buffer)
driver = PdmDriver()
driver.reset(task, vehicle, seed=0)
sys.stdout.buffer.write(pickle.dumps([driver.step(o) for o in observations]))
"""


def busy_crossing() -> tuple[Mission, list[Observation]]:
    """A left turn with oncoming cars, a parked car, a cyclist, people on foot and somebody behind, for 1.5 s."""
    points = line((95, STRAIGHT), (4 * math.pi, 8), (60, STRAIGHT))
    oncoming = line((120, STRAIGHT), start=(173, 3.5, math.pi))
    foes = (
        crossing_foe(points, oncoming, entry_s=60, has_priority=True),
        crossing_foe(points, line((120, STRAIGHT), start=(97, -60, math.pi / 2)), entry_s=55, has_priority=False),
    )
    task = mission(points, left_m=3.0, right_m=5.0, junctions=[JunctionPassage("j", 90.0, 112.0, "left", "j", foes)])
    others = [
        ("car", 130.0, 3.5, math.pi, 11.0, 4.5, 1.8),
        ("truck", 160.0, 3.6, math.pi, 12.0, 9.0, 2.5),
        ("car", 97.0, -30.0, math.pi / 2, 9.0, 4.5, 1.8),
        ("car", 78.0, -1.8, 0.0, 0.0, 4.5, 1.8),
        ("obstacle", 85.0, -2.6, 0.0, 0.0, 1.0, 1.0),
        ("bicycle", 70.0, -2.2, 0.05, 4.0, 1.8, 0.6),
        ("pedestrian", 101.0, 14.0, math.pi, 1.3, 0.4, 0.5),
        ("car", 40.0, 0.1, 0.0, 10.0, 4.5, 1.8),
    ]
    observations = []
    for k in range(0, 30, 2):
        t = k * STEP_S
        ego = EgoState(60.0 + 9.0 * t, 0.1, 0.01, 9.0, 0.2, 0.0, 0.0)
        actors = tuple(
            SeenActor(n, kind, x + v * t * math.cos(h), y + v * t * math.sin(h), h, v, length, width)  # type: ignore[arg-type]
            for n, (kind, x, y, h, v, length, width) in enumerate(others)
            if n != 2 or k < 20  # one is lost
        )
        observations.append(Observation(t, ego, actors, {"j": "green"}, measured_s=t - 0.1))
    return task, observations


def test_compiled_it_answers_as_the_plain_functions_do() -> None:
    """They run in Python here, where an index out of range would be an error."""
    task, observations = busy_crossing()
    driver = PdmDriver()
    driver.reset(task, SEDAN, seed=0)
    answers = [driver.step(o) for o in observations]
    done = subprocess.run(
        [sys.executable, "-c", PLAIN],
        input=pickle.dumps((task, SEDAN, observations)),
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        check=True,
    )
    plain = pickle.loads(done.stdout)
    assert len({a.throttle - a.brake for a in answers}) > 3  # it does something
    for one, other in zip(answers, plain, strict=True):
        assert astuple(one) == pytest.approx(astuple(other), abs=1e-9)


def test_a_function_without_a_file_is_compiled_too() -> None:
    space: dict[str, object] = {}
    exec("def twice(x): return 2 * x", space)  # there is no folder beside it to keep anything in
    assert compiled(FLOAT)(space["twice"])(2.5) == 5.0  # type: ignore[type-var]


def test_a_kernel_takes_its_types_and_no_others() -> None:
    @compiled(FLOATS, FLOAT)
    def scaled(values: np.ndarray, by: float) -> float:
        return values[0] * by

    assert scaled(np.array([3.0]), 2) == 6.0
    frozen = np.array([3.0])
    frozen.flags.writeable = False
    for wrong in (np.array([[3.0]]), np.array([3]), np.array([3.0, 4.0, 5.0])[::2], frozen, [3.0], 3.0):
        with pytest.raises(TypeError, match="No matching definition"):
            scaled(wrong, 2.0)
    with pytest.raises(TypeError):
        scaled(np.array([3.0]))  # type: ignore[call-arg]


def test_a_second_process_reads_kernels_from_the_cache_and_gets_the_same_bits(tmp_path: Path) -> None:
    code = """
import sys
import numpy as np
from foresee_dsl.kernels import boxes
rng = np.random.default_rng(3)
sys.stdout.write(boxes.gaps(*rng.uniform(-9, 9, (2, 50, 5))).tobytes().hex())
sys.stderr.write(str(sum(boxes.gaps.dispatcher.stats.cache_misses.values())))
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    first, second = (
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, env=environment) for _ in range(2)
    )
    assert (first.stderr, second.stderr) == (b"1", b"0")
    assert first.stdout == second.stdout != b""


def test_a_driver_s_own_numba_function_may_call_a_kernel() -> None:
    @njit
    def nearest(a: FloatArray, b: FloatArray) -> float:
        return float(box_kernels.gaps(a, b).min())

    a, b = np.array([[0.0, 0.0, 0.0, 4.0, 2.0]]), np.array([[10.0, 0.0, 0.0, 4.0, 2.0]])
    assert nearest(a, b) == box_kernels.gaps(a, b)[0] == 6.0


def test_all_kernels_are_compiled_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first process compiles them, and the next sees that there is nothing to do."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    compiled_all: list[str] = []
    monkeypatch.setattr(compiling, "_compile_all", compiled_all.append)
    for _ in range(2):
        compiling.ensure.__wrapped__()
    assert compiled_all == ["foresee_dsl.kernels", *compiling._added()]


def test_processes_share_the_kernels_of_a_package(tmp_path: Path) -> None:
    """Two processes compile each kernel of a package once, and a third finds all of them in the cache."""
    package, claims = tmp_path / "loops", tmp_path / "claims"
    for folder in (package, claims):
        folder.mkdir()
    kernels = "".join(f"\n\n@compiled(FLOAT)\ndef f{k}(x):\n    return x + {k}\n" for k in range(6))
    (package / "__init__.py").write_text("", encoding="utf-8")
    (package / "sums.py").write_text(f"from foresee_dsl.kernels.compiling import FLOAT, compiled{kernels}", "utf-8")
    code = """
import sys
from foresee_dsl.kernels import compiling
compiling.load_part("loops", sys.argv[1])
compiling.load("loops") if sys.argv[2] else None
made = [k for k in compiling._kernels_of("loops") if "dispatcher" in vars(k)]
print(sum(sum(k.dispatcher.stats.cache_misses.values()) for k in made), len(made))
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}

    def program(load: str) -> subprocess.Popen[str]:
        words = [sys.executable, "-c", code, str(claims), load]
        return subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True)

    both = [program("") for _ in range(2)]
    counts = [[int(count) for count in process.communicate()[0].split()] for process in both]
    assert [sum(column) for column in zip(*counts, strict=True)] == [6, 6]
    assert program("load").communicate()[0].split() == ["0", "6"]


def test_a_kernel_is_compiled_anew_when_any_of_the_kernels_files_changes(tmp_path: Path) -> None:
    (tmp_path / "pdm").mkdir()
    states = []
    for name, content in (("a", "X = 1"), ("pdm/b", "Y = 1"), ("pdm/b", "Y = 2"), ("a", "X = 2"), ("a", "X = 2")):
        (tmp_path / f"{name}.py").write_text(content, encoding="utf-8")
        state_of.cache_clear()
        states.append(state_of(tmp_path))
    assert len(set(states)) == 4 and states[-1] == states[-2]


def test_offsets_are_rounded_as_python_does() -> None:
    rng = np.random.default_rng(5)
    # Three decimals: every tenth value is half way between two centimetres, or just beside.
    values = [*rng.uniform(-6, 6, 2000), *np.round(rng.uniform(-6, 6, 4000), 3), *(np.arange(-400, 400) / 80), 0.0]
    assert [proposals.to_cm(float(v)) for v in values] == [round(float(v), 2) for v in values]


def test_the_route_is_looked_up_at_one_place_as_at_many() -> None:
    route = build_route(mission(line((60, STRAIGHT), (10, 8), (40, STRAIGHT))), SEDAN)
    places = np.random.default_rng(1).uniform(-60, 260, 200)  # before its begin and after its end too
    for column, at in (("profile", route_kernels.profile_at), ("curvature", route_kernels.curvature_at)):
        assert [at(route.points, s) for s in places.tolist()] == route.between(column, places).tolist()
    first, last = route.index(3.0), route.index(57.0) + 1
    room = [route.points[side][first:last].min() for side in ("left", "right")]
    assert list(route_kernels.least_room(route.points, 3.0, 57.0)) == room


def test_points_are_projected_on_the_nearest_place_of_the_route() -> None:
    route = build_route(mission(line((60, STRAIGHT), (20, 15), (60, STRAIGHT))), SEDAN)
    rng = np.random.default_rng(2)
    s, d = rng.uniform(0, 120, 100), rng.uniform(-3, 3, 100)
    at = route.points[route.indices(s)]
    actors, ways = np.zeros(100, ACTOR), np.zeros((2, 100), PREDICTED)
    for places in (actors, ways):
        places["x"], places["y"] = at["x"] - d * at["sin"], at["y"] + d * at["cos"]
    route_kernels.project_actors(actors, route.points, 60.0, 100.0)
    assert actors["s"] == pytest.approx(at["s"], abs=0.02)
    assert actors["d"] == pytest.approx(d, abs=0.005)
    route_kernels.project_predicted(np.array([False, True]), ways, route.points, 60.0, 100.0)
    assert not ways["s"][0].any() and not ways["d"][0].any()
    assert ways["s"][1] == pytest.approx(actors["s"], abs=0.05)  # its grid is coarser
    assert ways["d"][1] == pytest.approx(actors["d"], abs=0.005)


@njit
def arrival_of(egos: Records, route: Records, last_s: float) -> right_of_way.Arrival:
    return right_of_way.arrivals(egos[0], route, last_s)


def test_an_arrival_is_interpolated_as_numpy_does() -> None:
    route = build_route(mission(line((60, STRAIGHT), (20, 15), (60, STRAIGHT))), SEDAN)
    egos = ego_record(SEDAN)
    egos["front_s"], egos["rear_s"], egos["speed"] = 20.3, 15.6, 6.0
    arrival = arrival_of(egos, route.points, 74.3)
    times, places = arrival.times, 20.3 + right_of_way.PROFILE_STEP_M * np.arange(len(arrival.times))
    assert places[-1] < 80.0 <= places[-1] + right_of_way.PROFILE_STEP_M  # the ego's length and a metre farther
    assert (np.diff(times) > 0).all()
    assert times[-1] > 60.0 / arrival.limit_mps - 0.1  # it cannot be faster than what the profile allows most
    for s in (10.0, 20.3, 20.31, 47.7, 79.9, 95.0):
        assert right_of_way.arrives(arrival, s) == pytest.approx(np.interp(s, places, times), abs=1e-12)


def test_footprints_collide_where_their_outlines_are_near() -> None:
    """Against shapely, on random footprints around the ego, which has turned and moves."""
    rng = np.random.default_rng(3)
    count = 400
    x, y, heading = rng.uniform(-7, 7, count), rng.uniform(-5, 5, count), rng.uniform(-4, 4, count)
    actors = tuple(
        SeenActor(k, "car", *place, 0.0, 4.4, 1.8) for k, place in enumerate(np.stack([x, y, heading], axis=1).tolist())
    )
    ego = EgoState(0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0)
    route = build_route(mission(line((100, STRAIGHT), start=(-50, 0, 0))), SEDAN)
    turned = 0.4
    own = _box(0.0, 0.0, turned, SEDAN.length_m, SEDAN.width_m)
    found = {True: 0, False: 0}
    for actor in actors:
        situation = read_situation(route, SEDAN, Observation(0.0, ego, (actor,), {}))
        met = conflicts(situation.egos, situation.actors, _standing_at(actor), _ego_at(turned), np.array([2.0]))
        hit, close = met["hit"], met["close"]
        away = own.distance(_box(actor.x, actor.y, actor.heading_rad, actor.length_m, actor.width_m))
        # The gap along the best of four axes is at most the distance, and at least 1 / sqrt(2) of it.
        if away < COLLISION_MARGIN_M:
            assert hit.all()
        if away > COLLISION_MARGIN_M * math.sqrt(2):
            assert not hit.any()
        if away > CLEARANCE_M * math.sqrt(2):
            assert not close.any()
        found[bool(hit.any())] += 1
    assert min(found.values()) > 50


def _box(x: float, y: float, heading: float, length: float, width: float) -> Polygon:
    straight = box(x - length / 2, y - width / 2, x + length / 2, y + width / 2)
    return affinity.rotate(straight, heading, origin=(x, y), use_radians=True)


def _ego_at(heading: float) -> Records:
    """One proposal that stays at the origin, to blame for everything."""
    rolled = np.zeros((1, len(TIMES_S)), ROLLED)
    rolled["s"], rolled["speed"], rolled["cos"], rolled["sin"] = 50.0, 5.0, math.cos(heading), math.sin(heading)
    return rolled


def _standing_at(actor: SeenActor) -> Records:
    found = np.zeros((1, len(TIMES_S)), PREDICTED)
    found["x"], found["y"], found["s"] = actor.x, actor.y, 50.0
    found["cos"], found["sin"] = math.cos(actor.heading_rad), math.sin(actor.heading_rad)
    found["half_length"] = actor.length_m / 2
    return found


@pytest.mark.parametrize("broken", ["x", "heading_rad", "speed_mps", "length_m"])
def test_a_measurement_that_is_no_number_does_no_harm_outside_of_its_arrays(broken: str) -> None:
    """The answer may be anything; the process goes on, and the next run is as ever."""
    task, observations = busy_crossing()
    driver = PdmDriver()
    driver.reset(task, SEDAN, seed=0)
    before = [driver.step(o) for o in observations]
    driver.reset(task, SEDAN, seed=0)
    for number, observation in enumerate(observations):
        first, *rest = observation.actors
        bad = replace(first, **{broken: math.nan if number % 2 else math.inf})
        with np.errstate(invalid="ignore"):
            assert isinstance(driver.step(replace(observation, actors=(bad, *rest))), Control)
    driver.reset(task, SEDAN, seed=0)
    assert [driver.step(o) for o in observations] == before


def test_the_nearest_point_of_a_route_is_found_without_looking_at_all() -> None:
    rng = np.random.default_rng(1)
    for count in (1, 2, 15, 16, 17, 300, 700):
        heading = np.cumsum(rng.normal(0, 0.15, count))
        x, y = np.round(np.cumsum(np.cos(heading)), 1), np.round(np.cumsum(np.sin(heading)), 1)
        apart = np.hypot(np.diff(x), np.diff(y)).max(initial=0.1)
        coarse = np.stack([x, y, np.cos(heading), np.sin(heading), np.full(count, apart)])
        for k in range(50):
            at = rng.integers(count)
            px, py = rng.uniform(-300, 300, 2) if k % 5 == 0 else (x[at] + rng.normal(0, 3), y[at] + rng.normal(0, 3))
            cos, sin = math.cos(k), math.sin(k)
            dx, dy = px - x, py - y
            costs = dx * dx + dy * dy + 12.5 * (1.0 - (cos * coarse[2] + sin * coarse[3]))
            assert route_kernels._nearest_coarse(px, py, cos, sin, coarse) == int(np.argmin(costs))
