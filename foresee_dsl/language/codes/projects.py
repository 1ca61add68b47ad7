"""Codes of the mistakes that show when files are joined."""

from foresee_dsl.language.codes import names as p
from foresee_dsl.language.codes.code import Code

_LIMITED = "param limit: time = 9 s\nend after limit\ncase short { limit = 5 s }\ncase long { limit = 60 s }\n"
_DRAWN = "param limit: time = 40 s in 1 s..60 s step 0.01 s\nend after limit\n@\ncases 5 from seed 7"
_EGO = "  ego: car.sedan {\n    route [west]\n  }\n  expect never collision(ego)\n}\n"
_OF_MAIN = 'foresee 1\n\nmutant example of "main.foresee" pin sha256:5ef2c6120a41 {\n'

CODES = (
    Code(
        p.UNKNOWN_CASE,
        "no such case",
        "The address names a case that the scenario does not have.",
        f"$ foresee check main.foresee::lomg\n{_LIMITED}",
        f"$ foresee check main.foresee::long\n{_LIMITED}",
    ),
    Code(
        p.WHICH_CASE,
        "the scenario has several cases",
        "A scenario with cases is several test cases, and here one is needed: name it behind `::`.",
        f"$ foresee run main.foresee\n{_LIMITED}",
        f"$ foresee run main.foresee::long\n{_LIMITED}",
    ),
    Code(
        p.TOO_FEW_DRAWS,
        "too few draws satisfy what is required",
        "`cases N from seed S` draws until N sets of values satisfy every `require`; nearly none do. Widen a range, "
        "loosen a `require`, or ask for fewer.",
        _DRAWN.replace("@", "require limit > 60 s"),
        _DRAWN.replace("@", "require limit > 30 s"),
    ),
    Code(
        p.UNKNOWN_MODEL,
        "no such model",
        "Neither the bundled catalogue nor one that the scenario uses has this model; `foresee models` lists them.",
        "vehicle box: car.compcat { route [north] }",
        "vehicle box: car.compact { route [north] }",
    ),
    Code(
        p.WRONG_WAS,
        "the clip has another value than the change says",
        "The left side of a change is what the clip says now, so that a reviewer sees both and nothing is changed "
        "unawares.",
        "change runner.timing: 0.90 => 0.80",
        "change runner.timing: 1.00 => 0.80",
        "mutant",
    ),
    Code(
        p.BAD_CHANGE,
        "a change that cannot be made",
        "There is no such actor or property in the clip, or the new value is out of its range.",
        "change runner.steer: 0.00 => 1.70",
        "change runner.steer: 0.00 => 0.70",
        "mutant",
    ),
    Code(
        p.NOT_IN_PARENT,
        "a change of something that the other file does not have",
        "`change` and `drop` name a statement of the scenario that is extended, by its kind and name.",
        'foresee 1\n\nscenario a extends "parent.foresee" {\n  drop vehicle runer\n}\n',
        'foresee 1\n\nscenario a extends "parent.foresee" {\n  drop vehicle runner\n}\n',
        "file",
    ),
    Code(
        p.ALREADY_IN_PARENT,
        "something is added that is there already",
        "The scenario that is extended has a statement of this kind and name. Write `change` to replace it.",
        'foresee 1\n\nscenario a extends "parent.foresee" {\n  add vehicle runner: car.suv { route [north] }\n}\n',
        'foresee 1\n\nscenario a extends "parent.foresee" {\n  change vehicle runner: car.suv { route [north] }\n}\n',
        "file",
    ),
    Code(
        p.MISSING_FILE,
        "no such file",
        "Files are looked for beside the file that names them.",
        'foresee 1\n\nscenario a {\n  use network "twon.foresee"\n' + _EGO,
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n' + _EGO,
        "file",
    ),
    Code(
        p.BAD_ADDRESS,
        "not an address",
        "A test case is addressed `file.foresee`, or `file.foresee::case` where there are cases.",
        f"$ foresee check main.foresee::\n{_LIMITED}",
        f"$ foresee check main.foresee::long\n{_LIMITED}",
    ),
    Code(
        p.WRONG_KIND,
        "the file holds something else",
        "A network is asked for and the file holds a scenario, or the like.",
        'foresee 1\n\nscenario a {\n  use network "parent.foresee"\n' + _EGO,
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n' + _EGO,
        "file",
    ),
    Code(
        p.USES_ITSELF,
        "a file that uses itself",
        "A file is its own parent, or uses a file that uses it. Name another.",
        _OF_MAIN + "  change runner.timing: 1.00 => 0.80\n}\n",
        _OF_MAIN.replace("main.", "clip.").replace("sha256:5ef2c6120a41", "PIN")
        + "  change runner.timing: 1.00 => 0.80\n}\n",
        "file",
    ),
    Code(
        p.TOO_DEEP,
        "too many parents, one above the other",
        "A child may be a child of a child, 32 deep at most; more can only be a mistake of whatever wrote them.",
        "",
        "",
        "file",
    ),
    Code(
        p.STALE_PIN,
        "the parent has changed since the child was made",
        "The parent means something else than when the child was made, so what was found may not hold any more. Look "
        "at the change, then `foresee repin`, or clip again.",
        'foresee 1\n\nmutant a of "clip.foresee" pin sha256:5ef2c6120a41 {\n  change runner.timing: 1.00 => 0.80\n}\n',
        'foresee 1\n\nmutant a of "clip.foresee" pin PIN {\n  change runner.timing: 1.00 => 0.80\n}\n',
        "file",
    ),
    Code(
        p.UNKNOWN_SUFFIX,
        "a file of an unknown kind",
        "Networks are read from `.foresee`, SUMO's `.net.xml` and OpenDRIVE's `.xodr`; convert others with netconvert.",
        'foresee 1\n\nscenario a {\n  use network "town.osm"\n' + _EGO + "--- town.osm\n<osm/>\n",
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n' + _EGO,
        "file",
    ),
    Code(
        p.OUTSIDE,
        "a file outside the project",
        "A file may use only files of its project, so that checking a stranger's scenario reads nothing else.",
        '$ foresee check --no-outside main.foresee\nforesee 1\n\nscenario a {\n  use network "../town.foresee"\n'
        + _EGO
        + "--- ../town.foresee\n(a network)\n",
        '$ foresee check --no-outside main.foresee\nforesee 1\n\nscenario a {\n  use network "town.foresee"\n' + _EGO,
        "file",
    ),
    Code(
        p.DIFFERENT_KINDS,
        "two files that cannot be compared",
        "A difference in meaning is between two of a kind, or a child and its parent.",
        "$ foresee diff clip.foresee town.foresee\n",
        "$ foresee diff clip.foresee parent.foresee\n",
        "file",
    ),
)
"""In order."""
