"""Tables of words of other languages, with the words or helps of this language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from foresee_dsl.helps import Help, HelpText, as_opposite, remove, write

CODE = "FS065"


@dataclass(frozen=True, slots=True)
class Foreign:
    """The message for a statement in another language: the wrong part of its text (offsets), the message, the help."""

    start: int
    end: int
    message: str
    help: HelpText


TOP = ("scenario_item", "extension_item", "clip_item")
FIRST: Mapping[str, tuple[str, HelpText]] = MappingProxyType(
    {
        # first word: the word that replaces it ("" if none does), and the help if none does
        "assert": ("expect always", ""),
        "ensure": ("expect always", ""),
        "guarantee": ("expect always", ""),
        "if": ("when", ""),
        "while": ("when", ""),
        "whenever": ("when every", ""),
        "upon": ("when", ""),
        "on": ("when", ""),
        "until": ("when", ""),
        "keep": (
            "",
            write("require gap < 2 s")
            + " says which values belong together, `expect always ...` what is to hold in the run",
        ),
        "constraint": (
            "",
            write("require gap < 2 s") + " says which values belong together, `expect always ...` what is to hold",
        ),
        "import": ("use network", ""),
        "include": ("use network", ""),
        "else": (
            "",
            as_opposite("there is no `else`")
            + ": write a second trigger with a condition of its own (a "
            + write("not")
            + " holds from the beginning)",
        ),
        "elif": ("", as_opposite("there is no `elif`") + ": write a second trigger, `when ... { ... }`"),
        "for": (
            "",
            "nothing is repeated by a loop: `when every ... { ... }` fires again, "
            + write("cases 20 from seed 7")
            + " draws cases",
        ),
        "foreach": ("", "nothing is repeated by a loop: " + write("cases 20 from seed 7") + " draws test cases"),
        "repeat": ("", "nothing is repeated by a loop: a trigger `when every ... { ... }` fires again"),
        "loop": ("", "nothing is repeated by a loop: a trigger `when every ... { ... }` fires again"),
        "var": ("", "a parameter is written with its type: " + write("param gap: time = 1.5 s")),
        "let": ("", "a parameter is written with its type: " + write("param gap: time = 1.5 s")),
        "const": ("", "a parameter is written with its type: " + write("param gap: time = 1.5 s")),
        "def": (
            "",
            "nothing is defined by a function: a value is a " + write("param") + ", what happens is a " + write("when"),
        ),
        "function": (
            "",
            "nothing is defined by a function: a value is a " + write("param") + ", what happens is a " + write("when"),
        ),
        "print": ("", "what a run shows is in its report; " + remove("leave this out")),
        "return": ("", "a scenario returns nothing: " + remove("leave this out")),
        "do": ("", "actions begin together; for one after the other write `then { ... }`"),
        "serial": ("", "actions begin together; for one after the other write `then { ... }`"),
        "parallel": ("", "actions of one block begin together: " + remove("leave this out")),
        "one_of": ("", "a parameter with options and " + write("as choice(3, 1)") + " draws one of several"),
        "behavior": ("", "what an actor does is written in triggers: " + write("when time >= 0 s { lead stops }")),
        "with": (
            "",
            "in an actor's block each property is a line: "
            + write("start speed 40 km/h")
            + ", "
            + write("delay 0.5 s"),
        ),
        "take": ("", "an action begins with its actor: " + write("lead stops")),
        "terminate": ("", "a run ends by " + write("end after 20 s") + ", and when the ego arrives or fails"),
        "record": ("", "everything is recorded: " + remove("leave this out")),
        "simulator": ("", "the simulator is SUMO: " + remove("leave this out")),
        "cover": ("", "`foresee sample` shows what the cases reach: " + remove("leave this out")),
        "emit": (
            "",
            "triggers are not told of events: "
            + remove("leave this out")
            + ", and write what they wait for, `when distance(ego, lead) < 20 m { ... }`",
        ),
        "try": ("", "a trigger says what happens when: " + write("when ego within 10 m of lead { lead stops }")),
        "interrupt": ("", "a trigger says what happens when: " + write("when ego within 10 m of lead { lead stops }")),
        "zebra": ("", "people cross where the junction has " + write("crossings")),
        "class": ("", "models have sizes and abilities in a file `models NAME { ... }`"),
        "yield": (
            "",
            "who gives way is the network's: "
            + write("ignores priority")
            + " and "
            + write("meets")
            + " are what actors do",
        ),
    }
)
_A_TRIGGER = (
    "what happens is a trigger: "
    + write("when time > 5 s { lead stops }")
    + "; `foresee import` reads whole .xosc files"
)
_AN_ACTOR = "an actor is a block: " + write("vehicle lead: car.compact { start at 20 m along ego.route }")
_A_PARAMETER = "a parameter is written with its type: " + write("param gap: time = 1.5 s")
OPENSCENARIO: Mapping[str, Help] = MappingProxyType(
    {
        **dict.fromkeys(
            ("Storyboard", "Story", "Act", "ManeuverGroup", "Maneuver", "Event", "Action", "StartTrigger"), _A_TRIGGER
        ),
        **dict.fromkeys(
            ("StopTrigger", "ConditionGroup", "Condition", "Init", "Private", "GlobalAction", "PrivateAction"),
            _A_TRIGGER,
        ),
        **dict.fromkeys(("Entities", "ScenarioObject", "CatalogReference", "EntityObject", "Actors"), _AN_ACTOR),
        **dict.fromkeys(("ParameterDeclarations", "ParameterDeclaration", "VariableDeclaration"), _A_PARAMETER),
    }
)
SCENIC_CLASSES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "Pedestrian": ("pedestrian", "pedestrian.adult"),
        "Bicycle": ("bicycle", "bicycle.city"),
        "Object": ("obstacle", "obstacle.crate"),
        "Prop": ("obstacle", "obstacle.crate"),
        "Truck": ("vehicle", "truck.rigid"),
        "Bus": ("vehicle", "bus.city"),
    }
)
ACTORS: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("car", "van", "truck", "bus", "motorcycle", "lorry", "npc"), "vehicle"),
        **dict.fromkeys(("person", "walker", "child", "human", "ped"), "pedestrian"),
        **dict.fromkeys(("bike", "cyclist", "rider"), "bicycle"),
        **dict.fromkeys(("object", "thing", "prop", "box"), "obstacle"),
    }
)
WEATHER: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("wet", "slippery"), "wetness 0.6"),
        **dict.fromkeys(("rainy", "raining"), "rain 0.5"),
        **dict.fromkeys(("foggy", "mist", "misty"), "fog 0.5"),
        **dict.fromkeys(("sunny", "glare"), "sun 0.5"),
        **dict.fromkeys(("dry", "clear"), "wetness 0"),
    }
)

UNSUPPORTED = (
    (
        ("elevation", "slope", "height", "incline", "gradient", "z", "bridge", "tunnel"),
        "roads are flat: " + remove("leave it out") + "; a bridge is a road that shares no junction with the one below",
    ),
    (
        ("tram", "tram_track", "tram_tracks", "tram_lane", "rail", "rails", "track"),
        "SUMO would drive trams as one rigid body: "
        + remove("leave it out")
        + "; a reserved lane for a bus is "
        + write("bus_lane 3.5 m"),
    ),
)
"""Words for networks that the language leaves out on purpose, with the reason."""


OF_ROADS = {
    **dict.fromkeys(("max_speed", "maxspeed", "speed_limit", "limit"), "speed"),
    **dict.fromkeys(("width", "lanewidth"), "lane_width"),
    **dict.fromkeys(("crosswalk", "crossing", "zebra_crossing", "pedestrian_crossing"), "zebra"),
    **dict.fromkeys(("bike_lane", "bicycle_lane"), "cycle_lane"),
    **dict.fromkeys(("bike_track", "bicycle_track", "cycleway"), "cycle_track"),
    **dict.fromkeys(("pavement", "footpath", "sidewalks"), "sidewalk"),
    **dict.fromkeys(("street", "edge", "highway"), "road"),
    **dict.fromkeys(("node", "intersection", "crossroads"), "junction"),
    **dict.fromkeys(("circle", "rotary", "traffic_circle"), "roundabout"),
}
"""Other names for parts of networks, with ours."""
