"""Every word of the language in one table: what it is, what it means in a line, and how it is written.

Messages, the editor's help, the highlighters and the TextMate grammar all read it; a test holds it against the grammar
and the model. Units are in `language.units`.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

Group = Literal["definition", "statement", "setting", "action", "condition", "link", "type", "constant"]
"""What a word is.

definition: what a file holds. statement: the first word of a statement. setting: a line of a block, or a part of one,
that gives one value. action: what an actor does in a trigger. condition: what is measured, asked or combined. link: a
word inside a statement. type: of a parameter. constant: one of a fixed set of values (a turn, a control, a property);
it is no word of the grammar and may be a name elsewhere.
"""


@dataclass(frozen=True, slots=True)
class Keyword:
    """One word: its group, its meaning in a sentence without a full stop, and an example of a line with it."""

    word: str
    group: Group
    meaning: str
    example: str


def _of(group: Group, *rows: tuple[str, str, str]) -> tuple[Keyword, ...]:
    return tuple(Keyword(word, group, meaning, example) for word, meaning, example in rows)


_ALL = (
    *_of(
        "definition",
        ("foresee", "the version of the language; the first line of every file", "foresee 1"),
        ("scenario", "a situation, with parameters and cases or without", "scenario red_light_runner { ... }"),
        (
            "clip",
            "an exact snapshot of seconds of a run, which pins its parent",
            'clip runner_p1 of "runner.foresee" case r02 pin sha256:5ef2c6120a41 { ... }',
        ),
        (
            "mutant",
            "a few changes of a clip, which it pins",
            'mutant runner_p1_m3 of "runner_p1.foresee" pin sha256:c347e6a70b92 { ... }',
        ),
        ("network", "junctions and roads", "network town { ... }"),
        ("models", "sizes and abilities; in traffic: which models take part", "models more { ... }"),
        ("campaign", "which test cases are run, clipped and mutated, and how", "campaign nightly { ... }"),
    ),
    *_of(
        "statement",
        ("seeds", "test cases of a campaign: a file, folder, pattern or address", 'seeds "scenarios/**"'),
        ("drivers", "who drives in a campaign", "drivers [pdm, idm]"),
        ("rankers", "who picks the risky points of a campaign", "rankers [foresee]"),
        ("risky_points", "how many risky points of a run are clipped, at most", "risky_points 4"),
        ("children", "how many mutants a clip gets", "children 4"),
        ("repeat", "how often clips are mutated, each time with the next seed", "repeat 3"),
        ("budget", "no new run of a campaign begins later than that", "budget 30 min"),
        ("doc", "a sentence for people", 'doc "One sentence."'),
        ("tags", "words; `scenarioN` is the family in the paper's table of scenarios", "tags [scenario7, junction]"),
        ("use", "a network, or models, from another file", 'use network "networks/town.foresee"'),
        (
            "param",
            "a parameter: type, default, and the range that its values must lie in",
            "param gap: time = 1.5 s in 0 s..4 s step 0.1 s",
        ),
        ("require", "what the values of a case must satisfy", "require gap < 2 s"),
        ("weather", "ratios from 0 to 1; wetness lowers the friction", "weather rain 0.3, wetness 0.4"),
        ("ego", "the vehicle of the driver under test", "ego: car.sedan { ... }"),
        ("vehicle", "an actor: car, van, truck, bus or motorcycle", "vehicle runner: car.compact { ... }"),
        ("bicycle", "an actor that rides a bicycle", "bicycle cyclist: bicycle.city { ... }"),
        ("pedestrian", "an actor on foot", "pedestrian walker: pedestrian.adult { ... }"),
        ("obstacle", "a thing that does not move", "obstacle box: obstacle.crate { ... }"),
        (
            "traffic",
            "background actors, drawn from a seed",
            "traffic others { count 16; models [car.compact]; within 120 m of ego.route; seed 7 }",
        ),
        ("signal", "what a signal shows: at the beginning, or in a condition", "signal j4 stage ns_go elapsed 11.35 s"),
        ("when", "a trigger: actions for when a condition holds", "when ego.eta(j4) < 4 s { runner stops }"),
        ("expect", "what should hold; reported beside the verdict", "expect never collision(ego)"),
        ("end", "the run's limit; 60 s when absent", "end after 60 s"),
        ("case", "values for parameters: one test case", "case r01 { gap = 1.2 s }"),
        ("cases", "cases with drawn values", "cases 20 from seed 7"),
        ("add", "one statement more than in the extended scenario", "add weather rain 0.3"),
        ("drop", "a statement of the extended scenario that is not in this one", "drop vehicle runner"),
        ("route", "where an actor drives: a road and turns, or edges", "route from south straight over j4"),
        ("path", "a line off the lanes that an actor follows", "path [(90 m, 10 m), (90 m, 30 m)]"),
        ("start", "where an actor's front is at the beginning, or how fast it is", "start at 20 m along ego.route"),
        ("speed", "how fast: an actor where nothing hinders it, or a road's limit", "speed 50 km/h"),
        ("goal", "where the ego's route ends", "goal 40 m past j4 on ego.route"),
        (
            "ignores",
            "signals or priority, everywhere or at one junction",
            "ignores signals at j4",
        ),
        (
            "meets",
            "its speed is set so that it is at the junction's crossing point that much after the other, or before",
            "meets ego at j4 after 1.5 s",
        ),
        ("moving", "how far along its path an actor is already", "moving 2.60 m"),
        ("steers", "a steering offset, -1 (right) to 1 (left)", "steers 0.12 from 1.00 s for 1.00 s"),
        ("timing", "its speed along its own way, as a ratio", "timing 0.90"),
        ("delay", "an actor moves off that much later", "delay 0.5 s"),
        ("line", "how far an actor keeps to the left of its path or its lane's middle", "line 0.60 m"),
        (
            "recorded",
            "where the ego was that much after a clip's beginning: it follows these states first, then its driver",
            "recorded 0.10 s at (1.20 m, 0 m) heading 0 deg speed 12 m/s",
        ),
        (
            "junction",
            "where roads meet or end; in a condition: its outline",
            "junction j4 at (0 m, 0 m) signals { ... }",
        ),
        (
            "road",
            "two edges: NAME from the first junction to the second, NAME_back the other way",
            "road west from west_end to j4 { lanes 2; speed 50 km/h }",
        ),
        ("stage", "one stage of a junction's signal", "stage ns_go for 25 s green [north, south]"),
        ("building", "hides what is behind it", "building bank [(10 m, 20 m), (30 m, 20 m), (30 m, 40 m)]"),
        ("crossings", "people can cross every road with a sidewalk at this junction, or those named", "crossings"),
        ("via", "the road's line goes through these points", "via [(-60 m, 2 m)]"),
        ("model", "one entry of a catalogue: class.variant", "model car.sports { length 4.38 m; width 1.80 m }"),
        ("window", "the seconds of the parent's run that a clip holds", "window 12.40 s..22.40 s"),
        ("risk", "the forecaster's sentence", 'risk "what the forecaster saw" at 17.40 s with runner'),
        ("fidelity", "how far the unmutated clip's run is from its parent's, at most", "fidelity 0.00 m ego 0.12 m"),
        (
            "change",
            "one change: in a mutant WAS => NOW, in an extension a whole statement",
            "change runner.timing: 1.00 => 0.80",
        ),
        ("origin", "where a mutant comes from; means nothing to the run", "origin { operator [steer]; seed 91 }"),
        ("operator", "what made the changes", "operator [model_swap, steer]"),
        (
            "within",
            "at most that far, or by that time: of traffic, of a condition, of an expectation",
            "within 120 m of ego.route",
        ),
        ("count", "how many background actors", "count 16"),
        ("seed", "where the draw begins; the same seed draws the same", "seed 7"),
    ),
    *_of(
        "setting",
        ("rain", "0 to 1; for sensors", "weather rain 0.3"),
        ("fog", "0 to 1; for sensors", "weather fog 0.1"),
        ("wetness", "0 to 1; lowers the friction from 0.9 to 0.5", "weather wetness 0.4"),
        ("sun", "0 to 1; for sensors", "weather sun 0.5"),
        ("lanes", "lanes of a road's first edge, 1 to 8", "lanes 2"),
        ("back", "lanes of a road's other edge, 0 for one way; as a turn: back where it came from", "back 1"),
        ("lane_width", "width of each lane; 3.3 m when absent", "lane_width 3.5 m"),
        ("parking", "a strip for parked vehicles, right of each edge's lanes", "parking 2.2 m"),
        ("sidewalk", "a sidewalk of this width, right of each edge", "sidewalk 2 m"),
        ("median", "room between a road's two directions", "median 1.5 m"),
        ("length", "a model's length", "length 4.38 m"),
        ("width", "a model's width", "width 1.80 m"),
        ("height", "a model's height, with its rider; what is behind may be hidden", "height 1.48 m"),
        ("wheelbase", "between a model's axles", "wheelbase 2.57 m"),
        ("front_overhang", "from the front axle to the front bumper", "front_overhang 0.85 m"),
        ("rear_overhang", "from the rear axle to the rear bumper", "rear_overhang 0.96 m"),
        ("mass", "a model's mass", "mass 1350 kg"),
        ("max_speed", "the fastest that a model can go", "max_speed 180 km/h"),
        ("cruise_speed", "what a model walks or drives where nobody says a speed", "cruise_speed 1.3 m/s"),
        ("acceleration", "how strongly: of a model, or in an actor's state", "acceleration 3 m/s^2"),
        ("braking", "a model's comfortable braking", "braking 4 m/s^2"),
        ("emergency_braking", "a model's hardest braking", "emergency_braking 9 m/s^2"),
        ("max_steer", "how far the front wheels turn", "max_steer 35 deg"),
        ("steer_rate", "how fast the front wheels turn", "steer_rate 40 deg/s"),
        ("source", "where the numbers come from", 'source "data sheet of 2024"'),
        ("heading", "an actor's direction, counter-clockwise from east", "at (1 m, 2 m) heading 90 deg speed 8 m/s"),
        ("steer", "the angle of the front wheels in a state; of a mutant: a steering offset", "steer 2.0 deg"),
        ("preset", "how the clip was mutated", "preset focused"),
        ("preventable", "whether another driver would have prevented it", "preventable yes"),
        ("tool", "the version that wrote the mutant", 'tool "0.1.0"'),
        ("driver", "the driver that was under test", 'driver "pdm 2"'),
        ("found", "the failure that the mutant showed", 'found "F4 lateral collision with runner at 3.15 s"'),
        ("minimised", "how the mutant was made smaller", 'minimised "3 changes to 2"'),
    ),
    *_of(
        "action",
        ("starts", "an actor that waited moves off", "walker starts"),
        ("stops", "brakes and stands, for good or for a time", "lead stops for 4 s"),
        ("changes", "its speed or its lane", "lead changes speed to 3 m/s over 2 s"),
        ("lane", "to the left or right neighbour", "cutter changes lane left"),
        ("wait", "nothing happens for that time", "wait 2 s"),
        ("then", "what comes once every action before it is complete", "then { walker starts }"),
    ),
    *_of(
        "condition",
        ("time", "seconds since the start", "when time > 5 s { walker starts }"),
        ("distance", "metres between two footprints, or along the route to a junction", "distance(ego, lead) < 10 m"),
        ("ttc", "seconds until two footprints touch when both keep heading and speed", "ttc(ego, lead) < 3 s"),
        ("headway", "seconds that the first needs at its speed for the gap to the other", "headway(ego, lead) < 2 s"),
        ("collision", "the actor touches anything", "expect never collision(ego)"),
        ("arrived", "the actor has reached its goal", "expect eventually arrived(ego)"),
        ("and", "both hold; binds stronger than `or`", "time > 1 s and ego.speed < 3 m/s"),
        ("or", "one of them holds", "time > 9 s or ego.speed < 3 m/s"),
        ("not", "it does not hold", "not ego.speed < 3 m/s"),
        ("is", "a parameter has that value, or a signal shows that", "ego.signal(j4) is red"),
        ("never", "it holds at no frame", "expect never collision(ego)"),
        ("always", "it holds at every frame", "expect always ttc(ego, lead) > 1 s"),
        ("eventually", "it holds at one frame", "expect eventually within 60 s arrived(ego)"),
        ("once", "the trigger fires the first time only (as it does when nothing is said)", "when once time > 1 s"),
        ("every", "the trigger fires each time that its condition becomes true", "when every ttc(ego, lead) < 2 s"),
        (
            "next",
            "as `every`, but not before the condition has been false once",
            "when next ttc(ego, lead) < 2 s",
        ),
    ),
    *_of(
        "link",
        ("extends", "the scenario is another one, with the differences that follow", 'wet extends "dry.foresee"'),
        ("of", "the parent; the other side of `within`", 'clip runner_p1 of "runner.foresee"'),
        ("pin", "the hash of what the parent means", "pin sha256:5ef2c6120a41"),
        ("in", "the range or options of a parameter; inside a junction", "in 0 s..4 s step 0.1 s"),
        ("step", "values lie on these steps from the range's low end", "in 0 s..4 s step 0.1 s"),
        ("as", "how a parameter's values are drawn", "as normal(1.5 s, 0.4 s)"),
        ("uniform", "every value of the range is as likely", "as uniform"),
        ("normal", "mean and standard deviation, cut off at the range's ends", "as normal(1.5 s, 0.4 s)"),
        ("choice", "how often each option is drawn, relative to the others", "as choice(3, 1)"),
        ("grid", "values are taken in turn, every combination once", "as grid"),
        (
            "since",
            "since when what a `for` is about had held before the beginning",
            "when ego.speed > 5 m/s for 2 s since -1.30 s { runner stops }",
        ),
        ("after", "later than that", "end after 60 s"),
        ("before", "earlier than that; short of the junction", "meets ego at j4 before 1.0 s"),
        ("at", "where, or when", "start at 20 m along ego.route"),
        ("along", "a distance on an edge or on an actor's route", "20 m along ego.route"),
        ("past", "a distance behind a junction", "12 m past j4 on ego.route"),
        ("on", "on whose route", "12 m past j4 on ego.route"),
        ("offset", "to the side, left positive", "30 m along west offset 1 m"),
        ("from", "where a route begins, when steering begins, where a draw begins", "route from south"),
        ("over", "the junction of a turn; the time of a change", "straight over j4"),
        ("to", "where a road ends; the new speed", "changes speed to 3 m/s"),
        ("for", "how long", "stops for 4 s"),
        ("elapsed", "time since the stage began", "signal j4 stage ns_go elapsed 11.35 s"),
        ("green", "the roads that have green in a stage; what a signal shows", "green [north, south]"),
        ("with", "which actor the risk is about", 'risk "..." at 17.40 s with runner'),
    ),
    *_of(
        "type",
        ("angle", "a parameter's type: a quantity in deg or rad", "param turn_in: angle = 10 deg"),
        ("ratio", "a parameter's type: a plain number", "param wet: ratio = 0.3"),
        ("arm", "a parameter's type: the name of a road", "param approach: arm = south in [south, east]"),
        ("turn", "a parameter's type: straight, left, right or back", "param way: turn = straight"),
        ("side", "a parameter's type: left or right", "param evades: side = left"),
    ),
    *_of(
        "constant",
        ("straight", "a turn: straight on", "straight over j4"),
        ("left", "a turn, or a side", "left over j4"),
        ("right", "a turn, or a side", "right over j4"),
        ("signals", "a junction's control; what an actor ignores", "junction j4 at (0 m, 0 m) signals { ... }"),
        ("priority", "the wider or faster road goes first; what an actor ignores", "ignores priority at j4"),
        ("right_before_left", "a junction's control: who comes from the right goes first", "right_before_left"),
        ("stop", "a junction's control: all-way stop", "junction j4 at (0 m, 0 m) stop"),
        ("eta", "seconds until an actor enters a junction", "ego.eta(j4) < 4 s"),
        ("amber", "what a signal shows", "ego.signal(j4) is amber"),
        ("red", "what a signal shows", "ego.signal(j4) is red"),
        ("yes", "of `preventable`", "preventable yes"),
        ("no", "of `preventable`", "preventable no"),
        ("unknown", "of `preventable`", "preventable unknown"),
    ),
)

KEYWORDS = MappingProxyType({keyword.word: keyword for keyword in _ALL})
"""Every word of the language, by itself."""

USAGE = MappingProxyType(
    {k.word: k.example for k in _ALL if k.group in ("definition", "statement") or k.word in ("wait", "then")}
)
"""How each statement is written, by its first word."""

TAKEN = frozenset(
    (
        *("then", "wait", "once", "every", "next", "never", "always", "eventually", "within", "not"),
        *("time", "distance", "ttc", "headway", "collision", "arrived", "signal"),
    )
)
"""Words that begin a condition or an action, or stand before one: an actor or a label of that name could not be told
from them. A test holds the list against the grammar."""


def words_of(*groups: Group) -> tuple[str, ...]:
    """Return the words of some groups, in the order of the table."""
    return tuple(keyword.word for keyword in _ALL if keyword.group in groups)
