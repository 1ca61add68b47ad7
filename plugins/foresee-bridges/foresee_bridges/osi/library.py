"""The packages osi-python and asam-osi-utilities, and the small messages that all others are made of."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from foresee_dsl.exchange.outcome import ExchangeError

if TYPE_CHECKING:
    from foresee_dsl.compile.roads.polyline import XY

REFERENCE = "net.foresee-dsl"
"""Type of the external references that carry our names of things."""


def osi3() -> Any:  # noqa: ANN401  generated modules without types
    """Return the package osi3 with its message modules.

    Raises:
        ExchangeError: osi-python or asam-osi-utilities is not installed.
    """
    try:
        import osi3
        import osi_utilities  # noqa: F401  the writers
        from osi3 import (  # noqa: F401  importing them makes them attributes
            osi_groundtruth_pb2,
            osi_sensorview_pb2,
            osi_trafficupdate_pb2,
            osi_version_pb2,
        )
    except ModuleNotFoundError as err:
        raise ExchangeError(f"OSI traces need the package {err.name}: pip install 'foresee-bridges[osi]'") from None
    return osi3


def interface_version() -> Any:  # noqa: ANN401
    """Return the version of OSI that the messages have."""
    module = osi3().osi_version_pb2
    return module.DESCRIPTOR.GetOptions().Extensions[module.current_interface_version]


def version_text() -> str:
    """Return the version of OSI as a text, such as `3.8.0`."""
    version = interface_version()
    return f"{version.version_major}.{version.version_minor}.{version.version_patch}"


def set_vector(message: Any, x: float, y: float, z: float = 0.0) -> None:  # noqa: ANN401
    """Set the components of a vector message."""
    message.x, message.y, message.z = float(x), float(y), float(z)


def set_yaw(message: Any, yaw_rad: float) -> None:  # noqa: ANN401
    """Set an orientation around the vertical axis, from -pi to pi."""
    message.roll, message.pitch, message.yaw = 0.0, 0.0, math.remainder(float(yaw_rad), math.tau)


def set_size(message: Any, length_m: float, width_m: float, height_m: float) -> None:  # noqa: ANN401
    """Set the dimensions of a bounding box."""
    message.length, message.width, message.height = float(length_m), float(width_m), float(height_m)


def set_time(message: Any, time_s: float) -> None:  # noqa: ANN401
    """Set a timestamp."""
    nanos = round(time_s * 1e9)
    message.seconds, message.nanos = nanos // 10**9, nanos % 10**9


def add_points(points: Any, line: Iterable[XY]) -> None:  # noqa: ANN401
    """Append points of the ground plane to a list of vectors."""
    for x, y in line:
        set_vector(points.add(), x, y)


def add_reference(references: Any, *identifier: str) -> None:  # noqa: ANN401
    """Append our name of a thing to a list of external references."""
    reference = references.add()
    reference.reference, reference.type = "", REFERENCE
    reference.identifier.extend(identifier)


class Numbers:
    """Gives each thing a number of its own, in the order in which it is first asked for."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[str, ...], int] = {}

    def of(self, *key: str) -> int:
        """Return the number of a thing, from 1."""
        return self._numbers.setdefault(key, len(self._numbers) + 1)
