"""`C for 2 s since -1.30 s`: how it is read, printed and checked."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.errors import InputError
from foresee_dsl.language.model import Ref, Scenario, Sustained, When
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case

NETWORK = Path(__file__).parents[2] / "scenarios" / "networks" / "town.foresee"
TEXT = f"""foresee 1

scenario later {{
  use network "{NETWORK}"

  param since: time = -1 s in -2 s..0 s

  ego: car.sedan {{
    route from mill_west straight over mill_oak straight over mill_elm
  }}

  when CONDITION {{
    ego stops
  }}
}}
"""


def condition_of(text: str) -> Sustained:
    model = parse(TEXT.replace("CONDITION", text), "later.foresee").model
    assert isinstance(model, Scenario)
    (when,) = model.all(When)
    assert isinstance(when.condition, Sustained)
    assert f"when {text} {{" in print_model(model)
    return when.condition


def test_it_is_read_and_printed() -> None:
    since = condition_of("ego.speed > 5 m/s for 2 s since -1.30 s").since
    assert since is not None
    assert not isinstance(since, Ref)
    assert since.si == -1.3
    assert condition_of("(ego.speed > 5 m/s for 2 s since 0 s) for 1 s since -0.5 s").condition.kind == "for"
    assert condition_of("ego.speed > 5 m/s for 2 s since since").since == Ref(name="since")
    assert condition_of("ego.speed > 5 m/s for 2 s").since is None


@pytest.mark.parametrize(
    ("since", "code"), [("0.05 s", "FS050"), ("1 s", "FS050"), ("-1 m", "FS010"), ("0 s", ""), ("-9 s", "")]
)
def test_it_is_a_time_and_not_later_than_the_beginning(since: str, code: str, tmp_path: Path) -> None:
    file = tmp_path / "later.foresee"
    (tmp_path / "town.foresee").write_text(NETWORK.read_text())
    text = TEXT.replace(str(NETWORK), "town.foresee")
    file.write_text(text.replace("CONDITION", f"not ego.speed > 5 m/s for 2 s since {since}"))
    try:
        load_test_case(str(file))
        found = ""
    except InputError as error:
        found = error.diagnostics[0].code
    assert found == code
