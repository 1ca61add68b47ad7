"""Drawn cases: in range, on step, reproducible, as required."""

from __future__ import annotations

from decimal import Decimal
from itertools import product

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.model import Case, Cases, End, Param, ParamValue, Quantity, Require, Scenario
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.concretise import cases, concretise
from foresee_dsl.language.sampling import (
    TooFewError,
    axis_of,
    case_names,
    coverage,
    draw,
    holds,
    with_drawn_cases,
)

BODY = """foresee 1

scenario s {
  use network "town.foresee"
  ego: car.sedan { route [west] }
  end after 20 s
@
}
"""


def scenario(lines: str) -> Scenario:
    model = parse(BODY.replace("@", lines), "s.foresee").model
    assert isinstance(model, Scenario)
    return model


def drawn(lines: str, count: int, seed: int = 7) -> list[dict[str, ParamValue]]:
    found = draw(scenario(lines), wanted(count, seed))
    return [{given.name: given.value for given in case.values} for case in found]


def wanted(count: int, seed: int) -> Cases:
    return Cases(count=Quantity(value=Decimal(count)), seed=Quantity(value=Decimal(seed)))


def mistakes(lines: str) -> list[Diagnostic]:
    found = check_document(parse(BODY.replace("@", lines), "s.foresee"))
    return [d for d in found if d.severity == "error"]


def text(value: ParamValue) -> str:
    return value if isinstance(value, str) else f"{value.value:f} {value.unit}".strip()


def test_the_very_values_that_a_seed_draws() -> None:
    """Pinned: they are part of the language, so that a file means the same cases everywhere and for good."""
    lines = (
        "param gap: time = 1.5 s in 0 s..4 s step 0.1 s as normal(1.5 s, 0.4 s)\n"
        "param pace: speed = 30 km/h in 20 km/h..60 km/h\n"
        "param where: arm = south in [south, east, north] as choice(3, 1, 0.5)\n"
        "param turn: turn = left in [left, right] as grid"
    )
    found = [[text(v) for v in values.values()] for values in drawn(lines, 4)]
    assert found == [
        ["2.6 s", "44.17 km/h", "south", "left"],
        ["1.4 s", "30.64 km/h", "east", "right"],
        ["1.3 s", "37.74 km/h", "south", "left"],
        ["1.9 s", "21.56 km/h", "south", "right"],
    ]


def test_names_have_as_many_digits_as_the_last_one_needs() -> None:
    assert case_names(wanted(3, 7)) == ("seed7_01", "seed7_02", "seed7_03")
    assert case_names(wanted(100, 0))[0] == "seed0_001"


def test_drawn_cases_are_cases_everywhere() -> None:
    lines = "param gap: time = 1 s in 0 s..4 s step 0.1 s\nend after gap\ncase a { gap = 2 s }\ncases 3 from seed 7"
    document = parse(BODY.replace("  end after 20 s\n", "").replace("@", lines), "s.foresee")
    assert cases(document) == ("a", "seed7_01", "seed7_02", "seed7_03")
    whole = with_drawn_cases(document)
    assert cases(whole) == cases(document)
    assert isinstance(whole.model, Scenario) and isinstance(document.model, Scenario)
    third = whole.model.all(Case)[3]
    assert whole.diagnostic(third, "", "FS001", "").source_line == "cases 3 from seed 7"
    for model in (document.model, whole.model):
        (end,) = concretise(model, "seed7_03").all(End)
        assert end.after == third.values[0].value


limits = st.tuples(
    st.integers(-50, 50), st.integers(0, 80), st.sampled_from(["0.1", "0.25", "1", "3"]), st.sampled_from(["", "x"])
)


@given(limits, st.integers(0, 10**9), st.sampled_from(["uniform", "normal", "grid"]))
def test_values_are_in_the_range_and_on_a_step(
    given_limits: tuple[int, int, str, str], seed: int, distribution: str
) -> None:
    low, width, step, free = given_limits
    assume(not (free and distribution == "grid"))
    how = f"normal({low + width / 2} m, {width / 3 + 1} m)" if distribution == "normal" else distribution
    stepped = "" if free else f" step {step} m"
    lines = f"param a: length = {low} m in {low} m..{low + width} m{stepped} as {how}"
    for values in drawn(lines, 5, seed):
        value = values["a"]
        assert isinstance(value, Quantity) and value.unit == "m"
        assert low <= value.value <= low + width
        if not free:
            assert (value.value - low) % Decimal(step) == 0


@given(st.integers(0, 10**9), st.integers(1, 12))
def test_more_cases_and_other_parameters_leave_a_draw_as_it_is(seed: int, count: int) -> None:
    one = "param a: length = 1 m in 0 m..50 m step 0.5 m as normal(20 m, 9 m)"
    other = "param b: time = 1 s in 0 s..5 s\nparam c: arm = x in [x, y] as choice(1, 2)"
    few = drawn(one, count, seed)
    assert drawn(one, count, seed) == few
    assert drawn(one, count + 9, seed)[:count] == few
    assert [{"a": values["a"]} for values in drawn(f"{other}\n{one}", count, seed)] == few


@given(st.integers(0, 10**9))
def test_what_is_drawn_is_as_required(seed: int) -> None:
    lines = (
        "param a: time = 1 s in 0 s..4 s step 0.1 s\nparam b: time = 1 s in 0 s..4 s\nparam w: arm = x in [x, y]\n"
        "require a < b and (a > 500 ms or w is y)"
    )
    model = scenario(lines)
    for values in drawn(lines, 5, seed):
        assert all(holds(require.condition, values) for require in model.all(Require))


def test_a_grid_takes_every_combination_before_it_takes_one_again() -> None:
    lines = (
        "param a: length = 0 m in 0 m..3 m step 1 m as grid\nparam b: arm = x in [x, y, z] as grid\n"
        "param c: count = 1 in 1..2 as grid\nparam d: time = 1 s in 0 s..9 s"
    )
    found = [(text(v["a"]), v["b"], text(v["c"])) for v in drawn(lines, 48)]
    every = set(product(["0 m", "1 m", "2 m", "3 m"], "xyz", "12"))
    assert set(found[:24]) == every and found[24:] == found[:24]
    assert [a for a, _, _ in found[:5]] == ["0 m", "1 m", "2 m", "3 m", "0 m"]


def test_a_grid_leaves_out_what_is_not_as_required() -> None:
    lines = (
        "param a: count = 1 in 1..6 as grid\nparam b: count = 1 in 1..6 as grid\nparam c: count = 1 in 1..6\n"
        "require a < b\nrequire c > a"
    )
    found = [(text(v["a"]), text(v["b"])) for v in drawn(lines, 15)]
    assert len(set(found)) == 15 and all(a < b for a, b in found)


def test_weights_and_the_normal_distribution_draw_in_proportion() -> None:
    lines = (
        "param w: arm = x in [x, y] as choice(3, 1)\n"
        "param g: time = 2 s in 0 s..4 s step 0.01 s as normal(2 s, 0.5 s)\nparam u: length = 0 m in 0 m..1 m"
    )
    values = drawn(lines, 2000)
    assert 0.72 < sum(v["w"] == "x" for v in values) / 2000 < 0.78  # three standard deviations
    numbers = [v["g"].si for v in values if isinstance(v["g"], Quantity)]
    mean = sum(numbers) / 2000
    assert abs(mean - 2) < 0.034
    assert abs((sum((n - mean) ** 2 for n in numbers) / 2000) ** 0.5 - 0.5) < 0.025
    assert abs(sum(v["u"].si for v in values if isinstance(v["u"], Quantity)) / 2000 - 0.5) < 0.02


def test_mixed_units_reach_the_end_of_the_range() -> None:
    param = scenario("param a: length = 1 m in 0 m..0.03 km step 10 cm").first(Param)
    assert param is not None
    axis = axis_of(param)
    assert axis is not None and axis.size == 301
    assert axis.value(300) == Quantity(value=Decimal("30.0"), unit="m")


def test_too_few_draws_say_how_many_and_what_fails_most() -> None:
    lines = "param a: time = 1 s in 0 s..4 s step 0.1 s\nrequire a < 9 s\nrequire a < 0 s"
    with pytest.raises(TooFewError, match=r"of 10000 draws none satisfied.*`require a < 0 s` failed most, 10000 times"):
        drawn(lines, 2)
    document = parse(BODY.replace("@", f"{lines}\ncases 2 from seed 1"), "s.foresee")
    with pytest.raises(InputError) as caught:
        with_drawn_cases(document)
    assert caught.value.diagnostics[0].source_line == "cases 2 from seed 1"


def test_coverage_counts_steps_options_and_pairs() -> None:
    model = scenario(
        "param a: count = 1 in 1..4\nparam w: arm = x in [x, y]\nparam f: time = 1 s in 0 s..10 s\n"
        "case one { a = 1; w = x; f = 0 s }\ncase two { a = 4; w = x; f = 10 s }\ncase three { a = 4; w = x; f = 10 s }"
    )
    found = coverage(model, model.all(Case))
    assert [(r.name, r.reached, r.bins, r.of) for r in found.reaches] == [
        ("a", 2, 4, "steps"),
        ("w", 1, 2, "options"),
        ("f", 2, 10, "tenths"),
    ]
    assert (text(found.reaches[0].smallest), text(found.reaches[0].largest)) == ("1", "4")
    assert (found.cases, found.distinct) == (3, 2)
    assert (found.pairs_reached, found.pairs) == (2 + 2 + 2, 8 + 40 + 20)


GAP = "param gap: time = 1 s in 0 s..4 s step 0.1 s"
WHERE = "param where: arm = x in [x, y]"


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (f"{GAP} as normal(5 s, 1 s)", "the mean `5 s` is outside the range, 0 s..4 s"),
        (f"{GAP} as normal(1 s, 0 s)", "the standard deviation `0 s` is too small"),
        (f"{GAP} as normal(1 m, 1 s)", "`1 m` is a length, but a time is needed here"),
        (f"{GAP} as choice(1, 2)", "a choice needs options, but this parameter has a range"),
        (f"{WHERE} as choice(1, 2, 3)", "the number of weights, 3, differs from the number of options, 2"),
        (f"{WHERE} as choice(1, 0)", "`0` is not a weight"),
        (f"{WHERE} as normal(1 s, 1 s)", "a normal distribution needs a range, but this parameter has options"),
        ("param gap: time = 1 s in 0 s..4 s as grid", "a grid needs steps, but this range has no step"),
        ("param gap: time = 1 s as uniform", "'gap' has no range or options to draw from"),
        (f"{GAP}\ncases 0 from seed 1", "`0` cannot be the number of cases of a draw"),
        (f"{GAP}\ncases 10001 from seed 1", "`10001` cannot be the number of cases of a draw"),
        (f"{GAP}\ncases 2.5 from seed 1", "`2.5` is not a whole number"),
        (f"{GAP}\ncases 2 from seed 1\ncase seed1_02", "there are two cases called 'seed1_02'"),
        (f"{GAP}\ncases 2 from seed 1\ncases 30 from seed 1", "there are two cases called 'seed1_01'"),
        (f"{GAP}\nrequire gap < 3 s\ncase a {{ gap = 3 s }}", "in case 'a', gap is 3 s, but `require gap < 3 s`"),
        (f"{GAP}\nrequire gap > 2 s", "with the defaults, gap is 1 s, but `require gap > 2 s`"),
        (
            f"{GAP}\n{WHERE}\nrequire where is y or gap > 2 s\ncase a",
            "in case 'a', where is x and gap is 1 s, but `require where is y or gap > 2 s`",
        ),
        (f"{GAP}\nrequire ego.speed < 3 m/s", "`ego.speed < 3 m/s` is not known before the run"),
        (f"{GAP}\nrequire gap is long", "'gap' is a time, not a word"),
        (f"{WHERE}\nrequire where < 3 s", "'where' is a word, which cannot be less or more than another"),
        (f"{WHERE}\nrequire where is z", "'z' is not among the options of 'where'"),
        (f"{GAP}\nrequire gap < 3 m", "`3 m` is a length, but a time is needed here"),
        (f"{GAP}\nrequire gep < 3 s", "unknown parameter 'gep'"),
        (f"{GAP}\nwhen gap < 3 s {{ ego stops }}", "'gap' does not change during the run"),
        ("param red: arm = x", "'red' is a word of the language"),
        ("param time: time = 3 s", "'time' is a word of the language"),
        ("param s: side = up", "unknown side 'up'"),
        ("param pace: speed = 1 m/s in [2 m/s, 3 m/s]", "`1 m/s` is not among the options of 'pace'"),
    ],
)
def test_mistakes(lines: str, message: str) -> None:
    assert [found.message for found in mistakes(lines)] == [message]


def test_parameters_stand_for_words_of_their_type() -> None:
    lines = (
        "param j: junction = j4\nparam st: stage = go\nparam sd: side = left\nparam a: arm = west\n"
        "vehicle v: car.compact {\n  route from a straight over j\n"
        "  ignores signals at j\n  meets ego at j after 1 s\n}\n"
        "signal j stage st elapsed 1 s\nwhen ego in junction j and signal(j) is st and ego within 5 m of j {\n"
        "  v changes lane sd\n  v meets ego at j after 1 s\n}\nexpect always ego.eta(j) > 1 s"
    )
    assert mistakes(lines) == []
    wrong = mistakes(lines.replace("lane sd", "lane st"))
    assert [found.message for found in wrong] == ["'st' is of type stage, which does not fit here"]
