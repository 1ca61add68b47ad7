"""What drivers keep from run to run: programs that stay, weights; what that changes of a run is found and said."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import REMEMBERS, run_test_case
from foresee_dsl.drivers import kept
from foresee_dsl.drivers.consent import allow
from foresee_dsl.drivers.external import ExternalDriver
from foresee_dsl.drivers.external.process import kept_programs
from foresee_dsl.errors import DriverError
from foresee_dsl.language.project.loading import load_test_case
from tests.drivers.test_external import SEDAN, SEEN, TASK, is_gone
from tests.support.command import foresee
from tests.support.plug_in import scenario

STAYS = (Path(__file__).parents[2] / "docs" / "examples" / "staying_driver.py").read_text(encoding="utf-8")
BEGINS = "            mission = message"
COUNTS = f"""            runs = globals().get("runs", -1) + 1
            globals()["runs"] = runs
{BEGINS}"""
LEAKS = STAYS.replace('- ego["speed_mps"]', '- ego["speed_mps"] - runs').replace(
    "            mission = message", COUNTS
)
CASES = (60, 62, 64, 66)


@pytest.fixture(autouse=True)
def clean() -> object:
    """Keep nothing of other tests, and nothing after this one."""
    kept.forget()
    yield
    kept.forget()


def address(folder: Path, text: str) -> str:
    """Write a program that notes each start; return the driver's address."""
    file = folder / "probe.py"
    started = folder / "started"
    file.write_text(f"open({str(started)!r}, 'a').write('x')\n{text}", encoding="utf-8")
    allow(found := f"external:{sys.executable} -S {file}")
    return found


def test_a_program_that_stays_is_started_once_for_many_runs(tmp_path: Path) -> None:
    driver = ExternalDriver.from_argument(address(tmp_path, STAYS).partition(":")[2])
    pids = []
    for _ in range(3):
        driver.reset(TASK, SEDAN, 0)
        assert driver.version == "stays 1" and driver.step(SEEN).throttle > 0
        driver.close()
        pids.append(kept_programs())
    assert (tmp_path / "started").read_text() == "x" and pids[0] == pids[1] == pids[2] != ()
    kept.forget()
    assert not kept_programs() and all(is_gone(pid) for pid in pids[0])


@pytest.mark.parametrize(
    "text",
    [
        STAYS.replace("continue  #", "break  #"),  # it says that it stays, and ends
        STAYS.replace("continue  #", 'answer = {"type": "ended"}  #'),  # a line that was not asked for
        STAYS.replace(', "stays": True', ""),  # it does not say that it stays
    ],
)
def test_one_that_cannot_take_another_run_is_started_again(tmp_path: Path, text: str) -> None:
    driver = ExternalDriver.from_argument(address(tmp_path, text).partition(":")[2])
    for _ in range(2):
        driver.reset(TASK, SEDAN, 0)
        driver.step(SEEN)
        driver.close()
        for pid in kept_programs()[1:]:
            while not is_gone(pid) and Path(f"/proc/{pid}/stat").read_text().split()[2] not in "ZS":
                pass
    assert (tmp_path / "started").read_text() == "xx"


def test_stays_is_true_or_false(tmp_path: Path) -> None:
    driver = ExternalDriver.from_argument(address(tmp_path, STAYS.replace("True", '"yes"')).partition(":")[2])
    with pytest.raises(DriverError, match="its `stays` must be true or false, not 'yes'"):
        driver.reset(TASK, SEDAN, 0)


def test_a_run_with_a_program_that_stayed_is_checked_once_and_is_the_same(tmp_path: Path) -> None:
    case, driver = load_test_case(f"{scenario(tmp_path, *CASES)}::w60"), address(tmp_path, STAYS)
    results = [run_test_case(case, driver, 0) for _ in range(4)]
    assert len({result.trace.digest for result in results}) == 1
    assert not any(result.notes.changed for result in results)
    assert (tmp_path / "started").read_text() == "xx", "the second run was driven again by a fresh program"


def test_a_program_that_remembers_is_found_and_its_run_is_that_of_a_fresh_one(tmp_path: Path) -> None:
    case, driver = load_test_case(f"{scenario(tmp_path, *CASES)}::w60"), address(tmp_path, LEAKS)
    first, second = (run_test_case(case, driver, 0) for _ in range(2))
    assert first.trace.digest == second.trace.digest
    assert first.notes.changed == () and second.notes.changed == (REMEMBERS,)
    assert not kept_programs()


def test_a_campaign_starts_a_program_once_a_worker_and_gives_what_fresh_ones_give(tmp_path: Path) -> None:
    scenario(tmp_path, *CASES)
    options = ("--risky-points", 1, "--children", 1, "--against", "none", "--quiet", "--json", "--jobs", 1)
    found = {}
    for name, text in (("stays", STAYS), ("fresh", STAYS.replace(', "stays": True', "")), ("leaks", LEAKS)):
        (tmp_path / "started").unlink(missing_ok=True)
        driver = address(tmp_path, text)
        done = foresee("campaign", "alone.foresee", "--driver", driver, *options, "--out", name, cwd=tmp_path)
        data = json.loads(done.stdout)
        starts = len((tmp_path / "started").read_text())
        runs = [(run["verdict"], run["reason"], run["duration_s"]) for run in data["test_cases"]]
        found[name] = runs, starts, [(run["notes"] or {}).get("changed") for run in data["test_cases"]]
    assert found["stays"][0] == found["fresh"][0] == found["leaks"][0]
    assert found["stays"][1] == 2 and found["fresh"][1] >= len(CASES)
    assert found["stays"][2] == [None] * len(CASES) and [REMEMBERS] in found["leaks"][2]


PLUG_IN = """from foresee_dsl.drivers.idm import IdmDriver
from foresee_dsl.drivers.kept import keep


def load():
    with open("LOADED", "a") as file:
        file.write("x")
    return [0.0]


class Heavy:
    name, version = "heavy", "1"

    def __init__(self):
        self.inner = IdmDriver()

    def reset(self, mission, vehicle, seed):
        self.weights = keep(("heavy", "weights.pt"), load)
        CHANGE
        self.inner.reset(mission, vehicle, seed)

    def step(self, observation):
        control = self.inner.step(observation)
        return type(control)(control.steer, control.throttle * (1 - self.weights[0]), control.brake)
"""


@pytest.mark.parametrize(("change", "leaks"), [("pass", False), ("self.weights[0] += 0.1", True)])
def test_weights_are_loaded_once_and_a_change_of_them_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str, leaks: bool
) -> None:
    place = tmp_path / "plug_in"
    (place / "heavy-1.dist-info").mkdir(parents=True)
    module = f"heavy{int(leaks)}"
    text = PLUG_IN.replace("LOADED", str(tmp_path / "loaded")).replace("CHANGE", change)
    (place / f"{module}.py").write_text(text)
    (place / "heavy-1.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: heavy\nVersion: 1\n")
    (place / "heavy-1.dist-info" / "entry_points.txt").write_text(f"[foresee_dsl.drivers]\nheavy = {module}:Heavy\n")
    monkeypatch.syspath_prepend(str(place))
    case = load_test_case(f"{scenario(tmp_path, *CASES)}::w60")
    results = [run_test_case(case, "heavy", 0) for _ in range(3)]
    assert len({result.trace.digest for result in results[:2]}) == 1
    assert results[1].notes.changed == ((REMEMBERS,) if leaks else ())
    assert (tmp_path / "loaded").stat().st_size == (3 if leaks else 2), "once, and once for the check"
