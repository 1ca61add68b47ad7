"""Text to model: what is accepted, where things stand, and the parser's cache."""

from __future__ import annotations

import os
import subprocess
import sys
from decimal import Decimal
from pathlib import Path

import pytest
from lark.lexer import PatternStr

from foresee_dsl.errors import InputError, Span
from foresee_dsl.language import model as m
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.document import Document
from foresee_dsl.language.model import TAKEN
from foresee_dsl.language.parser import load, parse
from foresee_dsl.language.syntax.grammar import parser

ROOT = Path(__file__).parents[2]
CASES = ROOT / "tests" / "cases" / "language"


def scenario(body: str) -> Document:
    return parse(f"foresee 1\nscenario test {{\n{body}\n}}\n", "test.foresee")


def first(body: str) -> m.Item:
    model = scenario(body).model
    assert isinstance(model, m.Scenario)
    return model.body[0]


def metres(number: str) -> m.Quantity:
    return m.Quantity(value=Decimal(number), unit="m")


# ---- what is accepted -----------------------------------------------------------------------------------------------


def test_every_kind_of_file():
    kinds = {file.stem: type(load(file).model) for file in CASES.glob("*.foresee")}
    assert kinds == {
        "clip": m.Clip,
        "everything": m.Scenario,
        "extension": m.Extension,
        "four_arms": m.Network,
        "inline_network": m.Scenario,
        "more_models": m.Catalogue,
        "mutant": m.Mutant,
    }


def test_the_authors_digits_and_units_stay():
    (assignment,) = first("case a { gap = 1.20 s }").values
    assert str(assignment.value.value) == "1.20"
    assert assignment.value.unit == "s"


def test_words_are_parameters_only_where_there_is_one():
    body = "ego: car.sedan { route from south straight over j4 }\nparam way: turn = left"
    assert first(body).body[0] == m.Route(start="south", legs=(m.Leg(turn="straight", junction="j4"),))
    body = "ego: car.sedan { route from south way over j4 }\nparam way: turn = left\nparam south: arm = west"
    leg = m.Leg(turn=m.Ref(name="way"), junction="j4")
    assert first(body).body[0] == m.Route(start=m.Ref(name="south"), legs=(leg,))
    assert first(body.replace("from south", 'from "south"')).body[0] == m.Route(start="south", legs=(leg,))


def test_keywords_may_be_names():
    body = """
    param speed: speed = 3 m/s
    param step: time = 1 s in 0 s..4 s step 0.1 s
    vehicle start: car.compact {
      route from route straight over at
      speed speed
      delay step
    }
    when start.speed < speed and time > step {
      start meets ego at over after step
      speed starts
      ego stops
      end changes speed to speed
      when ignores signals at signals
    }
    case when { speed = 4 m/s; step = 2 s }
    """
    model = scenario(body).model
    assert [action.actor for action in model.first(m.When).actions] == ["start", "speed", "ego", "end", "when"]
    assert [a.name for a in model.first(m.Case).values] == ["speed", "step"]


@pytest.mark.parametrize(
    ("before", "rule"),
    [("", "action"), ("when ", "scenario_item"), ("expect ", "scenario_item"), ("expect never ", "scenario_item")],
)
def test_the_words_that_no_actor_or_label_is_called(before: str, rule: str):
    """`TAKEN` holds what the grammar takes for a keyword where an actor or a label begins, and nothing else."""
    grammar = parser()
    reading = grammar.parse_interactive(before, start=rule)
    list(reading.iter_parse())
    words = {t.name: t.pattern.value for t in grammar.terminals if isinstance(t.pattern, PatternStr)}
    starts = {words[name] for name in reading.accepts() if words.get(name, "").isidentifier()}
    assert starts and starts <= TAKEN
    for word in starts:
        found = check_document(scenario(f"vehicle {word}: car.compact"))
        assert f"'{word}' is a word of the language" in [d.message for d in found if d.code == "FS049"]


def test_separators_and_lists_over_several_lines():
    one = first("ego: car.sedan { route [a]; speed 3 m/s; }")
    several = first("ego: car.sedan {\n\n  ;route [\n a,  # why\n ]\n;;\n speed 3 m/s\n\n }")
    assert one == several


@pytest.mark.parametrize("head", ["ego:car.sedan", "ego :car.sedan", "ego: car.sedan"])
def test_a_block_needs_no_blank_before_it(head: str):
    assert first(f"{head}{{route [a]; speed 3 m/s}}") == first("ego: car.sedan {\n  route [a]\n  speed 3 m/s\n}")


@pytest.mark.parametrize("name", ["when", "if", "while", "whenever", "upon"])
def test_an_action_of_an_actor_called_like_a_trigger_has_no_block(name: str):
    trigger = first(f"when time > 1 s {{\n{name} starts\n     b starts\n}}")
    assert [action.actor for action in trigger.actions] == [name, "b"]


def test_a_scenario_may_be_called_extends():
    assert parse("foresee 1\nscenario extends { ego: car.sedan }", "x").model.name == "extends"


def test_a_long_list_goes_over_many_lines_with_comments():
    """A list ends at its bracket, however far that is and whatever signs its comments have."""
    points = "".join(f"    ({k} m, {k} m),  # a bend ]; {{\n" for k in range(200))
    path = first(f"pedestrian a: pedestrian.adult {{\n  path [\n{points}  ]\n}}")
    assert len(path.body[0].points) == 200


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_newlines_and_byte_order_mark(newline: str, tmp_path: Path):
    text = (CASES / "everything.foresee").read_text(encoding="utf-8")
    path = tmp_path / "x.foresee"
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", newline).encode())
    document = load(path)
    assert document.model == parse(text, "x").model
    assert document.path == str(path)


def test_brackets_and_precedence_of_conditions():
    def condition(text: str) -> m.Item:
        return first(f"expect never {text}").condition

    a, b, c = (m.Predicate(what="collision", actor=name) for name in "abc")
    assert condition("collision(a) or collision(b) and not collision(c)") == m.Either(
        conditions=(a, m.Both(conditions=(b, m.Not(condition=c))))
    )
    assert condition("(collision(a) or collision(b)) and collision(c)") == m.Both(
        conditions=(m.Either(conditions=(a, b)), c)
    )
    assert condition("((collision(a)))") == a


# ---- places ---------------------------------------------------------------------------------------------------------


def test_spans_of_fields_elements_and_values():
    document = scenario("tags [one, two]\nego: car.sedan {\n  start at 20.5 m along ego.route offset -4 m\n}")
    tags, ego = document.model.body
    lines = document.text.split("\n")

    def at(item: m.Item, name: str) -> str:
        span = document.spans[id(item), name]
        assert span.line == span.end_line
        return lines[span.line - 1][span.column - 1 : span.end_column - 1]

    place = ego.body[0].place
    assert at(tags, "") == "tags [one, two]"
    assert at(tags, "names") == "[one, two]"
    assert at(tags, "names.1") == "two"
    assert at(ego, "model") == "car.sedan"
    assert at(place, "at") == "20.5 m"
    assert at(place, "actor") == "ego"
    assert at(place, "offset") == "-4 m"
    assert at(place.at, "unit") == "m"
    assert document.spans[id(ego), ""] == Span(4, 1, 6, 2)


def test_a_statement_that_was_read_before_has_its_own_places():
    """Short statements are kept as they were parsed, and their places are counted anew each time."""
    for lines, columns in ((0, 2), (0, 2), (3, 0), (1, 7)):
        statement = "\n" * lines + " " * columns + "tags [one,\n two]"
        document = scenario(f"{statement}\n{statement}")
        for k, tags in enumerate(document.model.body):
            line = 3 + lines + k * (lines + 2)
            assert document.span(tags) == Span(line, columns + 1, line + 1, 6)
            assert document.span(tags, "names.0") == Span(line, columns + 7, line, columns + 10)
            assert document.span(tags, "names.1") == Span(line + 1, 2, line + 1, 5)


def test_every_item_of_the_samples_has_a_place():
    from foresee_dsl.language.traversal import walk

    for file in CASES.glob("*.foresee"):
        document = load(file)
        for item in walk(document.model):
            assert (id(item), "") in document.spans


def test_diagnostics_of_a_document_find_their_line():
    document = load(CASES / "everything.foresee", "shown")
    case = document.model.all(m.Case)[1]
    diagnostic = document.diagnostic(case.values[2], "value", "FS033", "m")
    assert diagnostic.path == "shown"
    assert diagnostic.source_line.strip().startswith("case r02")
    assert diagnostic.source_line[diagnostic.span.column - 1 :].startswith("62 km/h")


# ---- checks ---------------------------------------------------------------------------------------------------------


def codes(document: Document) -> list[str]:
    return [d.code for d in check_document(document)]


def test_complete_samples_have_no_mistakes():
    for file in CASES.glob("*.foresee"):
        assert check_document(load(file)) == (), file.name


def test_ego_and_network_are_needed_once():
    assert codes(scenario("")) == ["FS035", "FS036"]
    body = 'use network "a.net.xml"\nego: car.sedan { route [a] }\n'
    assert codes(scenario(body)) == []
    assert codes(scenario(body + 'use network "b.net.xml"')) == ["FS036"]


def test_actors_of_traffic_can_be_named():
    body = """use network "a.net.xml"
    ego: car.sedan { route [a] }
    traffic others { count 3; models [car.compact]; within 9 m of ego.route; seed 1 }
    when time > 1 s {
      others_02 stops
    }"""
    assert codes(scenario(body)) == []
    assert codes(scenario(body.replace("others_02", "others"))) == ["FS037"]


@pytest.mark.parametrize(
    ("value", "found"),
    [
        ("0 s", []),
        ("4 s", []),
        ("0.3 s", []),
        ("300 ms", []),
        ("4.1 s", ["FS033"]),
        ("0.25 s", ["FS033"]),
        ("-0.1 s", ["FS033"]),
        ("1 m", ["FS034"]),
        ("south", ["FS034"]),
    ],
)
def test_values_of_cases_are_in_range_and_on_a_step(value: str, found: list[str]):
    body = f"""use network "a.net.xml"
    ego: car.sedan {{ route [a] }}
    param gap: time = 1 s in 0 s..4 s step 0.1 s
    case r {{ gap = {value} }}"""
    assert codes(scenario(body)) == found


def test_wrong_dimension_in_a_condition():
    body = 'use network "a.net.xml"\nego: car.sedan { route [a] }\nexpect always ego.speed < 30 m'
    assert codes(scenario(body)) == ["FS010"]


# ---- cache and cost -------------------------------------------------------------------------------------------------

_CHECK = (
    "from pathlib import Path; from foresee_dsl.language.parser import load;"
    "print(load(Path('tests/cases/language/clip.foresee')).model.name)"
)


def command(cache: Path) -> subprocess.Popen[str]:
    env = {**os.environ, "FORESEE_CACHE": str(cache), "PYTHONPATH": str(ROOT)}
    return subprocess.Popen([sys.executable, "-c", _CHECK], env=env, cwd=ROOT, stdout=-1, stderr=-1, text=True)


def check(process: subprocess.Popen[str]) -> None:
    out, err = process.communicate(timeout=60)
    assert (out, err, process.returncode) == ("red_light_runner_r02_p1\n", "", 0)


def test_two_processes_make_the_cache_at_once(tmp_path: Path):
    both = [command(tmp_path / "cache") for _ in range(2)]
    for process in both:
        check(process)
    (cached,) = (tmp_path / "cache" / "grammar").iterdir()
    check(command(tmp_path / "cache"))
    cached.write_bytes(cached.read_bytes()[:1000])  # a disk that was full
    check(command(tmp_path / "cache"))


def test_no_cache_can_be_made(tmp_path: Path):
    (tmp_path / "file").write_text("in the way")
    process = command(tmp_path / "file")
    out, err = process.communicate(timeout=60)
    assert (out, process.returncode) == ("red_light_runner_r02_p1\n", 0)
    assert "cannot be used" in err


def test_the_language_loads_nothing_heavy():
    code = (
        "import sys, foresee_dsl.language; assert 'pydantic' not in sys.modules and 'lark' not in sys.modules;"
        "import foresee_dsl.language.parser, foresee_dsl.language.checks.documents, foresee_dsl.language.printer;"
        "heavy = {'numpy', 'networkx', 'scipy', 'shapely', 'jinja2', 'rich', 'libsumo'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


def test_a_model_made_by_hand_knows_its_units():
    with pytest.raises(ValueError, match="unknown unit"):
        m.Quantity(value=Decimal(1), unit="kmh")
    assert metres("1.50").si == 1.5


def test_all_mistakes_are_reported_at_once():
    with pytest.raises(InputError) as caught:
        scenario("end aftr 3 s\nweather rain 3 m\nvehcle a: car.x\nego: car.sedan { route [a]; delay 3 m; stat }")
    assert [(d.span.line, d.code) for d in caught.value.diagnostics] == [
        (3, "FS004"),
        (4, "FS010"),
        (5, "FS004"),
        (6, "FS010"),
        (6, "FS004"),
    ]
    assert "test.foresee:3:5" in str(caught.value)


def test_a_path_that_joins_a_road_takes_no_block_whatever_the_indentation_behind_it() -> None:
    lines = ["vehicle a: car.sedan {", 'then joins ["west"]', '  route from "west" }']
    model = parse("\n".join(["foresee 1", "scenario x {", *lines, "}"]), "x").model
    assert isinstance(model, m.Scenario)
    assert [item.kind for item in model.actors[0].body] == ["joins", "route"]
