"""`passes in lane`: a cyclist on lanes goes past the ego and a queue within its lane, in real SUMO."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.sumo_files import write_sumo_folder
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.clipping.fidelity import deviation
from foresee_dsl.drivers.idm import IdmDriver
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Change
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace, X, Y
from tests.support.worlds import written_case

QUEUE = """foresee 1

scenario queue {
  network {
    junction middle at (0 m, 0 m) signals {
      stage side_go for 14 s green [north]
      stage main_go for 20 s green [west, east]
    }
    junction west_end at (-200 m, 0 m)
    junction east_end at (250 m, 0 m)
    junction north_end at (0 m, 120 m)
    road west from west_end to middle { lanes 1; lane_width 4 m; speed 50 km/h }
    road east from middle to east_end { lanes 1; lane_width 4 m; speed 50 km/h }
    road north from north_end to middle { lanes 1 }
  }
  ego: car.sedan {
    route from west straight over middle
    start at 150 m along ego.route
    start speed 20 km/h
    speed 30 km/h
  }
  vehicle first: car.compact {
    route from west straight over middle
    start at 187 m along first.route
    start speed 0 km/h
    speed 30 km/h
  }
  vehicle second: car.compact {
    route from west straight over middle
    start at 178 m along second.route
    start speed 0 km/h
    speed 30 km/h
  }
  bicycle cyclist: bicycle.city {
    route from west straight over middle
    start at 118 m along cyclist.route
    speed 18 km/h
    passes in lane
  }
  end after 26 s
}
"""
WITHOUT = QUEUE.replace("    passes in lane\n", "")
MIDDLE_M, RED_S = -2.0, 19.0
"""The middle of the lane of 4 m beside the road's line, and a time shortly before the light turns green."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("passing")


def drive(case: TestCase) -> Trace:
    return run(compile_test_case(case), IdmDriver()).trace


@lru_cache
def driven(folder: Path, text: str) -> Trace:
    return drive(written_case(folder / "queue.foresee", text))


def states(trace: Trace, actor: str) -> np.ndarray:
    return trace.states[:, trace.index(actor)]


def test_a_cyclist_passes_the_ego_and_a_queue_at_a_red_light(folder: Path) -> None:
    trace = driven(folder, QUEUE)
    cyclist, frame = states(trace, "cyclist"), trace.frame_at(RED_S)
    width = {info.id: info.width_m for info in trace.actors}
    for other in ("ego", "second", "first"):
        states_of_other = states(trace, other)
        assert cyclist[0, X] < states_of_other[0, X]
        assert cyclist[frame, X] > states_of_other[frame, X]
        beside = np.abs(cyclist[:, X] - states_of_other[:, X]) < 3.0
        gap_m = states_of_other[beside, Y] - cyclist[beside, Y] - (width[other] + width["cyclist"]) / 2
        assert gap_m.min() > 0.2, f"it passes {other} on the right, without contact"
    assert cyclist[frame, SPEED] == 0, "it waits at the line"
    assert cyclist[:, Y].min() > MIDDLE_M - 2.0 + width["cyclist"] / 2 - 0.01, "it stays in its lane"
    assert np.abs(np.diff(cyclist[:, Y])).max() <= 1.0 * STEP_S + 1e-6, "it goes aside at 1 m/s, SUMO's lateral speed"


def test_without_the_statement_it_stays_behind_the_ego(folder: Path) -> None:
    trace = driven(folder, WITHOUT)
    frame = trace.frame_at(RED_S)
    assert states(trace, "cyclist")[frame, X] < states(trace, "ego")[frame, X] - 3.0
    assert states(trace, "cyclist")[:, Y] == pytest.approx(MIDDLE_M, abs=1e-3)


@pytest.mark.parametrize("other", ["first", "second"])
def test_other_vehicles_keep_the_middle_of_their_lane(folder: Path, other: str) -> None:
    assert states(driven(folder, QUEUE), other)[:, Y] == pytest.approx(MIDDLE_M, abs=1e-3)


@pytest.mark.parametrize("begins_s", [0.5, 1.0, 9.0, 11.0, 13.0])
def test_a_clip_cut_while_it_goes_aside_or_passes_goes_on_as_its_parent(folder: Path, begins_s: float) -> None:
    case, parent = written_case(folder / "queue.foresee", QUEUE), driven(folder, QUEUE)
    point_s = begins_s + 2.0
    point = RiskyPoint(1, parent.frame_at(point_s), point_s, "", "none", float("nan"), float("nan"), 0.0, "a test")
    cut = clip(case, parent, point, before_s=2, after_s=4, name="p1", parent="queue.foresee")
    assert parse(print_model(cut), "p1.foresee").model == cut
    assert "passes in lane" in print_model(cut)
    clip_case = expand_clip(cut, case, source=folder / "p1.foresee")
    child = drive(clip_case)
    result = deviation(parent, parent.frame_at(begins_s), child)
    assert max(result.actors[name] for name in ("cyclist", "first", "second")) < 1e-3


def test_a_mutant_of_it_runs_alike_each_time(folder: Path) -> None:
    case, parent = written_case(folder / "queue.foresee", QUEUE), driven(folder, QUEUE)
    point = RiskyPoint(1, parent.frame_at(11.0), 11.0, "", "none", float("nan"), float("nan"), 0.0, "a test")
    cut = clip(case, parent, point, before_s=2, after_s=4, name="p1", parent="queue.foresee")
    clip_case = expand_clip(cut, case, source=folder / "p1.foresee")
    text = (
        'foresee 1\n\nmutant child of "p1.foresee" pin sha256:000000000000 {\n'
        "  change cyclist.steer: 0.00 => 0.10 from 1.00 s for 0.50 s\n}\n"
    )
    model = parse(text, "child.foresee").model
    assert isinstance(model.body[0], Change)
    child = expand_mutant(model, clip_case, source=folder / "child.foresee")
    first, second = drive(child), drive(child)
    assert first.digest == second.digest
    assert first.digest != drive(clip_case).digest


IN_SUMO = """
import json, sys, libsumo
libsumo.start(["sumo", "-c", sys.argv[1], "--no-step-log"])
while libsumo.simulation.getTime() < 12:
    libsumo.simulationStep()
v = libsumo.vehicle
print(json.dumps({name: (v.getPosition(name)[0], v.getLateralLanePosition(name)) for name in v.getIDList()}))
"""


def test_the_cyclist_passes_in_sumo_without_us_too(folder: Path) -> None:
    config, *_ = write_sumo_folder(compile_test_case(written_case(folder / "queue.foresee", QUEUE)), folder / "sumo")
    done = subprocess.run([sys.executable, "-c", IN_SUMO, str(config)], capture_output=True, text=True, check=True)
    places = json.loads(done.stdout.splitlines()[-1])
    assert places["cyclist"][0] > places["ego"][0] - 2.0
    assert places["cyclist"][1] == pytest.approx(-1.675, abs=0.01), "at the right edge of its lane of 4 m"
    assert places["first"][1] == pytest.approx(0.0, abs=0.01)


def test_nothing_changes_in_sumos_files_without_it(folder: Path) -> None:
    bundle = compile_test_case(written_case(folder / "queue.foresee", WITHOUT))
    config, *files = write_sumo_folder(bundle, folder / "plain")
    text = "".join(file.read_text() for file in (config, *files, bundle.types_file))
    assert "lateral" not in text
    assert "Lat" not in text
    assert "-passing" not in text
