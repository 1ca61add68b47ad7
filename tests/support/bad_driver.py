"""A plug-in driver that goes wrong in the way that its address says: `bad:loop`, half a second into the run."""

from __future__ import annotations

import os
from pathlib import Path

from tests.support.plug_in import scenario

DRIVER = """import ctypes
import os
import sys

from foresee_dsl.drivers.idm import IdmDriver


class Bad:
    name, version = "bad", "1"

    def __init__(self, how=""):
        self.how, self.inner, self.forked = how, IdmDriver(), False
        if how == "init":
            raise ValueError("no licence")

    @classmethod
    def from_argument(cls, text):
        return cls(text)

    def reset(self, mission, vehicle, seed):
        if self.how == "reset":
            raise KeyError("weights")
        if self.how == "print":
            print("weights loaded")
            ctypes.CDLL(None).puts(b"the library says hello")
            print("\\x1b[31mred\\u202e", file=sys.stderr)
        self.inner.reset(mission, vehicle, seed)

    def step(self, observation):
        if observation.time_s >= 0.5:
            self.go_wrong(observation.time_s)
        return self.inner.step(observation)

    def go_wrong(self, observation_s):
        if self.how == "raise":
            raise ValueError("no \\x1b[31midea")
        if self.how == "loop":
            while True: pass
        if self.how == "lock":
            mutex, library = ctypes.create_string_buffer(100), ctypes.PyDLL(None)
            library.pthread_mutex_lock(mutex)
            library.pthread_mutex_lock(mutex)  # for ever, where no signal's handler gets a turn
        if self.how == "os_exit":
            print("so long")
            os._exit(0)
        if self.how == "sys_exit":
            sys.exit(0)
        if self.how == "chdir":
            os.chdir("/")
        if self.how == "environ":
            os.environ.clear()
        if self.how == "random":
            numpy.random.default_rng = numpy.random.Generator = None
        if self.how == "strict":
            numpy.seterr(all="raise")
            warnings.simplefilter("error")
        if self.how == "global":
            self.inner.deadline_s = numpy.random.random() + random.random()
        if self.how == "kill":
            os.kill(os.getpid(), 9)
        if self.how == "group":
            os.killpg(0, 15)
        if self.how in ("forks", "forks_and_dies") and not self.forked:
            self.forked = True
            for number in range(50):
                if not os.fork():
                    with open("forked", "a") as file:
                        file.write(f"{os.getpid()} ")
                    if number % 2:
                        os.setsid()
                    while True:
                        time.sleep(1)
        if self.how == "clones" and not self.forked:
            self.forked = True
            os.fork()  # both of them drive on
        if self.how == "forks_and_dies" and observation_s >= 0.8:
            os._exit(3)


import random, time, warnings, numpy  # down here, so that the lines above keep their numbers
"""


def install(folder: Path) -> tuple[dict[str, str], Path]:
    """Write the driver and a scenario of two cases; return an environment in which it is installed, and the file."""
    place = folder / "bad"
    info = place / "bad-1.dist-info"
    info.mkdir(parents=True)
    (place / "bad.py").write_text(DRIVER)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bad\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[foresee_dsl.drivers]\nbad = bad:Bad\n")
    return {**os.environ, "PYTHONPATH": str(place), "NO_COLOR": "1", "COLUMNS": "100"}, scenario(folder, 60, 62)
