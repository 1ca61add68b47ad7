"""Tables of words of other languages, with the words or helps of this language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from foresee_dsl.helps import Help, HelpText, as_opposite, remove, write

CODE = "FS065"


@dataclass(frozen=True, slots=True)
class Foreign:
    """The message for a statement in another language: the wrong part of its text (as offsets), the message, and the
    help."""

    start: int
    end: int
    message: str
    help: HelpText


TOP = ("scenario_item", "extension_item", "clip_item")
OURS: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("assert", "ensure", "guarantee"), "expect always"),
        **dict.fromkeys(("if", "while", "upon", "on", "until"), "when"),
        "whenever": "when every",
        **dict.fromkeys(("import", "include"), "use network"),
    }
)
"""First words of statements in other languages, each with the words that replace it."""
_A_TRIGGER = (
    "write events as a trigger: "
    + write("when time > 5 s { lead stops }")
    + "; `foresee import` reads whole .xosc files"
)
_AN_ACTOR = "write an actor as a block: " + write("vehicle lead: car.compact { start at 20 m along ego.route }")
_A_PARAMETER = "write a parameter with its type: " + write("param gap: time = 1.5 s")
_A_LIMIT = (
    write("require gap < 2 s")
    + " restricts the values of parameters, `expect always ...` states what is to hold in the run"
)
_A_DRAW = write("cases 20 from seed 7")
_LEFT_OUT = remove("leave this out")
HELPS: Mapping[str, HelpText] = MappingProxyType(
    {
        **dict.fromkeys(("keep", "constraint"), _A_LIMIT),
        "else": (
            as_opposite("there is no `else`")
            + ": write a second trigger with a condition of its own (a "
            + write("not")
            + " holds from the beginning)"
        ),
        "elif": as_opposite("there is no `elif`") + ": write a second trigger, `when ... { ... }`",
        "for": "there are no loops: `when every ... { ... }` fires again, " + _A_DRAW + " draws cases",
        "foreach": "there are no loops: " + _A_DRAW + " draws test cases",
        **dict.fromkeys(("repeat", "loop"), "there are no loops: a trigger `when every ... { ... }` fires again"),
        **dict.fromkeys(("var", "let", "const"), _A_PARAMETER),
        **dict.fromkeys(
            ("def", "function"),
            "there are no functions: write a value as " + write("param") + ", and actions in a " + write("when"),
        ),
        "print": "the report shows the run; " + _LEFT_OUT,
        "return": "a scenario returns nothing: " + _LEFT_OUT,
        **dict.fromkeys(
            ("do", "serial"), "actions begin together; to run them one after the other write `then { ... }`"
        ),
        "parallel": "actions of one block begin together: " + _LEFT_OUT,
        "one_of": "a parameter with options and " + write("as choice(3, 1)") + " draws one of several",
        "behavior": "write the actions of an actor in triggers: " + write("when time >= 0 s { lead stops }"),
        "with": (
            "write each property on a line of the actor's block: "
            + write("start speed 40 km/h")
            + ", "
            + write("delay 0.5 s")
        ),
        "take": "begin an action with its actor: " + write("lead stops"),
        "terminate": ("a run ends after the time of " + write("end after 20 s") + ", or when the ego arrives or fails"),
        "record": "everything is recorded: " + _LEFT_OUT,
        "simulator": "the simulator is SUMO: " + _LEFT_OUT,
        "cover": "`foresee sample` shows what the cases reach: " + _LEFT_OUT,
        "emit": (
            "triggers do not receive events: "
            + _LEFT_OUT
            + ", and write the condition, `when distance(ego, lead) < 20 m { ... }`"
        ),
        **dict.fromkeys(
            ("try", "interrupt"), "write a trigger: " + write("when ego within 10 m of lead { lead stops }")
        ),
        "zebra": "for people to cross, the junction needs " + write("crossings"),
        "class": "write sizes and abilities of models in a file `models NAME { ... }`",
        "yield": (
            "the network's rules decide which actor gives way; to change that for an actor, write "
            + write("ignores priority")
            + " or "
            + write("meets")
        ),
    }
)
"""First words of statements in other languages that no word replaces, each with a help."""
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
"""Words for features of networks that the language leaves out on purpose, each with the reason."""


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
"""Names of network settings in other languages, each with the name in this one."""
