"""Names, sentences and numbers from elsewhere fit the language."""

from __future__ import annotations

import re

import pytest
from foresee_exchange.naming import distinct_name, file_name, name_of, quantity, sentence

from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model.values import NAME_PATTERN


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("NPC Car-1", "npc_car_1"),
        ("TargetVehicle", "target_vehicle"),
        ("Straße", "strae"),
        ("3rd", "actor_3rd"),
        ("日本", "actor"),
        ("", "actor"),
        ("time", "time_actor"),
        ("within", "within_actor"),
        ("x" * 100, "x" * 40),
    ],
)
def test_names_are_ours(text: str, name: str) -> None:
    assert name_of(text, "actor") == name
    assert re.fullmatch(NAME_PATTERN, name)
    assert name not in KEYWORDS


def test_names_are_told_apart() -> None:
    assert distinct_name("A-1", "actor", {"a_1", "a_1_2"}) == "a_1_3"


def test_sentences_are_on_one_line_without_quotes() -> None:
    assert sentence(' a "b"\n\tc\x07\x7f ') == "a 'b' c"
    assert len(sentence("word " * 1000)) == 300


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.0, "0"), (-0.00001, "0"), (12.5, "12.5"), (1200.0, "1200"), (0.12345, "0.1234"), (1e7, "10000000")],
)
def test_quantities_have_no_needless_digits(value: float, said: str) -> None:
    found = quantity(value, "length")
    assert f"{found.value:f}" == said
    assert found.unit == "m"


@pytest.mark.parametrize("value", [1e308, float("nan"), float("-inf")])
def test_what_nobody_drives_is_refused(value: float) -> None:
    with pytest.raises(ExchangeError, match="is not a plausible speed"):
        quantity(value, "speed")


def test_files_have_names_that_a_scenario_can_say() -> None:
    assert file_name("my town.xodr") == "my town.xodr"
    assert file_name('a "b"\nc\x00.net.xml') == "a _b__c_.net.xml"
    assert file_name("x" * 300 + ".xodr") == "x" * 115 + ".xodr"
