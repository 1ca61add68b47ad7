"""Driving styles: vehicles that obey all rules and react to the ego, in real SUMO; clips and mutants keep them."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import STYLES
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.clipping.fidelity import deviation
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import InputError
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Style
from foresee_dsl.language.model.derived import PROPERTIES, USUAL
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import ACCELERATION, STEP_S, Y
from tests.support.command import foresee
from tests.support.worlds import written_case

SIDE_ROAD = """foresee 1

scenario side_road {
  network {
    junction middle at (0 m, 0 m)
    junction west_end at (-200 m, 0 m)
    junction east_end at (250 m, 0 m)
    junction north_end at (0 m, 120 m)
    junction south_end at (0 m, -120 m)
    road west from west_end to middle { lanes 2 }
    road east from middle to east_end { lanes 2 }
    road north from north_end to middle { lanes 1 }
    road south from middle to south_end { lanes 1 }
  }
  ego: car.sedan {
    route from west straight over middle
    start at 104 m along ego.route
    speed 40 km/h
  }
  vehicle other: car.compact {
    route from north straight over middle
    start at 80 m along other.route
    speed 30 km/h
  }
  end after 18 s anywhere
}
"""
WALK = "path [(9 m, 9 m), (9 m, 0 m)]"
CREEPS_MPS2, CAREFUL_MPS2, COMFORT_MPS2 = 0.75, 7.59, 3.4


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("styles")


def styled_case(folder: Path, style: str) -> TestCase:
    return written_case(folder / f"side_road_{style}.foresee", styled(style))


def styled(style: str) -> str:
    speed = "    speed 30 km/h\n"
    return SIDE_ROAD if style == USUAL else SIDE_ROAD.replace(speed, f"{speed}    style {style}\n")


def drive(case: TestCase) -> RunResult:
    return run(compile_test_case(case), load_driver("pdm"))


@lru_cache
def driven(folder: Path, style: str) -> RunResult:
    return drive(styled_case(folder, style))


def other(folder: Path, style: str) -> np.ndarray:
    trace = driven(folder, style).trace
    return trace.states[:, trace.index("other")]


def crosses_s(folder: Path, style: str) -> float:
    """When the other car's middle comes to the main road's line."""
    return int(np.argmax(other(folder, style)[:, Y] < 0)) * STEP_S


def begins_to_brake_s(states: np.ndarray) -> float:
    return int(np.argmax(states[:, ACCELERATION] < -1.0)) * STEP_S


def test_the_words_of_the_language_are_those_of_the_parameters() -> None:
    assert PROPERTIES["style"].words == (USUAL, *STYLES)


def test_who_takes_the_gap_goes_first_and_the_ego_brakes_in_comfort(folder: Path) -> None:
    assert crosses_s(folder, USUAL) > 10, "it waits for the ego"
    assert crosses_s(folder, "takes_gap") < 6, "it goes first"
    result = driven(folder, "takes_gap")
    hardest = -result.trace.states[:, 0, ACCELERATION].min()
    assert 1.0 < hardest < COMFORT_MPS2, "the ego reacts, with no more than comfortable braking"
    assert not result.infractions


def test_who_brakes_late_begins_later_and_brakes_harder(folder: Path) -> None:
    usual, late = other(folder, USUAL), other(folder, "brakes_late")
    assert begins_to_brake_s(late) > begins_to_brake_s(usual) + 0.2
    assert -usual[:, ACCELERATION].min() + 1.0 < -late[:, ACCELERATION].min() < CAREFUL_MPS2 + 0.1
    assert crosses_s(folder, "brakes_late") > 10, "it still gives way"


def test_who_creeps_gains_speed_slowly(folder: Path) -> None:
    assert other(folder, "creeps")[1:, ACCELERATION].max() == pytest.approx(CREEPS_MPS2, abs=0.01)
    assert crosses_s(folder, "creeps") > crosses_s(folder, USUAL) + 1.0


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("begins_s", [2.0, 4.0, 8.0, 11.0])
def test_a_clip_goes_on_as_its_parent(folder: Path, style: str, begins_s: float) -> None:
    case, parent = styled_case(folder, style), driven(folder, style).trace
    point_s = begins_s + 2.0
    point = RiskyPoint(1, parent.frame_at(point_s), point_s, "", "none", float("nan"), float("nan"), 0.0, "a test")
    cut = clip(case, parent, point, before_s=2, after_s=4, name="p1", parent=f"side_road_{style}.foresee")
    text = print_model(cut)
    assert parse(text, "p1.foresee").model == cut
    assert f"style {style}" in text
    child = drive(expand_clip(cut, case, source=folder / "p1.foresee")).trace
    result = deviation(parent, parent.frame_at(begins_s), child)
    assert result.actors["other"] < 1e-3


def test_a_mutant_changes_the_style_and_later_runs_do_not_see_it(folder: Path) -> None:
    case, parent = styled_case(folder, USUAL), driven(folder, USUAL).trace
    point = RiskyPoint(1, parent.frame_at(3.0), 3.0, "", "none", float("nan"), float("nan"), 0.0, "a test")
    cut = clip(case, parent, point, before_s=3, after_s=6, name="p1", parent=f"side_road_{USUAL}.foresee")
    clip_case = expand_clip(cut, case, source=folder / "p1.foresee")
    text = (
        'foresee 1\n\nmutant child of "p1.foresee" pin sha256:000000000000 {\n'
        "  change other.style: usual => takes_gap\n}\n"
    )
    child = expand_mutant(parse(text, "child.foresee").model, clip_case, source=folder / "child.foresee")
    actor = next(item for item in child.scenario.body if getattr(item, "name", "") == "other")
    assert Style(manner="takes_gap") in actor.body
    before, first, after, second = drive(clip_case), drive(child), drive(clip_case), drive(child)
    assert before.trace.digest == after.trace.digest
    assert first.trace.digest == second.trace.digest != before.trace.digest


def test_a_mutant_cannot_give_a_pedestrian_a_style(folder: Path) -> None:
    walker = "  pedestrian p: pedestrian.adult { path [(9 m, 9 m), (9 m, 0 m)] }\n  end"
    (file := folder / "walked.foresee").write_text(SIDE_ROAD.replace("  end", walker))
    case = load_test_case(str(file))
    point = RiskyPoint(1, 60, 3.0, "", "none", float("nan"), float("nan"), 0.0, "a test")
    cut = clip(case, drive(case).trace, point, before_s=1, after_s=1, name="p1", parent=file.name)
    text = 'foresee 1\n\nmutant child of "p1.foresee" pin sha256:000000000000 {\n  change p.style: usual => creeps\n}\n'
    (wrong := folder / "wrong_child.foresee").write_text(text.replace("creeps", "sleepy"))
    assert "`sleepy` cannot be a value of `style`" in foresee("check", wrong, expect=1).stderr
    mutant, clipped = parse(text, "child.foresee").model, expand_clip(cut, case, source=folder / "p1.foresee")
    with pytest.raises(InputError, match="p does not drive along a route, so it cannot have a style"):
        expand_mutant(mutant, clipped, source=folder / "child.foresee")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (styled("hurries"), "'hurries'"),
        (SIDE_ROAD.replace("speed 40 km/h", "style creeps"), "the ego cannot have `style`"),
        (
            SIDE_ROAD.replace(
                "  end", "  pedestrian p: pedestrian.adult { path [(9 m, 9 m), (9 m, 0 m)]; style creeps }\n  end"
            ),
            "'p' does not drive along a route",
        ),
    ],
)
def test_a_style_that_cannot_be_is_an_error(folder: Path, text: str, message: str) -> None:
    (file := folder / "wrong.foresee").write_text(text)
    with pytest.raises(InputError, match=message):
        load_test_case(str(file))
