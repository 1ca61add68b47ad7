"""Codes of the lints: what is allowed, and hardly meant."""

from foresee_dsl.language.codes import names as c
from foresee_dsl.language.codes.code import Code

_WARNING = "warning"
_LIMIT = "param limit: time = 9 s\nend after limit\n"
_NAMED = """\
--- named_clip.foresee
foresee 1

clip example of "named.foresee" pin PIN {
  window 1.00 s..4.00 s
  ego: car.sedan at (-80.00 m, -4.80 m) heading 0 deg speed 10.00 m/s {
    route [west, main]
  }
  goal (-30.00 m, -4.80 m)
  vehicle runner: car.compact at (1.60 m, -60.00 m) heading 90 deg speed 8.00 m/s {
    route [south, north_back]
  }
}
--- named.foresee
foresee 1

scenario named {
  use network "town.foresee"
  ego: car.sedan {
    route from west straight over j4
  }
  vehicle runner: car.compact {
    route from south straight over j4
  }
  expect safe: always ttc(ego, runner) > 1.50 s
}
"""

CODES = (
    Code(
        c.UNUSED_PARAMETER,
        "a parameter that nothing uses",
        "Its values change nothing, so cases that differ in it only are the same test. Use it, or remove it.",
        "param pace: speed = 9 m/s\nend after 60 s",
        "param pace: speed = 9 m/s\nvehicle box: car.compact {\n  route [north]\n  speed pace\n}",
        severity=_WARNING,
    ),
    Code(
        c.DEAD_CASE,
        "two cases with the same values",
        "Both are the same test, run twice. Remove one, or give it the value that was meant.",
        _LIMIT + "case a { limit = 9 s }\ncase b",
        _LIMIT + "case a { limit = 5 s }\ncase b",
        severity=_WARNING,
    ),
    Code(
        c.NEVER_FIRES,
        "a trigger that can never fire",
        "Its condition cannot hold before the run ends, or contradicts itself, so its actions never happen.",
        "when time > 100 s { runner stops }\nend after 60 s",
        "when time > 10 s { runner stops }\nend after 60 s",
        severity=_WARNING,
    ),
    Code(
        c.NOT_ON_ROUTE,
        "a junction that the actor does not come to",
        "An eta or a distance to a junction is that along the actor's route; where the route does not go over it, the "
        "condition never holds.",
        "vehicle box: car.compact { route [side, east] }\nwhen box.eta(j4) < 4 s { runner stops }",
        "vehicle box: car.compact { route [side, east] }\nwhen box.eta(j5) < 4 s { runner stops }",
        severity=_WARNING,
    ),
    Code(
        c.CANNOT_DO,
        "an action that the actor cannot do",
        "An obstacle does not move, what follows a path has no lanes, and the ego is driven by the software under "
        "test.",
        "obstacle crate: obstacle.crate { start at 70 m along ego.route }\nwhen time > 1 s { crate starts }",
        "pedestrian walker: pedestrian.adult { path [(-30 m, -9 m), (-30 m, 9 m)] }\nwhen time > 1 s { walker starts }",
    ),
    Code(
        c.CUT_SHORT,
        "an expectation for a time after the end",
        "The run ends first: what is expected later is never looked at, so the time says nothing. Let the run last "
        "longer, or shorten the time.",
        "expect eventually within 90 s arrived(ego)\nend after 60 s",
        "expect eventually within 60 s arrived(ego)\nend after 60 s",
        severity=_WARNING,
    ),
    Code(
        c.DECIDED,
        "an expectation whose outcome is known before the run",
        "It holds whatever happens, or cannot hold: no driver passes or fails by it.",
        "expect always ego.speed >= 0 m/s",
        "expect always ego.speed <= 50 km/h",
        severity=_WARNING,
    ),
    Code(
        c.OVER_TOP_SPEED,
        "a speed above the model's",
        "The model's `max_speed` is lower, so the actor never gets there. Take another model, or a lower speed.",
        "bicycle rider: bicycle.city { route from north straight over j4 }\n"
        "when time > 1 s { rider changes speed to 80 km/h }",
        "bicycle rider: bicycle.city { route from north straight over j4 }\n"
        "when time > 1 s { rider changes speed to 18 km/h }",
        severity=_WARNING,
    ),
    Code(
        c.BROKEN_ROUTE,
        "a route with a gap",
        "Each edge begins where the one before it ends, each leg starts where the one before it leads. With `...` "
        "between two edges the gap is filled with the shortest way.",
        "$ foresee check --no-places main.foresee\nvehicle box: car.compact { route [south, east] }",
        "$ foresee check --no-places main.foresee\nvehicle box: car.compact { route [south, ..., east] }",
        severity=_WARNING,
    ),
    Code(
        c.NOTHING_EXPECTED,
        "nothing is expected of the ego",
        "A scenario without an expectation about the ego says nothing about the driver. Mostly `expect never "
        "collision(ego)` is meant.",
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n  ego: car.sedan {\n    route [west]\n  }\n}\n',
        'foresee 1\n\nscenario a {\n  use network "town.foresee"\n  ego: car.sedan {\n    route [west]\n  }\n'
        "  expect never collision(ego)\n}\n",
        "file",
        severity=_WARNING,
    ),
    Code(
        c.WEAKENED,
        "an expectation that was made easier to meet",
        "A mutant must not do this: a failure of the driver would not show any more. In a scenario that extends "
        "another it is a warning: it may be meant.",
        'foresee 1\n\nmutant example of "named_clip.foresee" pin PIN {\n  change expect.safe: 1.50 s => 1.00 s\n}\n'
        + _NAMED,
        'foresee 1\n\nmutant example of "named_clip.foresee" pin PIN {\n  change expect.safe: 1.50 s => 2.00 s\n}\n'
        + _NAMED,
        "file",
    ),
    Code(
        c.NEEDLESS_ALLOW,
        "an `allow` comment that allows nothing",
        "No warning of this code is reported there, or there is no such code. Remove the comment, so that it does not "
        "hide what comes later.",
        "end after 60 s  # foresee: allow FS303",
        "end after 60 s",
        severity=_WARNING,
    ),
)
"""In order."""
