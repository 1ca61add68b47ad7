"""`python -m benchmarks.scale [NAME ...] [--write]`: measures how costs grow; `--write` puts the tables into the docs.

`schedule` reads the durations of a finished campaign, so run `make campaign` first.
"""

from __future__ import annotations

import sys
from importlib import import_module

from benchmarks.sections import write_section

NAMES = ("parts", "actors", "cases", "cluster", "schedule")


def main(words: list[str]) -> int:
    """Run the named measurements (all by default), print their tables, and with `--write` put them into the docs."""
    wanted = [word for word in words if not word.startswith("--")] or list(NAMES)
    unknown = [word for word in words if word != "--write" and word not in NAMES]
    if unknown:
        sys.stderr.write(f"there is no {unknown[0]}; there are {', '.join(NAMES)}, and --write\n")
        return 2
    for name in wanted:
        text = import_module(f"benchmarks.scale.{name}").text()
        sys.stdout.write(f"## {name}\n\n{text}\n")
        sys.stdout.flush()
        if "--write" in words:
            write_section(f"scale {name}", f"python -m benchmarks.scale {name} --write", text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
