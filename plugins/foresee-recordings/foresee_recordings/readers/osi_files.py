"""Files of ASAM OSI: messages with their lengths (`.osi`), channels of MCAP, and the map in or beside them."""

from __future__ import annotations

import io
import re
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

from foresee_dsl.files import read_outside_text
from foresee_dsl.limits import most, raised_by
from foresee_recordings.readers.parquet import metadata_of
from foresee_recordings.recording import RecordingError
from foresee_recordings.sources import head_of, opened

MCAP_MAGIC = b"\x89MCAP0\r\n"
"""The first bytes of an MCAP file (mcap.dev, specification)."""
_LENGTH = struct.Struct("<I")
"""The length before each message of a binary trace (OSI, trace file formats)."""
_MAP_FIELDS = ("map_reference", "open_drive_xml_content")
"""Fields 1 and 2 of omega-prime's message MapAsamOpenDrive, both texts (omega-prime's specification, option A)."""


class Trace:
    """A trace of ground truths.

    Attributes:
        opendrive: its map, the text of an OpenDRIVE file, once all messages were read; None if there is none.
        left_out: counts of what was not read, by description.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._reference = path, ""
        self.opendrive: str | None = None
        self.left_out: Counter[str] = Counter()

    def ground_truths(self) -> Iterator[Any]:
        """Yield the ground truths in the file's order; of a sensor view, the global one.

        Raises:
            RecordingError: the file is damaged, or a package is missing.
        """
        osi_module()
        from google.protobuf.message import DecodeError

        messages = self._of_mcap() if head_of(self._path, len(MCAP_MAGIC)) == MCAP_MAGIC else self._of_binary()
        number = 0
        try:
            for message in messages:
                number += 1
                self._reference = self._reference or message.map_reference
                yield message
        except DecodeError as err:
            raise RecordingError(f"{self._path}: message {number + 1} is not a message of OSI ({err})") from err
        if number == 0:
            raise RecordingError(f"{self._path}: it has no message GroundTruth or SensorView")
        if self.opendrive is None:
            self.opendrive = self._map_beside()

    def _map_beside(self) -> str | None:
        """Return the map beside the file that its messages name (omega-prime's specification, option B)."""
        name = re.split(r"[/\\]", self._reference)[-1]
        file = self._path.with_name(name) if name.endswith(".xodr") else None
        if file is None or not file.is_file():
            return None
        try:
            return read_outside_text(file)
        except (OSError, UnicodeDecodeError) as err:
            raise RecordingError(f"{file} cannot be read: {err}") from err

    def _of_binary(self) -> Iterator[Any]:
        most_bytes = round(most("file") * 1e6)
        kind: str = ""
        with opened(self._path) as file:
            number = 0
            while head := file.read(_LENGTH.size):
                number += 1
                size = _LENGTH.unpack(head)[0] if len(head) == _LENGTH.size else 0
                if size > most_bytes:
                    raise RecordingError(
                        f"{self._path}: message {number} claims to have {size / 1e6:,.0f} MB, so this is not a trace "
                        f"of OSI; {raised_by('file', size / 1e6)}"
                    )
                data = file.read(size)
                if len(head) < _LENGTH.size or len(data) < size:
                    self.left_out["messages that are cut off at the end of the file"] += 1
                    return
                kind = kind or _kind_of(self._path, data)
                yield _ground_truth(kind, data)

    def _of_mcap(self) -> Iterator[Any]:
        kinds: dict[int, str] = {}
        schemas: dict[int, str] = {}
        with opened(self._path) as file:
            for record in _records(self._path, file):
                match type(record).__name__:
                    case "Schema":
                        schemas[record.id] = record.name.rpartition(".")[2].lower()
                    case "Channel":
                        kinds[record.id] = schemas.get(record.schema_id, "")
                    case "Message":
                        kind = kinds.get(record.channel_id, "")
                        if kind in ("groundtruth", "sensorview"):
                            yield _ground_truth(kind, record.data)
                        elif kind == "mapasamopendrive":
                            self.opendrive = _map_text(record.data)
                        else:
                            self.left_out["messages of other channels"] += 1


def osi_module() -> Any:  # noqa: ANN401  generated modules without types
    """Return the package osi3 with its message modules.

    Raises:
        RecordingError: it is not installed, or not the one of MCAP.
    """
    try:
        import mcap  # noqa: F401
        import osi3
        from osi3 import osi_groundtruth_pb2, osi_object_pb2, osi_sensorview_pb2  # noqa: F401  makes them attributes
    except ModuleNotFoundError as err:
        raise RecordingError(f"OSI traces need the package {err.name}: pip install 'foresee-recordings[osi]'") from None
    return osi3


def is_parquet(path: Path) -> bool:
    """Return whether a file is one of Parquet."""
    return head_of(path, 4) == b"PAR1"


def opendrive_of_parquet(path: Path) -> str | None:
    """Return the OpenDRIVE map in the metadata of a Parquet file of omega-prime; None if it has none."""
    text = metadata_of(path).get(b"xodr")
    return None if text is None else text.decode("utf-8", "replace")


def _kind_of(path: Path, data: bytes) -> str:
    """Return which message a binary trace has: by the code in its name (OSI, naming conventions), or the one as which
    the first message has more moving objects, since the file itself does not say it."""
    if match := re.search(r"_(gt|sv)_", path.name):
        return {"gt": "groundtruth", "sv": "sensorview"}[match[1]]
    from google.protobuf.message import DecodeError

    counts = {}
    for kind in ("groundtruth", "sensorview"):
        try:
            objects = _ground_truth(kind, data).moving_object
        except DecodeError:
            continue
        counts[kind] = sum(thing.HasField("base") and thing.base.HasField("position") for thing in objects)
    return max(counts, key=lambda kind: counts[kind], default="groundtruth")


def _ground_truth(kind: str, data: bytes) -> Any:  # noqa: ANN401
    modules = osi_module()
    if kind == "sensorview":
        return modules.osi_sensorview_pb2.SensorView.FromString(data).global_ground_truth
    return modules.osi_groundtruth_pb2.GroundTruth.FromString(data)


def _records(path: Path, file: BinaryIO) -> Iterator[Any]:
    """Yield the records of an MCAP file, those in chunks too; a chunk is unpacked up to the limit `file`."""
    from mcap.exceptions import McapError
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    most_bytes = round(most("file") * 1e6)
    try:
        for record in StreamReader(file, emit_chunks=True, record_size_limit=most_bytes).records:
            if isinstance(record, Chunk):
                data = _unpacked(record, most_bytes)
                if len(data) > most_bytes:
                    raise RecordingError(
                        f"{path}: a chunk has more than {most('file'):g} MB when it is unpacked; {raised_by('file')}"
                    )
                yield from breakup_chunk(replace(record, data=data, compression=""))
            else:
                yield record
    except (McapError, struct.error, EOFError, ValueError, LookupError, RuntimeError) as err:
        raise RecordingError(f"{path} is not an MCAP file, or a damaged one: {err or type(err).__name__}") from err


def _unpacked(chunk: Any, most_bytes: int) -> bytes:  # noqa: ANN401
    """Return a chunk's records, at most one byte more than allowed.

    Raises:
        ValueError: it is damaged, or packed in another way.
    """
    if chunk.compression == "zstd":
        import zstandard

        try:
            return zstandard.ZstdDecompressor().stream_reader(io.BytesIO(chunk.data)).read(most_bytes + 1)
        except zstandard.ZstdError as err:
            raise ValueError(str(err)) from err
    if chunk.compression == "lz4":
        import lz4.frame

        data: bytes = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=most_bytes + 1)
        return data
    if chunk.compression:
        raise ValueError(f"a chunk is packed with {chunk.compression[:20]!r}")
    return bytes(chunk.data)


def _map_text(data: bytes) -> str:
    """Return the OpenDRIVE text of a message MapAsamOpenDrive, which is not a part of OSI.

    Raises:
        google.protobuf.message.DecodeError: it is damaged.
    """
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    field = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(name="map.proto", package="recordings", syntax="proto2")
    message = file.message_type.add(name="Map")
    for number, name in enumerate(_MAP_FIELDS, start=1):
        message.field.add(name=name, number=number, type=field.TYPE_STRING, label=field.LABEL_OPTIONAL)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    parsed = message_factory.GetMessageClass(pool.FindMessageTypeByName("recordings.Map")).FromString(data)
    return str(parsed.open_drive_xml_content)
