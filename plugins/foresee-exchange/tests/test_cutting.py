"""A part is cut out of a large map when it is imported, and a long import says what it does."""

from __future__ import annotations

import io
import time
from pathlib import Path

import pytest
from foresee_exchange.maps import opendrive, osm, sumo
from foresee_exchange.maps.cutting import Around, Boundary, Part, cut_net, part_of
from foresee_exchange.maps.osm import converted, extent_of, keep_within, read_osm
from rich.console import Console
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.compile.foreign.networks import foreign_net, in_silence
from foresee_dsl.compile.nets import safe_xml
from foresee_dsl.compile.nets.net_reader import read_net
from foresee_dsl.errors import ForeseeError
from foresee_dsl.report.terminal import steps
from tests.support.foreign_maps import net, road
from tests.support.foreign_maps import opendrive as xodr

TOWN = Path(__file__).parent / "small_town.osm"


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small town as a SUMO net."""
    file = tmp_path_factory.mktemp("town") / "town.net.xml"
    file.write_bytes(converted(read_osm(TOWN))[0])
    return file


def cut(file: Path, part: Part, folder: Path) -> tuple[Path, str]:
    folder.mkdir(exist_ok=True)
    return cut_net(file, part, folder, in_silence)


def test_what_lies_in_a_box_is_kept_with_its_ids_coordinates_and_signals(town: Path, tmp_path: Path) -> None:
    whole = read_net(town)
    signal = next(m.junction for m in whole.movements if m.tls)
    x, y = whole.junctions[signal].x, whole.junctions[signal].y
    part, note = cut(town, Boundary(x - 30, y - 30, x + 30, y + 30), tmp_path / "box")
    kept = read_net(part)
    assert note.startswith(f"{len(kept.edges)} of {len(whole.edges)} edges are kept: those in the box from (")
    assert 0 < len(kept.edges) < len(whole.edges)
    near = {edge.id for edge in whole.edges_at(signal)}
    assert near <= kept.edges.keys() <= whole.edges.keys()
    for edge in near:  # their other ends belong to junctions that have fewer arms now
        at = -1 if whole.edges[edge].end == signal else 0
        assert kept.edges[edge].lanes[0].shape[at] == whole.edges[edge].lanes[0].shape[at]
    assert {m.ends for m in kept.movements_at(signal)} == {m.ends for m in whole.movements_at(signal)}
    assert {m.link for m in kept.movements if m.tls} == {m.link for m in whole.movements if m.tls}
    assert [file.name for file in (tmp_path / "box").iterdir()] == ["part.net.xml"]  # the whole one is removed


def test_a_place_is_a_junction_an_edge_or_two_numbers(town: Path, tmp_path: Path) -> None:
    whole = read_net(town)
    signal = next(m.junction for m in whole.movements if m.tls)
    junction = whole.junctions[signal]
    one, other = (
        cut(town, Around.read(f"{place},30"), tmp_path / name)[0].read_text().partition("<edge")[2]
        for name, place in (("id", signal), ("xy", f"{junction.x},{junction.y}"))
    )
    assert one == other
    edge = next(iter(whole.edges))
    assert edge in read_net(cut(town, Around.read(f"{edge},10"), tmp_path / "edge")[0]).edges


def test_a_box_in_degrees_is_that_of_the_projection(town: Path, tmp_path: Path) -> None:
    extent = extent_of(read_osm(TOWN))
    assert extent is not None and extent.geo
    assert len(read_net(cut(town, extent, tmp_path / "all")[0]).edges) == len(read_net(town).edges)
    with pytest.raises(ForeseeError, match=r"has no edge in the box from \(8.00000, 50.00000\) .* it reaches from \("):
        cut(town, Boundary(8, 50, 9, 51, geo=True), tmp_path / "none")
    (tmp_path / "flat.net.xml").write_text(net())
    with pytest.raises(ForeseeError, match=r"has no projection.* use --in-boundary; it reaches from \(0.0, 0.0\)"):
        cut(tmp_path / "flat.net.xml", extent, tmp_path / "flat")


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (
            Boundary(9000, 0, 9100, 10),
            r"no edge in the box from \(9000.0, 0.0\) to .*; it reaches from \(0.0, 0.0\) to ",
        ),
        (Around("nowhere", 20), r"no junction or edge 'nowhere'; .* it reaches from \(0.0, 0.0\) to \(200.0, 0.0\) m"),
    ],
)
def test_a_part_without_streets_is_refused_with_the_extent_of_the_map(tmp_path: Path, part: Part, words: str) -> None:
    (tmp_path / "x.net.xml").write_text(net())
    with pytest.raises(ForeseeError, match=words):
        sumo.run(tmp_path / "x.net.xml", out=tmp_path / "out", part=part)
    assert not (tmp_path / "out").exists()


def test_a_part_of_a_net_is_imported_beside_the_whole_one(town: Path, tmp_path: Path) -> None:
    file = tmp_path / "town.net.xml"
    file.write_bytes(town.read_bytes())
    steps_of_it: list[str] = []
    done = sumo.run(file, out=tmp_path, part=Around.read("103,60"), tell=steps_of_it.append)
    assert [made.name for made in done.files] == ["town_part.foresee", "town_part.net.xml"]
    assert file.read_bytes() == town.read_bytes()
    assert any("edges are kept" in note for note in done.notes)
    assert "A first drive on a part of town.net.xml." in done.files[0].read_text()
    assert len(steps_of_it) >= 6


def test_a_part_of_an_extract_is_cut_before_and_by_netconvert(tmp_path: Path) -> None:
    root, whole = read_osm(TOWN), read_osm(TOWN)
    node = next(node for node in root.iterfind("node") if node.get("id") == "103")
    place = f"{node.get('lon')},{node.get('lat')}"
    box = Around.read(f"{place},20").geo_box()
    keep_within(root, box)
    assert 0 < len(root.findall("way")) < len(whole.findall("way"))
    assert converted(root, box=box)[0].count(b"<edge ") == converted(whole, box=box)[0].count(b"<edge ")
    with pytest.raises(ForeseeError, match=r"has no street for cars in the box .*; it reaches from \(11\."):
        osm.run(TOWN, out=tmp_path, part=Boundary(8, 50, 9, 51, geo=True))
    with pytest.raises(ForeseeError, match="103 is not a longitude and a latitude"):
        osm.run(TOWN, out=tmp_path, part=Around("103", 20))


def test_a_part_of_an_opendrive_map_becomes_a_net(tmp_path: Path) -> None:
    file = tmp_path / "map.xodr"
    file.write_text(xodr(road(), road(id="2", x=1000)))
    done = opendrive.run(file, out=tmp_path / "out", part=Around.read("1030,0,40"))
    assert [made.name for made in done.files] == ["map_part.foresee", "map_part.net.xml"]
    kept = read_net(foreign_net(tmp_path / "out" / "map_part.net.xml"))
    assert all(1000 <= x <= 1060 for edge in kept.edges.values() for x, _ in edge.lanes[0].shape)
    for part in (Boundary(5000, 0, 5100, 10), Around("2", 40)):
        with pytest.raises(ForeseeError, match=r"its roads begin within the box from \(0.0, 0.0\) to \(1000.0, 0.0\)"):
            opendrive.run(file, out=tmp_path / "none", part=part)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--in-boundary", "1,2,3"], "1,2,3 does not have 4 numbers"),
        (["--in-boundary", "5,0,1,1"], "the box 5,0,1,1 is empty"),
        (["--in-geo-boundary", "11,98,12,99"], "latitude that is not within -90 and 90"),
        (["--around", "300"], "300 is not a place with a radius in m"),
        (["--around", "1,2,3", "--in-boundary", "0,0,1,1"], "only one of --around"),
    ],
)
def test_a_wrong_box_is_wrong_usage(tmp_path: Path, options: list[str], words: str) -> None:
    (tmp_path / "x.net.xml").write_text(net())
    asked = CliRunner().invoke(app, ["import", "sumo", str(tmp_path / "x.net.xml"), "--out", str(tmp_path), *options])
    assert asked.exit_code == 2
    assert words in " ".join(asked.output.replace("│", " ").split())


def test_part_of_reads_each_option() -> None:
    assert part_of(None, None, None) is None
    assert part_of("a,b,30", None, None) == Around("a,b", 30)
    assert part_of(None, "-1,0,2.5,3", None) == Boundary(-1, 0, 2.5, 3)
    assert part_of(None, None, "9,50,10,51") == Boundary(9, 50, 10, 51, geo=True)


def test_a_net_with_too_many_elements_names_the_option_which_helps(
    town: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, _ = cut(town, Around.read("103,20"), tmp_path / "part")
    few, all_ = (sum(1 for _ in safe_xml.parse_net(file).iter()) for file in (part, town))
    assert few < all_
    monkeypatch.setattr(safe_xml, "MOST_ELEMENTS", few)
    with pytest.raises(
        ForeseeError, match=r"elements: cut out the part .* `foresee import sumo FILE --around X,Y,RADIUS`"
    ):
        safe_xml.parse_net(town)
    again, _ = cut(town, Around.read("103,20"), tmp_path / "again")
    assert len(read_net(again).edges) == len(read_net(part).edges)


def test_a_net_is_read_few_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was read nine times and once more for each way that was tried: a third of the time for a net of 23 MB."""
    readings: list[Path] = []
    pieces_of = safe_xml._pieces_of

    def counted(path: Path, *args: object, **options: object) -> object:
        readings.append(path)
        return pieces_of(path, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(safe_xml, "_pieces_of", counted)
    (tmp_path / "x.net.xml").write_text(net(more="<!-- read few times -->"))
    sumo.run(tmp_path / "x.net.xml", out=tmp_path / "out")
    assert 0 < len(readings) <= 5, readings


def test_a_long_step_is_told_once_and_a_short_command_prints_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    printed = io.StringIO()
    console = Console(file=printed, width=200)
    with steps.steps(console) as tell:
        tell("a short step")
    assert printed.getvalue() == ""
    monkeypatch.setattr(steps, "EVERY_S", 0.005)
    with steps.steps(console) as tell:
        tell("reading [a] network")
        time.sleep(0.1)
    assert printed.getvalue() == "0 s: reading [a] network\n"
