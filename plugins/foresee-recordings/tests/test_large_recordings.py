"""Recordings of any size are read in bounded memory, and what is kept of them has a limit."""

from __future__ import annotations

import gzip
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import RecordingError

ACTORS, STEPS = 50, 9000
MOST_BYTES = 10_000_000
"""A window of some thousand samples of 40 bytes; the rest is buffers of a megabyte, and a row."""
GROWTH = """
import resource, sys
from pathlib import Path
from foresee_recordings.reading import Request, read
def peak(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
for file in map(Path, sys.argv[1:]):
    before = peak()
    recording = read(Request(file, begins_s=100.0, ends_s=101.96))
print(sum(len(track.time_s) for track in recording.tracks), peak() - before)
"""


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a table of 20 MB: 450,000 rows of 50 actors."""
    file = tmp_path_factory.mktemp("large") / "large.csv"
    with file.open("w") as out:
        out.write("time_s,actor,x_m,y_m,heading_deg,speed_mps,length_m,width_m,kind\n")
        for k in range(STEPS):
            out.writelines(f"{k / 25},v{a},{k * 0.4 + 9 * a:.3f},{a}.0,0.0,10.0,4.5,1.8,car\n" for a in range(ACTORS))
    return file


def peak_bytes(request: Request) -> tuple[int, int]:
    """Return the samples that are read, and the most memory that Python's objects took meanwhile."""
    tracemalloc.start()
    try:
        recording = read(request)
        return sum(len(track.time_s) for track in recording.tracks), tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_window_of_a_large_table_takes_little_memory(large: Path) -> None:
    """Measured in a process that has read a small table before, so that all modules are loaded."""
    assert large.stat().st_size > 20_000_000
    small = large.with_name("small.csv")
    with large.open() as lines:
        small.write_text("".join([*islice(lines, 1), *islice(lines, ACTORS * 2500, ACTORS * 2550)]))
    command = [sys.executable, "-c", GROWTH, str(small), str(large)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    samples, growth = map(int, done.stdout.split())
    assert samples == 50 * ACTORS and growth < MOST_BYTES


def test_the_limit_of_samples_names_what_to_do(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_LIMITS", "recording=20000")
    with pytest.raises(
        RecordingError, match=r"more than 20,000 samples .* with --from and --to, or .*--limit recording="
    ):
        read(Request(large))
    assert len(read(Request(large, actors=frozenset({"v3"}))).tracks) == 1


def test_actors_count_too_since_each_takes_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_LIMITS", "recording=20000")
    file = tmp_path / "many.csv"
    file.write_text("t,id,x,y\n" + "".join(f"0,{k},0,0\n" for k in range(5000)))
    with pytest.raises(RecordingError, match=r"an actor counts as 10"):
        read(Request(file))


def timesteps() -> Iterator[str]:
    for k in range(500):
        vehicles = "".join(
            f'<vehicle id="v{a}" x="{k + 9 * a}" y="{a}" angle="90" type="car" speed="10"/>' for a in range(50)
        )
        yield f'<timestep time="{k / 10}">{vehicles}</timestep>\n'


def test_a_packed_fcd_is_unpacked_piece_by_piece(tmp_path: Path) -> None:
    file = tmp_path / "run.fcd.xml.gz"
    with gzip.open(file, "wt", compresslevel=1) as out:
        out.write("<fcd-export>")
        out.writelines(timesteps())
        out.write("</fcd-export>")
    samples, peak = peak_bytes(Request(file, begins_s=45.0, ends_s=46.0))
    assert samples == 11 * 50 and peak < MOST_BYTES


def test_a_packed_file_of_zeros_is_no_table_and_takes_no_memory(tmp_path: Path) -> None:
    file = tmp_path / "zeros.csv.gz"
    with gzip.open(file, "wb", compresslevel=1) as out:
        out.write(b"t,id,x,y\n0,a,")
        for _ in range(100):
            out.write(b"1" * 1_000_000)
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError, match=r"more than 1,000,000 characters: not a table"):
            read(Request(file))
        assert tracemalloc.get_traced_memory()[1] < 12_000_000
    finally:
        tracemalloc.stop()
