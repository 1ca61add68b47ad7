"""Cutting a part out of a map, with netconvert's `--keep-edges.in-boundary` and `--keep-edges.in-geo-boundary`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.networks import Tell
from foresee_dsl.compile.nets.net_reader import points_of
from foresee_dsl.compile.nets.netconvert import run_netconvert
from foresee_dsl.compile.nets.safe_xml import children_of, unpacked
from foresee_dsl.compile.roads.polyline import XY, Points, interpolate, lengths
from foresee_dsl.errors import CompileError
from foresee_dsl.exchange.outcome import ExchangeError

EMPTY = ("No edges loaded", "No nodes loaded")
"""Messages of netconvert 1.28 when no edge of a map is left."""
_METRES_A_DEGREE = 111_320.0
"""Metres per degree of latitude: the earth's circumference at the equator, 40,075 km, over 360."""
_LARGEST = 1e8
"""Largest value of a coordinate that is accepted, m (ours: larger than any coordinate of a map)."""
CUT = "cut a part out (`--around`, `--in-boundary`, `--in-geo-boundary`)"
"""Advice in messages about maps that are too large."""
_SIDES = ("west", "south", "east", "north")


@dataclass(frozen=True)
class Boundary:
    """A box; the edges of a map that lie wholly or partly in it are kept.

    Attributes:
        west, south, east, north: its sides, in m of the map's coordinates or in degrees.
        geo: whether the sides are in degrees.
    """

    west: float
    south: float
    east: float
    north: float
    geo: bool = False

    @classmethod
    def read(cls, text: str, *, geo: bool = False) -> Boundary:
        """Read `XMIN,YMIN,XMAX,YMAX`; an invalid text raises a `ValueError` that explains the error."""
        west, south, east, north = _numbers(text, "LON,LAT,LON,LAT (degrees)" if geo else "XMIN,YMIN,XMAX,YMAX (m)", 4)
        if west >= east or south >= north:
            raise ValueError(f"the box {text} is empty: write the south-western corner first, then the north-eastern")
        if geo and max(abs(west), abs(east)) > 180:
            raise ValueError(f"{text} has a longitude that is not within -180 and 180 degrees")
        if geo and max(abs(south), abs(north)) > 90:
            raise ValueError(f"{text} has a latitude that is not within -90 and 90 degrees: write the longitude first")
        return cls(west, south, east, north, geo)

    @property
    def option(self) -> tuple[str, str]:
        """Return the name and value of netconvert's option."""
        name = "--keep-edges.in-geo-boundary" if self.geo else "--keep-edges.in-boundary"
        return name, ",".join(str(getattr(self, side)) for side in _SIDES)

    def __str__(self) -> str:
        """Return the box in words."""
        unit, digits = (" degrees", 5) if self.geo else (" m", 1)
        west, south, east, north = (f"{getattr(self, side):.{digits}f}" for side in _SIDES)
        return f"from ({west}, {south}) to ({east}, {north}){unit}"


@dataclass(frozen=True)
class Around:
    """The part of a map up to `radius_m` to each side of a place.

    Attributes:
        place: the id of a junction or edge, or two numbers with a comma: x and y in m; for an OpenStreetMap extract
            longitude and latitude in degrees.
        radius_m: half the side of the box.
    """

    place: str
    radius_m: float

    @classmethod
    def read(cls, text: str) -> Around:
        """Read `PLACE,RADIUS`; an invalid text raises a `ValueError` that explains the error."""
        place, _, radius = text.rpartition(",")
        try:
            radius_m = float(radius)
        except ValueError:
            radius_m = math.nan
        if not place or not 0 < radius_m < _LARGEST:
            raise ValueError(f"{text} is not a place with a radius in m: write `X,Y,300` or `JUNCTION,300`")
        return cls(place, radius_m)

    @property
    def point(self) -> tuple[float, float] | None:
        """Return the place as two numbers; None if it is an id."""
        try:
            x, y = _numbers(self.place, "", 2)
        except ValueError:
            return None
        return x, y

    def box(self, x: float, y: float) -> Boundary:
        """Return the box around a point, m."""
        r = self.radius_m
        return Boundary(x - r, y - r, x + r, y + r)

    def geo_box(self) -> Boundary:
        """Return the box around a longitude and latitude; `ExchangeError` if the place is something else."""
        if self.point is None or abs(self.point[0]) > 180 or abs(self.point[1]) >= 90:
            raise ExchangeError(f"{self.place} is not a longitude and a latitude in degrees: write `13.605,52.325,300`")
        lon, lat = self.point
        high = self.radius_m / _METRES_A_DEGREE
        wide = high / math.cos(math.radians(lat))
        return Boundary(lon - wide, lat - high, lon + wide, lat + high, geo=True)


def _numbers(text: str, form: str, count: int) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(abs(value) < _LARGEST for value in values):
        raise ValueError(f"{text} does not have {count} numbers, separated by commas: write {form}")
    return values


Part = Boundary | Around
"""A part of a map to keep."""


def part_of(around: str | None, in_boundary: str | None, in_geo_boundary: str | None) -> Part | None:
    """Return the part that one of three options selects; None without any option.

    Raises:
        ValueError: more than one option is present, or its value is invalid.
    """
    if sum(text is not None for text in (around, in_boundary, in_geo_boundary)) > 1:
        raise ValueError("only one of --around, --in-boundary and --in-geo-boundary can be used")
    if around is not None:
        return Around.read(around)
    if in_boundary is not None:
        return Boundary.read(in_boundary)
    return None if in_geo_boundary is None else Boundary.read(in_geo_boundary, geo=True)


@dataclass(frozen=True)
class _Whole:
    """The properties of a SUMO network that are needed to cut a part out of it.

    Attributes:
        edges: number of its edges, without those inside junctions.
        extent: bounding box of its junctions, m.
        degrees: the extent in degrees, from its `origBoundary`; empty without a projection.
        place: position of the requested junction or edge, m.
        digits: decimals of its coordinates.
    """

    edges: int
    extent: Boundary
    degrees: str
    place: tuple[float, float] | None
    digits: int


def cut_net(file: Path, part: Part, folder: Path, tell: Tell) -> tuple[Path, str]:
    """Write a part of a SUMO network into a folder; return the file, and a description of the part.

    Ids, coordinates, signal programs and junctions remain unchanged; edges at the border are kept whole.

    Raises:
        ExchangeError: the network cannot be read, has no edge there, or is refused by netconvert.
    """
    tell(f"reading {file.name}")
    whole = _whole(file, part.place if isinstance(part, Around) else "")
    box = part if isinstance(part, Boundary) else _around(part, whole, file)
    if box.geo and not whole.degrees:
        raise ExchangeError(f"{file} has no projection, so its places have no longitude and latitude: use "
                            f"--in-boundary; it reaches {whole.extent}")  # fmt: skip
    tell(f"cutting the part out of {whole.edges} edges with netconvert")
    (folder / "whole.net.xml").write_bytes(unpacked(file, ExchangeError))
    options = ["--offset.disable-normalization", "true", "--precision", f"{whole.digits}", "--no-warnings", "true"]
    try:
        run_netconvert(["-s", "whole.net.xml", *box.option, *options, "-o", "part.net.xml"], folder)
    except CompileError as err:
        if any(words in str(err) for words in EMPTY):
            reach = f"{whole.extent}{f' ({whole.degrees} degrees)' if whole.degrees else ''}"
            raise ExchangeError(f"{file} has no edge in the box {box}; it reaches {reach}") from err
        raise ExchangeError(f"no part can be cut out of {file}: {err}") from err
    finally:
        (folder / "whole.net.xml").unlink()
    kept = sum(_is_street(element.tag, element.get("function")) for element in _elements(folder / "part.net.xml"))
    return folder / "part.net.xml", f"{kept} of {whole.edges} edges are kept: those in the box {box}, wholly or partly"


def _around(part: Around, whole: _Whole, file: Path) -> Boundary:
    place = part.point or whole.place
    if place is None:
        raise ExchangeError(f"{file} has no junction or edge {part.place!r}; a place may also be two numbers, x and y "
                            f"in m: it reaches {whole.extent}")  # fmt: skip
    return part.box(*place)


def _middle(points: Points) -> XY:
    marks, (xs, ys) = lengths(points), zip(*points, strict=True)
    return interpolate(marks[-1] / 2, marks, xs), interpolate(marks[-1] / 2, marks, ys)


def _elements(file: Path) -> Iterator[Element]:
    return children_of(file, "net", "a SUMO network", ExchangeError)


def _is_street(tag: str, function: str | None) -> bool:
    return tag == "edge" and function in (None, "normal")


def _whole(file: Path, wanted: str) -> _Whole:
    edges, located, degrees, digits = 0, False, "", 2
    place: tuple[float, float] | None = None
    xs: list[float] = []
    ys: list[float] = []
    try:
        for element in _elements(file):
            if element.tag == "location":
                located = True
                degrees = element.get("origBoundary", "") if element.get("projParameter", "!") not in ("!", "-") else ""
                west = element.get("convBoundary", "").partition(",")[0]
                digits = min(max(len(west.partition(".")[2]), 2), 6)
            elif _is_street(element.tag, element.get("function")):
                edges += 1
                if wanted and element.get("id") == wanted:
                    place = _middle(points_of(next(element.iterfind("lane")).attrib["shape"]))
            elif element.tag == "junction" and element.get("type") != "internal":
                xs.append(float(element.attrib["x"]))
                ys.append(float(element.attrib["y"]))
                if wanted and element.get("id") == wanted:
                    place = xs[-1], ys[-1]
    except (KeyError, ValueError, IndexError, StopIteration) as err:
        raise ExchangeError(f"{file} is a damaged SUMO network: {err}") from err
    if not edges or not xs or not located:
        raise ExchangeError(f"{file} is not a complete SUMO network: it has no edges or no location")
    return _Whole(edges, Boundary(min(xs), min(ys), max(xs), max(ys)), degrees, place, digits)
