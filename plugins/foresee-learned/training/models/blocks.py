"""Parts of both networks: reading the pictures, convolutions, attention, and waypoints one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from foresee_learned.inputs import BIRDS_EYE_SHAPE, CHANNELS, FORWARD_SHAPE, VECTOR
from foresee_learned.rasters.layout import GROUPS, VELOCITY_PER_MPS, VELOCITY_ZERO
from torch import Tensor, nn

_SPEED_MPS = 10.0
_DISTANCE_M = 20.0
"""Numbers are divided by these, so that most lie between -1 and 1."""
VELOCITY = CHANNELS.index("velocity_ahead")
USERS = [CHANNELS.index(name) for name in GROUPS]
UNKNOWN_SPEED_MPS = -5.0
"""Stands for a speed that training hides."""


class Reading(nn.Module):
    """Turns the inputs as they are stored into numbers of about one, by matrices over their channels.

    A velocity is stored as 128 + 5 for each m/s where a road user is and as 0 elsewhere: its value, less 128 times the
    road users' planes, is the velocity. As all is linear, the first convolutions can take it over (`folded`).
    """

    above: Tensor
    ahead: Tensor
    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        above = torch.eye(len(CHANNELS)) / 255
        for k in (VELOCITY, VELOCITY + 1):
            above[k, k] = 1 / (VELOCITY_PER_MPS * _SPEED_MPS)
            above[k, USERS] = -VELOCITY_ZERO / (VELOCITY_PER_MPS * _SPEED_MPS) / 255
        scale = [
            1 / _SPEED_MPS if name.endswith("mps") else 1 / _DISTANCE_M if name.endswith("m") else 1.0
            for name in VECTOR
        ]
        self.register_buffer("above", above, persistent=False)
        self.register_buffer("ahead", torch.eye(FORWARD_SHAPE[0]) / 255, persistent=False)
        self.register_buffer("scale", torch.tensor(scale), persistent=False)

    def forward(self, birds_eye: Tensor, forward: Tensor, vector: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return both pictures as floats, unchanged, and the vector divided."""
        kind = vector.dtype
        if self.training and vector.is_cuda:
            kind = torch.bfloat16  # whole numbers up to 255 are exact in it
        return birds_eye.to(kind), forward.to(kind), vector * self.scale


class Stem(nn.Module):
    """The first convolution of a picture: 3 x 3, every second pixel, over channels that a matrix has changed."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(inputs, outputs, 3, 2, 1, bias=False)
        self.after = nn.Sequential(nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))

    def forward(self, picture: Tensor, channels: Tensor) -> Tensor:
        """Return [B, outputs, rows / 2, columns / 2]."""
        weight = torch.einsum("oikl,ij->ojkl", self.convolution.weight, channels)
        if self.training:  # tensor cores want channels by eights
            more = -picture.shape[1] % 8
            picture = nn.functional.pad(picture, (0, 0, 0, 0, 0, more)).contiguous(memory_format=torch.channels_last)
            weight = nn.functional.pad(weight, (0, 0, 0, 0, 0, more))
        seen: Tensor = self.after(nn.functional.conv2d(picture, weight, stride=2, padding=1))
        return seen


def convolution(inputs: int, outputs: int, size: int = 3, stride: int = 1) -> nn.Sequential:
    """Return a convolution with its normalisation and rectifier."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
    )


class Residual(nn.Module):
    """Two convolutions of 3 x 3 beside an identity, as in ResNet; with a stride the identity is a convolution too."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.first = convolution(inputs, outputs, 3, stride)
        self.second = nn.Sequential(nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False), nn.BatchNorm2d(outputs))
        self.beside: nn.Module = nn.Identity()
        if stride != 1 or inputs != outputs:
            self.beside = nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))

    def forward(self, x: Tensor) -> Tensor:
        """Return the block's answer."""
        return torch.relu(self.second(self.first(x)) + self.beside(x))


class Attention(nn.Module):
    """Queries attend to tokens: heads of scaled dot products, written out so that every exporter knows the
    operators."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads, self.scale = heads, (width // heads) ** -0.5
        self.query, self.key_value = nn.Linear(width, width), nn.Linear(width, 2 * width)
        self.out = nn.Linear(width, width)

    def forward(self, queries: Tensor, tokens: Tensor) -> Tensor:
        """Return [B, Q, width] of queries [B, Q, width] and tokens [B, T, width]."""
        if torch.onnx.is_in_onnx_export():
            return self._of_one(queries, tokens)
        batch, count, width = queries.shape

        def split(x: Tensor) -> Tensor:
            return x.reshape(batch, -1, self.heads, width // self.heads).transpose(1, 2)

        keys, values = self.key_value(tokens).chunk(2, 2)
        q, k, v = split(self.query(queries) * self.scale), split(keys), split(values)
        weights = torch.softmax(q @ k.transpose(2, 3), -1)
        mixed: Tensor = self.out((weights @ v).transpose(1, 2).reshape(batch, count, width))
        return mixed

    def _of_one(self, queries: Tensor, tokens: Tensor) -> Tensor:
        """Return [Q, width] of one sample's [Q, width] and [T, width]: the heads as one operator of onnxruntime."""
        keys, values = self.key_value(tokens).chunk(2, 1)
        scaled = self.query(queries) * self.scale
        mixed: Tensor = self.out(_Heads.apply(scaled[None], keys[None], values[None], self.heads)[0])
        return mixed


class _Heads(torch.autograd.Function):
    """Attention in heads, [1, Q, width] of queries, keys and values, for files: onnxruntime's `MultiHeadAttention`."""

    @staticmethod
    def forward(_: object, queries: Tensor, keys: Tensor, values: Tensor, heads: int) -> Tensor:  # type: ignore[override]
        q, k, v = (x.unflatten(2, (heads, -1)).transpose(1, 2) for x in (queries, keys, values))
        return (torch.softmax(q @ k.transpose(2, 3), -1) @ v).transpose(1, 2).flatten(2)

    @staticmethod
    def symbolic(g: Any, queries: Any, keys: Any, values: Any, heads: int) -> Any:  # noqa: ANN401  torch's
        operator = "com.microsoft::MultiHeadAttention"
        return g.op(operator, queries, keys, values, num_heads_i=heads, scale_f=1.0).setType(queries.type())


def sample_of(tokens: Tensor) -> Tensor:
    """Return the unchanged tokens [B, T, width] or, for a file, those of the only sample: each product is then a
    product of two matrices, which onnxruntime computes fast."""
    return tokens[0] if torch.onnx.is_in_onnx_export() else tokens


def batch_of(tokens: Tensor) -> Tensor:
    """Undo `sample_of`."""
    return tokens[None] if torch.onnx.is_in_onnx_export() else tokens


class EncoderLayer(nn.Module):
    """Tokens attend to each other; normalised first, as is usual for small data."""

    def __init__(self, width: int, heads: int, inner: int, dropout: float) -> None:
        super().__init__()
        self.before, self.attention, self.between = nn.LayerNorm(width), Attention(width, heads), nn.LayerNorm(width)
        self.feed = nn.Sequential(nn.Linear(width, inner), nn.ReLU(inplace=True), nn.Linear(inner, width))
        self.drop = nn.Dropout(dropout)

    def forward(self, tokens: Tensor) -> Tensor:
        """Return the tokens, changed."""
        seen = self.before(tokens)
        tokens = tokens + self.drop(self.attention(seen, seen))
        return tokens + self.drop(self.feed(self.between(tokens)))


class DecoderLayer(nn.Module):
    """Queries attend to tokens and, with `among`, to each other."""

    def __init__(self, width: int, heads: int, inner: int, dropout: float, *, among: bool) -> None:
        super().__init__()
        self.among = EncoderLayer(width, heads, inner, dropout) if among else None
        self.before, self.attention, self.between = nn.LayerNorm(width), Attention(width, heads), nn.LayerNorm(width)
        self.feed = nn.Sequential(nn.Linear(width, inner), nn.ReLU(inplace=True), nn.Linear(inner, width))
        self.drop = nn.Dropout(dropout)

    def forward(self, queries: Tensor, tokens: Tensor) -> Tensor:
        """Return the queries, changed."""
        if self.among is not None:
            queries = self.among(queries)
        queries = queries + self.drop(self.attention(self.before(queries), tokens))
        return queries + self.drop(self.feed(self.between(queries)))


class WaypointGru(nn.Module):
    """Computes each waypoint from the one before it and the goal points, like the heads of TransFuser and
    InterFuser."""

    def __init__(self, features: int, width: int, count: int) -> None:
        super().__init__()
        self.count = count
        self.start = nn.Linear(features, width)
        self.goal = nn.Linear(len(VECTOR), 3 * width)
        self.place = nn.Linear(2, 3 * width, bias=False)
        self.state = nn.Linear(width, 3 * width)
        self.step = nn.Linear(width, 2)

    def forward(self, features: Tensor, vector: Tensor) -> Tensor:
        """Return [B, count, 2] metres ahead and left."""
        hidden = torch.tanh(self.start(features))
        goal = self.goal(vector)
        place = torch.zeros_like(vector[:, :2])
        places = []
        for _ in range(self.count):
            reset_in, update_in, new_in = (goal + self.place(place)).chunk(3, 1)
            reset_state, update_state, new_state = self.state(hidden).chunk(3, 1)
            update = torch.sigmoid(update_in + update_state)
            new = torch.tanh(new_in + torch.sigmoid(reset_in + reset_state) * new_state)
            hidden = new + update * (hidden - new)
            place = place + self.step(hidden)
            places.append(place)
        return torch.stack(places, 1) * _SPEED_MPS


def examples(batch: int = 1) -> tuple[Tensor, Tensor, Tensor]:
    """Return inputs of the right shapes and types."""
    pictures = (torch.randint(0, 2, (batch, *shape), dtype=torch.uint8) * 255 for shape in _SHAPES)
    above, ahead = pictures
    return above, ahead, torch.randn(batch, len(VECTOR))


_SHAPES: Sequence[tuple[int, int, int]] = (BIRDS_EYE_SHAPE, FORWARD_SHAPE)
