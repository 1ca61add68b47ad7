"""Reads extracts of OpenStreetMap: XML, packed or not, and PBF; and says on which side their traffic drives."""

from __future__ import annotations

import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.safe_xml import MOST_ELEMENTS, check_size, parse_xml
from foresee_dsl.exchange.outcome import ExchangeError

_LEFT = (
    # west, south, east, north, in degrees: boxes inside countries whose traffic keeps to the left. Ours: coarse, and
    # nowhere over a border to the other side; tags of the extract go before them.
    (-10.8, 49.8, 1.8, 61.0),  # Great Britain, Ireland
    (32.2, 34.5, 34.7, 35.8),  # Cyprus
    (14.1, 35.7, 14.7, 36.1),  # Malta
    (68.0, 6.0, 88.0, 27.5),  # India, Sri Lanka
    (66.0, 24.0, 74.0, 34.0),  # Pakistan, north-western India
    (129.5, 30.0, 146.0, 45.6),  # Japan
    (126.0, 24.0, 129.5, 28.5),  # Okinawa
    (113.8, 22.15, 114.5, 22.57),  # Hong Kong
    (99.5, 1.1, 104.5, 6.5),  # Malaysia, Singapore
    (98.5, 13.0, 101.5, 19.0),  # middle of Thailand
    (105.1, -8.9, 116.0, -5.8),  # Java, Bali
    (112.9, -44.0, 154.0, -10.0),  # Australia
    (166.0, -47.5, 179.0, -34.0),  # New Zealand
    (16.4, -35.0, 33.0, -22.2),  # South Africa, Botswana
    (34.0, -4.6, 41.5, 4.0),  # Kenya
    (-78.5, 17.6, -76.1, 18.6),  # Jamaica
    (-61.95, 10.0, -60.5, 11.4),  # Trinidad
)


def read_osm(file: Path) -> Element:
    """Return the root of an extract: `.osm`, the same packed by gzip, or `.osm.pbf`."""
    if not file.name.endswith(".pbf"):
        return parse_xml(file, "osm", "an OpenStreetMap file", ExchangeError)
    check_size(file, ExchangeError)
    try:
        osmium: Any = import_module("osmium")
    except ImportError as err:
        raise ExchangeError(f"{file} is a PBF file, which needs pyosmium: pip install 'foresee-dsl[osm]'") from err
    with tempfile.TemporaryDirectory(prefix="foresee-osm-") as folder:
        plain = Path(folder) / "map.osm"
        try:
            _write_plain(osmium, file, plain)
        except (RuntimeError, ValueError, OSError) as err:
            raise ExchangeError(f"{file} is not an OpenStreetMap file in PBF, or a damaged one: {err}") from err
        return parse_xml(plain, "osm", "an OpenStreetMap file", ExchangeError)


def _write_plain(osmium: Any, file: Path, plain: Path) -> None:  # noqa: ANN401 - it may not be installed
    elements = 0
    with osmium.SimpleWriter(str(plain)) as writer:
        for thing in osmium.FileProcessor(str(file)):
            elements += 1 + len(thing.tags) + (len(thing.nodes) if thing.is_way() else 0)
            if elements > MOST_ELEMENTS:
                raise ExchangeError(f"{file} has more than {MOST_ELEMENTS:,} elements: cut out the part that is needed")
            writer.add(thing)


def drives_on_the_left(root: Element) -> bool:
    """Say whether an extract's traffic keeps to the left: what its `driving_side` tags say, or else where it lies."""
    sides = [tag.get("v") for tag in root.iter("tag") if tag.get("k") == "driving_side"]
    if sides:
        return 2 * sides.count("left") > len(sides)
    node = root.find("node")
    try:
        lon, lat = (float(node.get(name, "nan")) for name in ("lon", "lat")) if node is not None else (0.0, 0.0)
    except ValueError:
        return False
    return any(west <= lon <= east and south <= lat <= north for west, south, east, north in _LEFT)
