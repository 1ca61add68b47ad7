"""Street sketches: what becomes of one, and what is said of a bad one."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.project.loading import load_test_case

SKETCH = """\
# a signal, a ring, and a one-way street
West, -150, 0
mid 0 0 signals
east 150 0
north 0 140 roundabout
south 0 -120
up -10 290
west-mid lanes 2 speed 50
mid-east lanes 2 back 1 speed 30mph parking 2.2
mid-north speed 30
south-mid oneway name lane_in
north-up cycle_lane 1.8 via 5 220
"""


def init(folder: Path, *words: str, text: str = ""):
    return CliRunner().invoke(app, ["init", "network", *words], input=text)


def test_a_sketch_becomes_a_network_with_a_first_scenario(tmp_path):
    sketch, starter = tmp_path / "town.txt", tmp_path / "scenarios" / "first.foresee"
    sketch.write_text(SKETCH)
    done = init(tmp_path, str(sketch), "--scenario", str(starter))
    assert done.exit_code == 0, done.output
    text = (tmp_path / "town.foresee").read_text()
    assert "junction west at (-150 m, 0 m)" in text
    assert "stage stage_1 for 25 s green [west_mid, mid_east]" in text
    assert "stage stage_2 for 25 s green [mid_north, lane_in]" in text
    assert "road mid_east from mid to east {" in text and "speed 30 mph" in text
    assert "roundabout north at (0 m, 140 m) { radius 18 m; sidewalk 2 m }" in text
    assert 'use network "../town.foresee"' in starter.read_text()
    assert compile_test_case(load_test_case(str(starter))).scene.goal_s > 0
    again = init(tmp_path, str(sketch))
    assert again.exit_code != 0 and "there already" in str(again.exception)


@pytest.mark.parametrize(
    ("text", "message", "help"),
    [
        ("a 0 0\nb 200\na-b", "node 'b' has no position", "a 0 0"),
        ("a 0 0\nb 200 0\na-c", "unknown node 'c'", "c 100 0"),
        ("a 0 0\nb 200 0\na-b lanes two", "`two` is not a number for `lanes`", "lanes 2"),
        ("a 0 0\nb 200 0\na-b speed 30kmh", "`30kmh` has no unit that fits `speed`", "km/h"),
        ("a 0 0\nb 200 0\na-b sped 30", "unknown word 'sped'", "speed"),
        ("a 0 0\nb 200 0 signal\na-b", "unknown control 'signal'", "signals"),
        ("a 0 0\na 5 0\na-a", "there are two nodes called 'a'", "another name"),
        ("a 0 0\nb x 0\na-b", "`x` is not a coordinate", "metres"),
        ("a 0 0\nb 200 0\na-b via 3", "`via` needs a point", "via 120 30"),
        ("a 0 0\nb 200 0\na-b\na-b", "there are two streets called 'a_b'", "a-b name a_b_2"),
        ("a 0 0\nb 200 0", "this sketch has no streets", "a-b"),
        ("a 0 0 roundabout\nb 200 0\na-b", "only a_b ends at the roundabout 'a'", "at least two"),
        ("a 0 0\nb 200 0\na-b lanes 40", "`40` is too large for `lanes`", "8"),
    ],
)
def test_a_bad_sketch_writes_nothing(tmp_path, monkeypatch, text, message, help):
    monkeypatch.chdir(tmp_path)
    done = init(tmp_path, "-", text=text)
    shown = f"{done.stdout}{done.stderr}{done.exception}"
    assert done.exit_code != 0 and message in shown and help in shown
    assert not list(tmp_path.iterdir())
