"""Golden cases: `tests/cases/compile/NAME/scenario.foresee` and what the compiler makes of it, or says against it.

`compiled.json` has the network, the signals, SUMO's vehicle types and the scene at the first frame; `mistakes.txt` is
what is impossible. `pytest --rewrite-goldens` writes them anew.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from foresee_dsl.compile import compile_test_case, placement_mistakes
from foresee_dsl.language.project.loading import load_test_cases
from tests.support.goldens import readable

CASES = sorted(folder for folder in (Path(__file__).parents[1] / "cases" / "compile").iterdir() if folder.is_dir())
SAMPLE_M = 25
ELSEWHERE = frozenset({"model", "line", "whens", "expects", "places"})
"""Fields of a scene that are shown in another way, or are taken over from the language as they are."""


def network_of(bundle):
    """Each lane on a line, movements as `from > to: turn`, and who has to give way at each junction."""
    net = bundle.network
    return {
        "lanes": {
            k: [ln.length_m, ln.speed_mps, ln.width_m, " ".join(sorted(ln.kinds))] for k, ln in net.lanes.items()
        },
        "movements": [f"{m.from_lane} > {m.to_lane}: {m.turn} {m.tls or ''} {m.link}" for m in net.movements],
        "right_of_way": {j.id: [f"{a:b} {b:b}" for a, b in j.requests] for j in net.junctions.values() if j.requests},
        "crossings": {name: [c.junction, c.tls, c.link, c.lane.shape] for name, c in net.crossings.items()},
        "buildings": net.buildings,
    }


def line_of(line):
    """The lanes of a line with where each begins, its junctions, and a point every 25 m."""
    return {
        "from_to": [line.origin_s, line.end_s, line.length_m],
        "lanes": [[lane, s] for s, lane in line.pieces],
        "junctions": [[p.junction, p.turn, p.signal, p.entry_s, p.exit_s] for p in line.passages],
        "points": [line.at(float(s)) for s in range(0, int(line.length_m), SAMPLE_M)],
        "limits": sorted(set(line.limits)),
    }


def types_of(bundle):
    """SUMO's vehicle types, as far as actors have them: the values in the order of the file."""
    names = {actor.model.name for actor in bundle.scene.actors} | {"ghost"}
    types = ElementTree.fromstring(bundle.types_file.read_text()).iter("vType")
    return [" ".join(t.attrib.values()) for t in types if t.get("id") in names]


def compiled(bundle):
    lines = {actor.id: line_of(actor.line) for actor in bundle.scene.actors if actor.line is not None}
    return {
        "network": network_of(bundle),
        "signals": bundle.signals,
        "scene": bundle.scene,
        "models": {actor.id: actor.model.name for actor in bundle.scene.actors},
        "types": types_of(bundle),
        "lines": lines,
        "places": list(bundle.scene.places.values()),
    }


@pytest.mark.parametrize("folder", CASES, ids=lambda folder: folder.name)
def test_golden(folder, golden):
    (case,) = load_test_cases([str(folder / "scenario.foresee")])
    mistakes = placement_mistakes([case])
    if mistakes:
        lines = [f"{m.span.line}: {m.code} {m.message} ({m.help})" for m in mistakes]
        golden("\n".join(lines) + "\n", folder / "mistakes.txt")
        return
    bundle = compile_test_case(case)
    golden(readable(compiled(bundle), leave_out=ELSEWHERE), folder / "compiled.json")


def test_every_case_has_been_written():
    expected = {"compiled.json", "mistakes.txt"}
    assert all(expected & {file.name for file in folder.iterdir()} for folder in CASES)
