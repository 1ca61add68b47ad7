"""Files that vary the parameters of an OpenSCENARIO file: parameters and cases come of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from foresee_exchange.openscenario.losses import SourceError
from foresee_exchange.openscenario.reading import importer

from foresee_dsl.exchange.outcome import ExchangeError, Imported
from foresee_dsl.language import model as m
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project.loading import load_test_cases
from tests.support import openscenario_files as osc


def single(name: str, inner: str) -> str:
    """One parameter with values or a range."""
    kind = "DeterministicSingleParameterDistribution"
    return f'<{kind} parameterName="{name}">{inner}</{kind}>'


def values(*found: str) -> str:
    """A set of values."""
    return "<DistributionSet>" + "".join(f'<Element value="{value}"/>' for value in found) + "</DistributionSet>"


def steps(low: float, high: float, step: float) -> str:
    """A range with steps."""
    return f'<DistributionRange stepWidth="{step}"><Range lowerLimit="{low}" upperLimit="{high}"/></DistributionRange>'


def varied(folder: Path, inner: str, text: str = "", **options: bool) -> tuple[Imported, m.Scenario]:
    """Import the variation of a scenario; return what was said, and what was written."""
    scenario = osc.write(folder / "in", text or osc.scenario()).name
    file = folder / "in" / "varies.xosc"
    file.write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2024-01-01" description="Paces" author="t"/>'
        f'<ParameterValueDistribution><ScenarioFile filepath="{scenario}"/>{inner}</ParameterValueDistribution>'
        "</OpenSCENARIO>"
    )
    done = importer.run(file, out=folder / "out", **options)  # type: ignore[arg-type]
    (written,) = [path for path in done.files if path.suffix == ".foresee" and "models" not in path.name]
    found = parse(written.read_text(), str(written)).model
    assert isinstance(found, m.Scenario)
    return done, found


def speeds(folder: Path, actor: str) -> list[float]:
    """The speed of an actor at the beginning of each test case, m/s."""
    cases = load_test_cases([folder / "out" / "varies.foresee"])
    actors = [next(a for a in case.scenario.actors if a.name == actor) for case in cases]
    return [round(a.state.speed.si, 3) for a in actors if a.state is not None and isinstance(a.state.speed, m.Quantity)]


def test_a_range_and_values_are_parameters_and_every_combination_is_a_case(tmp_path: Path) -> None:
    """The target begins `2 * gap - 5` m ahead, with `pace + 2` m/s."""
    inner = single("pace", steps(8, 12, 2)) + single("gap", values("15", "20"))
    done, scenario = varied(tmp_path, f"<Deterministic>{inner}</Deterministic>")
    assert done.cases == 6
    assert not done.lost
    params = [print_item(item) for item in scenario.all(m.Param)]
    assert params == [
        "param pace: ratio = 8 in 8..12 step 2 as grid",
        "param gap_value: ratio = 15 in [15, 20] as grid",
    ]
    assert sorted(speeds(tmp_path, "ego")) == [8, 8, 10, 10, 12, 12]
    assert sorted(speeds(tmp_path, "target_1")) == [10, 10, 12, 12, 14, 14]
    at = [case.scenario.actors[1].state.at.x.si for case in load_test_cases([tmp_path / "out" / "varies.foresee"])]  # type: ignore[union-attr]
    assert sorted(round(x - 50 - 1.4 - 2.3, 2) for x in at) == [25, 25, 25, 35, 35, 35]


def test_what_is_no_sum_of_parameters_is_a_written_case_with_the_values_in_a_comment(tmp_path: Path) -> None:
    text = osc.scenario().replace('value="${$pace + 2}"', 'value="${$pace * $pace / 10}"')
    done, _ = varied(tmp_path, f"<Deterministic>{single('pace', values('10', '12', '14'))}</Deterministic>", text)
    assert done.cases == 3
    written = (tmp_path / "out" / "varies.foresee").read_text()
    assert "# pace = 12\n  case set_002 {" in written
    assert speeds(tmp_path, "target_1") == [10, 14.4, 19.6]


def test_sets_of_values_belong_together(tmp_path: Path) -> None:
    kind = "DeterministicMultiParameterDistribution"
    sets = "".join(
        f'<ParameterValueSet><ParameterAssignment parameterRef="pace" value="{pace}"/>'
        f'<ParameterAssignment parameterRef="$gap" value="{gap}"/></ParameterValueSet>'
        for pace, gap in ((8, 15), (12, 30))
    )
    inner = f"<Deterministic><{kind}><ValueSetDistribution>{sets}</ValueSetDistribution></{kind}></Deterministic>"
    done, _ = varied(tmp_path, inner)
    assert done.cases == 2
    assert speeds(tmp_path, "ego") == [8, 12]


_RANDOM = """<Stochastic numberOfTestRuns="5" randomSeed="7">
  <StochasticDistribution parameterName="pace"><NormalDistribution expectedValue="10" variance="4">
    <Range lowerLimit="6" upperLimit="14"/></NormalDistribution></StochasticDistribution>
  <StochasticDistribution parameterName="gap"><ProbabilityDistributionSet><Element value="15" weight="3"/>
    <Element value="20" weight="1"/></ProbabilityDistributionSet></StochasticDistribution></Stochastic>"""


def test_drawn_parameters_say_how_they_are_drawn(tmp_path: Path) -> None:
    done, scenario = varied(tmp_path, _RANDOM)
    assert done.cases == 5
    assert [print_item(item) for item in (*scenario.all(m.Param), *scenario.all(m.Cases))] == [
        "param pace: ratio = 10 in 6..14 as normal(10, 2)",
        "param gap_value: ratio = 15 in [15, 20] as choice(3, 1)",
        "cases 5 from seed 7",
    ]
    assert all(6 <= speed <= 14 for speed in speeds(tmp_path, "ego"))


def test_a_distribution_that_the_language_does_not_have_is_drawn_by_the_import(tmp_path: Path) -> None:
    inner = _RANDOM.replace("<NormalDistribution", "<PoissonDistribution").replace("</Normal", "</Poisson")
    varied(tmp_path, inner)
    found = speeds(tmp_path, "ego")
    assert len(found) == 5
    assert all(6 <= speed <= 14 and speed == int(speed) for speed in found)


def test_a_distribution_of_a_tool_is_refused_with_what_to_write(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="which is not one of the standard's distributions: write a"):
        varied(tmp_path, _RANDOM.replace("NormalDistribution", "UserDefinedDistribution"))


def test_values_that_cannot_be_played_are_lost_and_said(tmp_path: Path) -> None:
    """With a gap of 2.5 m the target stands on the ego's place in its lane."""
    inner = f"<Deterministic>{single('gap', values('2.5', '15'))}</Deterministic>"
    text = osc.scenario().replace('entityRef="Ego" dLane="1"', 'entityRef="Ego" dLane="0"')
    with pytest.raises(ExchangeError, match="starts on top of"):
        varied(tmp_path / "all", inner, text)
    done, _ = varied(tmp_path / "rest", inner, text, partial=True)
    assert done.cases == 1
    assert [count for what, count in done.lost.items() if what.startswith("sets of parameter values")] == [1]


def test_a_parameter_that_the_scenario_does_not_have_is_said(tmp_path: Path) -> None:
    done, _ = varied(tmp_path, f"<Deterministic>{single('colour', values('red', 'blue'))}</Deterministic>")
    assert done.left_out["values of 'colour', which the scenario does not declare"] == 1
