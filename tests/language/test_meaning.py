"""Hashes are over what a file means: every value counts, its unit, layout and names do not."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path

import pytest

from foresee_dsl.language.meaning import clip_pin, meaning_hash, models_named, pin_of, same_value
from foresee_dsl.language.model import (
    Actor,
    CruiseSpeed,
    Doc,
    Ego,
    End,
    Expect,
    Fidelity,
    Item,
    Network,
    Quantity,
    Risk,
    Scenario,
    SignalState,
    Tags,
    Traffic,
    UseNetwork,
    Weather,
)
from foresee_dsl.language.project.concretise import concretise
from foresee_dsl.language.project.expand import expand_clip
from tests.support.meaning_examples import MODELS, NETWORK, SCENARIO, clip_of, example_case
from tests.support.worlds import model, point, q

CONCRETE = concretise(SCENARIO, "r01")


def hashed(scenario: Scenario = CONCRETE, network: Network | Path = NETWORK) -> str:
    return meaning_hash(scenario, network, MODELS)


def with_body(*body: Item) -> Scenario:
    return Scenario(name="runner", body=body)  # type: ignore[arg-type]  # pydantic checks the kinds


def test_form() -> None:
    kind, _, digits = hashed().partition(":")
    assert kind == "sha256"
    assert len(digits) == 12
    assert int(digits, 16) >= 0


def test_units_do_not_count() -> None:
    def hash_with(speed: Quantity) -> str:
        actor = Actor(kind="vehicle", name="a", model="car.sedan", body=(CruiseSpeed(speed=speed),))
        return hashed(with_body(actor))

    assert hash_with(q("50 km/h")) == hash_with(q("13.8888888888889 m/s")) == hash_with(q("50.000 km/h"))
    assert hash_with(q("50 km/h")) != hash_with(q("13.8888 m/s"))
    assert hash_with(q("0 km/h")) == hash_with(q("-0.0 m/s"))


def test_doc_tags_names_and_file_names_do_not_count() -> None:
    body = tuple(item for item in CONCRETE.body if not isinstance(item, Doc | Tags))
    assert hashed(Scenario(name="other", body=(UseNetwork(path="x.foresee"), *body))) == hashed()


def test_names_of_cases_and_parameters_do_not_count() -> None:
    renamed = SCENARIO.model_dump_json().replace('"pace"', '"how_fast"').replace('"r02"', '"slow"')
    assert hashed(concretise(Scenario.model_validate_json(renamed), "slow")) == hashed(concretise(SCENARIO, "r02"))
    assert hashed(concretise(SCENARIO, "r02")) != hashed()


def test_order_counts_only_where_it_has_meaning() -> None:
    body = CONCRETE.body
    kinds = (Ego, Weather, Expect, End, SignalState, Traffic)
    shuffled = sorted(body, key=lambda item: isinstance(item, kinds))
    assert hashed(with_body(*shuffled)) == hashed()
    expects = tuple(reversed(CONCRETE.all(Expect)))
    assert hashed(with_body(*(i for i in body if not isinstance(i, Expect)), *expects)) == hashed()
    actors = tuple(reversed(CONCRETE.all(Actor)))
    assert hashed(with_body(*(i for i in body if not isinstance(i, Actor)), *actors)) != hashed()


def test_order_of_an_actors_statements_does_not_count() -> None:
    runner = CONCRETE.all(Actor)[0]
    turned = runner.model_copy(update={"body": tuple(reversed(runner.body))})
    assert hashed(with_body(*(turned if item is runner else item for item in CONCRETE.body))) == hashed()


def quantities(item: object, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield where every number of an item stands."""
    if isinstance(item, Quantity):
        yield path
    elif isinstance(item, Item):
        for name in type(item).model_fields:
            yield from quantities(getattr(item, name), (*path, name))
    elif isinstance(item, tuple):
        for index, part in enumerate(item):
            yield from quantities(part, (*path, index))


def changed_at(item: object, path: tuple[str | int, ...]) -> object:
    if not path:
        assert isinstance(item, Quantity)
        return item.model_copy(update={"value": item.value + 1})
    step, rest = path[0], path[1:]
    if isinstance(step, int):
        assert isinstance(item, tuple)
        return (*item[:step], changed_at(item[step], rest), *item[step + 1 :])
    assert isinstance(item, Item)
    return item.model_copy(update={step: changed_at(getattr(item, step), rest)})


@pytest.mark.parametrize("path", list(quantities(CONCRETE)), ids=str)
def test_every_number_counts(path: tuple[str | int, ...]) -> None:
    other = changed_at(CONCRETE, path)
    assert isinstance(other, Scenario)
    assert hashed(other) != hashed()


@pytest.mark.parametrize("path", list(quantities(NETWORK)), ids=str)
def test_every_number_of_the_network_counts(path: tuple[str | int, ...]) -> None:
    other = changed_at(NETWORK, path)
    assert isinstance(other, Network)
    assert hashed(network=other) != hashed()


@pytest.mark.parametrize("item", [i for i in CONCRETE.body if not isinstance(i, Doc | Tags)], ids=lambda i: i.kind)
def test_every_statement_counts(item: Item) -> None:
    assert hashed(with_body(*(other for other in CONCRETE.body if other is not item))) != hashed()


def test_name_and_doc_of_a_network_do_not_count() -> None:
    body = tuple(item for item in NETWORK.body if not isinstance(item, Doc))
    assert hashed(network=Network(name="other", body=body)) == hashed()


def test_of_a_foreign_network_the_bytes_count(tmp_path: Path) -> None:
    one, same, other = (tmp_path / name for name in ("a.net.xml", "b.net.xml", "c.net.xml"))
    one.write_text("<net/>")
    same.write_text("<net/>")
    other.write_text("<net> </net>")
    assert hashed(network=one) == hashed(network=same) != hashed(network=other)
    before = hashed(network=one)
    one.write_text("<net version='2'/>")
    assert hashed(network=one) != before


def test_only_models_that_are_named_count() -> None:
    assert models_named(CONCRETE) == {"car.sedan", "car.compact", "pedestrian.adult", "van.delivery"}
    longer = {name: model(name, q("9 m"), source="ours") for name in MODELS}
    unused = MODELS | {"car.sports": longer["car.sports"]}
    assert meaning_hash(CONCRETE, NETWORK, unused) == hashed()
    for name in models_named(CONCRETE):
        assert meaning_hash(CONCRETE, NETWORK, MODELS | {name: longer[name]}) != hashed()


def test_the_source_of_a_model_does_not_count() -> None:
    other = MODELS["car.sedan"].model_copy(update={"source": "a brochure"})
    assert meaning_hash(CONCRETE, NETWORK, MODELS | {"car.sedan": other}) == hashed()


def test_a_clips_pin() -> None:
    parent = example_case(CONCRETE)
    clip = clip_of(parent.meaning)
    pin = clip_pin(clip, parent.meaning)
    silent = tuple(item for item in clip.body if not isinstance(item, Risk | Fidelity))
    assert clip_pin(clip_of(parent.meaning, name="other", body=(*silent, Doc(text="Hello."))), parent.meaning) == pin
    assert clip_pin(clip, "sha256:000000000000") != pin
    for index in range(len(silent)):
        less = clip_of(parent.meaning, body=silent[:index] + silent[index + 1 :])
        assert clip_pin(less, parent.meaning) != pin
    assert pin_of(expand_clip(clip, parent, source=Path("clip.foresee"))) == pin
    assert pin_of(parent) == parent.meaning


def test_same_value() -> None:
    assert same_value(q("1.5 s"), q("1500 ms"))
    assert not same_value(q("1 s"), q("1 m"))
    assert same_value(point("1", "2"), point("1.0", "2.00"))
    assert same_value("car.sedan", "car.sedan")
    assert not same_value(Quantity(value=Decimal("0.12")), Quantity(value=Decimal("0.13")))
