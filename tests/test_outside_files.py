"""Files that come from another person: what is no ordinary file, is too large, unpacks to too much or opens others."""

from __future__ import annotations

import gzip
import os
import random
import signal
import sqlite3
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from foresee_dsl.campaign.records import CaseRunOutcome, decode
from foresee_dsl.campaign.storage.maintenance import MergeCounts, merge
from foresee_dsl.campaign.storage.soundness import sum_of
from foresee_dsl.campaign.storage.store import COLUMNS, Store, StoredResult, StoreError
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.safe_xml import LONGEST_BYTES, parse_net
from foresee_dsl.errors import CompileError, InputError
from foresee_dsl.files import NotOrdinaryError, open_outside, read_outside, unpacked_within
from foresee_dsl.language.parser import load
from tests.support.foreign_maps import HILL_ROAD

ROOT = Path(__file__).parent.parent
FORESEE = Path(sys.executable).parent / "foresee"
SECONDS = 5


@contextmanager
def ended_after(seconds: int) -> Iterator[None]:
    """Raise in the middle of whatever waits for ever."""

    def ring(*_: object) -> None:
        raise TimeoutError("it waited")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def pipe(file: Path) -> None:
    os.mkfifo(file)


def device(file: Path) -> None:
    file.symlink_to("/dev/zero")


def log_of_the_kernel(file: Path) -> None:
    file.symlink_to("/proc/kmsg")


def memory_of_the_kernel(file: Path) -> None:
    file.symlink_to("/proc/kcore")


ODD = (pipe, device, log_of_the_kernel, memory_of_the_kernel)


@pytest.mark.parametrize("odd", ODD)
def test_only_ordinary_files_are_read(tmp_path: Path, odd: Callable[[Path], None]) -> None:
    odd(tmp_path / "x")
    if not (tmp_path / "x").exists():
        pytest.skip("this system has no such file")
    with ended_after(SECONDS):
        try:
            assert read_outside(tmp_path / "x") == b""
        except OSError as err:
            assert isinstance(err, NotOrdinaryError | PermissionError) or "more than the 100 MB" in str(err)


NAMES = ("x.foresee", "x.npz", "x.xodr", "x.net.xml", "x.osm", "x.osm.pbf", "x.xosc", "campaign.json", "x.txt", "x.xml")
COMMANDS = (
    "check x.foresee",
    "check .",
    "fmt x.foresee",
    "draw x.foresee",
    "diff x.foresee x.foresee",
    "textconv x.foresee",
    "git-diff x.foresee x.txt 0 0 x.txt 0 0",
    "run x.foresee --driver idm",
    "show x.npz",
    "view x.npz",
    "forecast x.npz",
    "clip x.npz --out clips",
    "import opendrive x.xodr --out out",
    "import sumo x.net.xml --out out",
    "import osm x.osm --out out",
    "import osm x.osm.pbf --out out",
    "import openscenario x.xosc --out out",
    "import carla --map x.xodr --routes x.xml --out out",
    "init network x.txt --out y.foresee",
    "review campaign.json",
    "report .",
    "compare . .",
    "keep 1 --campaign . --to kept",
    "verify x.foresee --driver idm",
    "repin x.foresee",
    "check uses.foresee",
    "store merge . --into other",
)


@pytest.mark.parametrize("odd", ODD)
def test_no_command_waits_for_a_file_that_is_not_ordinary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, odd: Callable[[Path], None]
) -> None:
    from typer.testing import CliRunner

    from foresee_dsl.cli import app
    from foresee_dsl.cli.options.common import BUG, explain_error

    for name in (*NAMES, "runs.sqlite"):
        odd(tmp_path / name)
    scenario = 'scenario x {\n  network "x.net.xml"\n  ego: car.sedan {\n    route ["a"]\n  }\n}\n'
    (tmp_path / "uses.foresee").write_text(f"foresee 1\n\n{scenario}")
    monkeypatch.chdir(tmp_path)
    for command in COMMANDS:
        with ended_after(2 * SECONDS):
            result = CliRunner().invoke(app, command.split())
        error = result.exception
        assert not isinstance(error, TimeoutError), command
        code = result.exit_code if error is None or isinstance(error, SystemExit) else explain_error(error)
        assert code != BUG, (command, error)


def test_files_are_opened_in_one_place() -> None:
    own = {
        "files.py",  # the helper itself
        "disk_cache.py", "kernels/compiling.py", "compile/nets/cache.py", "compile/nets/network_builder.py",
        "compile/templates.py", "compile/foreign/networks.py",
        "simulate/sumo_start.py", "campaign/import_closure.py", "campaign/keys.py", "campaign/steps/inputs.py",
        "campaign/folder.py",
        "campaign/profiling/tasks.py", "campaign/workers/processes.py", "campaign/storage/soundness.py",
        "language/syntax/grammar.py", "language/syntax/phrases.py", "language/codes.py", "report/page/html.py",
        "report/picture/draw.py",
        "weights.py", "selforacle/watcher.py", "faults/evidence.py", "maps/opendrive.py",
        "maps/network.py", "maps/osm.py", "cli/about.py", "cli/writing/init.py",
    }  # fmt: skip
    readers = (".read_bytes()", ".read_text(", '.open("rb")', "np.load(", "zlib.decompress(", "GzipFile(", "ZipFile(")
    allowed = {
        ("simulate/trace.py", "ZipFile("),
        ("compile/nets/safe_xml.py", "GzipFile("),
        ("fmi/instance.py", "ZipFile("),  # bytes from read_outside; the unpacked size is limited too
        ("campaign/storage/store.py", '.open("rb")'),  # the head of a database that SQLite opened before
    }
    packages = ROOT / "foresee_dsl", *ROOT.glob("plugins/*/foresee_*")
    found = {
        (name, reader)
        for package in packages
        for file in package.rglob("*.py")
        if (name := file.relative_to(package).as_posix()) not in own
        for reader in readers
        if reader in file.read_text(encoding="utf-8") and "_data" not in name
    }
    assert found == allowed, "a file of another person is read by files.read_outside"


def test_a_file_larger_than_the_limit_is_refused_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_LIMITS", "file=1")
    with (tmp_path / "x").open("wb") as file:
        file.truncate(3_000_000)
    with pytest.raises(OSError, match=r"it has 3.0 MB, more than the 1 MB that are read; `foresee --limit file=3 "):
        open_outside(tmp_path / "x")


# ---- files that open others ------------------------------------------------------------------------------------------

HILL = HILL_ROAD.read_text(encoding="utf-8")
NET = """<net version="1.20">
  <location netOffset="0.00,0.00" convBoundary="0,0,100,0" origBoundary="0,0,100,0" projParameter="!"/>
  <edge id="a" from="w" to="e"><lane id="a_0" index="0" speed="13.9" length="100" shape="0,0 100,0"/></edge>
  <junction id="w" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,1 0,-1"/>
  <junction id="e" type="dead_end" x="100" y="0" incLanes="a_0" intLanes="" shape="100,1 100,-1"/>
</net>"""


@pytest.mark.parametrize("attribute", ["file", "href"])
def test_a_file_that_includes_another_is_refused_and_the_other_not_opened(tmp_path: Path, attribute: str) -> None:
    os.mkfifo(tmp_path / "other.xml")  # who opens it waits
    include = f'<include {attribute}="{tmp_path}/other.xml"/>'
    (tmp_path / "x.xodr").write_text(HILL.replace("</OpenDRIVE>", f"{include}</OpenDRIVE>"))
    (tmp_path / "x.net.xml").write_text(NET.replace("</net>", f"{include}</net>"))
    (tmp_path / "y.net.xml").write_text(
        NET.replace("</net>", f'<include xmlns="http://www.w3.org/2001/XInclude" {attribute}="other.xml"/></net>')
    )
    for name in ("x.xodr", "x.net.xml", "y.net.xml"):
        with ended_after(SECONDS), pytest.raises(CompileError, match=r"includes another file \('.*other.xml'\), which"):
            foreign_net(tmp_path / name)


@pytest.mark.parametrize(
    "projection",
    [
        "+proj=tmerc +nadgrids=/home/me/x.gsb +units=m",
        "+init=/etc/passwd:x",
        "+proj=pipeline +step +proj=hgridshift +grids=@../x.gsb",
        'BOUNDCRS[ABRIDGEDTRANSFORMATION["x",PARAMETERFILE["grid","/home/me/x.gsb"]]]',
    ],
)
def test_a_projection_that_reads_a_file_is_refused(tmp_path: Path, projection: str) -> None:
    head = f"<geoReference><![CDATA[{projection}]]></geoReference></header>"
    (tmp_path / "x.xodr").write_text(HILL.replace('west="0"/>', f'west="0">{head}'))
    quoted = projection.replace('"', "&quot;")
    (tmp_path / "x.net.xml").write_text(NET.replace('projParameter="!"', f'projParameter="{quoted}"'))
    for name in ("x.xodr", "x.net.xml"):
        with pytest.raises(CompileError, match="has a projection that reads a file of this machine"):
            foreign_net(tmp_path / name)
    usual = "+proj=utm +zone=32 +geoidgrids=egm96_15.gtx +nadgrids=@null +units=m"
    (tmp_path / "y.net.xml").write_text(NET.replace('projParameter="!"', f'projParameter="{usual}"'))
    assert parse_net(tmp_path / "y.net.xml").find("location") is not None


# ---- sizes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "piece",
    ['<a x="{}"/>'.format("1" * 50_000_000), f"<!--{'x' * 50_000_000}-->", "<a {}/>".format(
        " ".join(f'a{n}=""' for n in range(1_000_000)))],
    ids=["attribute", "comment", "a million attributes"],
)  # fmt: skip
def test_a_tag_of_megabytes_is_refused_in_a_moment(tmp_path: Path, piece: str) -> None:
    (tmp_path / "x.net.xml").write_text(f"<net>{piece}</net>")
    with ended_after(SECONDS), pytest.raises(CompileError, match="has a tag, a text or a comment of more than 4 MB"):
        parse_net(tmp_path / "x.net.xml")


def test_a_packed_net_has_the_same_limit_of_its_pieces(tmp_path: Path) -> None:
    (tmp_path / "x.net.xml.gz").write_bytes(gzip.compress(b"<net><!--" + b"x" * 2 * LONGEST_BYTES + b"--></net>", 1))
    with ended_after(SECONDS), pytest.raises(CompileError, match="has a tag, a text or a comment of more than 4 MB"):
        parse_net(tmp_path / "x.net.xml.gz")


def test_texts_that_git_compares_have_a_limit(tmp_path: Path) -> None:
    (tmp_path / "old").write_bytes(b"ab\n" * 1_000_000)
    (tmp_path / "new").write_text("ab\n")
    command = [FORESEE, "git-diff", "x.foresee", "old", "0", "0", "new", "0", "0"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "* not compared: it has 3.0 MB, more than the 1 MB that are read; `foresee --limit" in done.stdout


# ---- what unpacks to more than it seems ------------------------------------------------------------------------------


def _bomb(size: int) -> bytes:
    packer = zlib.compressobj(9)
    return b"".join(packer.compress(bytes(1_000_000)) for _ in range(size // 1_000_000)) + packer.flush()


def test_what_zlib_has_packed_is_unpacked_within_a_limit() -> None:
    data = random.Random(1).randbytes(100_000)
    assert unpacked_within("record", zlib.compress(data)) == data
    with pytest.raises(ValueError, match=r"more than 20 MB when it is unpacked; `foresee --limit record=40 "):
        unpacked_within("record", _bomb(30_000_000))
    with pytest.raises(ValueError, match="cut off"):
        unpacked_within("record", zlib.compress(data)[:-10])


@pytest.mark.parametrize("summed", [True, False])
def test_a_record_that_unpacks_to_more_than_the_limit_counts_as_damaged(tmp_path: Path, summed: bool) -> None:
    bomb = _bomb(30_000_000)
    with Store(tmp_path / "sent") as store:
        store.add(StoredResult("good", "seed", "good", zlib.compress(b"{}")))
    row = StoredResult("bad", "seed", "bad", bomb)
    values = tuple(getattr(row, column) for column in COLUMNS)
    with closing(sqlite3.connect(tmp_path / "sent" / "runs.sqlite")) as database, database:
        places = ", ".join("?" * (len(COLUMNS) + 1))
        database.execute(f"INSERT INTO runs ({', '.join(COLUMNS)}, sum) VALUES ({places})",
                         (*values, sum_of(values) if summed else ""))  # fmt: skip
    with Store(tmp_path / "sent", write=False) as store:
        assert store.get("good") is not None and store.get("bad") is None
        assert store.damaged == {"bad": "bad"}
    assert merge([tmp_path / "sent"], tmp_path / "mine") == MergeCounts(new=1, known=0, damaged=1, without_trace=0)
    with pytest.raises(ValueError, match="more than 20 MB"):
        decode(bomb, CaseRunOutcome)


def test_a_store_that_computes_its_rows_is_refused(tmp_path: Path) -> None:
    with Store(tmp_path / "sent") as store:
        store.add(StoredResult("good", "seed", "good", zlib.compress(b"{}")))
    with closing(sqlite3.connect(tmp_path / "sent" / "runs.sqlite")) as database, database:
        database.execute("ALTER TABLE runs RENAME TO kept")
        database.execute("CREATE VIEW runs AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
                         "SELECT kept.* FROM kept, n")  # fmt: skip
    with (
        ended_after(SECONDS),
        pytest.raises(StoreError, match="contains a view, which stores of foresee-dsl do not have"),
    ):
        merge([tmp_path / "sent"], tmp_path / "mine")


def test_a_scenario_of_any_odd_kind_is_a_mistake_with_a_code(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.foresee")
    with ended_after(SECONDS), pytest.raises(InputError) as caught:
        load(tmp_path / "x.foresee")
    assert caught.value.diagnostics[0].message == "this is not an ordinary file"
