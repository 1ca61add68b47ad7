"""The frames in which the codes' examples stand, so that each can be run as it is shown.

`grammars/codes.toml` says how examples are written. Each lies in a folder with the files `town.foresee` (a network),
`parent.foresee` (a scenario) and `clip.foresee` (a clip of it).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from foresee_dsl.language.codes import Code

MAIN = "main.foresee"
"""The file that holds an example."""

_TOWN = """\
foresee 1

network town {
  junction j4 at (0 m, 0 m) signals {
    crossings
    stage ns_go for 25 s green [north, south]
    stage ew_go for 25 s green [west, main]
  }
  junction j5 at (200 m, 0 m)
  junction west_end at (-150 m, 0 m)
  junction east_end at (350 m, 0 m)
  junction north_end at (0 m, 120 m)
  junction south_end at (0 m, -120 m)
  junction side_end at (200 m, 120 m)

  road west from west_end to j4 { lanes 2; speed 50 km/h; sidewalk 2 m }
  road main from j4 to j5 { speed 50 km/h; sidewalk 2 m }
  road east from j5 to east_end { speed 50 km/h }
  road north from north_end to j4 { speed 50 km/h; sidewalk 2 m }
  road south from south_end to j4 { speed 50 km/h; sidewalk 2 m }
  road side from side_end to j5 { speed 30 km/h }

  building bank [(12 m, 12 m), (60 m, 12 m), (60 m, 40 m), (12 m, 40 m)]
}
"""
_SCENARIO = """\
foresee 1

scenario example {
  use network "town.foresee"

  ego: car.sedan {
    route from west straight over j4
    start at 40 m along ego.route
  }
  vehicle runner: car.compact {
    route from south straight over j4
    start at 30 m along runner.route
  }

  expect never collision(ego)
@
}
"""
_CLIP = """\
foresee 1

clip example of "parent.foresee" pin PIN {
  window 1.00 s..4.00 s
  ego: car.sedan at (-80.00 m, -4.80 m) heading 0 deg speed 10.00 m/s {
    route [west, main]
  }
  goal (-30.00 m, -4.80 m)
  vehicle runner: car.compact at (1.60 m, -60.00 m) heading 90 deg speed 8.00 m/s {
    route [south, north_back]
  }
@
}
"""


FRAMES = {
    "file": "@",
    "scenario": _SCENARIO,
    "actor": _SCENARIO.replace(
        "    route from south straight over j4\n    start at 30 m along runner.route\n", "@\n"
    ).replace("collision(ego)\n@", "collision(ego)"),
    "trigger": _SCENARIO.replace("@", "  when time > 1 s {\n@\n  }"),
    "network": _TOWN.removesuffix("}\n") + "@\n}\n",
    "clip": _CLIP,
    "mutant": 'foresee 1\n\nmutant example of "clip.foresee" pin PIN {\n@\n}\n',
}
"""The text around an example, by the frame's name; `@` is the place of the example."""


@dataclass(frozen=True, slots=True)
class Example:
    """An example that is ready to run: files by name, and the command (words after `foresee`)."""

    files: dict[str, str]
    command: tuple[str, ...] = ("check", MAIN)


def example(code: Code, text: str) -> Example:
    """Return the files and the command of one of a code's examples, `code.wrong` or `code.right`."""
    command: tuple[str, ...] = ("check", MAIN)
    if text.startswith("$ foresee "):
        line, _, text = text.partition("\n")
        command = tuple(line.split()[2:])
    first, *more = re.split(r"(?m)^--- *(.+)\n?", text)
    files = {
        "town.foresee": _TOWN,
        "parent.foresee": _SCENARIO.replace("@\n", ""),
        "clip.foresee": _CLIP.replace("@\n", ""),
    }
    if first.strip():
        frame = FRAMES[code.frame]
        lines = first.rstrip("\n")
        inside = lines if code.frame == "file" else "\n".join(f"  {line}".rstrip() for line in lines.split("\n"))
        files[MAIN] = frame.replace("@", inside)
    for name, content in zip(more[::2], more[1::2], strict=True):
        files[name.removesuffix("(empty)").strip()] = content
    return Example(files, command)
