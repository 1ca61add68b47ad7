"""`fusion`, in TransFuser's role: a convolutional branch for each picture, attention between them at three scales,
waypoints from a GRU and a target speed.

After "TransFuser: Imitation with Transformer-Based Sensor Fusion for Autonomous Driving" (Chitta et al., TPAMI 2022):
there both branches are RegNetY-3.2GF with attention at four scales; ours has 3 million parameters for 8 ms on one
processor core. The target speed as classes is that of its successor TransFuser++ (Jaeger et al., ICCV 2023).
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import torch
from foresee_learned.inputs import BIRDS_EYE_SHAPE, FORWARD_SHAPE, VECTOR
from foresee_learned.outputs import DENSITY_CHANNELS, FUSION_TIMES_S, SIGNALS, SPEED_BINS_MPS
from torch import Tensor, nn

from training.models.blocks import (
    EncoderLayer,
    Reading,
    Residual,
    Stem,
    WaypointGru,
    batch_of,
    convolution,
    sample_of,
)

ABOVE = (32, 48, 96, 160)
AHEAD = (16, 32, 64, 128)
"""Channels of the branches at a half, a quarter, an eighth and a sixteenth of their pictures' sides."""
JOINED = 256


class FusionAnswer(NamedTuple):
    """The outputs that are trained; logits for classes. The density map, the stop line and the signal are trained only
    because that helps the first two outputs, which the driver uses."""

    waypoints: Tensor
    target_speed: Tensor
    density: Tensor
    stop_line: Tensor
    signal: Tensor


class Exchange(nn.Module):
    """Attention between the branches: both are pooled to few tokens, which attend to each other and are added back."""

    def __init__(
        self, above: int, ahead: int, width: int, layers: int, grids: tuple[tuple[int, int], tuple[int, int]]
    ) -> None:
        super().__init__()
        (rows, columns), (rows_ahead, columns_ahead) = grids
        self.pools = nn.ModuleList()
        self.cells = rows * columns
        self.into_above, self.into_ahead = nn.Linear(above, width), nn.Linear(ahead, width)
        self.vector = nn.Linear(len(VECTOR), width)
        self.places = nn.Parameter(torch.randn(1, self.cells + rows_ahead * columns_ahead + 1, width) * 0.02)
        self.layers = nn.ModuleList(EncoderLayer(width, 4, 2 * width, 0.1) for _ in range(layers))
        self.norm = nn.LayerNorm(width)
        self.out_above, self.out_ahead = nn.Linear(width, above), nn.Linear(width, ahead)
        self.grids = grids

    def forward(self, above: Tensor, ahead: Tensor, vector: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return both branches with the exchanged features added, and the vector's token."""
        tokens = torch.cat(
            (
                self.into_above(_pooled(above, self.grids[0]).flatten(2).transpose(1, 2)),
                self.into_ahead(_pooled(ahead, self.grids[1]).flatten(2).transpose(1, 2)),
                self.vector(vector)[:, None],
            ),
            1,
        )
        tokens = sample_of(tokens + self.places)
        for layer in self.layers:
            tokens = layer(tokens)
        tokens = batch_of(self.norm(tokens))
        from_above, from_ahead = tokens[:, : self.cells], tokens[:, self.cells : -1]
        above = above + _spread(self.out_above(from_above), self.grids[0], above)
        ahead = ahead + _spread(self.out_ahead(from_ahead), self.grids[1], ahead)
        return above, ahead, tokens[:, -1]


def _pooled(x: Tensor, grid: tuple[int, int]) -> Tensor:
    step = x.shape[2] // grid[0], x.shape[3] // grid[1]
    return nn.functional.avg_pool2d(x, step) if step != (1, 1) else x


def _spread(tokens: Tensor, grid: tuple[int, int], like: Tensor) -> Tensor:
    batch, _, width = tokens.shape
    small = tokens.transpose(1, 2).reshape(batch, width, *grid)
    factor = like.shape[2] // grid[0]
    return nn.functional.interpolate(small, scale_factor=float(factor)) if factor != 1 else small


class Fusion(nn.Module):
    """The network for training."""

    def __init__(self) -> None:
        super().__init__()
        self.reading = Reading()
        self.above, self.ahead = nn.ModuleList(), nn.ModuleList()
        for channels, inputs, into in ((ABOVE, BIRDS_EYE_SHAPE[0], self.above), (AHEAD, FORWARD_SHAPE[0], self.ahead)):
            into.append(Stem(inputs, channels[0]))
            into.extend(Residual(a, b, 2) for a, b in pairwise(channels))
        small = ((8, 8), (4, 10))
        self.exchanges = nn.ModuleList(
            Exchange(ABOVE[k], AHEAD[k], width, layers, small)
            for k, width, layers in ((1, 64, 1), (2, 96, 1), (3, 128, 1))
        )
        self.squeeze_above, self.squeeze_ahead = convolution(ABOVE[3], 32, 1), convolution(AHEAD[3], 16, 1)
        self.vector = nn.Sequential(nn.Linear(len(VECTOR), 64), nn.ReLU(inplace=True))
        self.join = nn.Sequential(
            nn.Linear(32 * 64 + 16 * 40 + 128 + 64, JOINED), nn.ReLU(inplace=True), nn.Dropout(0.1),
            nn.Linear(JOINED, JOINED), nn.ReLU(inplace=True),
        )  # fmt: skip
        self.waypoints = WaypointGru(JOINED, 96, len(FUSION_TIMES_S))
        self.target_speed = nn.Sequential(
            nn.Linear(JOINED, 96), nn.ReLU(inplace=True), nn.Linear(96, len(SPEED_BINS_MPS))
        )
        self.density = nn.Conv2d(ABOVE[2], 4 * len(DENSITY_CHANNELS), 1)
        self.stop_line, self.signal = nn.Linear(JOINED, 1), nn.Linear(JOINED, len(SIGNALS))

    def features(self, birds_eye: Tensor, forward: Tensor, vector: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the joined features, the vector as read, and the view from above at an eighth of its sides."""
        above, ahead, numbers = self.reading(birds_eye, forward, vector)
        above, ahead = self.above[0](above, self.reading.above), self.ahead[0](ahead, self.reading.ahead)
        eighth = token = above
        for k, exchange in enumerate(self.exchanges, start=1):
            above, ahead = self.above[k](above), self.ahead[k](ahead)
            above, ahead, token = exchange(above, ahead, numbers)
            eighth = above if k == 2 else eighth
        parts = (
            self.squeeze_above(above).flatten(1),
            self.squeeze_ahead(ahead).flatten(1),
            token,
            self.vector(numbers),
        )
        return self.join(torch.cat(parts, 1)), numbers, eighth

    def forward(self, birds_eye: Tensor, forward: Tensor, vector: Tensor) -> FusionAnswer:
        """Return all trained outputs."""
        joined, numbers, eighth = self.features(birds_eye, forward, vector)
        return FusionAnswer(
            self.waypoints(joined, numbers),
            self.target_speed(joined),
            density_of(self.density(eighth)),
            self.stop_line(joined),
            self.signal(joined),
        )


class FusionDriver(nn.Module):
    """The network for driving: the same weights without the outputs that only help training."""

    def __init__(self, trained: Fusion) -> None:
        super().__init__()
        self.trained = trained

    def forward(self, birds_eye: Tensor, forward: Tensor, vector: Tensor) -> tuple[Tensor, Tensor]:
        """Return the outputs that `learned.outputs` names."""
        joined, numbers, _ = self.trained.features(birds_eye, forward, vector)
        return self.trained.waypoints(joined, numbers), torch.softmax(self.trained.target_speed(joined), 1)


def density_of(eighth: Tensor) -> Tensor:
    """Return the density map [B, 8, 24, 24] of what is known at an eighth of the view's sides: the part that the map
    covers, four of its squares for each place. The first channel is a logit."""
    return nn.functional.pixel_shuffle(eighth[:, :, 2:14, 2:14], 2)
