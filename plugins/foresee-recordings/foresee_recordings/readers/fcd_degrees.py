"""SUMO's floating car data in degrees (`--fcd-output.geo`): longitudes and latitudes become metres of a UTM zone.

Most networks from OpenStreetMap are in UTM, moved by `netOffset`, so a network of the request fits exactly.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.compile.nets.safe_xml import children_of
from foresee_recordings.maps.utm import utm, zone_of
from foresee_recordings.recording import FloatArray, Recording, RecordingError
from foresee_recordings.sources import head_of

_HEAD_BYTES = 1 << 16
"""Bytes in which SUMO's configuration is looked for, which it writes as a comment at the top. Ours."""
_OPTION = re.compile(rb'<fcd-output\.geo\s+value="(true|1|on|yes)"', re.IGNORECASE)
DEGREES_PER_M = (4e-6, 4e-5)
"""Displacement in degrees of a metre: 9e-6 along a meridian, more across it (2.6e-5 at 70 degrees). Ours: wider by a
factor of two, since speeds are those of the next moment."""


@dataclass(frozen=True)
class Zone:
    """A UTM zone, and the offset of a network in it, m: what is added to easting and northing."""

    number: int
    southern: bool
    offset: tuple[float, float] = (0.0, 0.0)

    @property
    def name(self) -> str:
        """Its name, such as `UTM zone 32 north`."""
        return f"UTM zone {self.number} {'south' if self.southern else 'north'}"


def is_in_degrees(path: Path, speed_ratio: float | None) -> bool:
    """Return whether positions are degrees: SUMO's configuration says so, or they move as slowly as degrees do.

    Args:
        speed_ratio: the median speed of the positions in relation to the recorded speeds; None if nothing moves.
    """
    if _OPTION.search(head_of(path, _HEAD_BYTES)):
        return True
    return speed_ratio is not None and DEGREES_PER_M[0] < speed_ratio < DEGREES_PER_M[1]


def zone_for(map_file: Path | None, place: FloatArray) -> Zone:
    """Return the zone of a network, or the one of a place, longitude and latitude.

    Raises:
        RecordingError: the network cannot be read, or is not in UTM.
    """
    if map_file is None or not map_file.name.endswith((".net.xml", ".net.xml.gz")):
        return Zone(zone_of(float(place[0])), bool(place[1] < 0))
    for element in children_of(map_file, "net", "a SUMO network", RecordingError):
        if element.tag == "location":
            projection = element.get("projParameter", "")
            match = re.search(r"\+zone=(\d+)", projection)
            if "+proj=utm" not in projection or match is None:
                raise RecordingError(
                    f"{map_file}: the positions are in degrees, and its projection is not UTM ({projection[:60]!r}): "
                    "write the recording without --fcd-output.geo"
                )
            x, y = (float(part) for part in element.get("netOffset", "0,0").split(","))
            return Zone(int(match[1]), "+south" in projection, (x, y))
    raise RecordingError(f"{map_file} has no <location>")


def projection(zone: Zone) -> Callable[[FloatArray], FloatArray]:
    """Return what turns [N, 2] longitudes and latitudes in place into easting and northing of a zone, m."""

    def project(places: FloatArray) -> FloatArray:
        for k, (longitude, latitude) in enumerate(places.tolist()):
            places[k] = utm(latitude, longitude, zone.number, southern=zone.southern)
        return places

    return project


def placed(recording: Recording, zone: Zone) -> Recording:
    """Return a recording with the offset that its network has in the zone."""
    if recording.roads is None:
        return recording
    return replace(recording, roads=replace(recording.roads, offset=zone.offset))
