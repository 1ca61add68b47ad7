"""Extracts of OpenStreetMap and SUMO nets become a network and a scenario that runs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from foresee_exchange.maps import osm, sumo
from typer.testing import CliRunner

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.cli import app
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.nets.netconvert import sumo_home
from foresee_dsl.errors import ForeseeError
from foresee_dsl.exchange.outcome import ExchangeError, Imported
from foresee_dsl.language.model import AlongEdge, Ego, GoalAt, StartAt
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict

TOWN = Path(__file__).parent / "small_town.osm"


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> tuple[Imported, Path]:
    out = tmp_path_factory.mktemp("town")
    return osm.run(TOWN, out=out), out


def test_a_town_has_its_signal_its_roundabout_and_its_one_way_street(town: tuple[Imported, Path]) -> None:
    done, out = town
    assert done.taken == {"edges for cars": 16, "junctions": 9, "signals": 1, "crossings": 10}
    assert done.left_out == {
        "outlines and lines: building": 1,
        "ways for others: footway": 1,
        "signs and stops: bus_stop": 1,
        "signs and stops: give_way": 1,
        "relations: route": 1,
    }
    net = out / "small_town.net.xml"
    roads = read_network(foreign_net(net))
    ring = [edge for edge in roads.edges if edge.startswith("202#")]
    assert len(ring) == 3
    assert "-205" not in roads.edges  # one way
    assert {m.direction for m in roads.movements_from("204")}.isdisjoint({"l"})  # no left turn, says the relation
    for movement in roads.movements:
        if movement.to_edge in ring and movement.from_edge not in ring:
            others = [m for m in roads.movements_at(movement.junction) if m.from_edge in ring]
            junction = roads.junctions[movement.junction]
            cars = "car" in movement.kinds and movement.index >= 0
            assert not cars or any(junction.yields(movement.index, m.index) for m in others)  # the ring goes first
    assert 8.2 < min(lane.speed_mps for lane in roads.edges["205"].lanes) < 8.4  # 30 km/h


def test_the_starter_crosses_the_signal_and_drivers_arrive(town: tuple[Imported, Path]) -> None:
    _, out = town
    file = out / "small_town.foresee"
    case = load_test_case(file)
    ego = case.scenario.first(Ego)
    assert ego is not None
    places = [item.place for item in ego.body if isinstance(item, StartAt | GoalAt)]
    assert all(isinstance(place, AlongEdge) for place in places)
    scene = compile_test_case(case).scene
    assert 150 <= scene.goal_s - scene.start_s <= 430  # with what lies inside junctions
    line = scene.ego.line
    assert line is not None
    assert [p.junction for p in line.passages if p.signal and p.entry_s < scene.goal_s] == ["103"]
    result = run_test_case(case, "idm", 0)
    assert result.verdict is Verdict.PASS
    assert "arrived" in result.reason
    assert len(result.trace.actors) > 8


def test_the_same_extract_gives_the_same_files(town: tuple[Imported, Path], tmp_path: Path) -> None:
    osm.run(TOWN, out=tmp_path)
    for file in town[0].files:
        assert (tmp_path / file.name).read_bytes() == file.read_bytes()


def test_a_sumo_net_is_taken_as_it_is(town: tuple[Imported, Path], tmp_path: Path) -> None:
    net = town[1] / "small_town.net.xml"
    (tmp_path / "in").mkdir()
    copy = tmp_path / "in" / "My Net.net.xml"
    copy.write_bytes(net.read_bytes().replace(b'type="static"', b'type="actuated"'))
    done = sumo.run(copy, out=tmp_path / "out")
    assert [written.name for written in done.files] == ["my_net.foresee", "my_net.net.xml"]
    assert done.left_out == {"signal programs that react to traffic (driven with fixed times)": 1}
    assert run_test_case(load_test_case(tmp_path / "out" / "my_net.foresee"), "idm", 0).verdict is Verdict.PASS


def test_a_net_whose_signals_react_is_used_directly(town: tuple[Imported, Path], tmp_path: Path) -> None:
    """SUMO cannot begin a run in the middle of such a program; `use network` makes it one of fixed times."""
    net = (town[1] / "small_town.net.xml").read_bytes().replace(b'type="static"', b'type="actuated"')
    assert b"actuated" in net
    (tmp_path / "small_town.net.xml").write_bytes(net)
    (tmp_path / "x.foresee").write_bytes((town[1] / "small_town.foresee").read_bytes())
    assert run_test_case(load_test_case(tmp_path / "x.foresee"), "idm", 0).verdict is Verdict.PASS


def test_the_command_says_what_it_did(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["import", "osm", str(TOWN), "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert "16 edges for cars" in result.stdout
    assert "1 ways for others: footway" in result.stdout


def test_a_netconvert_that_dies_of_the_maps_crossings_is_said_and_started_again(tmp_path: Path) -> None:
    """As 1.28 does on some extracts; here one that dies of the option."""
    real, packages = sumo_home(), tmp_path / "packages"
    (packages / "sumo" / "bin").mkdir(parents=True)
    for folder, within in ((real, packages / "sumo"), (real / "bin", packages / "sumo" / "bin")):
        for entry in folder.iterdir():
            if entry.name not in ("bin", "netconvert"):
                (within / entry.name).symlink_to(entry)
    for entry in real.parent.glob("eclipse_sumo-*.dist-info"):
        (packages / entry.name).symlink_to(entry)
    program = packages / "sumo" / "bin" / "netconvert"
    dies = 'for word in "$@"; do [ "$word" = --osm.crossings ] && kill -SEGV $$; done'
    program.write_text(f'#!/bin/sh\n{dies}\nexec {real}/bin/netconvert "$@"\n')
    program.chmod(0o755)
    command = [sys.executable, "-m", "foresee_dsl", "import", "osm", TOWN, "--out", tmp_path / "out"]
    environment = {**os.environ, "PYTHONPATH": str(packages), "COLUMNS": "400"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "while it added the map's crossings" in done.stdout
    assert (tmp_path / "out" / "small_town.net.xml").is_file()


def _text(change: Callable[[str], str]) -> bytes:
    return change(TOWN.read_text()).encode()


BAD_MAPS = {
    "truncated": (_text(lambda t: t[: len(t) // 2]), "a damaged one"),
    "a bomb": (
        b'<?xml version="1.0"?><!DOCTYPE o [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><osm>&b;</osm>',
        "declares entities",
    ),
    "another root": (b"<gpx/>", "its root is <gpx>"),
    "no text at all": (b"\x00\xff\x00", "a damaged one"),
    "no streets": (_text(lambda t: re.sub(r'k="highway"', 'k="was"', t)), "has no streets"),
    "ways for bicycles only": (
        _text(lambda t: re.sub(r'k="highway" v="(secondary|tertiary|residential)"', 'k="highway" v="cycleway"', t)),
        "no lanes for cars",
    ),
    "nothing to drive on": (
        _text(lambda t: t.replace('<nd ref="', '<nd ref="9')),  # nodes that it does not have
        "no street that leads anywhere",
    ),
}


@pytest.mark.parametrize("name", BAD_MAPS)
def test_bad_maps_are_refused_in_words_and_nothing_is_written(tmp_path: Path, name: str) -> None:
    data, said = BAD_MAPS[name]
    file = tmp_path / "bad.osm"
    file.write_bytes(data)
    with pytest.raises(ForeseeError) as caught:
        osm.run(file, out=tmp_path / "out")
    assert said in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<net/>", "not a complete SUMO network"),
        ("<net", "a damaged one"),
        ("<routes/>", "its root is <routes>"),
    ],
)
def test_bad_nets_are_refused_in_words_and_nothing_is_written(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "bad.net.xml"
    file.write_text(text)
    with pytest.raises(ExchangeError) as caught:
        sumo.run(file, out=tmp_path / "out")
    assert said in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_net_without_lanes_for_cars(town: tuple[Imported, Path], tmp_path: Path) -> None:
    file = tmp_path / "bad.net.xml"
    text = (town[1] / "small_town.net.xml").read_text()
    file.write_text(re.sub(r'(?:dis)?allow="[^"]*"', 'allow="pedestrian"', text))
    with pytest.raises(ExchangeError, match="no lanes for cars"):
        sumo.run(file, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
