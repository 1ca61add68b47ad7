"""The OpenDRIVE map of a run as CARLA's tools read it: whole numbers as ids, units, a geographic reference."""

from __future__ import annotations

import re
import tempfile
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree as ET  # writes what safe_xml has parsed

from foresee_bridges.carla.coordinates import GeoReference
from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.drivers.protocol import Mission

REFERENCE = "+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m +no_defs"
"""The reference of CARLA's towns, at which agents place a map that names none."""
_ORIGIN = re.compile(r"\+(lat_0|lon_0)=([-+.\deE]+)")
_IDS = (
    *(("junction", ".//junction", "id"), ("junction", ".//road", "junction")),
    *(("junction", f".//{link}[@elementType='junction']", "elementId") for link in ("predecessor", "successor")),
    *(("signal", ".//signal", "id"), ("signal", ".//signalReference", "id"), ("signal", ".//control", "signalId")),
    *(("controller", ".//controller", "id"), ("object", ".//object", "id")),
)
"""Kind of the id, path of the element, and its attribute. OpenDRIVE allows any text as an id; CARLA's reader and the
library ad_map_access take whole numbers only."""


def map_of(mission: Mission) -> tuple[str | None, GeoReference]:
    """Return the OpenDRIVE text of the mission's network, None without a road map, and its geographic reference."""
    if mission.road_map is None:
        return None, GeoReference()
    return for_carla(mission.road_map.opendrive())


@lru_cache(maxsize=2)  # the runs of a worker share few networks
def for_carla(text: str) -> tuple[str, GeoReference]:
    """Return a map with whole numbers as ids, and its reference.

    A map without latitude and longitude of its origin gets `REFERENCE`. Comments and the date of the header are left
    out, so that the same network gives the same text.
    """
    with tempfile.TemporaryDirectory(prefix="foresee-carla-") as folder:
        file = Path(folder) / "map.xodr"
        file.write_text(text, encoding="utf-8")
        root = parse_xml(file, "OpenDRIVE", "an OpenDRIVE map")
    _number(root)
    for speed in root.iterfind(".//speed"):
        speed.attrib.setdefault("unit", "m/s")  # the default of OpenDRIVE, which ad_map_access does not assume
    header = root.find("header")
    if header is None:
        header = ET.Element("header")
        root.insert(0, header)
    header.attrib.pop("date", None)
    element = header.find("geoReference")
    origin = dict(_ORIGIN.findall((element.text or "") if element is not None else ""))
    reference = GeoReference()
    if origin.keys() >= {"lat_0", "lon_0"}:
        reference = GeoReference(float(origin["lat_0"]), float(origin["lon_0"]))
    else:
        if element is None:
            element = ET.SubElement(header, "geoReference")
        element.text = REFERENCE
    return ET.tostring(root, encoding="unicode", xml_declaration=True), reference


def _number(root: ET.Element) -> None:
    """Replace ids that are not whole numbers, kind by kind, in the order of the file."""
    for kind in dict.fromkeys(kind for kind, _, _ in _IDS):
        places = [(element, name) for of, path, name in _IDS if of == kind for element in root.findall(path)]
        texts = dict.fromkeys(element.get(name, "") for element, name in places)
        numbers = {text: int(text) for text in texts if re.fullmatch(r"-?\d+", text)}
        following = max((*numbers.values(), 0)) + 1
        numbers |= {text: following + i for i, text in enumerate(text for text in texts if text not in numbers)}
        for element, name in places:
            if name in element.attrib:
                element.set(name, str(numbers[element.attrib[name]]))
