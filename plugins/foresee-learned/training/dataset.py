"""Turns recordings into training data: many processes draw the pictures once, as bits; training reads minibatches of
them.

    python -m training.dataset RECORDINGS... --out DRAWN

Pictures are drawn by the package's own code (`learned.inputs`). A sample takes 90 kB, so that 300,000 fit on one GPU,
which unpacks its own minibatches.
"""

from __future__ import annotations

import argparse
import os
import zlib
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from foresee_learned.inputs import CHANNELS, PAST_S, InputMaker, LearnedInputs
from foresee_learned.outputs import (
    DENSITY_AHEAD_M,
    DENSITY_CELL_M,
    DENSITY_ROWS,
    DENSITY_SIDE_M,
    STOP_LINE_M,
)
from foresee_learned.rasters.layout import GROUPS
from numpy.typing import NDArray

from training.samples import Labels, RecordedRun
from training.shards import read_shard

if TYPE_CHECKING:
    import torch

VELOCITY = CHANNELS.index("velocity_ahead")
PLANES = [k for k in range(len(CHANNELS)) if k not in (VELOCITY, VELOCITY + 1)]
"""Channels of the view from above that are 0 or 255."""
BOXES = 24
"""Largest number of road users in a sample; the nearest ones are kept."""
VALIDATION_SHARE = 20
"""Divisor: one case in this many is for validation."""
SAMPLE = np.dtype(
    [
        ("planes", np.uint8, (len(PLANES), 128, 16)),  # bits
        ("velocity", np.uint8, (2, 128, 128)),
        ("classes", np.uint8, (64, 160)),  # class of each pixel of the view ahead, from 1; 0: none
        ("depth", np.uint8, (64, 160)),
        ("vector", np.float32, (10,)),
        ("trajectory", np.float32, (12, 2)),
        ("stop_line", np.float32),
        ("signal", np.int64),
        ("cells", np.int64, (BOXES,)),  # squares of the density map; -1: no road user
        ("users", np.float32, (BOXES, 7)),  # the other channels of these squares
        ("weight", np.float32),  # relative frequency with which it is drawn
        ("run", np.int64),
        ("expert_drives", np.bool_),
    ]
)


class Job(NamedTuple):
    """The runs `part`, `part + parts`, ... of a file of recordings, for one process."""

    file: Path
    part: int
    parts: int
    out: Path


def draw(files: Sequence[Path], out: Path, workers: int) -> None:
    """Draw all samples of some recordings into files `out/NNNN_FIELD.npy`."""
    out.mkdir(parents=True, exist_ok=True)
    parts = max(1, -(-2 * workers // len(files)))
    jobs = [
        Job(file, part, parts, out / f"{k:04d}_{part:02d}") for k, file in enumerate(files) for part in range(parts)
    ]
    with ProcessPoolExecutor(workers) as pool:
        counts = list(pool.map(_drawn, jobs))
    print(f"drawn: {sum(counts)} samples of {len(files)} files", flush=True)  # noqa: T201


def _drawn(job: Job) -> int:
    """Draw a job's samples; return their number."""
    runs = read_shard(job.file)
    drawn = []
    for k, run in enumerate(runs):
        if k % job.parts == job.part:
            drawn.extend(_samples(run))
            run.forget_views()
    if drawn:
        table = np.array(drawn, SAMPLE)
        for name in SAMPLE.names or ():
            np.save(f"{job.out}_{name}.npy", table[name])
    return len(drawn)


def inputs_of(run: RecordedRun) -> Iterator[tuple[int, LearnedInputs]]:
    """Yield each labelled frame of a run with its inputs."""
    maker = InputMaker(run.mission, run.vehicle)
    for k in run.labelled.tolist():
        before = [run.past(k, back_s) for back_s in PAST_S]
        past = [() if frame is None else run.observation(frame).actors for frame in before]
        yield k, maker.draw(run.observation(k), past)


def _samples(run: RecordedRun) -> Iterator[tuple[object, ...]]:
    number = zlib.crc32(str(run.about.get("hash", run.about.get("name", ""))).encode())
    for k, seen in inputs_of(run):
        labels = run.labels(k)
        classes = seen.forward[:-1]
        cells, users = density_labels(labels)
        yield (
            np.packbits(seen.birds_eye[PLANES] > 0, axis=2, bitorder="little"),
            seen.birds_eye[VELOCITY : VELOCITY + 2],
            np.where(classes.any(axis=0), classes.argmax(axis=0) + 1, 0),
            seen.forward[-1],
            seen.vector,
            labels.trajectory,
            labels.stop and labels.stop_m <= STOP_LINE_M,
            labels.signal,
            cells,
            users,
            importance(labels, float(seen.vector[0]), expert_drives=labels.expert_drives),
            number,
            labels.expert_drives,
        )


def density_labels(labels: Labels) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return the squares of the density map in which road users are (-1: no more), and the map's values there."""
    cells, users = np.full(BOXES, -1, np.int64), np.zeros((BOXES, 7), np.float32)
    boxes = labels.boxes
    row = np.floor((DENSITY_AHEAD_M - boxes[:, 0]) / DENSITY_CELL_M)
    column = np.floor((DENSITY_SIDE_M - boxes[:, 1]) / DENSITY_CELL_M)
    inside = (row >= 0) & (row < DENSITY_ROWS) & (column >= 0) & (column < DENSITY_ROWS)
    near = np.flatnonzero(inside)
    near = near[np.argsort(np.hypot(boxes[near, 0], boxes[near, 1]), kind="stable")][:BOXES]
    _, first = np.unique(row[near] * DENSITY_ROWS + column[near], return_index=True)
    near = near[np.sort(first)]
    ahead, left, turned, length, width, speed = boxes[near].T
    cells[: len(near)] = row[near] * DENSITY_ROWS + column[near]
    users[: len(near)] = np.column_stack(
        (
            ahead - (DENSITY_AHEAD_M - (row[near] + 0.5) * DENSITY_CELL_M),
            left - (DENSITY_SIDE_M - (column[near] + 0.5) * DENSITY_CELL_M),
            *(length, width, np.cos(turned), np.sin(turned), speed),
        )
    )
    return cells, users


def importance(labels: Labels, speed_mps: float, *, expert_drives: bool) -> float:
    """Return the relative frequency with which a sample is drawn: 1 for plain driving, more for hard moments.

    Ours. A network that sees each moment as often as it occurs learns to drive straight on.
    """
    points = np.vstack([(0.0, 0.0), labels.trajectory])
    speeds = np.hypot(*np.diff(points, axis=0).T) / 0.25
    weight = 1.0
    if speed_mps < 0.3 and speeds.max() < 0.5:
        weight = 1.0  # waits, and goes on waiting; recordings hold few of these
    elif speed_mps < 1.5 and speeds[-1] > speed_mps + 1.0:
        weight = 5.0  # starts
    elif speeds[6] < speed_mps - 1.0:
        weight = 3.0  # brakes
    elif abs(labels.trajectory[-1, 1]) > 3.0:
        weight = 3.0  # turns
    elif abs(labels.trajectory[7, 1]) > 0.7:
        weight = 2.0  # bends
    ahead, left = labels.boxes[:, 0], labels.boxes[:, 1]
    close = (ahead > 0) & (ahead < 25) & (np.abs(left) < 6)
    if np.isin(labels.groups[close], [GROUPS.index("pedestrian"), GROUPS.index("two_wheeler")]).any():
        weight *= 2.0
    return weight * (1.0 if expert_drives else 3.0)


class Data:
    """Drawn samples in a device's memory, and minibatches of them."""

    def __init__(self, folders: Sequence[Path], device: torch.device) -> None:
        """Read everything that `draw` wrote into some folders."""
        import torch

        self.device = device
        self.columns: dict[str, torch.Tensor] = {}
        files = [path for folder in folders for path in sorted(folder.glob("*_run.npy"))]
        for name in SAMPLE.names or ():
            arrays = [np.load(str(file).replace("_run.npy", f"_{name}.npy"), mmap_mode="r") for file in files]
            total = sum(map(len, arrays))
            column = torch.empty((total, *arrays[0].shape[1:]), dtype=_torch_type(arrays[0].dtype), device=device)
            at = 0
            for array in arrays:
                column[at : at + len(array)] = torch.from_numpy(np.array(array)).to(device)
                at += len(array)
            self.columns[name] = column
        held_out = self.columns["run"] % VALIDATION_SHARE == 0
        self.training, self.validation = (torch.nonzero(chosen)[:, 0] for chosen in (~held_out, held_out))
        self._bits = (1 << torch.arange(8, device=device)).to(torch.uint8)

    def chosen(self, count: int, generator: torch.Generator) -> torch.Tensor:
        """Return indices of random training samples, hard ones more often."""
        import torch

        if not hasattr(self, "_sums"):
            self._sums = torch.cumsum(self.columns["weight"][self.training].double(), 0)
        ticket = torch.rand(count, generator=generator, device=self.device, dtype=torch.float64) * self._sums[-1]
        return self.training[torch.searchsorted(self._sums, ticket).clamp(max=len(self.training) - 1)]

    def batch(self, index: torch.Tensor) -> dict[str, torch.Tensor]:
        """Return a minibatch: inputs `birds_eye`, `forward`, `vector` as uint8 and float32, and the labels."""
        import torch

        got = {name: column[index] for name, column in self.columns.items()}
        planes = got.pop("planes")
        bits = ((planes[..., None] & self._bits) != 0).flatten(3).to(torch.uint8) * 255
        velocity = got.pop("velocity")
        got["birds_eye"] = torch.cat((bits[:, :VELOCITY], velocity, bits[:, VELOCITY:]), 1)
        classes = torch.arange(1, 13, device=self.device, dtype=torch.uint8)[None, :, None, None]
        ahead = (got.pop("classes")[:, None] == classes).to(torch.uint8) * 255
        got["forward"] = torch.cat((ahead, got.pop("depth")[:, None]), 1)
        return got


def _torch_type(kind: np.dtype) -> torch.dtype:  # type: ignore[type-arg]
    import torch

    return torch.from_numpy(np.zeros(1, kind)).dtype


def main() -> None:
    """Draw the samples of recordings."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path, nargs="+", help="files or folders that training.record wrote")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    files = [f for path in options.recordings for f in (sorted(path.glob("*.npz")) if path.is_dir() else [path])]
    draw(files, options.out, options.workers)


if __name__ == "__main__":
    main()
