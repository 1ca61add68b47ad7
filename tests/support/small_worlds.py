"""Test cases written as text on networks made in memory."""

from pathlib import Path

from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.nets.cache import cached_net
from foresee_dsl.compile.nets.network_builder import build_network
from foresee_dsl.compile.nets.signals import read_signals
from foresee_dsl.compile.placement.scene import SceneBuilder
from foresee_dsl.compile.roads.network import RoadNetwork, buildings_of
from foresee_dsl.errors import Message
from foresee_dsl.helps import Help
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.document import PlacementError, TestCase
from foresee_dsl.language.project.loading import bundled_models
from tests.support.built_networks import four_arms

PLAIN = four_arms(lanes=1, back=1, median=0, via=())
"""Four arms of 120 m, one lane of 3.3 m each way: lane centres are 1.65 m from the axes."""
EGO = "ego: car.sedan {\n route from south straight over j4\n start at 30 m along south\n}\n"


def net_of(network):
    return cached_net(("test", network.model_dump_json()), lambda out: build_network(network, out))


def case_of(text, network=PLAIN):
    document = parse(f"foresee 1\n\nscenario small {{\n{text}\n}}\n", "small.foresee")
    return TestCase(
        id="small.foresee",
        scenario=document.model,
        network=network,
        models=bundled_models(),
        meaning="sha256:000000000000",
        source=Path("small.foresee"),
        document=document,
    )


def scene_of(text, network=PLAIN):
    net = net_of(network)
    specs = {name: spec_of(model) for name, model in bundled_models().items()}
    read = RoadNetwork.from_net(net, buildings_of(network))
    return SceneBuilder(case_of(text, network), read, specs, read_signals(net, network)).build()


def problems_of(text, network=PLAIN):
    """What is wrong: (actor, statement, message, help) each; empty for nothing."""
    try:
        scene_of(text, network)
    except PlacementError as err:
        return [(p.actor, p.item, Message.of(p.message).text, Help.of(p.help).text) for p in err.problems]
    return []
