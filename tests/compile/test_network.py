"""Networks of the language, built by the real netconvert and driven in the real SUMO."""

import math
from pathlib import Path

import pytest

from foresee_dsl.compile.nets.netconvert import run_netconvert, tool_version, without_header
from foresee_dsl.compile.nets.network_builder import build_network
from foresee_dsl.errors import CompileError
from foresee_dsl.files import data_folder
from foresee_dsl.language.model import Doc, Network, Ref
from foresee_dsl.language.parser import parse
from foresee_dsl.language.streets.lines import shift_right
from tests.support.sumo_run import dead_ends, drive_everywhere
from tests.support.worlds import four_arms, junction, lanes_of, net_of, net_root, road, shape, stage, t_junction


@pytest.fixture(scope="module")
def root():
    return net_root(net_of(four_arms()))


def two_ends(*roads):
    return Network(name="n", body=(junction("a", 0, 0), junction("b", 200, 0), *roads))


def build(network):
    return net_root(net_of(network))


def turns(root, edge):
    """(lane, direction) of an edge's movements, sidewalks left out."""
    found = [c for c in root.iterfind(f"connection[@from='{edge}']") if not c.get("to").startswith(":")]
    return {(int(c.get("fromLane")), c.get("dir")) for c in found}


def test_roads_become_edges_with_the_names_of_the_language(root):
    edges = {e.get("id"): (e.get("from"), e.get("to")) for e in root.iterfind("edge") if "function" not in e.attrib}
    assert edges["west"] == ("west_end", "j4")
    assert edges["west_back"] == ("j4", "west_end")
    assert len(edges) == 8
    junctions = {j.get("id") for j in root.iterfind("junction") if j.get("type") != "internal"}
    assert junctions == {"j4", "north_end", "east_end", "south_end", "west_end"}


def test_lanes_have_the_widths_speeds_and_permissions_that_were_asked_for(root):
    sidewalk, right, left = lanes_of(root, "west")
    assert (sidewalk.get("allow"), sidewalk.get("width")) == ("pedestrian", "2.000")
    for lane in (right, left):
        assert lane.get("width") == "3.300"
        assert "pedestrian" in lane.get("disallow").split()
        assert "bicycle" not in lane.get("disallow").split()
        assert float(lane.get("speed")) == pytest.approx(50 / 3.6, abs=1e-3)
    assert len(lanes_of(root, "west_back")) == 2


def test_traffic_drives_on_the_right_at_the_coordinates_of_the_file(root):
    x_north = [x for x, _ in shape(lanes_of(root, "north")[1])]
    assert x_north == pytest.approx([-1.65] * len(x_north))  # southbound: west of the middle
    y_east = [y for _, y in shape(lanes_of(root, "east")[1])]
    assert y_east == pytest.approx([1.65] * len(y_east))
    assert root.find("location").get("netOffset") == "0.000,0.000"


def test_a_median_keeps_the_directions_apart(root):
    # At x = -60 the road passes through (-60, 2): half of the 1 m median, then half a lane, on either side.
    westbound = min(shape(lanes_of(root, "west_back")[1]), key=lambda p: abs(p[0] + 60))
    eastbound = min(shape(lanes_of(root, "west")[2]), key=lambda p: abs(p[0] + 60))
    assert westbound[1] - 2 == pytest.approx(0.5 + 1.65, abs=0.01)
    assert 2 - eastbound[1] == pytest.approx(0.5 + 1.65, abs=0.01)


def test_lanes_turn_where_their_side_lets_them(root):
    assert turns(root, "north") == {(1, "r"), (1, "s"), (1, "l")}
    wide = build(four_arms(back=2))  # two lanes into the junction, one lane straight on, two back
    assert turns(wide, "west") == {(1, "r"), (1, "s"), (2, "l")}
    t = build(t_junction())
    assert turns(t, "west") == {(1, "r"), (1, "s"), (2, "s")}
    assert turns(t, "east") == {(1, "s"), (2, "s"), (2, "l")}


def test_traffic_turns_round_at_dead_ends_only(root):
    around = {c.get("from") for c in root.iterfind("connection[@dir='t']") if c.get("from")[0] != ":"}
    assert around == {"north_back", "east_back", "south_back", "west_back"}


def test_crossings_lie_over_every_road_with_a_sidewalk(root):
    over = {frozenset(e.get("crossingEdges").split()) for e in root.iterfind("edge[@function='crossing']")}
    assert over == {frozenset({name, f"{name}_back"}) for name in ("north", "east", "south", "west")}
    bare = build(four_arms(sidewalk=0))
    crossed = {
        e.get("crossingEdges").split()[0].removesuffix("_back") for e in bare.iterfind("edge[@function='crossing']")
    }
    assert crossed == {"north", "east", "south"}
    assert len(lanes_of(bare, "west")) == 2


def test_a_one_way_road_lies_on_its_line_and_has_no_way_back():
    root = build(two_ends(road("main", "a", "b", lanes=2, back=0)))
    lanes = [shape(lane) for lane in lanes_of(root, "main")]
    assert [line[0][1] for line in lanes] == pytest.approx([-1.65, 1.65])
    assert not lanes_of(root, "main_back")


def test_defaults():
    root = build(two_ends(road("main", "a", "b")))
    (lane,) = lanes_of(root, "main")
    assert (lane.get("width"), lane.get("speed")) == ("3.300", "13.889")
    assert len(lanes_of(root, "main_back")) == 1


@pytest.mark.parametrize(
    ("control", "kind"),
    [("priority", "priority"), ("right_before_left", "right_before_left"), ("stop", "allway_stop")],
)
def test_control_without_signals(control, kind):
    root = build(t_junction(control))
    assert root.find("junction[@id='j4']").get("type") == kind
    assert root.find("tlLogic") is None


def test_the_wider_or_faster_road_goes_first():
    def state(network, edge):
        root = build(network)
        return {c.get("state") for c in root.iterfind(f"connection[@from='{edge}'][@dir='s']") if c.get("to")[0] != ":"}

    def crossroads(north_south, east_west):
        ends = [junction("n", 0, 90), junction("e", 90, 0), junction("s", 0, -90), junction("w", -90, 0)]
        roads = [road(f"r{k}", k, "j", **north_south) for k in "ns"] + [
            road(f"r{k}", k, "j", **east_west) for k in "ew"
        ]
        return Network(name="x", body=(junction("j", 0, 0), *ends, *roads))

    slow_fast = crossroads({"speed": 40}, {"speed": 50})
    assert state(slow_fast, "re") == state(slow_fast, "rw") == {"M"}
    assert state(slow_fast, "rn") == state(slow_fast, "rs") == {"m"}
    wide_narrow = crossroads({"lanes": 2}, {"lanes": 1})
    assert state(wide_narrow, "rn") == {"M"}
    assert state(wide_narrow, "re") == {"m"}


def read(path):
    return parse(path.read_text(encoding="utf-8"), str(path)).model


def test_the_crossroads_of_the_language_s_cases_is_the_one_that_these_tests_build():
    network = read(Path(__file__).parents[1] / "cases" / "language" / "four_arms.foresee")
    assert tuple(item for item in network.body if not isinstance(item, Doc)) == four_arms().body


@pytest.mark.parametrize(
    "network",
    [four_arms(), t_junction("priority"), t_junction("stop"), t_junction("right_before_left")],
    ids=["signals", "priority", "stop", "right_before_left"],
)
def test_cars_and_people_get_from_everywhere_to_everywhere_without_touching(tmp_path, network):
    net = net_of(network)
    seen = drive_everywhere(network, net, tmp_path, seconds=300, period=50, walkers=True)
    arms = dead_ends(network)
    ways = {f"{a}-{b}" for a in arms for b in arms if a != b}
    assert seen["collisions"] == []
    assert {v.partition(".")[0] for v in seen["arrived"]} == ways
    assert seen["walked"] == sorted(way.replace("-", "~") for way in ways)
    assert seen["still"] == 0  # nobody is stuck


def test_no_car_gets_stuck_in_the_bundled_town(tmp_path):
    network = read(data_folder("scenarios") / "networks" / "town.foresee")
    seen = drive_everywhere(network, net_of(network), tmp_path, seconds=400, period=90, walkers=True)
    arms = dead_ends(network)
    ways = {f"{a}-{b}" for a in arms for b in arms if a != b}
    assert {v.partition(".")[0] for v in seen["arrived"]} == ways
    assert seen["still"] == 0
    # What is left is SUMO's own: when people have kept a right turn waiting, it now and then starts beside a left turn
    # into the same road, and neither brakes in time. Nobody whose ways cross may touch.
    ends = [tuple(vehicle.partition(".")[0].partition("-")[2] for vehicle in pair) for *pair, _ in seen["collisions"]]
    assert [pair for pair in ends if pair[0] != pair[1]] == []


@pytest.mark.parametrize(
    ("network", "words"),
    [
        (two_ends(), "no roads"),
        (two_ends(road("main", "a", "c")), "names the junction c"),
        (two_ends(road("main", "a", "b", lanes=0)), "at least one lane"),
        (two_ends(road("main", "a", "b"), road("main_back", "b", "a", back=0)), "the edge main_back"),
        (two_ends(road("main", "a", "b", via=[(200, 0)], median=1)), "twice in a row"),
        (two_ends(road("main", "a", "b").model_copy(update={"lanes": Ref(name="n")})), "the parameter in `n`"),
    ],
)
def test_networks_that_cannot_be_built_are_refused(tmp_path, network, words):
    with pytest.raises(CompileError, match=words):
        build_network(network, tmp_path / "n.net.xml")
    assert not (tmp_path / "n.net.xml").exists()


def test_a_signal_that_names_a_road_elsewhere_is_refused(tmp_path):
    network = t_junction()
    middle = network.body[0].model_copy(update={"stages": (stage("main", 20, "west", "north"),)})
    with pytest.raises(CompileError, match=r"stage main of junction j4 gives green to north.*east, south, west"):
        build_network(network.model_copy(update={"body": (middle, *network.body[1:])}), tmp_path / "n.net.xml")


def test_netconvert_speaks_for_itself(tmp_path):
    with pytest.raises(CompileError, match=r"netconvert refused the network: .*missing\.nod\.xml"):
        run_netconvert(["--node-files", "missing.nod.xml", "--output-file", "n.net.xml"], tmp_path)


def test_the_version_is_that_of_the_program(tmp_path):
    run_netconvert(["-s", str(net_of(two_ends(road("main", "a", "b")))), "-o", "again.net.xml"], tmp_path)
    assert f"netconvert {tool_version()}".encode() in (tmp_path / "again.net.xml").read_bytes()


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        (
            b"<?xml version='1.0'?>\n<!-- a > b -->\n\n<!--c-->\n<net><!-- in --></net>",
            b"<?xml version='1.0'?>\n<net><!-- in --></net>",
        ),
        (b"<!-- a --><net/>", b"\n<net/>"),
        (b"<net/>", b"<net/>"),
    ],
)
def test_only_the_comments_in_front_are_cut(text, kept):
    assert without_header(text) == kept


def test_a_shifted_corner_keeps_its_distance_to_both_sides():
    corner = shift_right([(0, 0), (10, 0), (10, 10)], 2)
    assert corner == [(0, -2), (12, -2), (12, 10)]
    assert shift_right([(0, 0), (3, 4)], 0) == [(0, 0), (3, 4)]
    (x0, y0), (x1, y1) = shift_right([(0, 0), (3, 4)], 5)
    assert math.isclose(x0, 4) and math.isclose(y0, -3) and math.isclose(x1, 7) and math.isclose(y1, 1)
