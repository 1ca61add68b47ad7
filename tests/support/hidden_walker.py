"""A road with a house, a crossing and a parked van, from behind which a pedestrian steps onto the road: for reports of
runs."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_case

TEXT = """foresee 1

scenario hidden_walker {
  network street {
    junction west at (0 m, 0 m)
    junction east at (180 m, 0 m)
    junction north at (100 m, 80 m)
    junction middle at (100 m, 0 m) priority { crossings }
    road in from west to middle { parking 2.2 m; sidewalk 2 m }
    road out from middle to east { sidewalk 2 m }
    road up from north to middle { speed 30 km/h; sidewalk 2 m }
    building house [(30 m, -30 m), (80 m, -30 m), (80 m, -12 m), (30 m, -12 m)]
  }

  ego: car.sedan {
    route [in, out]
    start at 20 m along in
    start speed 36 km/h
    goal 30 m along out
  }
  obstacle van: obstacle.parked_van {
    start at 58 m along in offset -2.9 m
  }
  pedestrian walker: pedestrian.adult {
    path [62 m along in offset -4.5 m, 62 m along in offset 6 m]
    speed 1.8 m/s
  }
  when distance(ego, walker) < 32 m {
    walker starts
  }

  end after 12 s anywhere
}
"""


def hidden_walker(folder: Path) -> TestCase:
    """Write the scenario and return its test case."""
    file = folder / "hidden_walker.foresee"
    file.write_text(TEXT)
    return load_test_case(file)
