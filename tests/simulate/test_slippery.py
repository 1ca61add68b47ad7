"""A slippery patch: tyres hold less on it, for the ego and for others; clips keep it where it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.clipping.fidelity import deviation
from foresee_dsl.drivers.protocol import Control, Observation
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, X, Y
from foresee_dsl.story import tell
from tests.support.scenes import Cruise
from tests.support.situations import risky

FRICTION = 0.1
SCENARIO = """foresee 1

# Ice over all lanes; everybody brakes on it.
scenario ice {
  network {
    junction a at (0 m, 0 m)
    junction b at (300 m, 0 m)
    road main from a to b { lanes 3; back 0 }
  }

  PATCH

  ego: car.sedan {
    route [main]
    start at 20 m along main
    start speed 50 km/h
  }
  vehicle beside: car.sedan {
    route [main]
    start at 20 m along main offset 3.3 m
    start speed 50 km/h
  }
  bicycle rider: bicycle.city {
    path [20 m along main offset 6.6 m, 200 m along main offset 6.6 m]
    speed 20 km/h
  }

  when time >= 1 s {
    beside stops
    rider stops
  }

  end after 6 s
}
"""
ICE = "slippery ice at 50 m ahead of ego radius 50 m friction 0.1"


class Brakes(Cruise):
    """Brakes with all that there is from the second that the ice begins in."""

    def step(self, observation: Observation) -> Control:
        return Control(0.0, 0.0, 1.0) if observation.time_s >= 1.0 else super().step(observation)


def drive(folder: Path, patch: str, order: str = "beside stops") -> tuple[TestCase, RunResult]:
    file = folder / "ice.foresee"
    file.write_text(SCENARIO.replace("PATCH", patch).replace("beside stops", order))
    case = load_test_case(str(file))
    return case, run(compile_test_case(case), Brakes(50 / 3.6))


@pytest.fixture(scope="module")
def on_ice(tmp_path_factory: pytest.TempPathFactory) -> tuple[TestCase, RunResult]:
    return drive(tmp_path_factory.mktemp("ice"), ICE)


@pytest.fixture(scope="module")
def dry(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return drive(tmp_path_factory.mktemp("dry"), "")[1]


def on_the_patch(result: RunResult, actor: str, inside_m: float = 0.0) -> np.ndarray:
    """The accelerations in the steps that an actor began on the ice, so far from its edge at least."""
    states = result.trace.states[:, result.trace.index(actor)]
    spot = next(event.detail for event in result.trace.events if event.what == "slippery")
    on = np.hypot(states[:-1, X] - spot["x"], states[:-1, Y] - spot["y"]) < spot["radius_m"] - inside_m
    return states[1:, ACCELERATION][on]


def test_nobody_brakes_harder_on_ice_than_it_allows(on_ice: tuple[TestCase, RunResult], dry: RunResult) -> None:
    result = on_ice[1]
    for actor in ("ego", "beside", "rider"):
        most = -on_the_patch(result, actor, inside_m=3.0).min()
        assert 0.5 * FRICTION * GRAVITY_MPS2 < most <= FRICTION * GRAVITY_MPS2 + 1e-6, actor
        assert -np.nanmin(dry.trace.states[:, dry.trace.index(actor), ACCELERATION]) > 2.0
    assert dry.trace.states[-1, 0, SPEED] == 0.0
    assert result.trace.states[-1, 0, SPEED] > 5.0


def test_an_order_to_brake_is_no_stronger_than_the_ice_allows(tmp_path: Path) -> None:
    order = "beside brakes 6 m/s^2 for 4 s"
    _, result = drive(tmp_path, ICE, order)
    assert -on_the_patch(result, "beside", inside_m=3.0).min() <= FRICTION * GRAVITY_MPS2 + 1e-6
    _, dry = drive(tmp_path, "", order)
    braking = -dry.trace.states[:, dry.trace.index("beside"), ACCELERATION]
    assert np.count_nonzero(abs(braking - 6.0) < 1e-6) > 30


def test_one_wheel_of_four_on_ice_costs_its_share_of_the_grip(tmp_path: Path) -> None:
    _, result = drive(tmp_path, "slippery left at 20 m ahead of ego offset 1.6 m radius 1 m friction 0.1")
    braking = {round(-float(value), 3) for value in result.trace.states[:, 0, ACCELERATION] if value < -6.0}
    whole, three = (round(friction * GRAVITY_MPS2, 3) for friction in (0.9, (3 * 0.9 + FRICTION) / 4))
    assert {whole, three} <= braking


def test_a_clip_has_the_patch_where_it_was_and_drives_over_it_in_the_same_way(
    on_ice: tuple[TestCase, RunResult], tmp_path: Path
) -> None:
    case, parent = on_ice
    point = risky(parent.trace, "beside", 3.0)
    made = clip(case, parent.trace, point, before_s=1.5, after_s=1.5, name="ice_p1", parent="ice.foresee")
    (patch,) = (item for item in made.body if isinstance(item, m.Slippery))
    assert isinstance(patch.place, m.Point)
    assert parse(print_model(made), "clip").model == made
    clip_case = expand_clip(made, case, source=tmp_path / "ice_p1.foresee")
    found = run(compile_test_case(clip_case), Brakes(0.0))
    assert deviation(parent.trace, 30, found.trace).largest_m < 0.05


def test_the_story_says_where_the_ego_comes_onto_it(on_ice: tuple[TestCase, RunResult]) -> None:
    case, result = on_ice
    told = [moment.text for moment in tell(result.trace, case).moments if moment.kind == "slippery"]
    assert told == ["the ego comes onto 'ice', slippery ground with friction 0.1"]
