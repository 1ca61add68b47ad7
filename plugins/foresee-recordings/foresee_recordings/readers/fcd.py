"""SUMO's floating car data (`sumo --fcd-output`): XML, CSV or Parquet, read timestep by timestep.

Positions are those of the middle of the front bumper, angles are degrees clockwise from north (SUMO, "FCD output").
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from foresee_dsl.compile.nets.safe_xml import children_of
from foresee_recordings.readers import fcd_degrees
from foresee_recordings.readers.classes import Shape, have, kind_of, shape_of, usual_shape
from foresee_recordings.readers.fcd_samples import is_parquet_table, is_table, samples_of
from foresee_recordings.readers.samples import Samples
from foresee_recordings.reading import Request
from foresee_recordings.recording import Recording, RecordingError
from foresee_recordings.sources import head_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

SUMO_SIZES_M: Mapping[str, tuple[str, float, float]] = {
    "passenger": ("car", 5.0, 1.8), "emergency": ("van", 6.5, 2.16), "delivery": ("van", 6.5, 2.16),
    "truck": ("truck", 7.1, 2.4), "trailer": ("truck", 16.5, 2.55), "bus": ("bus", 12.0, 2.5),
    "coach": ("bus", 14.0, 2.6), "tram": ("bus", 22.0, 2.4), "motorcycle": ("motorcycle", 2.2, 0.9),
    "moped": ("motorcycle", 2.1, 0.78), "scooter": ("motorcycle", 1.2, 0.5), "bicycle": ("bicycle", 1.6, 0.65),
    "pedestrian": ("pedestrian", 0.215, 0.478), "wheelchair": ("pedestrian", 1.2, 0.72),
}  # fmt: skip
"""Our kind, length and width (m) of SUMO's classes without a size of their own, as SUMO 1.28 gives them to a vType."""
_DEFAULT_TYPES: Mapping[str, str] = {
    "DEFAULT_VEHTYPE": "passenger", "DEFAULT_TAXITYPE": "passenger", "DEFAULT_PEDTYPE": "pedestrian",
    "DEFAULT_BIKETYPE": "bicycle",
}  # fmt: skip
"""SUMO's own types, with their classes."""
_DEFAULT_TYPE: Mapping[str, str] = {"vehicle": "DEFAULT_VEHTYPE", "person": "DEFAULT_PEDTYPE"}
"""The type of an element without one."""
_LISTED = 8
"""Number of types that a note lists. Ours."""
_LARGE = ("rail", "rail_urban", "rail_electric", "rail_fast", "subway", "ship", "aircraft", "drone", "container",
          "cable_car")  # fmt: skip
"""SUMO's classes that are not road traffic."""
_TYPE_ROOTS = ("routes", "additional", "additionals")
"""Roots of the files with types; SUMO itself accepts any."""
_HEAD_BYTES = 1 << 16
"""Bytes in which the root is looked for. Ours: SUMO may write its configuration as a comment before it."""
_TYPE_FILES = ("*.rou.xml", "*.add.xml", "*.vtypes.xml", "*.rou.xml.gz", "*.add.xml.gz")
_NAMED = re.compile(r'<(?:route-files|additional-files)\s+value="([^"]*)"')
_USUAL_CLASSES: Mapping[str, str] = {"car": "passenger", "van": "delivery", "pedestrian": "pedestrian"}
"""SUMO's classes whose sizes stand for those of our kinds, where the two have other names."""


class FcdReader:
    """SUMO's floating car data."""

    what: ClassVar[str] = "SUMO's floating car data (--fcd-output): XML, CSV or Parquet, also .gz"
    numbers: ClassVar[tuple[str, ...]] = ()

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file is SUMO's FCD; a comment with SUMO's configuration may come before the root."""
        if head.startswith(b"PAR1"):
            return is_parquet_table(path)
        return is_table(head) or b"<fcd-export" in head or (b"<!-- generated on" in head and b"<fcd-output" in head)

    def read(self, request: Request) -> Recording:
        """Read the timesteps of the request; the file is not read beyond its end.

        Sizes are those of the vehicle types in the route and additional files beside the file (`*.rou.xml`,
        `*.add.xml`), otherwise those that SUMO gives to the class of this name.
        """
        samples = Samples(request)
        types: dict[str, str] = {}
        untyped: dict[str, str] = {}
        tags: dict[str, str] = {}
        for time_s, tag, fields in samples_of(request.path, samples.left_out):
            if samples.is_over(time_s):
                samples.wants("", time_s)
                break
            id_ = str(fields.get("id", ""))
            # Vehicles and persons have names of their own: both may have a `0`.
            actor = id_ if tags.get(id_, tag) == tag else f"{tag}_{id_}"
            if not samples.wants(actor, time_s) or not _add(request, samples, actor, time_s, fields):
                continue
            if actor not in types:
                tags.setdefault(id_, tag)
                types[actor] = str(fields.get("type") or _DEFAULT_TYPE[tag])
                if not fields.get("type"):
                    untyped[actor] = tag
        return self._recording(request, samples, types, untyped)

    def _recording(
        self, request: Request, samples: Samples, types: Mapping[str, str], untyped: Mapping[str, str]
    ) -> Recording:
        """Return the recording; `types`: the type of each actor, `untyped`: the elements of those that the file gives
        none."""
        file_types = types_beside(request.path, samples)
        guesses: Counter[str] = Counter()
        shapes = {}
        for actor, type_ in types.items():
            # A vehicle of a distribution or a flow may have a type `NAME@ID` of its own.
            shape = file_types.get(type_) or file_types.get(type_.partition("@")[0]) or _usual_shape(type_)
            if shape is None:
                samples.left_out["actors that are not road traffic, such as trains and ships"] += 1
                continue
            if actor in untyped:
                shapes[actor] = replace(shape, sized=False)
                continue
            shapes[actor] = shape
            if not shape.sized:
                guesses[f"{type_} as a {shape.kind}"] += 1
        if guesses:
            counts = ", ".join(f"{count} of the type {words}" for words, count in guesses.most_common(_LISTED))
            samples.note(
                "The file has no sizes: those that SUMO gives to a class by default are used, for "
                f"{counts}{', ...' if len(guesses) > _LISTED else ''}. Put the file with the vehicle types beside it "
                "(NAME.rou.xml or NAME.add.xml)."
            )
        for tag, count in Counter(untyped.values()).items():
            kind, *_ = SUMO_SIZES_M[_DEFAULT_TYPES[_DEFAULT_TYPE[tag]]]
            samples.note(
                f"{have(count, tag)} no type: {kind}s are assumed ({_DEFAULT_TYPE[tag]}). If SUMO wrote the file with "
                "--fcd-output.attributes, list `type` there."
            )
        zone = self._zone(request, samples)
        recording = samples.recording("fcd", shapes, offset_m=lambda _, shape: (-shape.length_m / 2, 0.0))
        return recording if zone is None else fcd_degrees.placed(recording, zone)

    def _zone(self, request: Request, samples: Samples) -> fcd_degrees.Zone | None:
        """Return the UTM zone into which positions in degrees were projected; None if they are in metres."""
        place = samples.first_place()
        if not (abs(place[0]) <= 180 and abs(place[1]) <= 90):
            return None
        if not fcd_degrees.is_in_degrees(request.path, samples.speed_ratio()):
            return None
        zone = fcd_degrees.zone_for(request.map_file, place)
        samples.move(fcd_degrees.projection(zone))
        samples.note(f"The positions are in degrees: they are projected to {zone.name}, m.")
        return zone


def _add(request: Request, samples: Samples, actor: str, time_s: float, fields: Mapping[str, str | float]) -> bool:
    try:
        x, y = float(fields["x"]), float(fields["y"])
        angle, speed = float(fields.get("angle", math.nan)), float(fields.get("speed", math.nan))
    except KeyError:
        samples.left_out["samples without a position"] += 1
        return False
    except ValueError as err:
        raise RecordingError(f"{request.path}: {actor!r} at {time_s:g} s: {err}") from None
    return samples.add(actor, time_s, x, y, math.radians(90.0 - angle), speed)


def _usual_shape(type_: str) -> Shape | None:
    """Return the shape of a type that no file defines; None if it is not road traffic."""
    if type_ in _DEFAULT_TYPES:
        return Shape(*SUMO_SIZES_M[_DEFAULT_TYPES[type_]])
    if type_.lower() in _LARGE or type_ in ("DEFAULT_RAILTYPE", "DEFAULT_CONTAINERTYPE"):
        return None
    kind = kind_of(type_) or "car"
    class_ = type_.lower() if type_.lower() in SUMO_SIZES_M else _USUAL_CLASSES.get(kind, kind)
    return Shape(*SUMO_SIZES_M[class_], sized=False) if class_ in SUMO_SIZES_M else usual_shape(kind)


def types_beside(path: Path, samples: Samples) -> dict[str, Shape]:
    """Return the shapes of the vehicle types in the route and additional files in a file's folder, by type: those that
    SUMO's configuration names, which is a comment at the top, and those with usual names.

    A file that cannot be read is noted, and its types are not known.
    """
    shapes: dict[str, Shape] = {}
    head = head_of(path, _HEAD_BYTES).decode("utf-8", "replace")
    paths = [part.strip() for value in _NAMED.findall(head) for part in re.split(r"[,;]", value)]
    names = [re.split(r"[/\\]", part)[-1] for part in paths]  # of another machine: only files beside this one are read
    files = [path.with_name(name) for name in names if name.endswith((".xml", ".xml.gz"))]
    files += [file for pattern in _TYPE_FILES for file in sorted(path.parent.glob(pattern))]
    for file in dict.fromkeys(files):
        if not file.is_file():
            continue
        try:
            shapes.update(_types_of(file))
        except RecordingError as err:
            samples.note(f"The types in {file.name} were not read: {err}")
    return shapes


def _types_of(file: Path) -> Iterator[tuple[str, Shape]]:
    head = head_of(file, _HEAD_BYTES).decode("utf-8", "replace")
    root = next((name for name in _TYPE_ROOTS if re.search(rf"<{name}[\s>]", head)), _TYPE_ROOTS[0])
    for element in children_of(file, root, "a file of SUMO's types", RecordingError):
        for type_ in [element] if element.tag == "vType" else element.iter("vType"):
            shape = _defined_shape(file, type_)
            if shape is not None:
                yield type_.get("id", ""), shape


def _defined_shape(file: Path, type_: Element) -> Shape | None:
    """Return the shape of a vType; its name says the kind if it has no class, but SUMO gives it the size of a car."""
    class_ = type_.get("vClass", "")
    if class_ in _LARGE:
        return None
    kind, length_m, width_m = SUMO_SIZES_M.get(class_, SUMO_SIZES_M["passenger"])
    try:
        length_m, width_m = float(type_.get("length", length_m)), float(type_.get("width", width_m))
    except ValueError as err:
        raise RecordingError(f"{file}: type {type_.get('id')!r}: {err}") from None
    named = None if class_ in SUMO_SIZES_M else kind_of(type_.get("id", ""))
    return shape_of(named or kind, length_m, width_m)
