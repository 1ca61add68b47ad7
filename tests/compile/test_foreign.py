"""Networks from outside: taken over as they are, or refused with a reason."""

from pathlib import Path

import pytest

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.network_builder import build_network
from foresee_dsl.errors import CompileError
from tests.support.worlds import four_arms, net_root

MAPS = Path(__file__).parents[3] / "shared" / "data" / "carla" / "maps"
NET = "<net><location netOffset='0,0'/><edge id='a'/></net>"
BOMB = "<!DOCTYPE net [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;'>]><net>&b;</net>"
LEAK = "<!DOCTYPE net [<!ENTITY x SYSTEM 'file:///etc/hostname'>]><net><edge id='&x;'/></net>"

needs_maps = pytest.mark.skipif(not MAPS.is_dir(), reason="the CARLA maps are not beside this repository")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path / "cache"))


def test_a_sumo_net_is_taken_as_it_is_without_the_comments_in_front(tmp_path):
    build_network(four_arms(), tmp_path / "built.net.xml")
    text = (tmp_path / "built.net.xml").read_bytes()
    own = tmp_path / "own.net.xml"
    own.write_bytes(text.replace(b"?>\n", b"?>\n\n<!-- made on some day\n<x> -->\n\n", 1))
    net = foreign_net(own)
    assert net.read_bytes() == text
    assert net != own
    own.write_bytes(text)
    assert foreign_net(own).read_bytes() == text


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.net.xml", "", "not a SUMO network"),
        ("a.net.xml", "this is no XML", "not a SUMO network"),
        ("a.net.xml", "<net><edge></net>", "not a SUMO network.*mismatched tag"),
        ("a.net.xml", "\x00\x01\x02", "not a SUMO network"),
        ("a.net.xml", "<?xml version='1.0' encoding='no-such'?><net/>", "not a SUMO network"),
        ("a.net.xml", "<routes/>", "its root is <routes>, not <net>"),
        ("a.net.xml", "<net/>", "not a complete SUMO network"),
        ("a.net.xml", BOMB, "entities"),
        ("a.net.xml", LEAK, "entities"),
        ("a.xodr", NET, "its root is <net>, not <OpenDRIVE>"),
        ("a.xodr", BOMB, "entities"),
        ("a.xodr", "<OpenDRIVE/>", "without roads"),
        (
            "a.xodr",
            "<OpenDRIVE><road id='1'><type s='x'/><lanes><laneSection s='0'/></lanes></road></OpenDRIVE>",
            "sound",
        ),
        ("a.xodr", "<OpenDRIVE><header/><road id='1' length='9' junction='-1'/></OpenDRIVE>", "netconvert refused"),
        ("a.osm", "<osm/>", r"end in \.net\.xml or \.xodr"),
        ("a.xml", NET, r"end in \.net\.xml or \.xodr"),
    ],
)
def test_what_is_no_network_is_refused_by_name(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(CompileError, match=words) as caught:
        foreign_net(tmp_path / name)
    assert "refused" in words or str(tmp_path / name) in str(caught.value)
    assert not any((tmp_path / "cache").rglob("net.net.xml"))


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(CompileError, match=r"nowhere\.net\.xml cannot be read: No such file"):
        foreign_net(tmp_path / "nowhere.net.xml")
    (tmp_path / "folder.xodr").mkdir()
    with pytest.raises(CompileError, match=r"folder\.xodr cannot be read"):
        foreign_net(tmp_path / "folder.xodr")


@needs_maps
def test_an_opendrive_town_keeps_its_coordinates_sidewalks_and_signals():
    root = net_root(foreign_net(MAPS / "xodr" / "Town10HD.xodr"))
    edges = [e for e in root.iterfind("edge") if e.get("function") is None]
    lanes = [lane for e in edges for lane in e]
    assert root.find("location").get("netOffset") == "0.00,0.00"
    assert (len(edges), len(lanes)) == (46, 86 + 46)  # as counted for these maps: car lanes and sidewalks
    assert len(root.findall("tlLogic")) == 5
    assert len(root.findall("edge[@function='crossing']")) == 28  # 18 at the map's 16 crosswalks, 10 where it has none


@needs_maps
def test_limits_are_those_of_the_opendrive_roads():
    root = net_root(foreign_net(MAPS / "xodr" / "Town10HD.xodr"))
    limits = {
        lane.get("speed")
        for lane in root.iter("lane")
        if "pedestrian" not in lane.get("allow", "") and lane.get("id")[0] != ":"
    }
    assert limits == {"17.88", "22.35"}  # 40 and 50 mph


@needs_maps
def test_a_sumo_town_keeps_its_ids():
    path = MAPS / "net" / "Town03.net.xml"
    root, original = net_root(foreign_net(path)), net_root(path)
    assert [e.get("id") for e in root.iter("edge")] == [e.get("id") for e in original.iter("edge")]
