"""The catalogue: defaults, refusals, and the models that ship."""

import math
from decimal import Decimal
from xml.etree import ElementTree

import pytest

from foresee_dsl.compile.catalogue import CLASS_DEFAULTS, cruise_speed, spec_of
from foresee_dsl.compile.sumo_files import types_of
from foresee_dsl.errors import CompileError
from foresee_dsl.files import data_folder
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.model import Quantity, Ref, VehicleModel
from foresee_dsl.language.parser import parse
from tests.support.sumo_run import run_sumo
from tests.support.worlds import four_arms, model, net_of, q

NEEDED = {
    "car": {"micro", "compact", "hatchback", "sedan", "wagon", "limousine", "suv", "sports", "electric", "pickup"},
    "van": {"small", "minibus", "delivery", "parcel"},
    "truck": {"light", "rigid", "single_unit", "three_axle"},
    "bus": {"midi", "city", "transit", "coach"},
    "motorcycle": {"moped", "scooter", "street", "touring"},
    "bicycle": {"child", "city", "racing", "pedelec", "speed_pedelec", "cargo"},
    "pedestrian": {
        *("adult", "hurried", "jogger", "child", "elderly"),
        *("walking_frame", "wheelchair", "pram", "luggage"),
    },
    "obstacle": {
        *("crate", "barrier", "bin", "skip"),
        *("parked_compact", "parked_car", "parked_suv", "parked_van", "parked_truck"),
    },
}
"""What scenarios may name; whoever takes one away breaks them."""
LARGEST_CIRCLE_M = {"car": 13.5, "van": 15.0, "truck": 24.0, "bus": 24.0, "motorcycle": 9.0, "bicycle": 6.0}
"""Of the front wheels' middle; lorries and buses must turn within 25 m (Directive 96/53/EC, annex I, 1.5)."""
LARGEST = {"car": (5.5, 2.0, 2.0), "van": (7.0, 2.2, 3.0), "truck": (12.0, 2.55, 4.0), "bus": (13.5, 2.6, 4.0)}
"""Length, width and height; lorries and buses: Directive 96/53/EC, annex I (AASHTO's bus is 4 cm wider)."""


@pytest.fixture(scope="module")
def bundled():
    path = data_folder("scenarios") / "models.foresee"
    catalogue = parse(path.read_text(encoding="utf-8"), str(path)).model
    assert (catalogue.kind, catalogue.name) == ("models", "standard")
    return {item.name: item for item in catalogue.body if isinstance(item, VehicleModel)}


@pytest.fixture(scope="module")
def specs(bundled):
    return {name: spec_of(item) for name, item in bundled.items()}


def test_the_bundled_catalogue_has_every_kind(bundled):
    assert {f"{kind}.{name}" for kind, names in NEEDED.items() for name in names} <= set(bundled)


def test_every_bundled_model_says_where_its_figures_come_from(bundled):
    assert [name for name, item in bundled.items() if not item.source] == []


def test_bundled_vehicles_are_complete_and_plausible(bundled, specs):
    for name, spec in specs.items():
        if spec.kind in ("pedestrian", "obstacle"):
            continue
        absent = [field for field, value in bundled[name] if value is None]
        assert absent in ([], ["cruise_speed"]), name
        assert (spec.cruise_mps is not None) == (spec.kind == "bicycle"), name
        circle_m = 2 * spec.wheelbase_m / math.sin(spec.max_steer_rad)
        assert circle_m < LARGEST_CIRCLE_M[spec.kind], name
        sizes = zip((spec.length_m, spec.width_m, spec.height_m), LARGEST.get(spec.kind, (3, 1, 2)), strict=True)
        assert all(size <= largest for size, largest in sizes), name
        parts = [getattr(bundled[name], part).si for part in ("front_overhang", "wheelbase", "rear_overhang")]
        assert sum(parts) == pytest.approx(spec.length_m, abs=0.005), name
        assert spec.rear_overhang_m == pytest.approx(parts[2], abs=0.005)
        assert 0.1 < spec.rear_overhang_m < 0.4 * spec.length_m, name
        assert spec.braking_mps2 < spec.emergency_braking_mps2 < 9.81, name


def test_members_of_a_class_differ_in_how_they_move(specs):
    for kind in ("car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian"):
        members = [spec for spec in specs.values() if spec.kind == kind]
        if kind == "pedestrian":
            assert len({spec.cruise_mps for spec in members}) == len(members)
        else:
            assert max(s.acceleration_mps2 for s in members) >= 1.25 * min(s.acceleration_mps2 for s in members), kind
        assert len({(spec.length_m, spec.width_m) for spec in members}) >= len(members) / 2


@pytest.mark.parametrize(
    ("given", "front_m", "wheelbase_m", "rear_m"),
    [
        ({}, 0.84, 2.562, 0.798),
        ({"rear_overhang": "0.90"}, 0.84, 2.46, 0.90),
        ({"rear_overhang": "0.90", "wheelbase": "2.50"}, 0.80, 2.50, 0.90),
        ({"rear_overhang": "0.90", "front_overhang": "0.70"}, 0.70, 2.60, 0.90),
        ({"rear_overhang": "0.90", "front_overhang": "0.80", "wheelbase": "2.51"}, 0.80, 2.51, 0.89),
    ],
)
def test_the_part_of_a_length_that_is_absent_is_what_the_others_leave(given, front_m, wheelbase_m, rear_m):
    spec = spec_of(model(**{name: q(value, "m") for name, value in given.items()}))
    found = (spec.front_overhang_m, spec.wheelbase_m, spec.rear_overhang_m)
    assert found == pytest.approx((front_m, wheelbase_m, rear_m), abs=1e-9)


def test_heights_and_cruise_speeds_take_the_default_of_the_class():
    assert (spec_of(model()).height_m, spec_of(model()).cruise_mps) == (1.5, None)
    assert spec_of(model("pedestrian.someone")).cruise_mps == 1.3
    assert spec_of(model("bicycle.some")).cruise_mps == pytest.approx(15 / 3.6)
    assert spec_of(model("bicycle.some", max_speed=q(3, "m/s"))).cruise_mps == 3
    tall = spec_of(model(height=q(2.1), cruise_speed=q(30, "km/h")))
    assert (tall.height_m, tall.cruise_mps) == (2.1, pytest.approx(30 / 3.6))


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (("front_overhang 0.9 m", "wheelbase 2.5 m", "rear_overhang 0.6 m"), "write `rear_overhang 0.80 m`"),
        (("front_overhang 0.9 m", "wheelbase 2.5 m", "rear_overhang 0.82 m"), "write `rear_overhang 0.80 m`"),
        (("front_overhang 0.9 m", "wheelbase 3.5 m"), "write `wheelbase 3.30 m`"),
        (("rear_overhang 4.5 m",), "write `rear_overhang 4.20 m`"),
        (("cruise_speed 50 km/h", "max_speed 40 km/h"), "use at most `40 km/h`"),
        (("braking 9 m/s^2", "emergency_braking 8 m/s^2"), "use at most `8 m/s^2`"),
    ],
)
def test_figures_that_contradict_each_other_are_reported_where_they_stand(lines, words):
    block = "\n".join(f"    {line}" for line in ("length 4.2 m", "width 1.8 m", *lines))
    document = parse(f"foresee 1\n\nmodels ours {{\n  model car.odd {{\n{block}\n  }}\n}}\n", "odd.foresee")
    (found,) = check_document(document)
    assert (found.code, words in found.help) == ("FS055", True), found
    assert found.span.line > 6


def test_overhangs_rounded_to_a_centimetre_are_no_mistake():
    sums = "front_overhang 1.22 m\n wheelbase 6.10 m\n rear_overhang 1.83 m"
    text = f"foresee 1\n\nmodels ours {{\n model truck.su {{\n length 9.14 m\n width 2.44 m\n {sums}\n }}\n}}\n"
    document = parse(text, "su.foresee")
    assert check_document(document) == ()
    (entry,) = document.model.body
    assert spec_of(entry).rear_overhang_m == pytest.approx(1.82)


def test_what_is_absent_takes_the_default_of_the_class():
    spec = spec_of(model())
    base = CLASS_DEFAULTS["car"]
    assert spec.wheelbase_m == pytest.approx(base.wheelbase_share * 4.2)
    assert spec.emergency_braking_mps2 == base.emergency_braking_mps2 == 9.0
    assert spec.max_steer_rad == pytest.approx(math.radians(35))


def test_what_is_given_is_taken_in_si():
    spec = spec_of(
        model(
            "bus.long", mass=q("12.5", "t"), max_speed=q(72, "km/h"), max_steer=q(45, "deg"), steer_rate=q(30, "deg/s")
        )
    )
    assert (spec.kind, spec.mass_kg, spec.max_speed_mps) == ("bus", 12500, pytest.approx(20))
    assert spec.max_steer_rad == pytest.approx(math.pi / 4)
    assert spec.steer_rate_rad_s == pytest.approx(math.pi / 6)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (model("plane.small"), "the class plane is not one of car, van"),
        (model(length=q(0)), "its length must be above zero"),
        (model(width=q(-1)), "its width must be above zero"),
        (model(wheelbase=q(4), front_overhang=q(0.5)), "longer than the vehicle"),
        (model(wheelbase=q(3), rear_overhang=q(2)), "rear overhang and wheelbase together are longer"),
        (model(wheelbase=q(3), front_overhang=q(1), rear_overhang=q(1)), "do not make up its length"),
        (model(height=q(0)), "its height must be above zero"),
        (model(cruise_speed=Ref(name="slow")), "the parameter in `slow`"),
        (model(emergency_braking=q(1, "m/s^2")), "weaker than its braking"),
        (model(max_steer=q(90, "deg")), "80 deg"),
        (model("pedestrian.ghost", max_speed=q(0, "m/s")), "its max_speed must be above zero"),
        (model(mass=Ref(name="heavy")), "the parameter in `heavy`"),
    ],
)
def test_models_that_cannot_be_are_refused(bad, words):
    with pytest.raises(CompileError, match=words):
        spec_of(bad)


def test_people_walk_and_cycle_at_their_pace_and_vehicles_at_the_limit(specs):
    limit = 50 / 3.6
    assert cruise_speed(specs["car.sedan"], limit) == limit
    assert cruise_speed(specs["motorcycle.moped"], limit) == specs["motorcycle.moped"].max_speed_mps < limit
    assert cruise_speed(specs["bicycle.city"], limit) == pytest.approx(15 / 3.6)
    assert cruise_speed(specs["bicycle.speed_pedelec"], 5.0) == 5.0
    paces = [cruise_speed(specs[f"pedestrian.{k}"], limit) for k in ("elderly", "child", "adult", "jogger")]
    assert paces == sorted(paces)
    assert paces[2] == 1.3
    assert cruise_speed(spec_of(model("pedestrian.slow", max_speed=q("0.5", "m/s"))), limit) == 0.5


def test_types_of_all_models_on_wheels_and_the_ghost(tmp_path, specs):
    (tmp_path / "types.add.xml").write_text(types_of([*specs.values(), *specs.values()]))
    types = {e.get("id"): e for e in ElementTree.parse(tmp_path / "types.add.xml").getroot()}
    on_wheels = {name for name, spec in specs.items() if spec.kind not in ("pedestrian", "obstacle")}
    assert set(types) == on_wheels | {"ghost"}
    assert [types[k].get("vClass") for k in ("car.suv", "van.minibus", "truck.rigid")] == [
        "passenger",
        "delivery",
        "truck",
    ]
    assert {e.get("sigma") for e in types.values()} == {e.get("speedDev") for e in types.values()} == {"0"}
    assert (types["car.sedan"].get("minGap"), types["bicycle.city"].get("minGap")) == ("2", "1")
    assert float(types["car.sedan"].get("maxSpeed")) == pytest.approx(specs["car.sedan"].max_speed_mps, abs=1e-3)
    assert (types["ghost"].get("length"), types["ghost"].get("width")) == ("0.5", "0.5")


def test_types_do_not_depend_on_the_order_of_the_models(tmp_path, specs):
    (tmp_path / "a.xml").write_text(types_of(specs.values()))
    (tmp_path / "b.xml").write_text(types_of(reversed(list(specs.values()))))
    assert (tmp_path / "a.xml").read_bytes() == (tmp_path / "b.xml").read_bytes()


def test_sumo_drives_every_type_over_the_junction(tmp_path, specs):
    net, types, routes = net_of(four_arms()), tmp_path / "types.add.xml", tmp_path / "r.rou.xml"
    types.write_text(types_of(specs.values()))
    names = [e.get("id") for e in ElementTree.parse(types).getroot()]
    rows = [
        f'<vehicle id="{n}" type="{n}" depart="{3 * k}"><route edges="south north_back"/></vehicle>'
        for k, n in enumerate(names)
    ]
    routes.write_text("<routes>" + "".join(rows) + "</routes>")
    seen = run_sumo(net, routes, 220, types)
    assert seen["arrived"] == sorted(names)
    assert seen["collisions"] == []


def test_quantities_of_the_bundled_file_have_no_more_digits_than_they_mean(bundled):
    numbers = [v.value for item in bundled.values() for _, v in item if isinstance(v, Quantity)]
    assert all(n == round(n, 2) and n >= Decimal(0) for n in numbers)
