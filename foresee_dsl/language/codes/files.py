"""Codes of the mistakes that show in one file."""

from foresee_dsl.language.codes.code import Code

_DEEP = "not " * 41
_CAR = """foresee 1

models ours {
  model car.odd {
    length 4.30 m
    width 1.80 m
    front_overhang 0.85 m
    wheelbase 2.60 m
    rear_overhang REAR
  }
}
"""

_READING = (
    Code(
        "FS001",
        "the file cannot be read",
        "The file is a folder, a device, or one that may not be read. Check its name and its permissions.",
        "",
        "",
    ),
    Code(
        "FS002",
        "not a text file of the language",
        "A file is UTF-8 text of at most 2 MB, and not empty. Write it with an ordinary editor.",
        "$ foresee check main.foresee\n--- main.foresee (empty)\n",
        "foresee 1\n\nnetwork lane {\n  junction a at (0 m, 0 m)\n  junction b at (90 m, 0 m)\n"
        "  road main from a to b\n}\n",
        "file",
    ),
    Code(
        "FS003",
        "the statement is not complete or not in order",
        "The words are known, but this is not how the statement is written. The help shows its form.",
        "end 20 s",
        "end after 20 s",
    ),
    Code(
        "FS004",
        "unknown word",
        "No statement has this word here. Most often it is misspelt: the help names the nearest one.",
        "vehcle box: car.compact { route [north] }",
        "vehicle box: car.compact { route [north] }",
    ),
    Code(
        "FS005",
        "unknown unit",
        "A quantity is a number and a unit of the language: s, ms, min, m, cm, km, m/s, km/h, mph, m/s^2, deg, rad, "
        "deg/s, kg, t.",
        "route [south]\nspeed 50 kmh",
        "route [south]\nspeed 50 km/h",
        "actor",
    ),
    Code(
        "FS006",
        "unknown property",
        "What stands before the dot has no such property. An actor has a route, a speed and an eta, for example.",
        "route [south]\nstart at 20 m along runner.rout",
        "route [south]\nstart at 20 m along runner.route",
        "actor",
    ),
    Code(
        "FS007",
        "a brace is missing, or one is too many",
        "Every `{` needs its `}`. The block that is not closed is found by how the lines are indented.",
        "vehicle box: car.compact {\n  route [north]\n",
        "vehicle box: car.compact {\n  route [north]\n}",
    ),
    Code(
        "FS008",
        "the statement cannot stand here",
        "The statement belongs into another block, or outside of this one. The help says where it may stand.",
        "lanes 2",
        "vehicle box: car.compact { route [north] }",
    ),
    Code(
        "FS009",
        "the first line is not `foresee 1`",
        "A file begins with the version of the language that it is written in, so that later versions can still read "
        "it.",
        "network lane {\n  junction a at (0 m, 0 m)\n  junction b at (90 m, 0 m)\n  road main from a to b\n}\n",
        "foresee 1\n\nnetwork lane {\n  junction a at (0 m, 0 m)\n  junction b at (90 m, 0 m)\n"
        "  road main from a to b\n}\n",
        "file",
    ),
    Code(
        "FS010",
        "a value of another dimension is needed",
        "The unit does not fit: a length stands where a time is needed, or a number has no unit at all.",
        "end after 60 m",
        "end after 60 s",
    ),
    Code(
        "FS011",
        "not a name",
        "Names are snake_case: a small letter, then small letters, digits and underscores. Models are called "
        "class.variant.",
        "vehicle Box: car.compact { route [north] }",
        "vehicle box: car.compact { route [north] }",
    ),
    Code(
        "FS012",
        "not one of the known values",
        "Only a few words may stand here, and this is none of them.",
        "runner changes lane letf",
        "runner changes lane left",
        "trigger",
    ),
    Code(
        "FS013",
        "said twice",
        "The same thing is said twice, and only one of them can hold. Keep one.",
        "road more from j5 to side_end { lanes 1; lanes 2 }",
        "road more from j5 to side_end { lanes 2 }",
        "network",
    ),
    Code(
        "FS014",
        "something is missing",
        "The statement, or the file, is not complete: something that has no default is absent.",
        "traffic others { count 4; models [car.compact]; within 90 m of ego.route }",
        "traffic others { count 4; models [car.compact]; within 90 m of ego.route; seed 1 }",
    ),
    Code(
        "FS015",
        "a character or string that cannot be read",
        "This character means nothing here, or a text is not closed. Texts stand in double quotes, on one line.",
        'doc "not closed',
        'doc "closed"',
    ),
    Code(
        "FS016",
        "a number out of range",
        "Numbers lie between -1e9 and 1e9.",
        "end after 99999999999 s",
        "end after 60 s",
    ),
    Code(
        "FS017",
        "a text that is too long or empty",
        "A file needs a name, and no text is longer than 2,000 characters.",
        'use models ""',
        'use models "mine.foresee"\n--- mine.foresee\nforesee 1\n\nmodels mine {\n'
        "  model car.tiny { length 3 m; width 1.5 m }\n}\n",
    ),
    Code(
        "FS018",
        "nested too deeply",
        "Conditions and sequences nest 40 deep at most. Split them into several statements.",
        f"when {_DEEP}time > 1 s {{ runner stops }}",
        "when not time > 1 s { runner stops }",
    ),
    Code(
        "FS019",
        "not a pin",
        "A pin is `sha256:` and twelve digits or letters a to f, over what the parent means.",
        'foresee 1\n\nmutant example of "clip.foresee" pin sha256:12 {\n  change runner.timing: 1.00 => 0.80\n}\n',
        'foresee 1\n\nmutant example of "clip.foresee" pin PIN {\n  change runner.timing: 1.00 => 0.80\n}\n',
        "file",
    ),
    Code(
        "FS020",
        "internal: the formatter would have changed the meaning",
        "The formatter compares what it wrote with what it read, and leaves a file alone when they differ. Please "
        "report it: no file should do this, so there is no example.",
        "",
        "",
    ),
)

_MEANING = (
    Code(
        "FS030",
        "two things have the same name",
        "A name stands for one thing, so that everybody who reads it knows which.",
        "vehicle box: car.compact { route [north] }\nvehicle box: car.compact { route [side] }",
        "vehicle box: car.compact { route [north] }\nvehicle bus: bus.city { route [side] }",
    ),
    Code(
        "FS031",
        "unknown parameter",
        "A word that stands where a value may is the name of a parameter, and there is none of this name.",
        "param pace: speed = 9 m/s\nvehicle box: car.compact {\n  route [north]\n  speed pase\n}\n"
        "when ego.speed > pace { box stops }",
        "param pace: speed = 9 m/s\nvehicle box: car.compact {\n  route [north]\n  speed pace\n}",
    ),
    Code(
        "FS032",
        "a parameter of the wrong type for its place",
        "A parameter may stand only where a value of its type may: a speed where a speed is asked for.",
        "param gap: time = 1 s\nvehicle box: car.compact {\n  route [north]\n  speed gap\n}",
        "param pace: speed = 9 m/s\nvehicle box: car.compact {\n  route [north]\n  speed pace\n}",
    ),
    Code(
        "FS033",
        "a value outside the parameter's range or options",
        "A case gives a value that the parameter does not allow. Change the value, or the range.",
        "param limit: time = 9 s in 1 s..60 s step 1 s\nend after limit\ncase long { limit = 90 s }",
        "param limit: time = 9 s in 1 s..60 s step 1 s\nend after limit\ncase long { limit = 60 s }",
    ),
    Code(
        "FS034",
        "a value that does not fit the parameter's type",
        "The default, an option or a case gives a value of another kind than the parameter's type says.",
        "param limit: time = 9 m\nend after limit",
        "param limit: time = 9 s\nend after limit",
    ),
    Code(
        "FS035",
        "the ego is missing, or there are several",
        "A scenario has exactly one ego: the vehicle that the software under test drives.",
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n}\n',
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n  ego: car.sedan {\n    route [west]\n  }\n'
        "  expect never collision(ego)\n}\n",
        "file",
    ),
    Code(
        "FS036",
        "the network is missing, or there are several",
        "A scenario has exactly one network: `use network` names a file, `network { ... }` writes it in place.",
        "foresee 1\n\nscenario a {\n  ego: car.sedan {\n    route [west]\n  }\n  expect never collision(ego)\n}\n",
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n  ego: car.sedan {\n    route [west]\n  }\n'
        "  expect never collision(ego)\n}\n",
        "file",
    ),
    Code(
        "FS037",
        "unknown actor",
        "Nobody of this name takes part. Actors of the traffic are called `others_01`, `others_02`, ...",
        "runer stops",
        "runner stops",
        "trigger",
    ),
    Code(
        "FS038",
        "the model is of another class",
        "The word in front decides what an actor is: a pedestrian has a pedestrian's model, a vehicle that of a car, "
        "van, truck, bus or motorcycle.",
        "pedestrian walker: car.sedan { path [(-30 m, -9 m), (-30 m, 9 m)] }",
        "pedestrian walker: pedestrian.adult { path [(-30 m, -9 m), (-30 m, 9 m)] }",
    ),
    Code(
        "FS039",
        "a range that ends before it begins",
        "The smaller value comes first.",
        "param limit: time = 9 s in 60 s..1 s\nend after limit",
        "param limit: time = 9 s in 1 s..60 s\nend after limit",
    ),
    Code(
        "FS040",
        "unknown junction",
        "A road joins two junctions of the same network. A place where a road just ends is a junction too.",
        "road more from j5 to nowhere",
        "junction somewhere at (200 m, -90 m)\nroad more from j5 to somewhere",
        "network",
    ),
    Code(
        "FS041",
        "unknown road, or one that does not touch the junction",
        "A stage gives green to roads that begin or end at its junction.",
        "junction j9 at (90 m, 90 m) signals {\n  stage go for 20 s green [sid]\n}\nroad lane from side_end to j9",
        "junction j9 at (90 m, 90 m) signals {\n  stage go for 20 s green [lane]\n}\nroad lane from side_end to j9",
        "network",
    ),
    Code(
        "FS042",
        "an actor that is nowhere",
        "Whatever moves needs a route or a path, an obstacle a place to stand.",
        "vehicle box: car.compact",
        "vehicle box: car.compact { route [north] }",
    ),
    Code(
        "FS043",
        "a ratio outside its range",
        "Weather goes from 0 (none) to 1 (as much as there can be), steering from -1 (right) to 1 (left).",
        "weather rain 1.3",
        "weather rain 1.0",
    ),
    Code(
        "FS044",
        "a clip is incomplete",
        "A clip has a window, a goal, and an exact state for everybody in it.",
        "vehicle late: car.compact { route [side] }",
        "vehicle late: car.compact at (198.40 m, 60.00 m) heading 270 deg speed 0 m/s { route [side] }",
        "clip",
    ),
    Code(
        "FS045",
        "a mutant that changes nothing",
        "A mutant is its changes. Without one it is the clip itself.",
        'doc "nothing happens"',
        "change runner.timing: 1.00 => 0.80",
        "mutant",
    ),
    Code(
        "FS046",
        "a change with values of the wrong kind",
        "Both sides of a change are values of the property: a model's name, a ratio, a speed, a time.",
        "change runner.timing: 1.00 => car.sports",
        "change runner.timing: 1.00 => 0.80",
        "mutant",
    ),
    Code(
        "FS047",
        "two statements of which one can stand",
        "Only one of these can hold. Keep one.",
        "end after 50 s\nend after 60 s",
        "end after 60 s",
    ),
    Code(
        "FS048",
        "a signal without stages, or stages without a signal",
        "A junction with `signals` needs stages; one without has none.",
        "junction j9 at (90 m, 90 m) signals\nroad lane from side_end to j9",
        "junction j9 at (90 m, 90 m) signals {\n  stage go for 20 s green [lane]\n}\nroad lane from side_end to j9",
        "network",
    ),
    Code(
        "FS049",
        "a name that the language needs itself",
        "A parameter, an actor or a label of this name could not be told from the language's own word.",
        "param straight: time = 9 s\nend after straight",
        "param limit: time = 9 s\nend after limit",
    ),
    Code(
        "FS050",
        "a value that makes no sense here",
        "The value has the right unit, but nothing in the world is like this: no lanes, or a road of no length.",
        "road more from j5 to side_end { lanes 0 }",
        "road more from j5 to side_end { lanes 1 }",
        "network",
    ),
    Code(
        "FS055",
        "figures of a model that contradict each other",
        "Front overhang, wheelbase and rear overhang make up the length; nobody cruises faster than it can, and nobody "
        "brakes harder in comfort than in an emergency.",
        _CAR.replace("REAR", "0.95 m"),
        _CAR.replace("REAR", "0.85 m"),
        "file",
    ),
    Code(
        "FS056",
        "a recorded state that nobody can follow",
        "The ego of a clip can follow recorded states before its driver takes over, one after the other. Other actors "
        "have their own ways of moving.",
        "route [south]\nrecorded 0.10 s at (1 m, -40 m) heading 90 deg speed 8 m/s",
        "route [south]",
        "actor",
    ),
    Code(
        "FS057",
        "a campaign without test cases",
        "A campaign needs test cases to begin with: files, folders, patterns or addresses.",
        "foresee 1\n\ncampaign nightly {\n  children 8\n}",
        'foresee 1\n\ncampaign nightly {\n  seeds "parent.foresee"\n  children 8\n}',
        "file",
    ),
)

_LIMIT = "param limit: time = 9 s in 5 s..20 s step 1 s"
_LOGICAL = (
    Code(
        "FS051",
        "a distribution that does not fit its parameter",
        "What is drawn lies in the parameter's range or among its options. A normal distribution needs a range with "
        "the mean inside, a choice one weight for each option, a grid steps or options.",
        f"{_LIMIT} as normal(30 s, 2 s)\nend after limit",
        f"{_LIMIT} as normal(10 s, 2 s)\nend after limit",
    ),
    Code(
        "FS052",
        "a parameter compared where the world is, or the other way round",
        "A `require` is settled before the run, so it compares parameters only. Triggers and expectations watch the "
        "run, in which a parameter never changes.",
        f"{_LIMIT}\nend after limit\nrequire ego.speed < 3 m/s",
        f"{_LIMIT}\nend after limit\nrequire limit < 15 s",
    ),
    Code(
        "FS053",
        "a case that violates a `require`",
        "Every case, and where there are none the defaults, must satisfy what the scenario requires.",
        f"{_LIMIT}\nend after limit\nrequire limit < 15 s\ncase long {{ limit = 18 s }}",
        f"{_LIMIT}\nend after limit\nrequire limit < 15 s\ncase long {{ limit = 14 s }}",
    ),
)

CODES = (*_READING, *_MEANING, *_LOGICAL)
"""In order."""
