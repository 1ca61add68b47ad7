"""Noise from hashes: the same everywhere, of the right size, smooth where it drifts, a function of time."""

from __future__ import annotations

import numpy as np
import pytest

from foresee_dsl.simulate.sensing.noise import Streams, drift, key_of, mixed, normals, uniforms

COUNTERS = np.arange(200_000, dtype=np.int64)
KEY = np.array([key_of(3, "somebody")], dtype=np.uint64)


def test_the_hash_is_splitmix64() -> None:
    # The first outputs of the published generator that starts at 0.
    hashes = mixed(np.zeros(1, dtype=np.uint64), np.array([1, 2], dtype=np.int64))
    assert [hex(h) for h in hashes.tolist()] == ["0xe220a8397b1dcdaf", "0x6e789e6aa1b965f4"]


def test_the_numbers_never_change() -> None:
    assert key_of(0, "ego's pose") == int.from_bytes(bytes.fromhex("e306247234e333d6"), "big")
    assert normals(np.array([0, 2**64 - 1], dtype=np.uint64)).tolist() == pytest.approx([-3.464, 3.464], abs=1e-3)
    assert uniforms(np.array([0, 2**63], dtype=np.uint64)).tolist() == [0.0, 0.5]


def test_normal_numbers_are_normal_enough() -> None:
    values = normals(mixed(KEY, COUNTERS))
    assert (values.mean(), values.std()) == pytest.approx((0.0, 1.0), abs=0.01)
    assert (np.abs(values) > 2.0).mean() == pytest.approx(0.043, abs=0.003)
    assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < 0.01


def test_uniform_numbers_are_uniform() -> None:
    values = uniforms(mixed(KEY, COUNTERS))
    assert 0.0 <= values.min() < 0.001 < 0.999 < values.max() < 1.0
    assert np.histogram(values, 10, (0.0, 1.0))[0] / len(values) == pytest.approx(0.1, abs=0.005)


def test_a_drift_is_smooth_and_of_the_right_size() -> None:
    keys = mixed(KEY, np.arange(20, dtype=np.int64))
    values = drift(keys, np.arange(-500, 19_500, dtype=np.int64), 20)
    assert values.std() == pytest.approx(1.0, abs=0.03)
    steps = np.diff(values, axis=0)
    assert np.abs(steps).max() < 0.4
    # The curvature of a B-spline is at most four times the largest value, here 3.47 / 0.69, per spacing squared.
    assert np.abs(np.diff(steps, axis=0)).max() < 4 * 3.47 / 0.69 / 20**2, "no kinks at the knots"


def test_blocks_make_no_difference() -> None:
    # A clip begins in the middle of a block; what it draws is what its parent drew.
    def streams() -> Streams:
        return Streams(5, ("a", "b"), (0.5, 1.0), 20, 4)

    parent, clip = streams(), streams()
    rows = {frame: (parent.normals(frame).copy(), parent.chances(frame).copy()) for frame in range(-3, 200)}
    for frame in (150, 77, 78, -2, 33, 31, 32):
        assert (clip.normals(frame) == rows[frame][0]).all()
        assert (clip.chances(frame) == rows[frame][1]).all()


def test_others_do_not_change_an_objects_noise() -> None:
    # A clip has fewer actors than its parent.
    many, few = Streams(5, ("a", "b", "c"), (0.5, 1.0), 20), Streams(5, ("c",), (0.5, 1.0), 20)
    assert (many.normals(9)[2] == few.normals(9)[0]).all()
    assert many.chances(9)[2] == few.chances(9)[0]


def test_some_of_the_variance_drifts() -> None:
    streams = Streams(5, tuple(f"actor_{k}" for k in range(60)), (0.0, 0.5, 1.0), 20)
    values = np.array([streams.normals(frame) for frame in range(2000)])
    assert values.std(axis=(0, 1)) == pytest.approx([1.0, 1.0, 1.0], abs=0.04)
    fresh = np.diff(values, axis=0).var(axis=(0, 1)) / 2
    assert fresh == pytest.approx([1.0, 0.5, 0.0], abs=0.03)
