"""`fusion_safe`, in InterFuser's role: a transformer over tokens of both pictures; queries ask for waypoints, the
density map, the stop line and the signal.

After "Safety-Enhanced Autonomous Driving Using Interpretable Sensor Fusion Transformer" (Shao et al., CoRL 2022): there
ResNets make the tokens, six layers encode and six decode at a width of 256; ours fits 8 ms on one processor core.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from foresee_learned.inputs import BIRDS_EYE_SHAPE, FORWARD_SHAPE, VECTOR
from foresee_learned.outputs import DENSITY_CHANNELS, FUSION_SAFE_TIMES_S, SIGNALS
from torch import Tensor, nn

from training.models.blocks import DecoderLayer, EncoderLayer, Reading, Residual, Stem, WaypointGru, batch_of, sample_of

WIDTH, HEADS, INNER = 128, 4, 256
ABOVE = (32, 48, 96)
AHEAD = (16, 32, 64)
"""Channels of the stems at a half, a quarter and an eighth of their pictures' sides."""
TOKENS_ABOVE, TOKENS_AHEAD = 64, 40
_QUERIES = 3
"""Waypoints, stop line, signal; the density map's queries are places of the view from above."""


class FusionSafeAnswer(NamedTuple):
    """The outputs that are trained: waypoints; logits of stop line, signal and of the density map's first channel."""

    waypoints: Tensor
    density: Tensor
    stop_line: Tensor
    signal: Tensor


class _Branch(nn.Module):
    def __init__(self, inputs: int, channels: tuple[int, int, int]) -> None:
        super().__init__()
        self.stem = Stem(inputs, channels[0])
        self.rest = nn.Sequential(Residual(channels[0], channels[1], 2), Residual(channels[1], channels[2], 2))

    def forward(self, picture: Tensor, channels: Tensor) -> Tensor:
        features: Tensor = self.rest(self.stem(picture, channels))
        return features


class FusionSafe(nn.Module):
    """The network for training."""

    def __init__(self) -> None:
        super().__init__()
        self.reading = Reading()
        self.above, self.ahead = _Branch(BIRDS_EYE_SHAPE[0], ABOVE), _Branch(FORWARD_SHAPE[0], AHEAD)
        self.token_above, self.token_ahead = nn.Conv2d(ABOVE[2], WIDTH, 2, 2), nn.Conv2d(AHEAD[2], WIDTH, 2, 2)
        self.token_vector = nn.Linear(len(VECTOR), WIDTH)
        self.places = nn.Parameter(torch.randn(1, TOKENS_ABOVE + TOKENS_AHEAD + 1, WIDTH) * 0.02)
        self.encoder = nn.ModuleList(EncoderLayer(WIDTH, HEADS, INNER, 0.1) for _ in range(4))
        self.norm = nn.LayerNorm(WIDTH)
        self.queries = nn.Parameter(torch.randn(1, _QUERIES, WIDTH) * 0.02)
        self.decoder = nn.ModuleList(DecoderLayer(WIDTH, HEADS, INNER, 0.1, among=True) for _ in range(2))
        self.asked, self.asked_density = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)
        self.query_density = nn.Linear(ABOVE[2], WIDTH)
        self.places_density = nn.Parameter(torch.randn(1, 144, WIDTH) * 0.02)
        self.decoder_density = DecoderLayer(WIDTH, HEADS, 192, 0.1, among=False)
        self.density = nn.Linear(WIDTH, 4 * len(DENSITY_CHANNELS))
        self.waypoints = WaypointGru(WIDTH, 96, len(FUSION_SAFE_TIMES_S))
        self.stop_line, self.signal = nn.Linear(WIDTH, 1), nn.Linear(WIDTH, len(SIGNALS))

    def forward(self, birds_eye: Tensor, forward: Tensor, vector: Tensor) -> FusionSafeAnswer:
        """Return all trained outputs."""
        above, ahead, numbers = self.reading(birds_eye, forward, vector)
        above, ahead = self.above(above, self.reading.above), self.ahead(ahead, self.reading.ahead)
        tokens = torch.cat(
            (
                self.token_above(above).flatten(2).transpose(1, 2),
                self.token_ahead(ahead).flatten(2).transpose(1, 2),
                self.token_vector(numbers)[:, None],
            ),
            1,
        )
        tokens = sample_of(tokens + self.places)
        for layer in self.encoder:
            tokens = layer(tokens)
        tokens = self.norm(tokens)
        queries = sample_of(self.queries.expand(vector.shape[0], -1, -1))
        for layer in self.decoder:
            queries = layer(queries, tokens)
        queries = batch_of(self.asked(queries))
        return FusionSafeAnswer(
            self.waypoints(queries[:, 0], numbers),
            self._density(above, tokens),
            self.stop_line(queries[:, 1]),
            self.signal(queries[:, 2]),
        )

    def _density(self, above: Tensor, tokens: Tensor) -> Tensor:
        places = above[:, :, 2:14, 2:14].flatten(2).transpose(1, 2)
        queries = sample_of(self.query_density(places) + self.places_density)
        decoded = self.decoder_density(queries, tokens)
        cells = batch_of(self.density(self.asked_density(decoded))).transpose(1, 2)
        return nn.functional.pixel_shuffle(cells.reshape(-1, 4 * len(DENSITY_CHANNELS), 12, 12), 2)


class FusionSafeDriver(nn.Module):
    """The network for driving: the same network with probabilities instead of logits."""

    def __init__(self, trained: FusionSafe) -> None:
        super().__init__()
        self.trained = trained

    def forward(self, birds_eye: Tensor, forward: Tensor, vector: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the outputs that `learned.outputs` names."""
        waypoints, density, stop_line, signal = self.trained(birds_eye, forward, vector)
        density = torch.cat((torch.sigmoid(density[:, :1]), density[:, 1:]), 1)
        return waypoints, density, torch.sigmoid(stop_line), torch.softmax(signal, 1)
