"""Noise from hashes: the same everywhere, of the right size, smooth where it drifts, a function of time."""

from __future__ import annotations

import numpy as np
import pytest

from foresee_dsl.kernels.noise import hashes, normal, normals_over, uniform
from foresee_dsl.simulate.sensing.noise import Streams, key_of

ROW = [0.2340768886674433, 1.5833081528832296]
"""What these streams gave when they were made; a clip of an older release would not fit any more."""
COUNTERS = np.arange(200_000, dtype=np.int64)
KEY = np.array([key_of(3, "somebody")], dtype=np.uint64)


def test_the_hash_is_splitmix64() -> None:
    # The first outputs of the published generator that starts at 0.
    (row,) = hashes(np.zeros(1, dtype=np.uint64), np.array([1, 2, -1, -(2**63)], dtype=np.int64)).tolist()
    assert [hex(h) for h in row[:2]] == ["0xe220a8397b1dcdaf", "0x6e789e6aa1b965f4"]
    assert row[2:] == [_splitmix64(-1), _splitmix64(-(2**63))]


def _splitmix64(counter: int) -> int:
    """The same in whole numbers of any size."""
    most = 2**64 - 1
    z = counter * 0x9E3779B97F4A7C15 & most
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & most
    z = (z ^ z >> 27) * 0x94D049BB133111EB & most
    return z ^ z >> 31


def test_the_numbers_never_change() -> None:
    assert key_of(0, "ego's pose") == int.from_bytes(bytes.fromhex("e306247234e333d6"), "big")
    assert [normal(np.uint64(h)) for h in (0, 2**64 - 1)] == pytest.approx([-3.464, 3.464], abs=1e-3)
    assert [uniform(np.uint64(h)) for h in (0, 2**63)] == [0.0, 0.5]
    (row,) = Streams(2, ("a",), (0.5, 1.0), 20).normals(7)
    assert row == pytest.approx(ROW, abs=1e-9)


def test_normal_numbers_are_normal_enough() -> None:
    values = np.array([normal(h) for h in hashes(KEY, COUNTERS)[0]])
    assert (values.mean(), values.std()) == pytest.approx((0.0, 1.0), abs=0.01)
    assert (np.abs(values) > 2.0).mean() == pytest.approx(0.043, abs=0.003)
    assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < 0.01


def test_uniform_numbers_are_uniform() -> None:
    values = np.array([uniform(h) for h in hashes(KEY, COUNTERS)[0]])
    assert 0.0 <= values.min() < 0.001 < 0.999 < values.max() < 1.0
    assert np.histogram(values, 10, (0.0, 1.0))[0] / len(values) == pytest.approx(0.1, abs=0.005)


def test_a_drift_is_smooth_and_of_the_right_size() -> None:
    keys = hashes(KEY, np.arange(4 * 20, dtype=np.int64)).reshape(20, 4)
    values = normals_over(keys, np.array([[1.0], [0.0]]), 20, -500, 20_000)[:, :, 0]
    assert values.std() == pytest.approx(1.0, abs=0.03)
    steps = np.diff(values, axis=0)
    assert np.abs(steps).max() < 0.4
    # The curvature of a B-spline is at most four times the largest value, here 3.47 / 0.69, per spacing squared.
    assert np.abs(np.diff(steps, axis=0)).max() < 4 * 3.47 / 0.69 / 20**2, "no kinks at the knots"


def test_blocks_make_no_difference() -> None:
    # A clip begins in the middle of a block; what it draws is what its parent drew.
    def streams() -> Streams:
        return Streams(5, ("a", "b"), (0.5, 1.0), 20)

    parent, clip = streams(), streams()
    rows = {frame: parent.normals(frame) for frame in range(-3, 200)}
    for frame in (150, 77, 78, -2, 33, 31, 32, 63, 64):
        assert clip.normals(frame) == rows[frame]


def test_others_do_not_change_an_objects_noise() -> None:
    # A clip has fewer actors than its parent.
    many, few = Streams(5, ("a", "b", "c"), (0.5, 1.0), 20), Streams(5, ("c",), (0.5, 1.0), 20)
    assert many.normals(9)[2] == few.normals(9)[0]


def test_some_of_the_variance_drifts() -> None:
    streams = Streams(5, tuple(f"actor_{k}" for k in range(60)), (0.0, 0.5, 1.0), 20)
    values = np.array([streams.normals(frame) for frame in range(2000)])
    assert values.std(axis=(0, 1)) == pytest.approx([1.0, 1.0, 1.0], abs=0.04)
    fresh = np.diff(values, axis=0).var(axis=(0, 1)) / 2
    assert fresh == pytest.approx([1.0, 0.5, 0.0], abs=0.03)
