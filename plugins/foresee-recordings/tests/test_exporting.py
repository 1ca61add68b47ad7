"""Runs as FCD, CommonRoad and tables of levelXdata: our readers read them back, and they follow their schemas."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest
from foresee_recordings.exporting.formats import to_commonroad, to_fcd, to_levelx
from foresee_recordings.exporting.options import RunOptions
from foresee_recordings.exporting.runs import recording_of
from foresee_recordings.readers.tables import table
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import Recording

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.errors import InputError
from foresee_dsl.exchange.network_parts import heads_of
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.plugins import BESIDE, package_of
from tests.support.command import foresee

CASE = f"{data_folder('scenarios') / 'scenario7.foresee'}::r01"
NEAR_M, NEAR_RAD = 1e-3, 1e-5
"""The files round to a millimetre, or to less."""


@pytest.fixture(scope="module")
def run() -> Recording:
    return recording_of(run_test_case(load_test_case(CASE), driver="pdm", seed=0).trace)


def exported(folder: Path, exporter: object) -> Imported:
    return exporter(RunOptions([CASE], folder), lambda _: None)  # type: ignore[operator]


def check_motion(run: Recording, back: Recording, ids: dict[str, str] | None = None, *, near_mps: float = 1e-3) -> None:
    """Compare all tracks of a run with those that were read back."""
    assert len(back.tracks) == len(run.tracks)
    for track in run.tracks:
        other = back.track(ids[track.id] if ids else track.id)
        assert other.sized and other.time_s == pytest.approx(track.time_s, abs=1e-6)
        assert (other.length_m, other.width_m) == pytest.approx((track.length_m, track.width_m), abs=1e-3)
        assert np.abs(other.states[:, :2] - track.states[:, :2]).max() < NEAR_M
        turned = np.remainder(other.states[:, 2] - track.states[:, 2] + math.pi, 2 * math.pi) - math.pi
        assert np.abs(turned).max() < NEAR_RAD
        assert np.abs(other.states[:, 3] - np.abs(track.states[:, 3])).max() < near_mps


def test_fcd_reads_back_and_follows_sumos_schema(run: Recording, tmp_path: Path) -> None:
    report = exported(tmp_path, to_fcd)
    types, fcd = report.files
    back = read(Request(fcd))
    check_motion(run, back)
    assert {track.id: track.kind for track in back.tracks} == {track.id: track.kind for track in run.tracks}
    assert not back.left_out and not back.notes
    assert report.left_out["signals"] > 0 and report.taken["frames"] == len(run.tracks[0].time_s)
    sumo = pytest.importorskip("sumo", reason="eclipse-sumo has the schemas")
    etree = pytest.importorskip("lxml.etree")
    for file, schema in ((fcd, "fcd_file"), (types, "additional_file")):
        xsd = etree.XMLSchema(file=str(Path(sumo.__file__).parent / "data" / "xsd" / f"{schema}.xsd"))
        xsd.assertValid(etree.parse(str(file)))


def test_commonroad_reads_back_with_its_lanelets(run: Recording, tmp_path: Path) -> None:
    (file,) = exported(tmp_path, to_commonroad).files
    back = read(Request(file))
    check_motion(run, back, {track.id: str(k) for k, track in enumerate(run.tracks, start=1)})
    assert back.track("1").kind == "car" and back.roads is not None
    net = tmp_path / "roads.net.xml"
    net.write_text(back.roads.text)
    network = read_network(foreign_net(net))
    ego = back.track("1").states[0, :2] + back.roads.offset
    nearest = min(np.hypot(*(np.asarray(lane.shape)[:, :2] - ego).T).min() for lane in network.lanes.values())
    assert nearest < 60.0
    bundle = compile_test_case(load_test_case(CASE))
    assert len(back.signals) == len(heads_of(bundle.network, bundle.signals)) > 20
    assert {colour for signal in back.signals for colour in signal.colours} == {"red", "green"}
    original = bundle.network
    assert limits(network) == limits(original) and len(limits(network)) > 2


def limits(network: RoadNetwork) -> set[float]:
    lanes = (lane for lane in network.lanes.values() if "car" in lane.kinds and not lane.internal)
    return {round(lane.speed_mps, 1) for lane in lanes}


def test_commonroad_opens_in_commonroad_io(tmp_path: Path) -> None:
    reader = pytest.importorskip("commonroad.common.file_reader", reason="commonroad-io pins an older protobuf")
    (file,) = exported(tmp_path, to_commonroad).files
    scenario, _ = reader.CommonRoadFileReader(str(file)).open()
    assert len(scenario.dynamic_obstacles) == 20 and scenario.dt == 0.05


def test_tables_read_back_and_have_the_columns_of_ind(run: Recording, tmp_path: Path) -> None:
    exported(tmp_path, to_levelx)
    back = read(Request(tmp_path))
    check_motion(run, back, {track.id: str(k) for k, track in enumerate(run.tracks)})
    assert [track.kind for track in back.tracks] == [track.kind for track in run.tracks]
    with table(tmp_path / "00_tracks.csv") as rows:
        assert rows.columns[:10] == (
            "recordingId", "trackId", "frame", "trackLifetime", "xCenter", "yCenter", "heading", "width", "length",
            "xVelocity",
        )  # fmt: skip
        values = np.array([row for row in rows.rows if row[1] == "0"], dtype=float)
    with table(tmp_path / "00_tracksMeta.csv") as rows:
        names = [row[rows.index("name")] for row in rows.rows]
    assert names[0] == "ego" and names == [track.id for track in run.tracks]
    velocity, acceleration = values[:, 9:11], values[:, 11:13]
    steps = np.diff(values[:, 4:6], axis=0) / 0.05
    assert np.abs(steps - (velocity[1:] + velocity[:-1]) / 2).max() < 0.1
    assert np.median(np.abs(np.diff(velocity, axis=0) / 0.05 - (acceleration[1:] + acceleration[:-1]) / 2)) < 0.1
    assert (values[:, 3] == values[:, 2] - values[0, 2]).all() and values[0, 3] == 0


@pytest.mark.parametrize("file_format", ["osi", "mcap"])
def test_the_osi_export_of_the_bridges_reads_back_too(run: Recording, tmp_path: Path, file_format: str) -> None:
    pytest.importorskip("osi_utilities", reason="the extra `osi` is not installed")
    formats = pytest.importorskip("foresee_bridges.osi.formats", reason="foresee-bridges is not installed")
    options = formats.OsiOptions([CASE], tmp_path, file_format=file_format)
    (file,) = formats.to_osi(options, lambda _: None).files
    back = read(Request(file))
    check_motion(run, back, near_mps=0.1)  # OSI's velocity is that of the centre, which moves sideways in bends
    assert {track.id: track.kind for track in back.tracks} == {track.id: track.kind for track in run.tracks}
    assert len(back.signals) > 5 and all(signal.place for signal in back.signals)
    assert {colour for signal in back.signals for colour in signal.colours} <= {"red", "amber", "green", "off"}
    assert back.notes == ("The host vehicle is ego.",)


def test_equal_runs_are_equal_bytes_and_the_command_has_the_formats(tmp_path: Path) -> None:
    document = json.loads(foresee("export", "fcd", CASE, "--out", str(tmp_path / "a"), "--json").stdout)
    files = [Path(file) for file in document["files"]]
    for file, again in zip(files, exported(tmp_path / "b", to_fcd).files, strict=True):
        assert file.name == again.name and file.read_bytes() == again.read_bytes()
    own = [e for e in entry_points(group="foresee_dsl.exporters") if package_of(e) == "foresee-recordings"]
    assert tuple(sorted(entry.name for entry in own)) == BESIDE["recordings"]["foresee_dsl.exporters"]


def test_the_help_of_a_format_imports_nothing_heavy() -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from foresee_dsl.cli import app\n"
        "done = CliRunner().invoke(app, ['export', 'fcd', '--help']); assert done.exit_code == 0\n"
        "print({'numpy', 'shapely', 'networkx', 'jinja2', 'libsumo'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_an_error_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="r99"):
        to_levelx(RunOptions([CASE, f"{CASE[:-3]}r99"], tmp_path / "out"), lambda _: None)
    assert not (tmp_path / "out").exists()
