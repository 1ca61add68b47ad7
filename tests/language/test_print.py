"""Model to text: the canonical layout, comments, and where blank lines go."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import pytest

from foresee_dsl.errors import InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.parser import format_text, load, parse
from foresee_dsl.language.printer import print_item, print_model

ROOT = Path(__file__).parents[2]
CASES = ROOT / "tests" / "cases" / "language"
SAMPLES = sorted(CASES.glob("*.foresee")) + sorted((ROOT / "scenarios").rglob("*.foresee"))


@pytest.mark.parametrize("file", sorted(CASES.glob("*.foresee")), ids=lambda file: file.stem)
def test_samples_are_in_the_canonical_layout(file: Path):
    text = file.read_text(encoding="utf-8")
    assert format_text(text, file.name) == text


@pytest.mark.parametrize("file", SAMPLES, ids=lambda file: file.stem)
def test_a_printed_model_has_no_double_blank_lines_or_trailing_blanks(file: Path):
    text = print_model(load(file).model)
    assert "\n\n\n" not in text
    assert text.endswith("}\n")
    assert all(line == line.rstrip() for line in text.split("\n"))


@pytest.mark.parametrize("name", ["clip", "mutant", "inline_network", "more_models"])
def test_generated_files_are_grouped_like_the_samples(name: str):
    file = CASES / f"{name}.foresee"
    assert print_model(load(file).model) == file.read_text(encoding="utf-8")


UGLY = """# licence
foresee 1 # version


# about this
scenario   test{ # open
# first
doc "x"


#far

#near
tags [a,b] ; end after   60 s# at the end
case r01{gap=1.2 s;approach=south}
case r02 { gap = 1.2 s # why
}
ego : car.sedan{
route [ a, # inside
  b ]
# last
} # closed
#
when time>1 s and(ego.speed<3 m/s)or not(not time<2 s) { ego stops }
  # at end
}
# behind

# all
"""

PRETTY = """# licence
foresee 1  # version

# about this
scenario test {  # open
  # first
  doc "x"

  # far

  # near
  tags [a, b]
  end after 60 s  # at the end
  case r01 { gap = 1.2 s; approach = south }
  case r02 {
    gap = 1.2 s  # why
  }
  ego: car.sedan {
    route [a, b]  # inside
    # last
  }  # closed
  #
  when time > 1 s and ego.speed < 3 m/s or not not time < 2 s {
    ego stops
  }
  # at end
}

# behind

# all
"""


def test_formatting():
    assert format_text(UGLY, "x") == PRETTY
    assert format_text(PRETTY, "x") == PRETTY


def test_a_file_with_mistakes_is_not_formatted():
    with pytest.raises(InputError):
        format_text(UGLY.replace("end after", "end aftr"), "x")


def test_short_roads_are_one_line_and_long_values_do_not_wrap():
    text = "foresee 1\n\nnetwork n {{\n  road {0} from {0} to {0} {{ lanes 2; speed 50 km/h }}\n}}\n"
    for name in ("a", "b" * 70):
        assert format_text(text.format(name), "x") == text.format(name)


def test_ids_of_imported_networks_are_strings():
    route = m.EdgeRoute(edges=("west", "-12#3", "a b"), shortest=True)
    assert print_item(route) == 'route [west, ..., "-12#3", ..., "a b"]'


def test_an_id_that_looks_like_a_parameter_is_quoted():
    text = 'foresee 1\n\nscenario s {\n  param west: arm = south\n\n  ego: car.sedan {\n    route from "west"\n  }\n}\n'
    model = parse(text, "x").model
    assert model.first(m.Ego).body == (m.Route(start="west", legs=()),)
    assert print_model(model) == text


def test_numbers_are_plain():
    value = m.Quantity(value=Decimal("1E+3"), unit="m")
    assert print_item(m.Walked(along=value)) == "moving 1000 m"
    assert print_item(m.Walked(along=m.Quantity(value=Decimal("1E-7"), unit="m"))) == "moving 0.0000001 m"
    assert print_item(m.Walked(along=m.Quantity.of(-0.0001, "length", 2))) == "moving 0.00 m"
