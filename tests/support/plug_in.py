"""Installs a plug-in driver into a folder that may be put on PYTHONPATH: it drives like `idm`, or breaks on request."""

from __future__ import annotations

from pathlib import Path

DRIVER = '''"""Drives like `idm`; how far the goal is says how it breaks, a second into the run."""

import ctypes
import os
import signal
import time

from foresee_dsl.drivers.idm import IdmDriver


class Breaker:
    name = "breaker"
    version = "1"

    def __init__(self):
        self.inner = IdmDriver()

    def reset(self, mission, vehicle, seed):
        self.how = round(mission.goal_s - mission.start_s)
        self.inner.reset(mission, vehicle, seed)

    def step(self, observation):
        if observation.time_s >= 1.0:
            if self.how == 81:
                ctypes.string_at(0)
            elif self.how == 82:
                time.sleep(1000)
            elif self.how == 83:
                self.hoard = b"x" * 1_500_000_000
                time.sleep(1000)
            elif self.how == 84:
                raise ValueError("no idea")
            elif self.how == 85:
                os.kill(os.getpid(), signal.SIGABRT)
            elif self.how == 86:
                mutex, library = ctypes.create_string_buffer(100), ctypes.PyDLL(None)
                library.pthread_mutex_lock(mutex)
                library.pthread_mutex_lock(mutex)  # for ever, and without letting go of Python's lock
        return self.inner.step(observation)
'''
SCENARIO = """foresee 1

scenario alone {
  network road {
    junction a at (0 m, 0 m)
    junction b at (300 m, 0 m)
    road main from a to b { lanes 1; back 0; speed 50 km/h }
  }
  param way: length = 80 m in 10 m..200 m step 1 m

  ego: car.sedan {
    route [main]
    start at 20 m along main
    start speed 36 km/h
    goal way along main
  }
  expect never collision(ego)
  end after 14 s anywhere

"""


def install(folder: Path) -> Path:
    """Write the package with its entry point; return the folder for PYTHONPATH."""
    place = folder / "plug_in"
    info = place / "breaker-1.dist-info"
    info.mkdir(parents=True)
    (place / "breaker.py").write_text(DRIVER)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: breaker\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[foresee_dsl.drivers]\nbreaker = breaker:Breaker\n")
    return place


def scenario(folder: Path, *ways: int) -> Path:
    """Write a scenario with a case for each distance of the goal from the start, m."""
    file = folder / "alone.foresee"
    cases = "".join(f"  case w{way} {{ way = {way + 20} m }}\n" for way in ways)
    file.write_text(f"{SCENARIO}{cases}}}\n")
    return file
