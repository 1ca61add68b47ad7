"""Roads from a file beside the recording: a SUMO network, an OpenDRIVE map, or lanelets."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.files import read_outside_text
from foresee_recordings.recording import RecordedMap, RecordingError

_AS_THEY_ARE = (".net.xml", ".xodr", ".foresee")
"""Files that a scenario can use as its network without a conversion."""


def roads_of_file(path: Path) -> RecordedMap:
    """Return the roads of a file.

    Raises:
        RecordingError: it cannot be read, or is not a map.
    """
    suffix = next((suffix for suffix in _AS_THEY_ARE if path.name.endswith(suffix)), "")
    if not suffix:
        raise RecordingError(f"{path} is not a map: its name must end in {', '.join(_AS_THEY_ARE)}")
    try:
        return RecordedMap(read_outside_text(path), suffix)
    except OSError as err:
        raise RecordingError(f"{path} cannot be read: {err.strerror or err}") from err
    except UnicodeDecodeError as err:
        raise RecordingError(f"{path} is not a text in UTF-8") from err
