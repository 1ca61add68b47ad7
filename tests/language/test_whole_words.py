"""A keyword is a whole word: what begins with one is a name where names may stand, and elsewhere a mistake."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from lark.exceptions import UnexpectedInput

from foresee_dsl.errors import InputError
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.syntax.expected import keywords
from foresee_dsl.language.syntax.grammar import parse_tree

TESTS = Path(__file__).parents[1]
_MORE = """foresee 1

campaign nightly {
  seeds "a.foresee"
  allocation even
  rules off
  first_from "out"
  budget 10 min
  drivers [pdm]
  preset focused
  seed 1
  against [idm]
  rankers [foresee]
  risky_points 2
  children 3
  repeat 2
}
---
foresee 1

scenario e {
  weather sun 0.3, rain 0.2, fog 0.1, wetness 0.3
  slippery oil at (1 m, 2 m) radius 3 m friction 0.2
  require not 3 > 4
  when a.speed < 3 m/s for 2 s since 1 s { a stops; a leads b gap 2 s }
  vehicle b: car.sedan { route [a]; style creeps }
  vehicle c: car.sedan { route [a]; style takes_gap }
  vehicle d: car.sedan { route [a]; style brakes_late }
  use tracks "a.tracks.csv"
  vehicle f: car.sedan { track "7" }
  expected "b" fails
  expect never ego runs red
  expect always ego yields to b at crossing
  end after 3 s anywhere
}
---
foresee 1

models m {
  model car.x {
    length 4 m; width 2 m; height 1 m; wheelbase 2 m; front_overhang 1 m; rear_overhang 1 m; mass 900 kg
    max_speed 99 km/h; cruise_speed 50 km/h; acceleration 2 m/s^2; braking 3 m/s^2; emergency_braking 8 m/s^2
    max_steer 30 deg; steer_rate 20 deg/s
    source "none"
  }
}
---
foresee 1

network n {
  building b [(1 m, 2 m), (3 m, 4 m), (5 m, 2 m)]
}
---
foresee 1

clip c of "d.foresee" pin sha256:0 {
  vehicle a: car.sedan at (1 m, 2 m) heading 3 deg speed 4 m/s {
    recorded 1 s at (1 m, 2 m) heading 3 deg speed 4 m/s
  }
}
---
foresee 1

mutant c of "d.foresee" pin sha256:0 {
  origin { driver "idm"; avoided "pdm"; anticipating no; why "it" }
  change ego.speed: 3 => min(4, max(1, 2))
}
"""
"""What no test file has that can be parsed."""
_NAMED = """foresee 1

scenario {n} {{
  network {{
    junction {n} at (0 m, 0 m)
    junction {n}2 at (100 m, 0 m)
    road {n} from {n} to {n}2
  }}
  param {n}: speed = 5 m/s
  ego: car.sedan {{
    route from {n} right over {n}
    start at 10 m along {n}
    start speed {n}
  }}
  vehicle {n}: car.sedan {{
    route [{n}, {n}]
    start at 3 m ahead of ego
  }}
  bicycle {n}2: bicycle.city {{
    path [2 m ahead of {n} offset 1 m, the place of {n}]
  }}
  traffic {n}3 {{ count 2; models [car.sedan]; within 50 m of ego.route; seed 1 }}
  when {n}: {n}.speed > {n} and not {n} within 3 m of {n} or ttc({n}, ego) < 2 s {{
    {n} changes speed to 3 m/s over 2 s; {n} follows {n} gap 2 s
    {n} stops for 3 s
    then {{
      {n} leads {n} gap 3 m
      {n} stops at {n}
    }}
  }}
  expect {n}: never {n} ahead of {n}
  expect always ego yields to {n} at crossing
  expect never ego runs red
  case {n} {{
    {n} = 4 m/s
  }}
}}
"""


@cache
def _texts() -> tuple[str, ...]:
    """Texts that can be parsed, the shortest first."""
    folders = (
        "cases/language",
        "cases/language/errors",
        "cases/compile/lane_change",
        "compile/streets",
        "derive/following",
    )
    files = [file for folder in folders for file in sorted((TESTS / folder).glob("*.foresee"))]
    files.append(TESTS / "cases" / "language" / "newcomer" / "base.foresee")
    texts = [*_MORE.split("---\n"), *(file.read_text(encoding="utf-8") for file in files)]
    return tuple(text for text in sorted(texts, key=len) if _words_of(text) is not None)


def _words_of(text: str) -> set[str] | None:
    """Return the words of the names and texts in a text; None where it cannot be parsed."""
    try:
        tree = parse_tree(text, "file")
    except UnexpectedInput:
        return None
    return {word for token in tree.scan_values(lambda _: True) for word in re.findall(r"\w+", str(token))}


@pytest.mark.parametrize("keyword", sorted(keywords()))
def test_what_begins_with_a_keyword_is_one_word(keyword: str) -> None:
    places = [
        (text, found.end())
        for text in _texts()
        for found in re.finditer(rf"^[^\"#\n]*\b({keyword})\b(?=[ ]\w)", text, flags=re.MULTILINE)
    ]
    if not places:
        pytest.skip("nothing of a word or number stands behind it")
    text, end = places[0]
    for glued in (f"{text[:end]}x{text[end:]}", f"{text[:end]}2{text[end:]}", text[:end] + text[end + 1 :]):
        word = re.findall(r"\w+", glued[: end + 1])[-1] + (re.match(r"\w*", glued[end + 1 :]) or [""])[0]
        found = _words_of(glued)
        if found is not None:
            assert word in found, f"`{word}` was divided"
            continue
        with pytest.raises(InputError) as caught:
            parse(glued, "x.foresee")
        line = text[:end].count("\n") + 1
        at = [d.span.line for d in caught.value.diagnostics if d.span is not None]
        assert line in at, f"`{word}` is in line {line}, the mistakes are in {at}"


@pytest.mark.parametrize("keyword", sorted(keywords()))
def test_a_name_may_begin_with_a_keyword(keyword: str) -> None:
    for name in (f"{keyword}x", f"{keyword}_1", f"{keyword}2"):
        model = parse(_NAMED.format(n=name), "x.foresee").model
        assert parse(print_model(model), "x.foresee").model == model


def test_every_keyword_is_in_a_text() -> None:
    words = {word for text in _texts() for word in re.findall(r"\w+", text)}
    assert keywords() <= words, f"write {sorted(keywords() - words)} into `_MORE`"
