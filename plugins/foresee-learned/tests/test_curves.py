"""Loss curves as pictures."""

from __future__ import annotations

from pathlib import Path

from training.curves import drawn, points


def test_curves_are_drawn_from_what_training_writes(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("step,waypoints,held\n100,1.0,\n200,0.5,0.7\n")
    assert points(tmp_path / "one.csv", "held") == [(200.0, 0.7)]
    picture = drawn({"<one>": points(tmp_path / "one.csv", "waypoints")}, "waypoints")
    assert picture.count("<polyline") == 1
    assert "&lt;one&gt;" in picture
    assert "200 steps" in picture
