"""`foresee import opendrive`: a map written by hand."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from foresee_exchange.maps import opendrive

from foresee_dsl.compile import compile_test_case, placement_mistakes
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.runner import run
from tests.support.command import foresee
from tests.support.foreign_maps import HILL_ROAD


def test_a_map_becomes_a_network_and_a_scenario_that_runs(tmp_path: Path) -> None:
    done = opendrive.run(HILL_ROAD, out=tmp_path / "out")
    assert [file.name for file in done.files] == ["hill_road.foresee", "hill_road.xodr"]
    assert (done.taken["edges"], done.taken["lanes for cars"], done.taken["sidewalks"]) == (2, 2, 2)
    assert done.left_out == {
        "signs (right of way is computed from the roads)": 1,
        "objects": 1,
        "lanes of type shoulder": 1,
    }
    cases = load_test_cases([tmp_path / "out"])
    assert len(cases) == 1
    assert placement_mistakes(cases) == ()
    bundle = compile_test_case(cases[0])
    line = bundle.scene.actors[0].line
    assert line is not None
    limits = set(line.limits)
    assert len(limits) == 1
    assert limits.pop() == pytest.approx(30 * 0.44704, abs=0.01)  # the map's, not netconvert's 50 km/h
    assert run(bundle, load_driver("idm")).verdict == "pass"


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("cut.xodr", lambda text: text[:900], "not an OpenDRIVE map"),
        (
            "bomb.xodr",
            lambda text: text.replace("<OpenDRIVE>", '<!DOCTYPE O [<!ENTITY a "b">]><OpenDRIVE>'),
            "entities",
        ),
        ("walk.xodr", lambda text: text.replace('"driving"', '"sidewalk"'), "no lanes for cars|refused"),
        ("map.xml", lambda text: text, r"must end in \.xodr"),
        # netconvert writes lanes as wide as the map says
        (
            "wide.xodr",
            lambda text: re.sub(r'<width sOffset="0" a="[^"]*"', '<width sOffset="0" a="1e300"', text),
            r"^wide\.xodr is not a sound OpenDRIVE map: lane .* has no usable shape, length, speed or width",
        ),
    ],
)
def test_bad_maps_are_refused_and_nothing_written(tmp_path: Path, name: str, change: object, words: str) -> None:
    assert callable(change)
    file = tmp_path / name
    file.write_text(change(HILL_ROAD.read_text()))
    with pytest.raises(ForeseeError, match=words):
        opendrive.run(file, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_real_town(carla: Path, tmp_path: Path) -> None:
    done = opendrive.run(carla / "maps" / "xodr" / "Town10HD.xodr", out=tmp_path / "out")
    assert done.taken["junctions with a signal"] == 5
    assert any("program of this tool" in note for note in done.notes)
    assert placement_mistakes(load_test_cases([tmp_path / "out"])) == ()


def test_the_command_writes_over_an_older_import(tmp_path: Path) -> None:
    shutil.copy(HILL_ROAD, tmp_path / "my map.xodr")
    for _ in range(2):
        done = foresee("import", "opendrive", tmp_path / "my map.xodr", "--out", tmp_path / "out")
        assert "not expressed:" in done.stdout
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["my map.xodr", "my_map.foresee"]
