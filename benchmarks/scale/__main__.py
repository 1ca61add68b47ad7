"""`python -m benchmarks.scale [NAME ...] [--write]`: measures how the cost grows; `--write` puts it into the docs.

`schedule` reads the times of a finished campaign: `make campaign` before it.
"""

from __future__ import annotations

import sys
from importlib import import_module

from benchmarks.sections import write_section

NAMES = ("parts", "actors", "cases", "cluster", "schedule")


def main(words: list[str]) -> int:
    """Measure what is named (all without any), print each table, and write it where that is asked for."""
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
