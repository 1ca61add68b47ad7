"""Small worlds: networks in memory, built once a session; the grid that simulations share; test cases as text.

A net is kept by its content in the cache of the test session, so workers and test files share it; nothing writes to it.
"""

from __future__ import annotations

from decimal import Decimal
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.nets.cache import cached_net
from foresee_dsl.compile.nets.net_reader import read_network, topology_of
from foresee_dsl.compile.nets.netconvert import run_netconvert
from foresee_dsl.compile.nets.network_builder import build_network
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.nets.signals import signals_of
from foresee_dsl.compile.placement.scene import SceneBuilder
from foresee_dsl.compile.roads.network import buildings_of
from foresee_dsl.errors import Message
from foresee_dsl.helps import Help
from foresee_dsl.language.document import PlacementError, TestCase
from foresee_dsl.language.model import Junction, Network, Point, Quantity, Road, Stage, VehicleModel
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.loading import bundled_models, load_test_case

_UNITS = {"speed": "km/h", "lanes": "", "back": ""}


def q(value, unit=None):
    """A quantity: `q("50 km/h")`, `q(50, "km/h")`; a number without a unit is in metres, a text has none."""
    number, _, written = str(value).partition(" ")
    if unit is None:
        unit = written if isinstance(value, str) else "m"
    return Quantity(value=Decimal(number), unit=unit)


def point(x, y):
    """The point at these metres, numbers or texts."""
    return Point(x=q(x, "m"), y=q(y, "m"))


def model(name="car.plain", length=None, width=None, **values):
    """A model of a catalogue; `values`: its other properties."""
    return VehicleModel(name=name, length=length or q("4.2 m"), width=width or q("1.8 m"), **values)


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
        **{key: q(value, _UNITS.get(key, "m")) for key, value in values.items()},
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


PLAIN = four_arms(lanes=1, back=1, median=0, via=())
"""Four arms of 120 m, one lane of 3.3 m each way: lane centres are 1.65 m from the axes."""


def net_of(network: Network) -> Path:
    """Return the net of a network."""
    return cached_net(("test", network.model_dump_json()), lambda out: build_network(network, out))


def shifted_net(network: Network, x_m: float, y_m: float) -> Path:
    """Return the net of a network, moved as nets are whose coordinates were normalised."""
    shift = ["--offset.disable-normalization", "--offset.x", f"{x_m}", "--offset.y", f"{y_m}"]
    parts = ("shifted", network.model_dump_json(), *shift)
    return cached_net(
        parts, lambda out: run_netconvert(["-s", str(net_of(network)), *shift, "-o", str(out)], out.parent)
    )


def net_root(path):
    return ElementTree.parse(path).getroot()


def lanes_of(root, edge):
    return root.findall(f"edge[@id='{edge}']/lane")


def shape(element):
    return [tuple(map(float, p.split(","))) for p in element.get("shape").split()]


# ---- the grid -------------------------------------------------------------------------------------------------------

COMPACT = ModelSpec("car.compact", "car", 4.0, 1.75, 2.5, 0.8, 1100.0, 50.0, 3.0, 4.5, 8.0, 0.61, 7.0)
VAN = ModelSpec("van.delivery", "van", 5.9, 2.0, 3.6, 0.95, 2500.0, 45.0, 2.0, 4.0, 7.0, 0.58, 6.0)
ADULT = ModelSpec("pedestrian.adult", "pedestrian", 0.5, 0.6, 0.5, 0.0, 75.0, 3.0, 1.5, 2.0, 3.0, 0.5, 7.0)
CRATE = ModelSpec("obstacle.crate", "obstacle", 1.0, 1.2, 1.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_TYPES = """<additional>
<vType id="car.compact" length="4.0" width="1.75" accel="3.0" decel="4.5" emergencyDecel="8.0" maxSpeed="50"
  minGap="2.0" sigma="0" speedDev="0"/>
<vType id="van.delivery" vClass="delivery" length="5.9" width="2.0" accel="2.0" decel="4.0" emergencyDecel="7.0"
  maxSpeed="45" minGap="2.0" sigma="0" speedDev="0"/>
<vType id="ghost" length="0.5" width="0.5" minGap="0" sigma="0" speedDev="0" accel="5" decel="5" maxSpeed="50"/>
</additional>
"""
_SIZE, _APART_M = 4, 110.0


def grid_edges() -> list[tuple[str, str]]:
    """Return both directions of every street of the grid, whose junctions are called `n<column><row>`."""
    ends = []
    for c, r in product(range(_SIZE), repeat=2):
        ends += [(f"n{c}{r}", f"n{c + 1}{r}")] * (c + 1 < _SIZE) + [(f"n{c}{r}", f"n{c}{r + 1}")] * (r + 1 < _SIZE)
    return [end for a, b in ends for end in ((a, b), (b, a))]


def grid_net() -> Path:
    """Return a town-like grid: signals at n11 and n22, priority elsewhere; the streets of the row 1 have two lanes.

    `types.add.xml` beside it has the types of the vehicles.
    """
    nodes = "".join(
        f'<node id="n{c}{r}" x="{c * _APART_M}" y="{r * _APART_M}" '
        f'type="{"traffic_light" if (c, r) in ((1, 1), (2, 2)) else "priority"}"/>\n'
        for c, r in product(range(_SIZE), repeat=2)
    )
    edges = "".join(
        f'<edge id="{a}_{b}" from="{a}" to="{b}" numLanes="{2 if a[2] == b[2] == "1" else 1}" speed="13.89" '
        f'priority="{2 if a[2] == b[2] else 1}" sidewalkWidth="2"/>\n'
        for a, b in grid_edges()
    )

    def build(net: Path) -> None:
        folder = net.parent
        (folder / "t.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
        (folder / "t.edg.xml").write_text(f"<edges>{edges}</edges>")
        (folder / "types.add.xml").write_text(_TYPES)
        options = ["--crossings.guess", "--walkingareas", "--no-turnarounds", "--no-warnings"]
        options += ["--junctions.limit-turn-speed", "5.5", "--tls.green.time", "15", "-o", str(net)]
        run_netconvert(["-n", "t.nod.xml", "-e", "t.edg.xml", *options], folder)

    return cached_net(("grid", nodes, edges, _TYPES), build)


def read_signals(net, network):
    """Return the signals of a net file by junction; `network`: the written network of which it was built, or None."""
    root = parse_net(net)
    return signals_of(root, topology_of(root), network)


# ---- test cases ---------------------------------------------------------------------------------------------

EGO = "ego: car.sedan {\n route from south straight over j4\n start at 30 m along south\n}\n"


def case_from(scenario, network, models, *, folder=Path(), case="", meaning="sha256:000000000000", document=None):
    """The test case of a scenario in memory; `case`: the name of its case."""
    file = f"{scenario.name}.foresee"
    return TestCase(
        id=f"{file}::{case}" if case else file,
        scenario=scenario,
        network=network,
        models=models,
        meaning=meaning,
        source=folder / file,
        document=document,
    )


def case_of(text, network=PLAIN):
    """The test case of the statements of a scenario."""
    document = parse(f"foresee 1\n\nscenario small {{\n{text}\n}}\n", "small.foresee")
    return case_from(document.model, network, bundled_models(), document=document)


def written_case(file, text):
    """The test case of a file's text, which is written."""
    file.write_text(text)
    return load_test_case(str(file))


def scene_of(text, network=PLAIN):
    net = net_of(network)
    specs = {name: spec_of(model) for name, model in bundled_models().items()}
    read = read_network(net, buildings_of(network))
    return SceneBuilder(case_of(text, network), read, specs, read_signals(net, network)).build()


def problems_of(text, network=PLAIN):
    """Return the problems: (actor, statement, message, help) each; empty without problems."""
    try:
        scene_of(text, network)
    except PlacementError as err:
        return [(p.actor, p.item, Message.of(p.message).text, Help.of(p.help).text) for p in err.problems]
    return []
