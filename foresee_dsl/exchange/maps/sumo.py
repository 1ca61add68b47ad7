"""Takes over a SUMO network: the net as it is, and a scenario that runs on it."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from xml.etree.ElementTree import tostring  # no parsing: that is foreign_xml's

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.foreign.signal_programs import fix_times
from foresee_dsl.compile.nets.net_reader import read_net
from foresee_dsl.compile.nets.netconvert import without_header
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.exchange.foreign_xml import read_xml
from foresee_dsl.exchange.maps.heights import Heights, bridges, flat_notes
from foresee_dsl.exchange.maps.starter import Way, starter
from foresee_dsl.exchange.naming import name_of, sentence
from foresee_dsl.exchange.outcome import ExchangeError, Imported, write_together
from foresee_dsl.language.printer import print_model

NET = ".net.xml"


def run(file: Path, *, out: Path) -> Imported:
    """Write `NAME.net.xml` and the scenario `NAME.foresee` for a SUMO network `NAME.net.xml`.

    Raises:
        ExchangeError: the file is no SUMO network, too large, or has no way for a car.
        CompileError: it is not complete.
    """
    root = read_xml(file, ("net",), "a SUMO network")
    name = name_of(file.name.removesuffix(NET).removesuffix(".xml"), "net")
    if root.find("edge") is None or root.find("location") is None:
        raise ExchangeError(f"{file} is not a complete SUMO network: it has no edges or no location")
    changed = fix_times(root)
    left_out = Counter(
        {
            "signal programs that react to traffic (driven with fixed times)": changed.reacting,
            "signal programs besides the one that SUMO begins with": changed.others,
        }
    )
    data = tostring(root, encoding="utf-8", xml_declaration=True) if changed else without_header(file.read_bytes())
    return with_starter(data, name, out, doc=sentence(f"A first drive on {file.name}."), left_out=left_out)


def with_starter(
    net: bytes, name: str, out: Path, *, doc: str, left_out: Counter[str], notes: tuple[str, ...] = ()
) -> Imported:
    """Write a net and a scenario that runs on it, together or not at all.

    Args:
        net: the net file's bytes. name: of both files. out: the folder.
        doc: the scenario's sentence. left_out, notes: see `Imported`.

    Raises:
        ExchangeError: nobody could drive on it, or `out` cannot be written.
        CompileError: it is not complete.
    """
    found: list[tuple[Way, dict[str, int]]] = []

    def write(folder: Path) -> None:
        file = folder / f"{name}{NET}"
        file.write_bytes(net)
        scenario, way = starter(file, name=name, network=file.name, doc=doc)
        (folder / f"{name}.foresee").write_text(print_model(scenario), encoding="utf-8", newline="\n")
        found.append((way, _counts(file)))

    files = write_together(out, write)
    way, taken = found[0]
    over = (
        f" over the signal of {', '.join(way.signals)}" if way.signals else ", over no signal: there is none on a way"
    )
    said = f"the ego drives {way.length_m:.0f} m{over}; edit {name}.foresee for another way"
    return Imported(
        files=files, cases=1, taken=taken, left_out=+left_out, notes=(said, *notes, *_flat_notes(out / f"{name}{NET}"))
    )


def _flat_notes(file: Path) -> tuple[str, ...]:
    net = foreign_net(file)
    return flat_notes(bridges(RoadNetwork.of(read_net(net)), Heights.of(net)))


def _counts(file: Path) -> dict[str, int]:
    """Return what a network has, in words."""
    parts = read_net(foreign_net(file))
    open_to = [edge for edge in parts.edges.values() if edge.for_kind("car")]
    return {
        "edges for cars": len(open_to),
        "junctions": len({edge.end for edge in open_to}),
        "signals": len({m.tls for m in parts.movements if m.tls}),
        "crossings": len(parts.crossings),
    }
