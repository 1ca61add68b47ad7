"""Names: defined, used, explained and renamed across files; the texts that are said about them."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.editor import navigate
from foresee_dsl.editor.files import Files
from foresee_dsl.editor.hover import conversions, hover
from foresee_dsl.editor.symbols import folds, occurrences, outline
from foresee_dsl.errors import Span
from foresee_dsl.helps import Help, meant_code, meant_word, write
from foresee_dsl.language.messages.suggest import meant_at
from foresee_dsl.language.units import UNITS

NET = """foresee 1

network n {
  junction a at (0 m, 0 m)
  junction b at (300 m, 0 m)
  road main from a to b { lanes 2 }
}
"""
BASE = """foresee 1

scenario base {
  use network "n.foresee"

  param gap: time = 1 s

  ego: car.sedan {
    route [main]
  }
  vehicle lead: car.compact {
    route ["main", main_back]
    delay gap
  }
  traffic others {
    count 2
    models [car.compact]
    within 50 m of ego.route
    seed 1
  }

  when distance(ego, lead) < 5 m {
    lead stops
    others_01 stops
  }
}
"""
MORE = """foresee 1

scenario more extends "base.foresee" {
  change vehicle lead: car.suv {
    route [main]
  }
  change param.gap: 1 s => 2 s
  add when ttc(ego, lead) < 2 s {
    lead stops
  }
}
"""


@pytest.fixture
def files(tmp_path: Path) -> Files:
    texts = {"n.foresee": NET, "base.foresee": BASE, "more.foresee": MORE}
    return Files({tmp_path / name: text for name, text in texts.items()}, [tmp_path])


def at(files: Files, path: Path, word: str) -> tuple[int, int]:
    text = files.text(path) or ""
    offset = text.index(word)
    return text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)


def after_renaming(files: Files, path: Path, word: str, name: str) -> dict[str, str]:
    use = navigate.at(files, path, *at(files, path, word))
    assert use is not None
    renaming = navigate.rename(files, path, use, name)
    by_file: dict[Path, list[Span]] = {}
    for place in renaming.places:
        by_file.setdefault(place.path, []).append(place.span)
    return {p.name: navigate.edited(files.text(p) or "", spans, name) for p, spans in by_file.items()}


@pytest.mark.parametrize(
    ("word", "changed"),
    [
        ("lead", {"base.foresee", "more.foresee"}),
        ("gap", {"base.foresee", "more.foresee"}),
        ("main", {"n.foresee", "base.foresee", "more.foresee"}),
        ("others", {"base.foresee"}),
    ],
)
def test_renaming_changes_every_use(files: Files, tmp_path: Path, word: str, changed: set[str]) -> None:
    found = after_renaming(files, tmp_path / "base.foresee", word, "renamed")
    assert set(found) == changed
    for name, text in found.items():
        old = {"n.foresee": NET, "base.foresee": BASE, "more.foresee": MORE}[name]
        assert text == old.replace(word, "renamed")


def test_a_file_with_mistakes_is_not_half_renamed(files: Files, tmp_path: Path) -> None:
    broken = dict(files.overlay) | {tmp_path / "more.foresee": MORE.replace("lead stops", "lead stps")}
    with pytest.raises(navigate.RenameError, match=r"more\.foresee' has errors"):
        after_renaming(Files(broken, [tmp_path]), tmp_path / "base.foresee", "lead", "other")


def test_what_an_extension_changes_is_defined_in_the_other_file(files: Files, tmp_path: Path) -> None:
    more, base = tmp_path / "more.foresee", tmp_path / "base.foresee"
    for word in ("lead: car.suv", "gap", "lead stops"):
        use = navigate.at(files, more, *at(files, more, word))
        assert use is not None
        place = navigate.definition(files, more, use)
        assert place is not None and place.path == base
    parent = navigate.at(files, more, *at(files, more, '"base'))
    assert parent is not None
    assert navigate.definition(files, more, parent) == navigate.Place(base, Span(3, 10, 3, 14))


def test_every_name_of_the_bundled_files_has_a_definition(scenarios: Path) -> None:
    known = ("straight", "left", "right", "back", "red", "amber", "green")
    paths = sorted(scenarios.rglob("*.foresee"))
    files = Files({}, [scenarios])
    for path in paths:
        for o in files.names(path):
            if o.kind != "file" and o.name not in known:
                assert files.define(path, o) is not None, (path.name, o)
    assert sum(len(files.names(path)) for path in paths) > 200


def test_a_broken_statement_leaves_the_other_names(files: Files) -> None:
    broken = BASE.replace("    delay gap", "    delay gap gap gap {")
    assert {"lead", "gap", "n.foresee"} <= {o.name for o in occurrences(broken)}
    assert [e.name for e in outline(broken)[0].children][:3] == ["gap", "ego", "lead"]


@pytest.mark.parametrize(
    ("number", "unit", "said"),
    [
        (50, "km/h", "50 km/h = 13.89 m/s = 31.07 mph"),
        (15, "deg", "15 deg = 0.2618 rad"),
        (1.5, "s", "1.5 s = 1500 ms = 0.025 min"),
        (12345.678, "m", "12345.7 m = 1234567.8 cm = 12.35 km"),
        (3, "m/s^2", "3 m/s^2"),
    ],
)
def test_quantities_in_other_units(number: float, unit: str, said: str) -> None:
    assert conversions(number, UNITS[unit]).startswith(f"`{said}`")


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("gap: time", "param gap: time = 1 s"),
        ("lead: car.compact", "- length"),
        ("car.compact", "- width"),
        ('"n.foresee"', "a network"),
        ("main", "road main from a to b { lanes 2 }"),
        ("when", "a trigger"),
        ("5 m {", "500 cm"),
        ("others_01", "traffic others {"),
    ],
)
def test_hover(files: Files, tmp_path: Path, word: str, said: str) -> None:
    path = tmp_path / "base.foresee"
    line, column = at(files, path, word)
    found = hover(files, path, line, column + 1)
    assert found is not None and said in found.markdown
    assert found.span.line == line and found.span.column <= column + 1 <= found.span.end_column


def test_there_is_nothing_to_say_about_a_comment_or_a_text(tmp_path: Path) -> None:
    path = tmp_path / "x.foresee"
    files = Files({path: '# speed 50 km/h\ndoc "speed 50 km/h"\n'}, [])
    assert hover(files, path, 1, 4) is None
    assert hover(files, path, 2, 7) is None
    assert hover(files, path, 99, 1) is None


@pytest.mark.parametrize(
    ("help", "written", "right"),
    [
        (meant_word("km/h", "kmh"), "kmh", "km/h"),
        (meant_word("town.foresee", "nets/towm.foresee"), '"nets/towm.foresee"', '"nets/town.foresee"'),
        (meant_word("town.foresee", "towm.foresee"), '"towm.foresee"', '"town.foresee"'),
        (meant_word("route", "rout"), "rout", "route"),
        (meant_code("=>"), "->", "=>"),
        (meant_word("runner", "runer"), "runer stops", "runner stops"),
        (meant_word("east", "west"), "from west to west_end", "from east to west_end"),
        (meant_word("b", "a"), "car at a and a", None),
        ("write it like " + write("speed 50 km/h"), "speed", None),
    ],
)
def test_what_was_meant_takes_the_place_of_the_wrong_word(help: Help, written: str, right: str | None) -> None:
    found = meant_at(help.edits, written)
    assert (written[: found[0]] + found[2] + written[found[1] :] if found else None) == right


def test_folds() -> None:
    text = (
        "foresee 1\n\n# one\n# two\nscenario a {\n  ego: car.sedan {\n    route [b]\n  }\n  case r { gap = 1 s }\n}\n"
    )
    assert folds(text) == ((3, 4, "comment"), (5, 9, "region"), (6, 7, "region"))
