"""Signal programs: what is written, what is read back, and what SUMO shows."""

from pathlib import Path

import pytest

from foresee_dsl.compile.nets.net_reader import read_net, topology_of
from foresee_dsl.compile.nets.signals import ALL_RED_S, AMBER_S, PEDESTRIAN_CLEARANCE_S, links_of
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import Network
from tests.support.sumo_run import drive_everywhere
from tests.support.worlds import ends_of, four_arms, junction, net_of, net_root, read_signals, road, stage, t_junction

TOWN03 = Path(__file__).parents[3] / "shared" / "data" / "carla" / "maps" / "net" / "Town03.net.xml"


@pytest.fixture(scope="module")
def net():
    return net_of(four_arms())


@pytest.fixture(scope="module")
def signal(net):
    return read_signals(net, four_arms())["j4"]


@pytest.fixture(scope="module")
def links(net):
    return {(link.edge or link.crosses[0], link.direction): link for link in links_of(topology_of(net_root(net)), "j4")}


def letters(signal, links, phase):
    return {key: signal.phases[phase].state[link.index] for key, link in links.items()}


def test_every_stage_is_green_then_amber_then_all_red(signal):
    assert signal.stages == ("ns_go", "ew_go")
    for k, name in enumerate(signal.stages):
        walk, clear, amber, red = (p for p in signal.phases if p.stage == k)
        assert walk.duration_s + clear.duration_s == 25
        assert clear.duration_s == PEDESTRIAN_CLEARANCE_S
        assert (amber.duration_s, red.duration_s) == (AMBER_S, ALL_RED_S) == (3, 2)
        assert [p.since_stage_s for p in (walk, clear, amber, red)] == [0, 20, 25, 28]
        assert set(red.state) == {"r"}
        assert signal.phase_at(name, 26.0) == (4 * k + 2, 2.0)


def test_who_goes_in_a_stage(signal, links):
    shown = letters(signal, links, 0)
    assert {shown[arm, "s"] for arm in ("north", "south")} == {"G"}
    assert {shown[arm, turn] for arm in ("north", "south") for turn in "lr"} == {"g"}  # oncoming cars, people
    assert {shown[arm, turn] for arm in ("east", "west") for turn in "lsr"} == {"r"}
    assert {shown[f"{arm}_back", ""] for arm in ("north", "south")} == {"r"}
    assert {shown[f"{arm}_back", ""] for arm in ("east", "west")} == {"G"}


def test_people_stop_before_the_cars_do(signal, links):
    before, after = letters(signal, links, 0), letters(signal, links, 1)
    assert {key for key in before if before[key] != after[key]} == {("east_back", ""), ("west_back", "")}
    amber = letters(signal, links, 2)
    assert {key for key, letter in amber.items() if letter == "y"} == {
        (a, t) for a in ("north", "south") for t in "lsr"
    }


def test_a_turn_with_nobody_against_it_need_not_yield():
    ends = ends_of("north", "east", "south", "west")
    stages = [stage(name, 12, name) for name in ("north", "east", "south", "west")]
    roads = [road(name, f"{name}_end", "j4") for name in ("north", "east", "south", "west")]
    network = Network(name="n", body=(junction("j4", 0, 0, *stages), *ends, *roads))
    net = net_of(network)
    phases = read_signals(net, network)["j4"].phases
    assert len(phases) == 12  # no people: each stage is green, amber, all red
    for phase in phases[::3]:
        assert sorted(phase.state) == ["G"] * 3 + ["r"] * 9


def test_the_stem_of_a_t_junction_yields_to_people_and_has_its_own_crossing_red():
    network = t_junction()
    net = net_of(network)
    signal = read_signals(net, network)["j4"]
    links = {(k.edge or k.crosses[0], k.direction): k for k in links_of(read_net(net), "j4")}
    stem = letters(signal, links, 4)
    assert {key: c for key, c in stem.items() if c != "r"} == {
        ("south", "l"): "g",
        ("south", "r"): "g",
        ("west_back", ""): "G",
        ("east_back", ""): "G",
    }


def test_two_roads_that_cross_may_be_green_together_and_one_yields():
    network = four_arms()
    middle = network.body[0].model_copy(update={"stages": (stage("all", 30, "north", "east", "south", "west"),)})
    network = network.model_copy(update={"body": (middle, *network.body[1:])})
    net = net_of(network)
    green, *_ = read_signals(net, network)["j4"].phases
    assert green.state.count("r") == 4  # the crossings
    assert 0 < green.state.count("g") < 12


def test_a_short_stage_gives_people_half_of_it():
    network = t_junction()
    stages = (stage("main", 6, "west", "east"), stage("stem", 15, "south"))
    middle = network.body[0].model_copy(update={"stages": stages})
    network = network.model_copy(update={"body": (middle, *network.body[1:])})
    net = net_of(network)
    phases = read_signals(net, network)["j4"].phases
    assert [p.duration_s for p in phases[:4]] == [3, 3, 3, 2]


def test_sumo_shows_the_program_and_nobody_collides_in_dense_traffic(tmp_path, net, signal):
    seen = drive_everywhere(four_arms(), net, tmp_path, seconds=125, period=8, walkers=True)
    assert seen["collisions"] == []
    assert seen["states"]["j4"] == [p.state for p in (*signal.phases, *signal.phases)] + [signal.phases[0].state]
    assert {v.partition("-")[0] for v in seen["arrived"]} == {"north", "east", "south", "west"}


def test_such_a_run_would_notice_cars_that_do_not_yield(tmp_path, net, signal):
    text = net.read_text()
    for phase in signal.phases:
        text = text.replace(f'state="{phase.state}"', f'state="{"G" * len(phase.state)}"')
    (tmp_path / "bad.net.xml").write_text(text)
    bad = tmp_path / "bad.net.xml"
    seen = drive_everywhere(four_arms(), bad, tmp_path, seconds=60, period=8, walkers=True, reckless=True)
    assert seen["collisions"]


@pytest.mark.parametrize("network", [four_arms(), four_arms(back=2), t_junction()], ids=["four", "wide", "t"])
def test_no_two_movements_that_conflict_both_have_the_right_of_way(network):
    net = net_of(network)
    links = links_of(read_net(net), "j4")
    for phase in read_signals(net, network)["j4"].phases:
        first = {link.index for link in links if phase.state[link.index] == "G"}
        assert not [(link.index, link.foes & first) for link in links if link.index in first and link.foes & first]


def test_a_net_of_something_else_is_noticed(net):
    other = four_arms()
    middle = other.body[0].model_copy(update={"stages": (stage("other", 25, "north"),)})
    with pytest.raises(CompileError, match="stages of junction j4"):
        read_signals(net, other.model_copy(update={"body": (middle, *other.body[1:])}))


def test_every_phase_of_a_foreign_net_is_a_stage(net):
    signal = read_signals(net, None)["j4"]
    assert signal.stages == tuple(f"phase_{k}" for k in range(8))
    assert [p.stage for p in signal.phases] == list(range(8))
    assert {p.since_stage_s for p in signal.phases} == {0.0}


@pytest.mark.skipif(not TOWN03.exists(), reason="the CARLA maps are not beside this repository")
def test_signals_of_a_town():
    signals = read_signals(TOWN03, None)
    assert len(signals) == 11
    assert all(len(signal.stages) == len(signal.phases) > 1 for signal in signals.values())
