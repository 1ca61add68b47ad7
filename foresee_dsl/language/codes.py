"""The codes of the language's diagnostics: one entry each, with a wrong and a right example."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from foresee_dsl.language.units import Dimension


@dataclass(frozen=True, slots=True)
class Code:
    """What a code means: a title, something that earns it, and the same put right."""

    code: str
    title: str
    wrong: str
    right: str


_ALL = (
    Code("FS001", "the file cannot be read", 'use network "no_such_file.foresee"', 'use network "town.foresee"'),
    Code("FS002", "not a text file of the language", "(a binary, empty or too large file)", "foresee 1"),
    Code("FS003", "the statement is not complete or not in order", "start 20 m", "start at 20 m along ego.route"),
    Code("FS004", "unknown word", "vehcle runner: car.compact", "vehicle runner: car.compact"),
    Code("FS005", "unknown unit", "speed 50 kmh", "speed 50 km/h"),
    Code("FS006", "unknown property", "start at 20 m along ego.rout", "start at 20 m along ego.route"),
    Code("FS007", "a brace is missing", "ego: car.sedan {\n  speed 9 m/s", "ego: car.sedan {\n  speed 9 m/s\n}"),
    Code("FS008", "the statement cannot stand here", "road west from a to b { count 2 }", "traffic others { count 2 }"),
    Code("FS009", "the first line is not `foresee 1`", "scenario a {\n}", "foresee 1\n\nscenario a {\n}"),
    Code("FS010", "a value of another dimension is needed", "end after 60 m", "end after 60 s"),
    Code("FS011", "not a name", "vehicle Runner: car.compact", "vehicle runner: car.compact"),
    Code("FS012", "not one of the known values", "changes lane letf", "changes lane left"),
    Code("FS013", "said twice", "road a from b to c { lanes 1; lanes 2 }", "road a from b to c { lanes 2 }"),
    Code("FS014", "something is missing", "traffic others { count 4 }", "traffic others { count 4; seed 1; ... }"),
    Code("FS015", "a character or string that cannot be read", 'doc "not closed', 'doc "closed"'),
    Code("FS016", "a number out of range", "end after 99999999999 s", "end after 60 s"),
    Code("FS017", "a text that is too long or empty", 'use network ""', 'use network "town.foresee"'),
    Code("FS018", "nested too deeply", "when not not not ... (forty times)", "when time > 1 s { runner stops }"),
    Code("FS019", "not a pin", "pin sha256:12", "pin sha256:5ef2c6120a41"),
    Code("FS020", "internal: the formatter would have changed the meaning", "", ""),
    Code("FS030", "two things have the same name", "vehicle a: ...\nvehicle a: ...", "vehicle a: ...\nvehicle b: ..."),
    Code("FS031", "unknown parameter", "speed runer_speed", "speed runner_speed"),
    Code("FS032", "a parameter of the wrong type for its place", "param gap: time = 1 s\nspeed gap", "speed pace"),
    Code("FS033", "a value outside the parameter's range or options", "case a { gap = 9 s }", "case a { gap = 4 s }"),
    Code("FS034", "a value that does not fit the parameter's type", "case a { gap = 9 m }", "case a { gap = 4 s }"),
    Code(
        "FS035", "the ego is missing or there are several", "scenario a {\n}", "scenario a {\n  ego: car.sedan {...}\n}"
    ),
    Code("FS036", "the network is missing or there are several", "scenario a {\n}", 'use network "town.foresee"'),
    Code("FS037", "unknown actor", "when time > 1 s { runer stops }", "when time > 1 s { runner stops }"),
    Code("FS038", "the model is of another class", "pedestrian p: car.sedan", "pedestrian p: pedestrian.adult"),
    Code("FS039", "a range that ends before it begins", "in 4 s..0 s", "in 0 s..4 s"),
    Code("FS040", "unknown junction", "road a from nort to j4", "road a from north to j4"),
    Code("FS041", "unknown road, or one that does not touch the junction", "green [nort]", "green [north]"),
    Code("FS042", "an actor that is nowhere", "vehicle a: car.sedan", "vehicle a: car.sedan { route [main] }"),
    Code("FS043", "a ratio outside its range", "weather rain 1.3", "weather rain 1.0"),
    Code("FS044", "a clip is incomplete", "clip a of ... { }", "clip a of ... { window ...; ego: ...; goal ... }"),
    Code("FS045", "a mutant that changes nothing", "mutant a of ... { }", "mutant a of ... { change ... }"),
    Code("FS046", "a change with values of the wrong kind", "change a.model: 1 => 2", "change a.timing: 1.00 => 0.80"),
    Code("FS047", "two statements of which one can stand", "end after 5 s\nend after 6 s", "end after 6 s"),
    Code(
        "FS048", "a signal without stages, or stages without a signal", "junction j at ... signals", "stage go for ..."
    ),
    Code("FS049", "a name that the language needs itself", "param straight: time = 1 s", "param way: turn = straight"),
    Code("FS050", "a value that makes no sense here", "road a from b to c { lanes 0 }", "lanes 1"),
)

CODES = MappingProxyType({code.code: code for code in _ALL})
"""Every code of the text side of the language, by its name. FS1.. and FS2.. belong to projects and placement."""

EXAMPLES: MappingProxyType[Dimension, str] = MappingProxyType(
    {
        "time": "2.5 s",
        "length": "12 m",
        "speed": "50 km/h",
        "acceleration": "3 m/s^2",
        "angle": "15 deg",
        "angular_rate": "300 deg/s",
        "mass": "1200 kg",
        "ratio": "0.3",
        "count": "2",
    }
)
"""A value of each dimension, for messages."""

NOUNS: MappingProxyType[Dimension, str] = MappingProxyType(
    {
        "time": "a time",
        "length": "a length",
        "speed": "a speed",
        "acceleration": "an acceleration",
        "angle": "an angle",
        "angular_rate": "a turning rate",
        "mass": "a mass",
        "ratio": "a plain number",
        "count": "a whole number",
    }
)
"""What each dimension is called in messages."""

USAGE: MappingProxyType[str, str] = MappingProxyType(
    {
        "foresee": "foresee 1",
        "scenario": "scenario red_light_runner { ... }",
        "clip": 'clip runner_p1 of "runner.foresee" case r02 pin sha256:5ef2c6120a41 { ... }',
        "mutant": 'mutant runner_p1_m3 of "runner_p1.foresee" pin sha256:c347e6a70b92 { ... }',
        "network": "network town { ... }",
        "models": "models more { ... }",
        "doc": 'doc "One sentence."',
        "tags": "tags [scenario7, junction]",
        "use": 'use network "networks/town.foresee"',
        "param": "param gap: time = 1.5 s in 0 s..4 s step 0.1 s",
        "weather": "weather rain 0.3, wetness 0.4",
        "ego": "ego: car.sedan { ... }",
        "vehicle": "vehicle runner: car.compact { ... }",
        "bicycle": "bicycle cyclist: bicycle.city { ... }",
        "pedestrian": "pedestrian walker: pedestrian.adult { ... }",
        "obstacle": "obstacle box: obstacle.crate { ... }",
        "traffic": "traffic others { count 16; models [car.compact]; within 120 m of ego.route; seed 7 }",
        "signal": "signal j4 stage ns_go elapsed 11.35 s",
        "when": "when ego.eta(j4) < 4 s { runner stops }",
        "expect": "expect never collision(ego)",
        "end": "end after 60 s",
        "case": "case r01 { gap = 1.2 s }",
        "route": "route from south straight over j4",
        "path": "path [(90 m, 10 m), (90 m, 30 m)]",
        "start": "start at 20 m along ego.route",
        "speed": "speed 50 km/h",
        "goal": "goal 40 m past j4 on ego.route",
        "ignores": "ignores signals at j4",
        "meets": "meets ego at j4 after 1.5 s",
        "moving": "moving 2.60 m",
        "steers": "steers 0.12 from 1.00 s for 1.00 s",
        "timing": "timing 0.90",
        "delay": "delay 0.5 s",
        "junction": "junction j4 at (0 m, 0 m) signals { ... }",
        "road": "road west from west_end to j4 { lanes 2; speed 50 km/h }",
        "stage": "stage ns_go for 25 s green [north, south]",
        "crossings": "crossings",
        "via": "via [(-60 m, 2 m)]",
        "model": "model car.sports { length 4.38 m; width 1.80 m }",
        "window": "window 12.40 s..22.40 s",
        "risk": 'risk "what the forecaster saw" at 17.40 s with runner',
        "fidelity": "fidelity 0.00 m",
        "change": "change runner.timing: 1.00 => 0.80",
        "origin": "origin { operator [steer]; seed 91 }",
        "operator": "operator [model_swap, steer]",
        "within": "within 120 m of ego.route",
        "count": "count 16",
        "seed": "seed 7",
    }
)
"""How each statement is written, by its first word."""

ACTION_USAGE = "runner meets ego at j4 after 1.5 s"
"""How an action of a trigger is written."""
