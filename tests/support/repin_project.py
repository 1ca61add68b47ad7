"""A project in a git repository: a network, a scenario, a clip, two mutants, all pinned. Shared by tests of `repin`."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.project.loading import load_test_case

NETWORK = """foresee 1

network town {
  junction a at (0 m, 0 m)
  junction b at (400 m, 0 m)
  road main from a to b { lanes 2; back 0 }
}
"""

SCENARIO = """foresee 1

# Somebody brakes.
scenario lead_brakes {
  use network "networks/town.foresee"

  param gap: length = 40 m in 10 m..80 m step 1 m

  weather rain 0.3

  ego: car.sedan {
    route [main]
    start speed 36 km/h
  }
  vehicle lead: car.compact {
    route [main]
    start at gap along main
  }

  expect never collision(ego)
  end after 20 s

  case near { gap = 20 m }
  case far { gap = 60 m }
}
"""

CLIP = """foresee 1

clip lead_brakes_p1 of "../lead_brakes.foresee" case near pin PIN {  # of the night run
  window 2.00 s..5.00 s
  risk "close" at 3.00 s with lead

  ego: car.sedan at (30 m, -1.6 m) heading 0 deg speed 10.00 m/s {
    route [main]
  }
  goal (130 m, -1.6 m)

  vehicle lead: car.compact at (60 m, -1.6 m) heading 0 deg speed 8.00 m/s {
    route [main]
  }
}
"""

MUTANT = """foresee 1

mutant lead_brakes_p1_NAME of "lead_brakes_p1.foresee" pin PIN {
  change lead.timing: 1.00 => FACTOR
}
"""


class Repository:
    """The files, and what happens to them."""

    def __init__(self, root: Path, *, git: bool = True) -> None:
        self.root = root
        self.network = self.write("networks/town.foresee", NETWORK)
        self.scenario = self.write("lead_brakes.foresee", SCENARIO)
        pin = load_test_case(f"{self.scenario}::near").meaning
        self.clip = self.write("children/lead_brakes_p1.foresee", CLIP.replace("PIN", pin))
        self.mutants = tuple(self._mutant(name, factor) for name, factor in (("m1", "0.80"), ("m2", "0.60")))
        if git:
            self.git("init", "--quiet")
            self.commit()

    def _mutant(self, name: str, factor: str) -> Path:
        text = MUTANT.replace("PIN", pin_of(load_test_case(self.clip))).replace("NAME", name)
        return self.write(f"children/lead_brakes_p1_{name}.foresee", text.replace("FACTOR", factor))

    def write(self, name: str, text: str) -> Path:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode())
        return path

    def edit(self, path: Path, old: str, new: str) -> None:
        text = path.read_bytes().decode()
        assert old in text
        path.write_bytes(text.replace(old, new).encode())

    def git(self, *arguments: str) -> str:
        """Run git as nobody in particular, whatever the machine's configuration."""
        who = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
        done = subprocess.run(
            ["git", *who, *arguments],
            cwd=self.root,
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull},
        )
        return done.stdout

    def commit(self) -> None:
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", "x")
