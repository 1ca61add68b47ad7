"""Fuzzes the importers of maps: `python -m corpus.mutated_maps --inputs 1000 --kind osm`, from the checkout.

Each input is a valid map with a few changes. It must become a net with a starter, or be refused with a message; other
exceptions, and more than 60 s or 2 GB, are findings. A finding is written into `fuzz-findings/`, and the exit code is
1.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from foresee_dsl.errors import ForeseeError
from tests.support import foreign_maps as maps

LIMIT_S = 60
_MEMORY_BYTES = 2_000_000_000
_TESTS = Path(__file__).parents[1] / "tests"
_VALUES = (
    *("", "0", "-1", "1", "nan", "inf", "-inf", "1e9", "1e300", "1e-300", "x", "-0", "65536", "0.5", " ", "none"),
    *("all", "true", "é", "\\", '"', "a" * 300, "1,2", "1,2 3", "1,2 3,4", "left", "no", "LHT", "clover", "2 lanes"),
)
SEEDS: dict[str, tuple[str, Callable[[], list[str]]]] = {
    "opendrive": ("map.xodr", lambda: [maps.HILL_ROAD.read_text(), _two_roads(), _bent()]),
    "osm": ("map.osm", lambda: [(_TESTS / "small_town.osm").read_text()]),
    "sumo": ("map.net.xml", lambda: [maps.net(), maps.net("100,0 103,0 103,3 106,0")]),
}
"""By kind of map: the file name, and the valid maps that are changed."""


def _two_roads() -> str:
    link = '<successor elementType="road" elementId="2" contactPoint="start"/>'
    return maps.opendrive(maps.road(links=link), maps.road(id="2", x=60, attributes='rule="RHT"'))


def _bent() -> str:
    pieces = ('<spiral curvStart="0" curvEnd="0.02"/>', '<poly3 a="0" b="0" c="0.01" d="0"/>',
              '<paramPoly3 aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.01" dV="0"/>')  # fmt: skip
    return maps.opendrive(*(maps.road(id=str(k), x=100 * k, piece=piece) for k, piece in enumerate(pieces)))


def changed(text: str, rng: random.Random) -> bytes:
    """Return a map with one to four changes; the same generator gives the same changes."""
    root = ElementTree.fromstring(text)
    for _ in range(rng.randint(1, 4)):
        _change(root, rng)
    data = ElementTree.tostring(root)
    if rng.random() < 0.1:  # a damaged file
        at = rng.randrange(len(data))
        data = data[:at] + (b"" if rng.random() < 0.5 else bytes([rng.randrange(256)]) + data[at + 1 :])
    return data


def _change(root: ElementTree.Element, rng: random.Random) -> None:
    parents = [element for element in root.iter() if len(element)]
    if not parents:
        return
    parent = rng.choice(parents)
    k = rng.randrange(len(parent))
    child = parent[k]
    kind = rng.randrange(6)
    if kind <= 2 and child.attrib:
        child.set(rng.choice(sorted(child.attrib)), rng.choice(_VALUES))
    elif kind == 3:
        parent.remove(child)
    elif kind == 4:
        parent.insert(rng.randrange(len(parent) + 1), child)
    elif child.attrib:
        del child.attrib[rng.choice(sorted(child.attrib))]


def look(kind: str, data: bytes, folder: Path) -> str:
    """Import a map, without the drive; return "imported", "refused", or the error."""
    from foresee_exchange.maps import osm
    from foresee_exchange.maps.osm import read_osm

    from foresee_dsl.exchange.starter import Ground, starter

    name = SEEDS[kind][0]
    (folder / name).write_bytes(data)
    try:
        if kind == "osm":
            net, _ = osm.converted(read_osm(folder / name))
            name = "map.net.xml"
            (folder / name).write_bytes(net)
        starter(Ground.of(folder / name), name="map", network=name, doc="A first drive.")
    except ForeseeError as err:
        return "refused" if str(err).strip() else "refused without a word"
    except TimeoutError:
        return f"took more than {LIMIT_S} s"
    except Exception:  # whatever else is raised is a finding
        return traceback.format_exc()
    return "imported"


def _too_long(_signal: int, _frame: object) -> None:
    raise TimeoutError


def fuzz(kind: str, seed: int, numbers: range, most_s: float = float("inf")) -> tuple[Counter[str], dict[str, bytes]]:
    """Judge inputs of a kind; return the counts of outcomes, and one input for each error."""
    seen: Counter[str] = Counter()
    findings: dict[str, bytes] = {}
    texts, until = SEEDS[kind][1](), time.monotonic() + most_s
    signal.signal(signal.SIGALRM, _too_long)
    with tempfile.TemporaryDirectory() as name:
        for number in numbers:
            if time.monotonic() > until:
                break
            rng = random.Random(f"{seed} {kind} {number}")
            data = changed(rng.choice(texts), rng)
            signal.alarm(LIMIT_S)
            what = look(kind, data, Path(name))
            signal.alarm(0)
            seen[what.strip().splitlines()[-1]] += 1
            if what not in ("imported", "refused"):
                findings.setdefault(what, data)
    return seen, findings


def main() -> int:
    """Run the fuzzer."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--inputs", type=int, default=1000)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--kind", choices=sorted(SEEDS), action="append")
    options.add_argument("--minutes", type=float, default=float("inf"), help="of each kind at most")
    arguments = options.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    failed = False
    with tempfile.TemporaryDirectory() as cache:
        os.environ["FORESEE_CACHE"] = cache  # a thousand nets that are not needed again
        for kind in arguments.kind or sorted(SEEDS):
            seen, findings = fuzz(kind, arguments.seed, range(arguments.inputs), 60 * arguments.minutes)
            sys.stdout.write(f"{kind}: {seen.total()} inputs: {dict(seen)}\n")
            for k, (what, data) in enumerate(findings.items()):
                file = Path("fuzz-findings") / f"{kind}_{k}_{SEEDS[kind][0]}"
                file.parent.mkdir(exist_ok=True)
                file.write_bytes(data)
                sys.stdout.write(f"--- {file}\n{what}\n")
            failed = failed or bool(findings)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
