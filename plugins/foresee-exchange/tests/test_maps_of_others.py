"""What other tools write into their maps: each is imported, and `idm` arrives on it."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import SubElement

import pytest
from foresee_exchange.maps import opendrive, osm, sumo
from foresee_exchange.maps.osm import crossings_of, drives_on_the_left, read_osm

from foresee_dsl.compile import placement_mistakes
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_net
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_cases
from tests.support.foreign_maps import net, road
from tests.support.foreign_maps import opendrive as xodr

TOWN = Path(__file__).parent / "small_town.osm"
SIGNAL = '<signals><signal s="5" t="-4" id="9" name="" dynamic="no" orientation="+" type="" subtype=""/></signals>'


def direct_junction() -> str:
    """A motorway that splits: one lane goes on, the other leads off, without connecting roads."""
    to_junction = '<successor elementType="junction" elementId="7"/>'
    back = '<predecessor elementType="junction" elementId="7"/>'
    links = [
        f'<connection id="{k}" incomingRoad="1" linkedRoad="{other}" contactPoint="start">'
        f'<laneLink from="{lane}" to="-1"/></connection>'
        for k, (other, lane) in enumerate([("2", -1), ("3", -2)])
    ]
    second = road(id="3", x=60, links=back, more="").replace('y="0" hdg="0"', 'y="-3.5" hdg="-0.05"')
    junction = f'<junction id="7" name="" type="direct">{"".join(links)}</junction>'
    return xodr(road(links=to_junction, right=2), road(id="2", x=60, links=back), second, junction)


MAPS = {
    "a namespace": xodr(road(), namespace=' xmlns="http://code.asam.net/simulation/standard/opendrive_schema"'),
    "empty types of signals": xodr(road(more=SIGNAL)),
    "an arc that is straight": xodr(road(piece='<arc curvature="0.0"/>')),
    "a spiral that is an arc": xodr(road(piece='<spiral curvStart="0.01" curvEnd="0.01"/>')),
    "a piece of road of 10 m": xodr(road(length=10)),
    "a direct junction": direct_junction(),
}


@pytest.mark.parametrize("name", MAPS)
def test_an_odd_map_is_imported_and_idm_arrives(tmp_path: Path, name: str) -> None:
    (tmp_path / "map.xodr").write_text(MAPS[name])
    done = opendrive.run(tmp_path / "map.xodr", out=tmp_path / "out")
    assert [file.name for file in done.files] == ["map.foresee", "map.xodr"]
    assert not any("does not arrive" in note for note in done.notes), done.notes


def test_traffic_that_keeps_to_the_left_stays_there(tmp_path: Path) -> None:
    (tmp_path / "map.xodr").write_text(xodr(road(attributes='rule="LHT"', left=1)))
    done = opendrive.run(tmp_path / "map.xodr", out=tmp_path / "out")
    assert "traffic keeps to the left" in done.notes
    made = read_net(foreign_net(tmp_path / "map.xodr"))
    assert made.left_hand
    sides = {
        edge.lanes[0].shape[0][0] < edge.lanes[0].shape[-1][0]: edge.lanes[0].shape[0][1]
        for edge in made.edges.values()
    }
    assert sides == {True: pytest.approx(1.75), False: pytest.approx(-1.75)}  # to the east on the northern side
    assert not any("does not arrive" in note for note in done.notes)


def test_a_map_with_both_sides_is_refused(tmp_path: Path) -> None:
    (tmp_path / "map.xodr").write_text(xodr(road(attributes='rule="LHT"'), road(id="2", x=100)))
    with pytest.raises(ForeseeError, match=r"1 roads with traffic on the left .* and 1 with traffic on the right"):
        opendrive.run(tmp_path / "map.xodr", out=tmp_path / "out")


def test_packed_files_are_the_same_maps(tmp_path: Path) -> None:
    (tmp_path / "town.net.xml.gz").write_bytes(gzip.compress(net().encode()))
    done = sumo.run(tmp_path / "town.net.xml.gz", out=tmp_path / "out")
    assert [file.name for file in done.files] == ["town.foresee", "town.net.xml"]
    assert (tmp_path / "out" / "town.net.xml").read_text() == net()
    (tmp_path / "bomb.osm.gz").write_bytes(gzip.compress(b"<osm>" + (b"<n/>" + b" " * 1_000_000) * 101))
    with pytest.raises(ForeseeError, match="more than 100 MB when it is unpacked"):
        osm.run(tmp_path / "bomb.osm.gz", out=tmp_path / "out")


def test_pbf_files_hold_the_same_map(tmp_path: Path) -> None:
    osmium: Any = pytest.importorskip("osmium")
    with osmium.SimpleWriter(str(tmp_path / "town.osm.pbf")) as writer:
        for thing in osmium.FileProcessor(str(TOWN)):
            writer.add(thing)
    plain, packed = (
        [(e.tag, e.get("id"), e.get("ref"), e.get("k"), e.get("v")) for e in read_osm(file).iter() if e.tag != "bounds"]
        for file in (TOWN, tmp_path / "town.osm.pbf")
    )
    assert packed == plain
    (tmp_path / "bad.osm.pbf").write_bytes(b"no such thing")
    with pytest.raises(ForeseeError, match="in PBF, or a damaged one"):
        read_osm(tmp_path / "bad.osm.pbf")


def test_an_extract_says_or_shows_on_which_side_its_traffic_drives(tmp_path: Path) -> None:
    assert not drives_on_the_left(read_osm(TOWN))  # Munich
    text = TOWN.read_text()
    for change in (
        lambda: text.replace('<tag k="highway"', '<tag k="driving_side" v="left"/><tag k="highway"', 1),
        lambda: text.replace('lat="48.', 'lat="51.').replace('lon="11.', 'lon="-0.'),  # London
    ):
        (tmp_path / "town.osm").write_text(change())
        assert drives_on_the_left(read_osm(tmp_path / "town.osm"))


def test_crossings_of_an_extract_are_found_at_their_junctions(tmp_path: Path) -> None:
    """Used where netconvert dies of putting them; here 18 m before and behind a junction in each direction."""
    osm.run(TOWN, out=tmp_path)
    made = replace(read_net(foreign_net(tmp_path / "small_town.net.xml")), crossings={})
    root = read_osm(TOWN)
    node = next(node for node in root.iterfind("node") if node.get("id") == "103")
    lon, lat = float(node.get("lon", "")), float(node.get("lat", ""))
    for k, (east_m, north_m) in enumerate([(18, 0), (-18, 0), (0, 18), (0, -18)]):
        place = {"lon": f"{lon + east_m / 74_500:.7f}", "lat": f"{lat + north_m / 111_200:.7f}"}
        SubElement(SubElement(root, "node", {"id": f"900{k}", **place}), "tag", {"k": "highway", "v": "crossing"})
    wanted = crossings_of(root, made)
    assert wanted is not None
    assert wanted.count(b'node="103"') >= 3


def test_a_starter_that_cannot_be_placed_is_found_without_a_run(tmp_path: Path) -> None:
    (tmp_path / "map.xodr").write_text(xodr(road()))
    starter = opendrive.run(tmp_path / "map.xodr", out=tmp_path / "out").files[0]
    assert placement_mistakes(load_test_cases([str(starter)])) == ()
    (tmp_path / "out" / "map.xodr").write_text(xodr(road(length=10)))
    (found,) = placement_mistakes(load_test_cases([str(starter)]))
    assert found.code == "FS252" and found.span is not None
