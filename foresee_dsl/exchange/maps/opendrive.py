"""Takes over an OpenDRIVE map: the map as it is, and a scenario that runs on it."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_net
from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.exchange.maps.contents import left_out_of, notes_on, taken_from
from foresee_dsl.exchange.maps.heights import Heights, bridges, flat_notes
from foresee_dsl.exchange.maps.starter import Way, starter
from foresee_dsl.exchange.naming import file_name, name_of, sentence
from foresee_dsl.exchange.outcome import ExchangeError, Imported, write_together
from foresee_dsl.language.printer import print_model


def run(file: Path, *, out: Path) -> Imported:
    """Write `NAME.xodr` and the scenario `NAME.foresee` for an OpenDRIVE map.

    Raises:
        CompileError: the file is unreadable, too large, no OpenDRIVE, or refused by netconvert.
        ExchangeError: it has no way for a car, or `out` cannot be written.
    """
    if file.suffix != ".xodr":
        raise ExchangeError(f"{file} is not called like an OpenDRIVE map: its name must end in .xodr")
    root = parse_xml(file, "OpenDRIVE", "an OpenDRIVE map")
    name = name_of(file.stem, "map")
    ways: list[Way] = []

    def write(folder: Path) -> None:
        copy = folder / file_name(file.name)
        copy.write_bytes(file.read_bytes())
        doc = sentence(f"A first drive on {file.name}.")
        scenario, way = starter(copy, name=name, network=copy.name, doc=doc)
        (folder / f"{name}.foresee").write_text(print_model(scenario), encoding="utf-8", newline="\n")
        ways.append(way)

    files = write_together(out, write)
    net = foreign_net(out / file_name(file.name))
    parts = read_net(net)
    flat = flat_notes(bridges(RoadNetwork.of(parts), Heights.of(net)))
    over = f" over the signal of {', '.join(ways[0].signals)}" if ways[0].signals else ""
    said = f"the ego drives {ways[0].length_m:.0f} m{over}; edit {name}.foresee for another way"
    return Imported(files, 1, taken_from(parts), left_out_of(root, parts), (said, *notes_on(root, parts), *flat))
