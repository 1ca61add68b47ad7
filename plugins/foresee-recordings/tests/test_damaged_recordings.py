"""Damaged recordings, drawn at random: each gives an error of ours or tracks that can be used."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import RecordingError

PIECES = (b"nan", b"inf", b"-1e308", b"1e400", b'"', b"\n", b",", b"\0", b"\xff", b"<", b"&", b"9" * 30, b"")
DAMAGED_FILES = 60


def fcd() -> bytes:
    steps = "".join(
        f'<timestep time="{k}"><vehicle id="a" x="{9 * k}" y="2" angle="90" type="car" speed="9"/>'
        f'<person id="p" x="3" y="{k}" angle="0" speed="1"/></timestep>\n'
        for k in range(12)
    )
    return f"<fcd-export>{steps}</fcd-export>".encode()


def table() -> bytes:
    rows = "".join(f"{k / 10},{a},{k + 30 * a},{a},0.0,10,4.5,1.8,car\n" for k in range(15) for a in range(3))
    return f"t,id,x,y,heading,speed,length,width,class\n{rows}".encode()


def levelx() -> bytes:
    rows = "".join(f"1,{a},{k},{k * 0.4},{a * 3},0.0,10,0\n" for a in range(3) for k in range(15))
    return f"recordingId,trackId,frame,xCenter,yCenter,heading,xVelocity,yVelocity\n{rows}".encode()


def esmini() -> bytes:
    names = ("Entity_Name", "Entity_ID", "Current_Speed", "World_Position_X", "World_Position_Y", "World_Heading_Angle")
    header = ", ".join(f"#1 {name} [-]" for name in names)
    rows = "".join(f"{k}, {k / 10}, Ego, 0, 10.0, {k}.0, 2.0, 0.0,\n" for k in range(20))
    return f"esmini\nIndex [-], TimeStamp [s], {header},\n{rows}".encode()


def osi() -> bytes:
    osi3 = pytest.importorskip("osi3.osi_groundtruth_pb2", reason="the extra `osi` is not installed")
    data = b""
    for k in range(10):
        message = osi3.GroundTruth()
        message.timestamp.nanos = k * 10**8
        thing = message.moving_object.add(type=2)
        thing.id.value = 1
        thing.base.position.x, thing.base.position.y = k, 2.0
        thing.base.dimension.length, thing.base.dimension.width = 4.5, 1.8
        data += len(message.SerializeToString()).to_bytes(4, "little") + message.SerializeToString()
    return data


FILES: dict[str, Callable[[], bytes]] = {
    "run.fcd.xml": fcd, "any.csv": table, "01_tracks.csv": levelx, "log.csv": esmini, "run.osi": osi,
}  # fmt: skip


def damaged(data: bytes, draw: random.Random) -> bytes:
    """Return data with one to five changes: other bytes, pieces inserted, repeated, deleted, or the end cut off."""
    changed = bytearray(data)
    for _ in range(draw.choice((1, 1, 2, 5))):
        place, end = sorted((draw.randrange(len(changed) + 1), draw.randrange(len(changed) + 1)))
        match draw.randrange(5):
            case 0 if changed:
                changed[min(place, len(changed) - 1)] = draw.randrange(256)
            case 1:
                changed[place : place + draw.randrange(9)] = draw.choice(PIECES)
            case 2:
                changed[place:place] = changed[place : min(end, place + 400)]
            case 3:
                del changed[place : place + draw.randrange(200)]
            case _:
                del changed[max(place, len(changed) // 2) :]
    return bytes(changed)


@pytest.mark.parametrize("name", FILES)
def test_damage_gives_an_error_of_ours_or_usable_tracks(name: str, tmp_path: Path) -> None:
    (tmp_path / "01_tracksMeta.csv").write_text(
        "trackId,width,length,class\n0,1.8,4.5,car\n1,2.5,9,truck\n2,0,0,pedestrian\n"
    )
    (tmp_path / "01_recordingMeta.csv").write_text("recordingId,frameRate\n1,25\n")
    data, file, draw = FILES[name](), tmp_path / name, random.Random(7)
    file.write_bytes(data)
    assert read(Request(file)).tracks
    outcomes = set()
    for _ in range(DAMAGED_FILES):
        file.write_bytes(damaged(data, draw))
        try:
            recording = read(Request(file))
        except RecordingError as err:
            outcomes.add("error")
            assert str(tmp_path) in str(err)
            continue
        outcomes.add("tracks")
        for track in recording.tracks:
            assert np.isfinite(track.states).all() and (np.diff(track.time_s) > 0).all() and len(track.time_s) > 1
            assert track.length_m > 0 and track.width_m > 0
    assert outcomes == {"error", "tracks"}
