"""Judges one foreign map: imports it, checks its geometry, and lets `idm` drive on it alone."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from foresee_exchange.maps import opendrive, osm, sumo

from corpus.carla_towns import without_traffic
from corpus.rows import Outcome, Row
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.errors import ForeseeError
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict

LIMIT_S = 60.0
"""Time of one map, s, at most."""
_IMPORTERS: dict[str, Callable[..., Imported]] = {"opendrive": opendrive.run, "osm": osm.run, "sumo": sumo.run}
_KINDS = {
    "opendrive": (".xodr",),
    "osm": (".osm", ".osm.xml", ".osm.gz", ".osm.xml.gz", ".osm.pbf", ".osm.bz2"),
    "sumo": (".net.xml", ".net.xml.gz"),
}
_GOOD_REASONS = (
    "a damaged one",  # no XML, or cut off
    "without roads",
    "no lanes for cars",
    "has no streets",
    "has no nodes",
    "no street that leads anywhere",
    "has no route of 3 m for a car",
    "is not a complete SUMO network",
    "its root is",
    "not a sound OpenDRIVE map",
    "sound SUMO network",
    "the language cannot express",
    "is missing in definition of",  # netconvert's words for an attribute that the schema asks for
    "Invalid Number Format",
    "No edges loaded",
    "that are read: cut out",  # too large
)
"""Parts of messages about files without a map that a car could drive on."""


def kind_of(path: Path) -> str | None:
    """Return the importer for a file; None if there is none."""
    return next((kind for kind, endings in _KINDS.items() if path.name.endswith(endings)), None)


def judge(file: Path, name: str) -> Row:
    """Import a map and let `idm` drive the starter alone; return the result."""
    kind = kind_of(file)
    if kind is None:
        return Row(name, Outcome.good_reason, "no map by its name")
    with tempfile.TemporaryDirectory(prefix="foresee-corpus-") as folder:
        try:
            done = _IMPORTERS[kind](file, out=Path(folder) / "out")
        except ForeseeError as err:
            good = any(part in str(err) for part in _GOOD_REASONS)
            return Row(name, Outcome.good_reason if good else Outcome.ours, str(err).replace(str(file), file.name))
        starter = load_test_case(next(written for written in done.files if written.suffix == ".foresee"))
        try:
            result = run_test_case(without_traffic(starter), "idm", 0, deadlines=None)
        except ForeseeError as err:
            return Row(name, Outcome.imported, str(err), arrives=False)
    detail = f"{result.verdict.name}: {result.reason}"
    return Row(name, Outcome.imported, detail, arrives=result.verdict is Verdict.PASS)
