"""Pictures of many rides in small files: the class of a pixel takes half a byte before compression."""

from __future__ import annotations

import lzma
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

_FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 6, "dict_size": 1 << 24}]


@dataclass(frozen=True)
class Rides:
    """Pictures of rides.

    Attributes:
        classes: [N, 64, 160] the class of each pixel, below 16.
        ride: [N] the seed of each picture's ride.
        segment: [N] number of waypoints that the ego had passed.
        palette: [classes, 3] the colour of each class.
    """

    classes: NDArray[np.uint8]
    ride: NDArray[np.int32]
    segment: NDArray[np.int32]
    palette: NDArray[np.uint8]

    @classmethod
    def joined(cls, parts: Sequence[Rides]) -> Self:
        """Return the pictures of several, in order."""
        joined = (np.concatenate([getattr(p, name) for p in parts]) for name in ("classes", "ride", "segment"))
        return cls(*joined, parts[0].palette)

    def __len__(self) -> int:
        return len(self.ride)


def save(rides: Rides, file: Path) -> None:
    """Write rides, LZMA over half bytes: a picture takes about 150 bytes."""
    file.parent.mkdir(parents=True, exist_ok=True)
    halves = rides.classes[:, :, 0::2] | rides.classes[:, :, 1::2] << 4
    packed = lzma.compress(halves.tobytes(), lzma.FORMAT_XZ, filters=_FILTERS)
    shape = np.array(halves.shape)
    np.savez(file, classes=np.frombuffer(packed, np.uint8), shape=shape, ride=rides.ride, segment=rides.segment,
             palette=rides.palette)  # fmt: skip


def load(files: Iterable[Path]) -> Rides:
    """Read the rides of several files."""
    parts = []
    for file in files:
        with np.load(file) as data:
            halves = np.frombuffer(lzma.decompress(data["classes"].tobytes()), np.uint8).reshape(data["shape"])
            classes = np.empty((len(halves), halves.shape[1], halves.shape[2] * 2), np.uint8)
            classes[:, :, 0::2], classes[:, :, 1::2] = halves & 15, halves >> 4
            parts.append(Rides(classes, data["ride"], data["segment"], data["palette"]))
    return Rides.joined(parts)
