"""SUMO's floating car data: fronts become centres, types give sizes, and hostile files give errors."""

from __future__ import annotations

import gzip
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import Recording, RecordingError

PROGRAMS = Path(sys.executable).parent
HEAD = '<fcd-export xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">\n'


def fcd(*steps: tuple[float, str]) -> str:
    return (
        HEAD + "".join(f'<timestep time="{time:.2f}">{text}</timestep>\n' for time, text in steps) + "</fcd-export>\n"
    )


def vehicle(id_: str, x: float, y: float, angle: float = 90.0, speed: float = 10.0, more: str = 'type="car"') -> str:
    return f'<vehicle id="{id_}" x="{x}" y="{y}" angle="{angle}" speed="{speed}" {more}/>'


def reading(tmp_path: Path, text: str, **wanted: object) -> Recording:
    file = tmp_path / "run.fcd.xml"
    file.write_text(text)
    return read(Request(file, **wanted))  # type: ignore[arg-type]


def test_the_front_becomes_the_centre_and_an_angle_from_north_one_from_east(tmp_path: Path) -> None:
    (tmp_path / "a.rou.xml").write_text('<routes><vType id="lorry" vClass="truck" length="10" width="2.4"/></routes>')
    steps = [(k, vehicle("e", 100 + 10 * k, 5, more='type="lorry"') + vehicle("n", 5, 10 * k, 0)) for k in range(3)]
    recording = reading(tmp_path, fcd(*steps))
    east, north = recording.track("e"), recording.track("n")
    assert (east.kind, east.length_m, east.width_m, east.sized) == ("truck", 10.0, 2.4, True)
    assert east.states[0] == pytest.approx([95.0, 5.0, 0.0, 10.0])
    assert north.states[2] == pytest.approx([5.0, 20.0 - 2.5, math.pi / 2, 10.0])
    assert (north.length_m, north.sized) == (5.0, False)
    assert any("1 of the type car as a car" in note for note in recording.notes)
    assert (recording.format, recording.name, len(recording.sha256)) == ("fcd", "run", 64)


def run_sumo(folder: Path, output: str) -> None:
    files = ("-n", "n.net.xml", "-r", "t.rou.xml", "--fcd-output", output)
    command = [PROGRAMS / "sumo", *files, "--step-length", "0.1"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


def test_a_real_run_has_the_centres_of_sumo(tmp_path: Path) -> None:
    """SUMO drives around a corner; its places at 4 s are shifted here by hand."""
    (tmp_path / "n.nod.xml").write_text(
        '<nodes><node id="a" x="0" y="0"/><node id="b" x="90" y="0"/><node id="c" x="90" y="60"/></nodes>'
    )
    (tmp_path / "n.edg.xml").write_text(
        '<edges><edge id="e" from="a" to="b" sidewalkWidth="2"/><edge id="f" from="b" to="c"/></edges>'
    )
    (tmp_path / "t.rou.xml").write_text(
        '<routes><vType id="bus" vClass="bus"/><route id="r" edges="e f"/>'
        '<vehicle id="v" type="bus" route="r" depart="0"/>'
        '<person id="p" depart="0"><walk edges="e"/></person>'
        '<vehicle id="w" type="DEFAULT_BIKETYPE" route="r" depart="3"/></routes>'
    )
    command = [PROGRAMS / "netconvert", "-n", "n.nod.xml", "-e", "n.edg.xml", "-o", "n.net.xml"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    run_sumo(tmp_path, "out.fcd.xml")
    recording = read(Request(tmp_path / "out.fcd.xml"))
    for name in ("out.csv", "out.parquet"):
        run_sumo(tmp_path, name)
        if name.endswith("parquet"):
            pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
        same = read(Request(tmp_path / name))
        assert same.format == "fcd" and [t.id for t in same.tracks] == [t.id for t in recording.tracks]
        for track, other in zip(same.tracks, recording.tracks, strict=True):
            assert track.kind == other.kind and track.states == pytest.approx(
                other.states, abs=0.01
            )  # XML and CSV have two digits
    assert {track.id: (track.kind, track.length_m, track.sized) for track in recording.tracks} == {
        "v": ("bus", 12.0, True), "w": ("bicycle", 1.6, True), "p": ("pedestrian", 0.215, True),
    }  # fmt: skip
    step = re.search(r'<timestep time="4.00">(.*?)</timestep>', (tmp_path / "out.fcd.xml").read_text(), re.S)
    assert step
    places = {id_: (float(x), float(y)) for id_, x, y in re.findall(r'id="(\w)" x="([-\d.]+)" y="([-\d.]+)"', step[1])}
    for id_, half in (("v", 6.0), ("w", 0.8), ("p", 0.1075)):
        x, y = places[id_]
        assert recording.track(id_).at(4.0)[:3] == pytest.approx([x - half, y, 0.0], abs=1e-9)
    assert recording.track("v").states[-1, 2] == pytest.approx(math.pi / 2, abs=0.01)


def test_only_the_request_is_kept_and_the_rest_is_not_even_read(tmp_path: Path) -> None:
    steps = [(k * 0.5, vehicle("a", 5 * k, 0) + vehicle("b", 5 * k, 4)) for k in range(40)]
    text = fcd(*steps).replace("</fcd-export>", "<broken")  # behind the request
    recording = reading(tmp_path, text, begins_s=3.0, ends_s=6.0, actors=frozenset("b"))
    (track,) = recording.tracks
    assert (track.id, track.time_s[0], track.time_s[-1], len(track.time_s)) == ("b", 3.0, 6.0, 7)
    with pytest.raises(RecordingError, match=r"damaged one"):
        reading(tmp_path, text)
    with pytest.raises(RecordingError, match=r"no actor of x has two usable samples .* from 0 s to 19.5 s"):
        reading(tmp_path, fcd(*steps), actors=frozenset("x"))


def test_gzip_a_comment_before_the_root_and_elements_without_sizes(tmp_path: Path) -> None:
    comment = "<!-- generated on 2026-01-01 by Eclipse SUMO\n" + "x" * 5000 + '<fcd-output value="a"/> -->'
    ship = vehicle("s", 0, 0, more='type="ship"') + '<container id="c" x="0" y="0"/>'
    text = '<?xml version="1.0"?>\n' + comment + fcd(*((k, vehicle("a", 10 * k, 0) + ship) for k in range(3)))
    file = tmp_path / "packed.fcd.xml.gz"
    file.write_bytes(gzip.compress(text.encode()))
    recording = read(Request(file), "fcd")
    assert [track.id for track in recording.tracks] == ["a"]
    assert recording.left_out == {
        "elements other than vehicles and persons": 3,
        "actors that are not road traffic, such as trains and ships": 1,
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (fcd((0, vehicle("a", 1, 2)), (1, vehicle("a", "x", 2))), "could not convert string to float"),  # type: ignore[arg-type]
        (fcd(*((k, vehicle("a", 13.0 + 0.1 * k, 52)) for k in range(60))), "geographic coordinates"),
        (fcd(*((k, vehicle("a", 5000 * k, 0)) for k in range(60))), "not in metres"),
        (HEAD + "<timestep time='nan'/></fcd-export>", "it has no samples"),
        (HEAD + "<timestep time='now'/></fcd-export>", "the time of a timestep is 'now', not a number"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]>" + fcd((0, "&b;")), "declares entities"),
        ("<fcd-export-other/>", "its root is"),
        (fcd((0, "")), "it has no samples"),
    ],
)
def test_what_cannot_be_read_is_an_error(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        reading(tmp_path, text)


NET = '<net><location netOffset="-385000.00,-5819000.00" projParameter="{}"/></net>'


def test_sizes_are_in_the_files_that_sumos_configuration_names(tmp_path: Path) -> None:
    (tmp_path / "cars.xml").write_text('<routes><vType id="car" length="4" width="1.7"/></routes>')
    (tmp_path / "broken.xml").write_text("<routes>")
    files = "C:\\x\\cars.xml, broken.xml, .., /, none.xml"
    comment = f'<!-- generated on <route-files value="{files}"/><fcd-output value="a"/> -->'
    recording = reading(tmp_path, comment + fcd(*((k, vehicle("a", 10 * k, 0)) for k in range(3))))
    assert (recording.tracks[0].length_m, recording.tracks[0].states[1, 0]) == (4.0, 8.0)
    assert len(recording.notes) == 1 and recording.notes[0].startswith("The types in broken.xml were not read:")


@pytest.mark.parametrize("comment", ["", '<!-- generated on <fcd-output.geo value="true"/> -->'])
def test_degrees_are_projected_into_the_zone_of_the_network(tmp_path: Path, comment: str) -> None:
    """The place in zone 33 is that of pyproj 3.7.2."""
    steps = [(k, vehicle("a", 13.3, 52.5 + 8.99e-5 * k, 0)) for k in range(60 if not comment else 5)]
    text = comment + fcd(*steps)
    free = reading(tmp_path, text)
    assert free.tracks[0].states[0, :2] == pytest.approx([384603.151, 5818010.359 - 2.5], abs=0.01)
    assert free.notes[-1] == "The positions are in degrees: they are projected to UTM zone 33 north, m."
    assert np.hypot(*np.diff(free.tracks[0].states[:, :2], axis=0).T) == pytest.approx(10.0, abs=0.02)
    net = tmp_path / "roads.net.xml"
    net.write_text(NET.format("+proj=utm +zone=33 +ellps=WGS84"))
    fitted = reading(tmp_path, text, map_file=net)
    assert fitted.roads is not None and fitted.roads.offset == (-385000.0, -5819000.0)
    net.write_text(NET.format("+proj=tmerc +lat_0=0"))
    with pytest.raises(RecordingError, match=r"its projection is not UTM .*without --fcd-output.geo"):
        reading(tmp_path, text, map_file=net)


def test_a_small_network_in_metres_is_not_taken_for_degrees(tmp_path: Path) -> None:
    steps = [(k, vehicle("a", 10 * k / 8, 3, speed=1.25)) for k in range(70)]
    assert reading(tmp_path, fcd(*steps)).tracks[0].states[40, 0] == pytest.approx(50 - 2.5)


def test_a_vehicle_and_a_person_may_have_one_name(tmp_path: Path) -> None:
    person = '<person id="0" x="{}" y="0" angle="90" speed="1"/>'
    steps = [(k, vehicle("0", 50 + 10 * k, 9) + person.format(k)) for k in range(4)]
    tracks = reading(tmp_path, fcd(*steps)).tracks
    assert [(track.id, track.kind, track.states[3, 1]) for track in tracks] == [
        ("0", "car", 9.0), ("person_0", "pedestrian", 0.0),
    ]  # fmt: skip


def test_cars_that_are_assumed_are_in_the_notes(tmp_path: Path) -> None:
    person = '<person id="p" x="{}" y="0" angle="90" speed="1"/>'
    typed = 'type="DEFAULT_VEHTYPE"'
    steps = [
        (k, vehicle("a", 10 * k, 4, more="") + vehicle("b", 10 * k, 9, more=typed) + person.format(k)) for k in range(4)
    ]
    recording = reading(tmp_path, fcd(*steps))
    assert {t.id: (t.kind, t.length_m, t.sized) for t in recording.tracks} == {
        "a": ("car", 5.0, False), "b": ("car", 5.0, True), "p": ("pedestrian", 0.215, False),
    }  # fmt: skip
    more = "If SUMO wrote the file with --fcd-output.attributes, list `type` there."
    assert recording.notes == (
        f"1 vehicle has no type: cars are assumed (DEFAULT_VEHTYPE). {more}",
        f"1 person has no type: pedestrians are assumed (DEFAULT_PEDTYPE). {more}",
    )


def test_what_is_wrong_in_single_samples_is_counted(tmp_path: Path) -> None:
    def place(k: int) -> str:
        x = {5: 900.0, 8: math.nan}.get(k, 10.0 * k)
        return vehicle("a", x, 0) + (vehicle("a", x, 0) if k == 3 else "") + (vehicle("a", x, 3) if k == 4 else "")

    steps = [(k if k < 15 else k + 5, place(k)) for k in range(20)] + [(30, '<vehicle id="a"/>')]
    recording = reading(tmp_path, fcd(*steps))
    assert recording.left_out == {
        "samples that repeat an earlier one of their actor": 1,
        "samples at the time of an earlier one of their actor, at another place": 1,
        "samples with a number that is not finite": 1,
        "samples far away from those before and after them": 1,
        "samples without a position": 1,
    }
    assert [track.id for track in recording.tracks] == ["a", "a_part2"]
    assert "1 gap of more than 1 s and 2.5 usual steps: after it, an actor goes on as another." in recording.notes
    assert np.diff(recording.tracks[0].time_s).max() == 2.0  # beside a sample that was left out
