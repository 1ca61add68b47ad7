"""What conditions name must be on the network: junctions, signals, stages, places."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.errors import InputError
from foresee_dsl.language.project.loading import load_test_case

TEXT = """foresee 1

scenario s {
  use network "%s/networks/town.foresee"

  ego: car.sedan { route from mill_west straight over mill_oak straight over mill_elm }
  vehicle other: car.compact { route from king_west straight over king_oak; }

  when time > 1 s {
    ego ignores signals
    then when CONDITION { wait 1 s }
  }
}
"""


@pytest.mark.parametrize(
    ("condition", "code", "message", "help"),
    [
        ("ego in junction mill_oka", "FS251", "no junction called mill_oka", "mill_oak"),
        ("ego.eta(ego) < 2 s", "FS251", "no junction called ego", ""),
        ("ego in junction ego", "FS251", "no junction called ego", ""),
        ("ego.eta(mill_oka) < 2 s", "FS251", "no junction called mill_oka", "mill_oak"),
        ("ego runs red at mill_oka", "FS251", "no junction called mill_oka", "mill_oak"),
        ("ego yields to other at mill_oka", "FS251", "no junction called mill_oka", "mill_oak"),
        ("ego yields to other at crossing of mill_oka", "FS251", "no junction called mill_oka", "mill_oak"),
        ("ego within 5 m of mill_oka", "FS251", "no actor and no junction called mill_oka", "mill_oak"),
        ("ego within 5 m of 900 m along ego.route", "FS252", "after the end of the route of ego", "m long"),
        ("ego.signal(mill_oak) is red", "FS251", "no signal at mill_oak", "mill_elm"),
        ("ego.signal(king_elm) is red", "FS252", "the route of ego does not go over king_elm", "mill_oak, mill_elm"),
        ("signal(mill_elm) is ew_gone", "FS251", "no stage called ew_gone", "ew_go, ns_go"),
        ("signal(mill_elm) is red", "FS251", "no stage called red", "`ego.signal(mill_elm) is red`"),
        ("ego.signal(mill_elm) is turquoise", "FS251", "green, amber or red, not turquoise", ""),
        ("ego.signal(mill_elm) is ew_go", "FS251", "not ew_go", "write `signal(mill_elm) is ew_go`"),
        ("ego in lane 2 of mill_west", "FS252", "mill_west has no lane 2: it has 1 lane", "from 1 to 1"),
        ("ego in lane 9", "FS252", "no road of the network has 9 lanes", "from 1 to"),
        ("ego in lane 1 of mill_wets", "FS251", "no edge called mill_wets", "mill_west"),
    ],
)
def test_what_is_not_there_is_said(
    condition: str, code: str, message: str, help: str, scenarios: Path, tmp_path: Path
) -> None:
    file = tmp_path / "s.foresee"
    file.write_text((TEXT % scenarios).replace("CONDITION", condition))
    with pytest.raises(InputError) as caught:
        compile_test_case(load_test_case(str(file)))
    (found,) = caught.value.diagnostics
    assert (found.code, found.path) == (code, str(file))
    assert message in found.message
    assert help in found.help
    assert found.span is not None
    assert found.span.line == 11


def test_places_of_conditions_are_resolved(scenarios: Path, tmp_path: Path) -> None:
    file = tmp_path / "s.foresee"
    file.write_text((TEXT % scenarios).replace("CONDITION", "ego within 5 m of 10 m before mill_oak on ego.route"))
    ((x, y),) = compile_test_case(load_test_case(str(file))).scene.places.values()
    assert -25.0 < x < -10.0
    assert y == pytest.approx(-1.9, abs=0.1)
