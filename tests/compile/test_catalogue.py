"""The catalogue: defaults, refusals, and the models that ship."""

import math
from decimal import Decimal
from xml.etree import ElementTree

import pytest
from built_networks import four_arms, q, run_sumo

from foresee_dsl.compile.catalogue import CLASS_DEFAULTS, cruise_speed, spec_of
from foresee_dsl.compile.files import write_types
from foresee_dsl.compile.network import build_network
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import Quantity, Ref, VehicleModel
from foresee_dsl.language.parser import parse
from foresee_dsl.resources import data_folder

NEEDED = {
    "car": {"compact", "sedan", "suv", "sports", "wagon"},
    "van": {"delivery", "minibus"},
    "truck": {"rigid"},
    "bus": {"city"},
    "motorcycle": {"street", "scooter"},
    "bicycle": {"city", "racing", "cargo"},
    "pedestrian": {"adult", "child", "elderly", "jogger"},
    "obstacle": {"crate", "barrier", "parked_car"},
}


def model(name="car.plain", **values):
    return VehicleModel(name=name, **{"length": q(4.2), "width": q(1.8), **values})


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
        fields = ("wheelbase", "front_overhang", "mass", "max_speed", "acceleration", "braking", "emergency_braking")
        assert all(getattr(bundled[name], field) is not None for field in (*fields, "max_steer", "steer_rate"))
        circle_m = 2 * spec.wheelbase_m / math.sin(spec.max_steer_rad)  # of the outer front wheel's middle
        largest_m = {"bus": 22, "truck": 20}.get(spec.kind, 13.5)
        assert circle_m < largest_m, name
        rear_m = spec.length_m - spec.wheelbase_m - spec.front_overhang_m
        assert 0.1 < rear_m < 0.4 * spec.length_m, name
        assert spec.braking_mps2 < spec.emergency_braking_mps2 < 9.81, name


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
        (model("plane.small"), "the class plane is none of car, van"),
        (model(length=q(0)), "its length must be above zero"),
        (model(width=q(-1)), "its width must be above zero"),
        (model(wheelbase=q(4), front_overhang=q("0.5")), "longer than the vehicle"),
        (model(emergency_braking=q(1, "m/s^2")), "weaker than its braking"),
        (model(max_steer=q(90, "deg")), "80 deg"),
        (model("pedestrian.ghost", max_speed=q(0, "m/s")), "its max_speed must be above zero"),
        (model(mass=Ref(name="heavy")), "the parameter heavy"),
    ],
)
def test_models_that_cannot_be_are_refused(bad, words):
    with pytest.raises(CompileError, match=words):
        spec_of(bad)


def test_people_walk_at_their_pace_and_vehicles_at_the_limit(specs):
    limit = 50 / 3.6
    assert cruise_speed(specs["car.sedan"], limit) == limit
    assert cruise_speed(specs["bicycle.city"], limit) == specs["bicycle.city"].max_speed_mps < limit
    paces = [cruise_speed(specs[f"pedestrian.{k}"], limit) for k in ("elderly", "child", "adult", "jogger")]
    assert paces == sorted(paces)
    assert paces[2] == 1.3
    assert cruise_speed(spec_of(model("pedestrian.slow", max_speed=q("0.5", "m/s"))), limit) == 0.5


def test_types_of_all_models_on_wheels_and_the_ghost(tmp_path, specs):
    write_types([*specs.values(), *specs.values()], tmp_path / "types.add.xml")
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
    write_types(specs.values(), tmp_path / "a.xml")
    write_types(reversed(list(specs.values())), tmp_path / "b.xml")
    assert (tmp_path / "a.xml").read_bytes() == (tmp_path / "b.xml").read_bytes()


def test_sumo_drives_every_type_over_the_junction(tmp_path, specs):
    net, types, routes = (tmp_path / name for name in ("n.net.xml", "types.add.xml", "r.rou.xml"))
    build_network(four_arms(), net)
    write_types(specs.values(), types)
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
