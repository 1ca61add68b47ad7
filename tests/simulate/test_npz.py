"""Traces that come from anybody: what unpacks to gigabytes, claims any size or holds code is refused unread."""

from __future__ import annotations

import io
import json
import random
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foresee_dsl.simulate.trace import STEP_S, ActorInfo, Event, Trace, read_arrays


def packed(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


@pytest.fixture(scope="module")
def trace() -> Trace:
    frames, actors = 40, 2
    return Trace(
        time_s=np.arange(frames) * STEP_S,
        states=np.random.default_rng(1).normal(size=(frames, actors, 7)),
        lanes=np.zeros((frames, actors), np.int32),
        along=np.full((frames, actors), np.nan),
        stages=np.zeros((frames, 1), np.int16),
        elapsed=np.zeros((frames, 1)),
        waypoints=np.zeros((5, 2)),
        actors=(ActorInfo("ego", "car", "car.sedan", 4.7, 1.8, 2.8), ActorInfo("a", "van", "van.x", 5.0, 2.0, 3.0)),
        lane_ids=("way_0",),
        signals=("j",),
        signal_stages=(("go", "stop"),),
        events=(Event(1.0, "a", "stops", {"index": 1}),),
        meta={"driver": "pdm"},
    )


def test_what_was_written_is_read_again(trace: Trace) -> None:
    again = Trace.load(io.BytesIO(trace.packed()))
    assert again.digest == trace.digest and again.meta == trace.meta


def test_an_archive_that_unpacks_to_more_than_is_allowed_is_refused_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORESEE_LIMITS", "trace=40")
    file = tmp_path / "bomb.npz"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("states.npy", "w") as member:
        for _ in range(5):
            member.write(bytes(10_000_000))
    assert file.stat().st_size < 1_000_000
    tracemalloc.start()
    with pytest.raises(ValueError, match=r"is too large to be read: it takes 50 MB .*--limit trace=50"):
        Trace.load(file)
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()


def test_a_head_that_claims_any_size_sets_no_memory_aside() -> None:
    head = b"\x93NUMPY\x01\x00v\x00" + b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000,), }".ljust(
        117
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("states.npy", head + b"\n" + bytes(800))
    with pytest.raises(ValueError, match=r"its array states.npy does not have the size"):
        read_arrays(file)


def test_pickles_are_not_loaded() -> None:
    data = packed(states=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ValueError, match="does not have the size"):
        read_arrays(io.BytesIO(data))


def test_arrays_and_headers_that_do_not_fit_are_no_trace(trace: Trace) -> None:
    with np.load(io.BytesIO(trace.packed())) as data:
        arrays = dict(data)
    header = json.loads(arrays["header"].tobytes())
    wrong: list[dict[str, Any]] = [
        {"states": arrays["states"][:-1]},
        {"lanes": arrays["lanes"] + 7},
        {"time_s": arrays["time_s"].astype(np.float32)},
        {"header": _bytes({**header, "actors": 3})},
        {"header": _bytes({**header, "actors": [{**header["actors"][0], "width_m": None}, header["actors"][1]]})},
        {"header": _bytes({**header, "events": [{"time_s": "x"}]})},
        {"header": _bytes([])},
    ]
    for change in wrong:
        with pytest.raises(ValueError, match="is not a trace, or is damaged"):
            Trace.load(io.BytesIO(packed(**{**arrays, **change})))


def test_a_changed_file_is_read_or_refused_in_words(trace: Trace) -> None:
    data, random_ = trace.packed(), random.Random(7)
    refused = 0
    for _ in range(100):
        changed = bytearray(data)
        for _ in range(random_.randrange(1, 4)):
            changed[random_.randrange(len(changed))] = random_.randrange(256)
        try:
            Trace.load(io.BytesIO(bytes(changed)))
        except ValueError as err:
            refused += 1
            assert "is not a trace" in str(err) or "format" in str(err) or "too large" in str(err)
    assert refused > 50


def _bytes(header: object) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.frombuffer(json.dumps(header).encode(), np.uint8)
