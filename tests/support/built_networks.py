"""Networks made in memory, and what the tests of the compiler share to look into nets."""

import json
import subprocess
import sys
from collections import Counter
from decimal import Decimal
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.sumo_files import types_of
from foresee_dsl.language.model import Junction, Network, Point, Quantity, Road, Stage, VehicleModel

UNITS = {"speed": "km/h", "lanes": "", "back": ""}


def q(value, unit="m"):
    return Quantity(value=Decimal(str(value)), unit=unit)


def point(x, y):
    return Point(x=q(x), y=q(y))


def stage(name, seconds, *green):
    return Stage(name=name, green=green, duration=q(seconds, "s"))


def junction(name, x, y, *stages, control=None, crossings=None):
    control = control or ("signals" if stages else "priority")
    return Junction(name=name, at=point(x, y), control=control, crossings=crossings, stages=stages)


def road(name, start, end, via=(), **values):
    return Road(
        name=name,
        start=start,
        end=end,
        via=tuple(point(x, y) for x, y in via),
        **{key: q(value, UNITS.get(key, "m")) for key, value in values.items()},
    )


def ends_of(*roads):
    """Dead ends called `*_end`, 120 m from the origin."""
    at = {"north": (0, 120), "east": (120, 0), "south": (0, -120), "west": (-120, 0)}
    return [junction(f"{name}_end", *at[name]) for name in roads]


def four_arms(**west):
    """The content of scenarios/networks/four_arms.foresee."""
    stages = (stage("ns_go", 25, "north", "south"), stage("ew_go", 25, "east", "west"))
    ends = ends_of("north", "east", "south", "west")
    middle = junction("j4", 0, 0, *stages, crossings=())
    plain = [road(n, f"{n}_end", "j4", speed=50, sidewalk=2) for n in ("north", "east", "south")]
    special = {"lanes": 2, "back": 1, "lane_width": 3.3, "speed": 50, "sidewalk": 2, "median": 1, "via": [(-60, 2)]}
    return Network(
        name="four_arms", body=(middle, *ends, *plain, road("west", "west_end", "j4", **{**special, **west}))
    )


def t_junction(control="signals"):
    """Roads from west, east and south; the stem has green alone."""
    stages = (stage("main", 20, "west", "east"), stage("stem", 15, "south")) if control == "signals" else ()
    middle = junction("j4", 0, 0, *stages, control=control, crossings=())
    ends = ends_of("west", "east", "south")
    sizes = {"west": {"lanes": 2, "speed": 60}, "east": {"lanes": 2, "speed": 60}, "south": {"speed": 50}}
    return Network(
        name="t", body=(middle, *ends, *(road(n, f"{n}_end", "j4", sidewalk=2, **v) for n, v in sizes.items()))
    )


def net_root(path):
    return ElementTree.parse(path).getroot()


def lanes_of(root, edge):
    return root.findall(f"edge[@id='{edge}']/lane")


def shape(element):
    return [tuple(map(float, p.split(","))) for p in element.get("shape").split()]


def dead_ends(network):
    """Names of the roads that begin where no other road is."""
    roads = [item for item in network.body if isinstance(item, Road)]
    touched = Counter(end for item in roads for end in (item.start, item.end))
    return [item.name for item in roads if touched[item.start] == 1]


def drive_everywhere(
    network, net: Path, folder: Path, *, seconds: int, period: float, walkers: bool, reckless=False
) -> dict:
    """Send cars from every dead end to every other one (and people along the same ways) and run SUMO."""
    model = VehicleModel(name="car.plain", length=q(4.5), width=q(1.8))
    (folder / "types.add.xml").write_text(types_of([spec_of(model)]))
    if reckless:
        text = (folder / "types.add.xml").read_text()
        blind = 'jmIgnoreFoeProb="1" jmIgnoreFoeSpeed="99" jmIgnoreJunctionFoeProb="1" sigma='
        (folder / "types.add.xml").write_text(text.replace("sigma=", blind))
    roads = dead_ends(network)
    rows, people = [], []
    for a, b in ((a, b) for a, b in product(roads, roads) if a != b):
        flow = f'begin="0" end="{seconds // 2}" period="{period}" type="car.plain" departSpeed="max"'
        rows.append(f'<flow id="{a}-{b}" from="{a}" to="{b}_back" departLane="best" {flow}/>')
        people.append(f'<person id="{a}~{b}" depart="0" departPos="60"><walk from="{a}" to="{b}_back"/></person>')
    routes = folder / "all.rou.xml"
    routes.write_text("<routes>" + "".join(rows + (people if walkers else [])) + "</routes>")
    return run_sumo(net, routes, seconds, folder / "types.add.xml")


def run_sumo(net, routes, seconds, additional=None):
    program = Path(__file__).with_name("sumo_run.py")
    files = [str(net), str(routes), str(seconds), *([str(additional)] if additional else [])]
    done = subprocess.run(
        [sys.executable, str(program), *files], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])
