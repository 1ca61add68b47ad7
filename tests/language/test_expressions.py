"""Expressions: what they come to, how they are written, and what is said of those that make no sense."""

from __future__ import annotations

import pytest

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import case_values
from foresee_dsl.language.arithmetic.evaluate import evaluate
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.meaning import same_value
from foresee_dsl.language.parser import format_text, parse
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.project.concretise import concretise
from foresee_dsl.language.sampling import with_drawn_cases

_FRAME = """foresee 1

scenario s {{
  use network "town.foresee"

  param gap: time = 1.5 s in 0 s..4 s
  param pace: speed = 36 km/h in 10 km/h..60 km/h
  param width: length = 2 m
  param share: ratio = 0.5
  param n: count = 3
  param kind: model = car.compact

  ego: car.sedan {{
    route from west straight over j4
  }}
  {}
}}
"""


def _value(text: str) -> m.AnyValue:
    """The value that a text stands for, of whatever dimension."""
    model = parse(_FRAME.format(f"require 1 s < {text}"), "s.foresee").model
    assert isinstance(model, m.Scenario)
    require = model.first(m.Require)
    assert require is not None and isinstance(require.condition, m.Comparison)
    return require.condition.right


def _mistakes(line: str) -> tuple[Diagnostic, ...]:
    try:
        return check_document(parse(_FRAME.format(line), "s.foresee"))
    except InputError as error:
        return error.diagnostics


_VALUES: dict[str, m.ParamValue] = {
    "gap": m.Quantity(value="1.5", unit="s"),
    "pace": m.Quantity(value=36, unit="km/h"),
    "width": m.Quantity(value=2, unit="m"),
    "share": m.Quantity(value="0.5"),
    "n": m.Quantity(value=3),
}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("gap + 0.5 s", "2.0 s"),
        ("gap+0.5 s", "2.0 s"),
        ("gap -0.5 s", "1.0 s"),
        ("gap - -0.5 s", "2.0 s"),
        ("500 ms + gap", "2000 ms"),
        ("2 * width", "4 m"),
        ("2*width", "4 m"),
        ("width/2", "1 m"),
        ("10 m/4", "2.5 m"),
        ("pace * 1.5 s", "15 m"),
        ("pace / 2 s", "5 m/s^2"),
        ("pace * pace / (2 * 5 m/s^2)", "10 m"),
        ("width / gap * 3", "4 m/s"),
        ("pace + 1 m/s", "39.6 km/h"),
        ("-pace + 40 km/h", "4 km/h"),
        ("- 2 m + width", "0 m"),
        ("-(width + 1 m)", "-3 m"),
        ("2 + 3 * 4", "14"),
        ("(2 + 3) * 4", "20"),
        ("20 - 8 - 2", "10"),
        ("20 / 5 / 2", "2"),
        ("20 / (5 / 2)", "8"),
        ("min(gap, 1 s)", "1 s"),
        ("max(gap, 1 s, 900 ms)", "1.5 s"),
        ("min (gap, max(1 s, 2 * gap))", "1.5 s"),
        ("width / (4 m)", "0.5"),
        ("width / 4 m", "0.5"),
        ("1 m / 3", "0.333333333333 m"),
        ("90 deg / 2 s", "45 deg/s"),
        ("n * share", "1.5"),
        ("1 km + 20 cm", "1.0002 km"),
    ],
)
def test_what_it_comes_to(text: str, value: str):
    found = evaluate(_value(text), _VALUES)
    assert same_value(found, _value(value))
    assert found.unit == _value(value).unit


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("((gap)) + (0.50 s)", "gap + 0.50 s"),
        ("(gap * 2) + (gap / 2)", "gap * 2 + gap / 2"),
        ("(gap + 1 s) * 2", "(gap + 1 s) * 2"),
        ("gap - (1 s - 0.5 s)", "gap - (1 s - 0.5 s)"),
        ("gap + (1 s + 0.5 s)", "gap + (1 s + 0.5 s)"),
        ("gap * (2 / 4)", "gap * (2 / 4)"),
        ("-(-gap)", "-(-gap)"),
        ("- 0.5 s", "-0.5 s"),
        ("min( (gap) ,(1 s) )", "min(gap, 1 s)"),
        ("2 *-gap", "2 * -gap"),
    ],
)
def test_how_it_is_written(text: str, printed: str):
    assert written(_value(text)) == printed
    assert _value(printed) == _value(text), "the same again"
    laid_out = format_text(_FRAME.format(f"require 1 s < {text}"), "s.foresee")
    assert f"require 1 s < {printed}\n" in laid_out
    assert format_text(laid_out, "s.foresee") == laid_out


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("gap + gap", "2 * gap", True),
        ("gap + 0.5 s", "500 ms + gap", True),
        ("(gap + 1 s) * 2", "2 * gap + 2 s", True),
        ("gap * 1", "gap", True),
        ("1 s + 0.5 s", "1.5 s", True),
        ("gap / 4", "0.25 * gap", True),
        ("min(gap, 1 s)", "min(1 s, gap, gap)", True),
        ("width / pace", "1 / (pace / width)", True),
        ("gap + 0.5 s", "gap + 0.6 s", False),
        ("min(gap, 1 s)", "max(gap, 1 s)", False),
        ("gap - 1 s", "1 s - gap", False),
        ("2 * gap", "2 * share", False),
        ("gap / (gap + 1 s)", "gap / (gap + 2 s)", False),
    ],
)
def test_two_spellings_of_one_value(one: str, other: str, same: bool):
    assert same_value(_value(one), _value(other)) is same


@pytest.mark.parametrize(
    ("line", "code", "message", "help"),
    [
        ("end after gap + 3 m", "FS062", "`gap` is a time, but `3 m` is a length: only", "`2.5 s`"),
        ("end after gap - 3", "FS062", "`3` has no unit", "did you mean `3 s`?"),
        ("end after 2 gap", "FS060", "the sign between `2` and 'gap' is missing", "did you mean `2 * gap`?"),
        ("end after width * pace", "FS062", "is in m^2/s, but a time is needed here", "did you mean `width / pace`?"),
        ("end after min(gap, width)", "FS062", "only values of one kind are compared", ""),
        ("end after gap * kind", "FS062", "'kind' is of type model, which holds a word", ""),
        ("end after gaap + 1 s", "FS031", "unknown parameter 'gaap'", "did you mean 'gap'?"),
        ("end after gap / (share - 0.5)", "FS063", "with the defaults, `gap / (share - 0.5)` divides by zero", ""),
        ("end after gap - 2 s", "FS050", "`gap - 2 s` is -0.5 s (gap is 1.5 s), which is too small for `after`", ""),
        ("weather rain 3 * share", "FS043", "is 1.5 (share is 0.5), which is too large for `rain`", "use at most `1`"),
        ("require gap + 1 s < width", "FS062", "`gap + 1 s` is a time, but `width` is a length", ""),
        ("require gap < 2 * gap - 2 s", "FS053", "with the defaults, gap is 1.5 s", ""),
        ("expect never 3 s < time", "FS061", "a quantity that is measured in the run belongs", "`time > 3 s`"),
        ("expect never distance(ego, x) > ego.speed", "FS061", "both sides of this comparison are measured", ""),
        ("expect never gap + 1 s > 3 s", "FS052", "'gap + 1 s' does not change during the run", ""),
        ("case a { gap = 3 * gap }", "FS063", "'gap' depends on itself: gap -> gap", ""),
        ("case a { gap = 2 * width }", "FS062", "`2 * width` is a length, but a time is needed here", ""),
        ("case a { gap = 3 * 2 s }", "FS033", "`6 s` is outside the range of 'gap'", ""),
        ("case a { kind = 2 * gap }", "FS034", "'kind' is of type model, not a number", ""),
        ("case a { gap = pace }", "FS032", "'pace' is of type speed, but 'gap' of type time", ""),
        ("end after " + "(" * 60 + "gap" + ")" * 60, "", "", ""),
        ("end after " + "-(" * 60 + "gap" + ")" * 60, "FS018", "nested too deeply", ""),
        ("end after " + " + ".join(["gap"] * 60), "FS018", "a calculation of 60 values", ""),
        ("traffic others { count n * share; models [car.compact]; within 9 m of ego.route; seed 1 }",
         "FS032", "is 1.5 (n is 3, share is 0.5), but this place needs a whole number", ""),
    ],
)  # fmt: skip
def test_what_makes_no_sense(line: str, code: str, message: str, help: str):
    found = _mistakes(line)
    if not code:
        assert found == ()
        return
    assert [d.code for d in found] == [code], found
    assert message in found[0].message
    assert help in found[0].help
    assert found[0].help


def test_a_result_that_does_not_fit_names_its_case():
    found = _mistakes(
        "end after gap - 1 s\n  case a { gap = 1.2 s }\n  case b { gap = 0.5 s }\n  case c { gap = 1 s / 2 }"
    )
    assert [d.message for d in found] == [
        "in case 'b' (and 1 more), `gap - 1 s` is -0.5 s (gap is 0.5 s), which is too small for `after`"
    ]


def test_a_case_works_values_out_of_its_other_values():
    text = _FRAME.format("end after gap + share * 1 s\n  case a { gap = 2 * other; other = 1 s; share = 1 / n }")
    text = text.replace("  param width", "  param other: time = 0.1 s\n  param width")
    document = parse(text, "s.foresee")
    assert check_document(document) == ()
    assert isinstance(document.model, m.Scenario)
    end = concretise(document.model, "a").first(m.End)
    assert end is not None
    assert same_value(end.after, m.Quantity(value="2.33333333333", unit="s"))


def test_a_parameter_may_be_called_min():
    text = _FRAME.format("end after min + max(min, 2 s)").replace(
        "  param width", "  param min: time = 1 s\n  param width"
    )
    model = parse(text, "s.foresee").model
    assert isinstance(model, m.Scenario)
    end = concretise(model, None).first(m.End)
    assert end is not None
    assert end.after == m.Quantity(value=3, unit="s")


_STATED = """foresee 1

scenario stated {
  use network "town.foresee"
  tags [
    the, beside,
    the_bus
  ]

  param gap: time = 3 * 0.5 s in 0 s..2 * 2 s step 1 s / 2
  param pace: speed = 36 km/h in [20 km/h, 2 * 18 km/h] as choice(1, 1 + 1)
  param room: length = pace * gap + 2 m
  param width: length = room in 1 m..2 * room as normal(room, room / 4)
  param twice: length = 2 * width

  ego: car.sedan { route from west straight over j4 }
  end after 20 s
  cases 2 * 2 from seed 7
  case late { gap = 2 s }
}
"""


def _case_values(text: str) -> dict[str, dict[str, str]]:
    drawn = with_drawn_cases(parse(text, "stated.foresee")).model
    assert isinstance(drawn, m.Scenario)
    return {
        case.name: {name: value_text(value) for name, value in case_values(drawn, case).items()}
        for case in drawn.all(m.Case)
    }


def test_parameters_are_stated_by_expressions():
    """Bounds by the others' defaults, a default by what the others are in the case; what is drawn is a plain value."""
    assert check_document(parse(_STATED, "stated.foresee")) == ()
    values = _case_values(_STATED)
    assert list(values) == ["seed7_01", "seed7_02", "seed7_03", "seed7_04", "late"]
    late = {"gap": "2 s", "pace": "36 km/h", "room": "22 m", "width": "22 m", "twice": "44 m"}
    assert values["late"] == late
    plain = _STATED.replace("3 * 0.5 s in 0 s..2 * 2 s step 1 s / 2", "1.5 s in 0 s..4 s step 0.5 s")
    plain = plain.replace("2 * 18 km/h", "36 km/h").replace("1 + 1", "2").replace("2 * 2 from", "4 from")
    plain = plain.replace("1 m..2 * room as normal(room, room / 4)", "1 m..34 m as normal(17 m, 4.25 m)")
    assert _case_values(plain) == values


def test_what_is_stated_by_expressions_is_written_as_it_was():
    formatted = format_text(_STATED, "stated.foresee")
    assert "  tags [the, beside, the_bus]\n" in formatted
    for line in _STATED.split("\n"):
        assert line.strip().startswith(("tags", "the", "]", "ego", "route")) or line in formatted
    assert format_text(formatted, "stated.foresee") == formatted


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("param far: length = 2 * wdth", "FS031", "unknown parameter 'wdth'"),
        ("param far: time = gap + width", "FS062", "`gap` is a time, but `width` is a length"),
        ("param far: time = far * 2", "FS063", "'far' depends on itself: far -> far"),
        ("param far: time = far", "FS063", "'far' depends on itself: far -> far"),
        ("param far: time = 2 s in [2 s, far]", "FS063", "'far' depends on itself: far -> far"),
        ("param far: time = 1 s in 0 s..gap / (gap - 1.5 s)", "FS063", "divides by zero"),
        ("param far: speed = 2 * gap", "FS034", "`2 * gap` is a time, but a speed is needed here"),
        ("param far: time = 9 s in 0 s..2 * gap", "FS033", "`9 s` is outside the range of 'far', 0 s..2 * gap"),
        ("cases 5 / 2 from seed 7", "FS010", "`5 / 2` is not a whole number"),
    ],
)
def test_what_is_stated_wrongly(line: str, code: str, message: str):
    found = [(one.code, one.message) for one in _mistakes(line)]
    assert any(one == code and message in said for one, said in found), found
    assert all(one == code for one, _ in found), found


def test_results_of_drawn_cases_are_checked_before_they_run():
    found = _mistakes(
        "vehicle other: car.compact { route from west straight over j4; delay gap - 2.5 s }\n  cases 5 from seed 3"
    )
    assert len(found) == 1 and found[0].code == "FS050"
    assert found[0].message.startswith("in case 'seed3_")
    assert "for example with `max(gap - 2.5 s, 0 s)`" in found[0].help
