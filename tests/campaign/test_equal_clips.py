"""Clips of one run that mean the same are made and counted once; the next risky points are studied instead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.simulate.trace import Trace
from tests.support.small_campaign import SETTINGS, campaign

TEXT = """foresee 1

scenario two_at_once {
  network crossing {
    junction west at (0 m, 0 m)
    junction east at (200 m, 0 m)
    road way from west to east { lanes 1; speed 50 km/h; sidewalk 2 m }
  }

  ego: car.sedan {
    route [way]
    start at 10 m along way
    start speed 36 km/h
    goal 190 m along way
  }
  pedestrian near: pedestrian.adult {
    path [(100 m, -5 m), (101 m, -5 m)]
    speed 0.1 m/s
  }
  pedestrian far: pedestrian.adult {
    path [(100 m, -6 m), (101 m, -6 m)]
    speed 0.1 m/s
  }
  pedestrian later: pedestrian.adult {
    path [(150 m, -5 m), (151 m, -5 m)]
    speed 0.1 m/s
  }
  end after 30 s
}
"""


def test_points_of_one_moment_give_one_clip(tmp_path: Path) -> None:
    file = tmp_path / "two_at_once.foresee"
    file.write_text(TEXT, encoding="utf-8")
    settings = replace(SETTINGS, ranker="proximity", risky_points=2, children=0)
    result, _ = campaign(file, tmp_path / "out", settings)
    trace = Trace.load(tmp_path / "out" / result.seeds[0].trace)
    ranked = [(point.actor, point.frame) for point in load_ranker("proximity").rank(trace, before_s=3, after_s=3)]
    assert [actor for actor, _ in ranked] == ["near", "far", "later"]
    assert ranked[0][1] == ranked[1][1] < ranked[2][1]
    assert [clip.rank for clip in result.clips] == [1, 3]
