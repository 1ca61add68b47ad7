"""From a simulated run to its clips and children: SUMO, netconvert and the bundled driver, nothing by hand."""

import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.clipping.fidelity import deviation, with_fidelity
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run


def drive(case):
    return run(compile_test_case(case), load_driver("pdm"))


@pytest.fixture(scope="module")
def seed(scenarios):
    case = load_test_case(str(scenarios / "scenario3.foresee") + "::r01")
    return case, drive(case)


def test_a_clip_of_a_run_goes_on_as_its_parent_did_and_its_children_run(seed, tmp_path):
    case, parent = seed
    points = load_ranker("foresee").rank(parent.trace)
    point = next(p for p in points if p.time_s + 5 <= parent.duration_s)
    cut = clip(case, parent.trace, point, before_s=5, after_s=5, name="p1", parent="scenario3.foresee")
    assert parse(print_model(cut), "p1.foresee").model == cut
    assert len(print_model(cut).splitlines()) < 200

    clip_case = expand_clip(cut, case, source=tmp_path / "p1.foresee")
    child = drive(clip_case)
    found = deviation(parent.trace, parent.trace.frame_at(cut.start_s), child.trace)
    assert found.frames == child.trace.frames
    assert found.median_others_m < 0.005
    assert found.largest_m < 0.05
    assert "fidelity 0.0" in print_model(with_fidelity(cut, found))

    mutants = mutate(clip_case, cut, child.trace, count=2, seed=1, driver="pdm")
    assert len(mutants) == 2
    for mutant in mutants:
        result = drive(expand_mutant(mutant, clip_case, source=tmp_path / f"{mutant.name}.foresee"))
        assert result.verdict not in (Verdict.INVALID, Verdict.CRASH)
        assert result.trace.digest != child.trace.digest


def test_every_ranker_gives_points_that_can_be_clipped(seed):
    case, parent = seed
    for name in ("foresee", "proximity", "random", "exhaustive"):
        points = load_ranker(name).rank(parent.trace, seed=5)
        assert points
        assert len(points) == len({(p.frame, p.actor) for p in points})
        for point in points[:3]:
            assert point.time_s >= 5.0
            cut = clip(case, parent.trace, point, before_s=5, after_s=5, name="p", parent="scenario3.foresee")
            assert cut.start_s == pytest.approx(point.time_s - 5)
