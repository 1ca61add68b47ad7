"""Fuzzes the importers of scenarios and maps: `python -m corpus.mutated_files openscenario --files 1000 --seed 1`.

Each mutated file must become a scenario (a map: a net with a starter) or an error with a message, within limits of
time and memory. Other outcomes are printed with the file's number (`--show NUMBER` prints the file), and the exit code
is then 1.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

from foresee_exchange.carla import importer as carla
from foresee_exchange.maps import osm
from foresee_exchange.openscenario.reading import importer as openscenario

from foresee_dsl.errors import ForeseeError
from foresee_dsl.exchange.starter import Ground, starter
from tests.support import foreign_maps as maps
from tests.support import openscenario_files as osc

MOST_CPU_S = 20
"""Limit of processor time for a file, s (the first one compiles the network)."""
MOST_MEMORY_MB = 3000

_ODD = ("", "x", "-5", "1e400", "nan", "$", "${1/0}", "${" + "(" * 60, "99999999", "0", "-0.0", "Ego", "\u202e", '"',
        "\\",        "${pi * 1e9}", "true", "0x10", "1e-320", "$pace", "none", "A::B", " 3 ", "\u0663", "inf", "65536",
        "0.5", "é", "a" * 300, "1,2", "1,2 3", "1,2 3,4", "left", "no", "all", "LHT", "clover", "2 lanes")  # fmt: skip
_TAGS = ("Event", "Condition", "WorldPosition", "LanePosition", "RoutePosition", "SpeedAction", "LaneChangeAction",
         "StandStillCondition", "Nurbs", "Clothoid", "Trajectory", "waypoint", "position", "route")  # fmt: skip
_ROUTES = """<routes><route id="1" town="straight"><waypoints><position x="60" y="5.25" z="0"/>
  <position x="200" y="5.25" z="0"/></waypoints><scenarios><scenario name="a" type="Scenario3">
  <trigger_point x="120" y="5.25" z="0" yaw="0"/></scenario></scenarios></route>
  <route id="2" town="straight"><waypoint x="60" y="1.75" z="0" pitch="0" roll="0" yaw="0"/>
  <waypoint x="300" y="1.75" z="0" pitch="0" roll="0" yaw="0"/></route></routes>"""
_TRIGGERS = {
    "available_scenarios": [
        {
            "straight": [
                {
                    "scenario_type": "Scenario3",
                    "available_event_configurations": [
                        {"transform": {"x": "120", "y": "5.25", "z": "0", "pitch": "0", "yaw": "0"}}
                    ],
                }
            ]
        }
    ]
}


def _scenario() -> str:
    follow = "".join(
        f'<Vertex time="{k}"><Position><LanePosition roadId="1" laneId="-1" s="{100 + 10 * k}"/></Position></Vertex>'
        for k in range(3)
    )
    curves = '<Clothoid curvature="0" curvaturePrime="0.001" length="20" startTime="0" stopTime="2">' \
             '<Position><RoadPosition roadId="1" s="90" t="-2"/></Position></Clothoid>'  # fmt: skip
    near = '<RelativeDistanceCondition entityRef="Ego" relativeDistanceType="longitudinal" value="40" ' \
           'freespace="false" rule="lessThan"/>'  # fmt: skip
    after = '<ByValueCondition><StoryboardElementStateCondition storyboardElementType="event" ' \
            'storyboardElementRef="a" state="completeState"/></ByValueCondition>'  # fmt: skip
    trajectories = [
        f"<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name='t' closed='false'><Shape>{shape}"
        "</Shape></Trajectory></TrajectoryRef></FollowTrajectoryAction></RoutingAction>"
        for shape in (f"<Polyline>{follow}</Polyline>", curves)
    ]
    events = osc.group(
        "Target-1",
        osc.event("a", osc.lane_change(-1), osc.of_entity("Target-1", near)),
        osc.event("b", osc.speed_action("6"), osc.condition(after, delay=0.5)),
    ) + osc.group("walker", *(osc.event(f"t{k}", t, osc.condition(after)) for k, t in enumerate(trajectories)))
    return osc.scenario(events=events)


def mutated_xml(text: str, chance: random.Random) -> bytes:
    """Return XML with one to four errors; sometimes the bytes themselves are damaged."""
    root = ElementTree.fromstring(text)
    for _ in range(chance.randint(1, 4)):
        parents = {child: parent for parent in root.iter() for child in parent}
        if not parents:
            break
        element = chance.choice(list(parents))
        what = chance.randrange(6)
        if what == 0:
            parents[element].remove(element)
        elif what == 1 and element.attrib:
            element.set(chance.choice(list(element.attrib)), chance.choice(_ODD))
        elif what == 2 and element.attrib:
            del element.attrib[chance.choice(list(element.attrib))]
        elif what == 3:
            parents[element].append(element)  # the same again
        elif what == 4:
            element.tag = chance.choice([chance.choice(_TAGS), chance.choice(list(parents)).tag])
        else:
            other = chance.choice(list(parents))
            if element not in set(other.iter()) and other not in set(element.iter()):
                other.append(element)
    data = bytearray(ElementTree.tostring(root))
    if chance.random() < 0.05:
        data = data[: chance.randrange(len(data))]
    if chance.random() < 0.05 and data:
        data[chance.randrange(len(data))] = chance.randrange(256)
    return bytes(data)


def mutated_json(value: object, chance: random.Random) -> object:
    """Return a JSON document in which about every thirtieth value is replaced."""
    if chance.random() < 0.03:
        return chance.choice([None, [], {}, *_ODD, 1e308, -1, True])
    if isinstance(value, dict):
        return {key: mutated_json(inner, chance) for key, inner in value.items() if chance.random() > 0.01}
    return [mutated_json(inner, chance) for inner in value] if isinstance(value, list) else value


def openscenario_file(folder: Path, number: int, seed: int) -> Callable[[], object]:
    """Write a mutated scenario; return its import."""
    file = osc.write(folder, osc.scenario())
    file.write_bytes(mutated_xml(_scenario(), random.Random(f"openscenario {seed} {number}")))
    return lambda: openscenario.run(file, out=folder / "out", partial=number % 4 != 0)


def carla_file(folder: Path, number: int, seed: int) -> Callable[[], object]:
    """Write mutated routes and triggers of a town with one straight road; return their import."""
    chance = random.Random(f"carla {seed} {number}")
    town = folder / "straight.xodr"
    town.write_text(osc.XODR)
    routes, triggers = folder / "straight_Scenario3.xml", folder / "straight_Scenario3.json"
    routes.write_bytes(mutated_xml(_ROUTES, chance) if number % 3 else _ROUTES.encode())
    triggers.write_text(json.dumps(mutated_json(_TRIGGERS, chance) if number % 3 != 1 else _TRIGGERS))
    return lambda: carla.run(town, [routes], [triggers], out=folder / "out")


def _two_roads() -> str:
    link = '<successor elementType="road" elementId="2" contactPoint="start"/>'
    return maps.opendrive(maps.road(links=link), maps.road(id="2", x=60, attributes='rule="RHT"'))


def _bent() -> str:
    pieces = ('<spiral curvStart="0" curvEnd="0.02"/>', '<poly3 a="0" b="0" c="0.01" d="0"/>',
              '<paramPoly3 aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.01" dV="0"/>')  # fmt: skip
    return maps.opendrive(*(maps.road(id=str(k), x=100 * k, piece=piece) for k, piece in enumerate(pieces)))


_MAPS: dict[str, tuple[str, Callable[[], list[str]]]] = {
    "opendrive": ("map.xodr", lambda: [maps.HILL_ROAD.read_text(), _two_roads(), _bent()]),
    "osm": ("map.osm", lambda: [(Path(__file__).parents[1] / "tests" / "small_town.osm").read_text()]),
    "sumo": ("map.net.xml", lambda: [maps.net(), maps.net("100,0 103,0 103,3 106,0")]),
}
"""By kind of map: the file name, and the valid maps that are changed."""


def map_file(kind: str, folder: Path, number: int, seed: int) -> Callable[[], object]:
    """Write a mutated map of a kind; return its import, without the drive."""
    chance = random.Random(f"{kind} {seed} {number}")
    name, texts = _MAPS[kind]
    (folder / name).write_bytes(mutated_xml(chance.choice(texts()), chance))
    return partial(_import_map, folder / name)


def _import_map(file: Path) -> None:
    if file.suffix == ".osm":
        net, _ = osm.converted(osm.read_osm(file))
        file = file.with_suffix(".net.xml")
        file.write_bytes(net)
    starter(Ground.of(file), name="map", network=file.name, doc="A first drive.")


MAKERS: dict[str, Callable[[Path, int, int], Callable[[], object]]] = {
    "openscenario": openscenario_file,
    "carla": carla_file,
    **{kind: partial(map_file, kind) for kind in _MAPS},
}


def _too_long(_signal: int, _frame: object) -> None:
    raise TimeoutError(f"{MOST_CPU_S} s of the processor")


def judge(work: Callable[[], object]) -> str:
    """Return the outcome of an import: `written`, `refused`, or the error."""
    signal.signal(signal.SIGPROF, _too_long)
    signal.setitimer(signal.ITIMER_PROF, MOST_CPU_S)
    try:
        work()
    except ForeseeError as err:
        return "refused" if str(err).strip() else "an error without words"
    except RecursionError:
        return "RecursionError"
    except Exception:
        return traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return "written"


def main() -> None:
    """Judge many files, and print the errors."""
    parser = argparse.ArgumentParser(prog="python -m corpus.mutated_files", description=main.__doc__)
    parser.add_argument("format", choices=MAKERS)
    parser.add_argument("--files", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", type=int, help="print the files of this number instead")
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY_MB * 2**20,) * 2)
    numbers = range(options.first, options.first + options.files) if options.show is None else [options.show]
    seen: Counter[str] = Counter()
    for number in numbers:
        with tempfile.TemporaryDirectory() as folder:
            work = MAKERS[options.format](Path(folder), number, options.seed)
            if options.show is not None:
                sys.stdout.writelines(f"{f.name}\n{f.read_text(errors='replace')}\n" for f in Path(folder).glob("*.*"))
                return
            outcome = judge(work)
            left = [file.name for file in Path(folder).glob("out/.*")]
        if left:
            outcome = f"half-written: {left}"
        seen[outcome if outcome in ("written", "refused") else "wrong"] += 1
        if outcome not in ("written", "refused"):
            sys.stdout.write(f"number {number}: {outcome}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{dict(seen)}, {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000:.0f} MB\n")
    sys.exit(bool(seen["wrong"]))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as cache:
        os.environ["FORESEE_CACHE"] = cache  # a thousand nets that are not needed again
        main()
