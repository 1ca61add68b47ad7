"""Roads from a file beside the recording: a SUMO network, an OpenDRIVE map, or lanelets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from foresee_dsl.files import read_outside_text
from foresee_recordings.maps.lanelet2 import read_lanelet2
from foresee_recordings.maps.network import network_of
from foresee_recordings.recording import RecordedMap, RecordingError

_AS_THEY_ARE = (".net.xml", ".xodr", ".foresee")
"""Files that a scenario can use as its network without a conversion."""


def roads_of_file(path: Path, *, origin_m: tuple[float, float] = (0.0, 0.0)) -> RecordedMap:
    """Return the roads of a file.

    Args:
        origin_m: easting and northing of the recording's origin, m, for maps in UTM: levelX's `xUtmOrigin` and
            `yUtmOrigin`.

    Raises:
        RecordingError: it cannot be read, or is not a map.
    """
    if path.suffix == ".osm":
        lane_map = read_lanelet2(path)
        roads = network_of(lane_map)
        if not lane_map.in_utm:
            return roads
        return replace(roads, offset=(roads.offset[0] + origin_m[0], roads.offset[1] + origin_m[1]))
    suffix = next((suffix for suffix in _AS_THEY_ARE if path.name.endswith(suffix)), "")
    if not suffix:
        raise RecordingError(f"{path} is not a map: its name must end in {', '.join((*_AS_THEY_ARE, '.osm'))}")
    try:
        return RecordedMap(read_outside_text(path), suffix)
    except OSError as err:
        raise RecordingError(f"{path} cannot be read: {err.strerror or err}") from err
    except UnicodeDecodeError as err:
        raise RecordingError(f"{path} is not a text in UTF-8") from err
