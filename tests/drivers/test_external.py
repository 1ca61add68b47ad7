"""Drivers in other programs: the protocol's lines, every way in which a program can break it, and whole runs."""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.mutate_file import mutate_file
from foresee_dsl.campaign.regression.expectations import Status
from foresee_dsl.campaign.regression.verify import verify_files
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.drivers.consent import allow, allowing
from foresee_dsl.drivers.external import ExternalDriver, plain, read_answer, read_ready, reset_line, step_line
from foresee_dsl.drivers.external.process import LONGEST_LINE
from foresee_dsl.drivers.protocol import Closing, Control, Driver, EgoState, Observation, SeenActor
from foresee_dsl.drivers.registry import load_driver, recorded_address, recorded_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict
from tests.support import command
from tests.support.driving import SEDAN, line, mission
from tests.support.towns import drive_through, town

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = f"external:{sys.executable} {ROOT / 'docs' / 'examples' / 'external_driver.py'}"
FORESEE = Path(sys.executable).parent / "foresee"
TASK = mission(line((60, math.inf)))
SEEN = Observation(0.0, EgoState(5, 0, 0, 1, 0, 0, 0), (SeenActor(3, "car", 9, 1, 0, 2, 4.5, 1.8),), {"j": "green"})

PRELUDE = """import json, os, signal, subprocess, sys, time
def say(text): sys.stdout.write(text + "\\n"); sys.stdout.flush()
def hear(): return json.loads(sys.stdin.readline())
def ready(): hear(); say('{"type": "ready", "name": "probe", "version": "7"}')
GO = '{"steer": 0, "throttle": 0.5, "brake": 0}'
"""
Write = Callable[[str], str]


@pytest.fixture
def program(tmp_path: Path) -> Write:
    """Write a program and return the address that starts it."""

    def write(text: str) -> str:
        file = tmp_path / f"probe_{len(list(tmp_path.glob('probe_*')))}.py"
        file.write_text(PRELUDE + text, encoding="utf-8")
        address = f"external:{sys.executable} -S {file}"
        allow(address)
        return address

    return write


@contextlib.contextmanager
def loaded(address: str) -> Iterator[ExternalDriver]:
    allow(address)
    driver = load_driver(address)
    assert isinstance(driver, ExternalDriver)
    try:
        yield driver
    finally:
        driver.close()


def is_gone(pid: int) -> bool:
    """Dead and reaped: a zombie still takes signals."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def wait_until(done: Callable[[], bool], seconds: float = 10.0) -> bool:
    until = time.monotonic() + seconds
    while not done() and time.monotonic() < until:
        time.sleep(0.01)
    return done()


def is_dead(pid: int) -> bool:
    """Gone, or a zombie whose parent (not we) has not looked: both run no more."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


# ---- the lines ------------------------------------------------------------------------------------------------------


def test_the_first_line_holds_the_whole_mission() -> None:
    message = json.loads(reset_line(TASK, SEDAN, 5))
    assert (message["foresee"], message["type"], message["seed"]) == (1, "reset", 5)
    assert message["mission"]["centreline"] == TASK.centreline.tolist()
    assert message["mission"]["goal_s"] == TASK.goal_s
    assert message["vehicle"]["wheelbase_m"] == SEDAN.wheelbase_m


def test_a_step_is_one_line_and_names_every_field() -> None:
    text = step_line(SEEN)
    assert text.endswith(b"\n") and text.count(b"\n") == 1
    seen = json.loads(text)["observation"]
    assert set(seen) >= {"time_s", "ego", "actors", "signals"}
    assert seen["actors"][0]["width_m"] == 1.8
    assert seen["signals"] == {"j": "green"}


def test_new_fields_appear_by_themselves_and_pictures_do_not() -> None:
    @dataclass(frozen=True)
    class Sensed:
        ranges_m: np.ndarray
        picture: np.ndarray
        wide: np.ndarray
        draw: Callable[[], int]
        best: np.float64
        seen: np.bool_
        nested: tuple[EgoState, ...] = ()

    said = plain(
        Sensed(
            np.array([1.5, np.inf, np.nan]),
            np.zeros((3, 4, 4)),
            np.zeros((200, 200)),
            lambda: 1,
            np.float64(2),
            np.bool_(True),
            (SEEN.ego,),
        )
    )
    ego = {
        "x": 5,
        "y": 0,
        "heading_rad": 0,
        "speed_mps": 1,
        "acceleration_mps2": 0,
        "yaw_rate_rad_s": 0,
        "steer_rad": 0,
    }
    assert said == {"ranges_m": [1.5, None, None], "best": 2.0, "seen": True, "nested": [ego]}
    json.dumps(said, allow_nan=False)


def test_what_pictures_are_drawn_from_is_not_sent(program: Write, tmp_path: Path, scenarios: Path) -> None:
    answers = """
ready(); seen = hear()
open(__file__ + ".seen", "w").write(json.dumps(seen)); say(GO)
sys.exit(hear())
"""
    address = program(answers)
    drive_through(town(tmp_path, scenarios, end=1), address)
    seen = Path(address.split()[-1] + ".seen").read_text(encoding="utf-8")
    assert set(json.loads(seen)["observation"]) == {"time_s", "ego", "actors", "signals", "measured_s"}
    assert len(seen) < 1000


def test_unknown_keys_are_ignored() -> None:
    ready = read_ready(b'{"type": "ready", "name": "a", "version": "1.2+b", "more": [1]}')
    assert (ready.name, ready.version, ready.stays) == ("a", "1.2+b", False)
    assert read_answer(b'{"steer": -2, "throttle": 0, "brake": 1e3, "why": "x"}') == Control(-2.0, 0.0, 1000.0)


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (b"", "not JSON"),
        (b"steer left", "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b"[" * 60_000, "not JSON"),
        (b'{"steer": 0, "throttle": 0, "brake": ' + b"9" * 9000 + b"}", "not JSON"),
        (b"[0, 0, 0]", "not a JSON object"),
        (b'{"steer": 0, "throttle": 0}', "has no brake"),
        (b'{"steer": NaN, "throttle": 0, "brake": 0}', "not JSON"),
        (b'{"steer": 0, "throttle": -Infinity, "brake": 0}', "not JSON"),
        (b'{"steer": 1e999, "throttle": 0, "brake": 0}', "steer is not finite"),
        (b'{"steer": 0, "throttle": 0, "brake": ' + b"9" * 400 + b"}", "brake is not finite"),
        (b'{"steer": true, "throttle": 0, "brake": 0}', "steer is not a number"),
        (b'{"steer": "0", "throttle": 0, "brake": 0}', "steer is not a number"),
        (b'{"steer": null, "throttle": 0, "brake": 0}', "steer is not a number"),
    ],
)
def test_what_is_no_control_is_said(answer: bytes, why: str) -> None:
    with pytest.raises(DriverError, match=why) as caught:
        read_answer(answer)
    assert len(str(caught.value)) < 250


@given(st.one_of(st.binary(max_size=200), st.text(max_size=100).map(str.encode)))
def test_garbage_is_a_driver_error_and_nothing_else(answer: bytes) -> None:
    for read in (read_answer, read_ready):
        with contextlib.suppress(DriverError):
            read(answer)


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


@given(
    st.fixed_dictionaries({}, optional=dict.fromkeys(("steer", "throttle", "brake", "type", "name", "version"), _JSON))
)
def test_odd_objects_are_a_driver_error_or_finite(answer: dict[str, object]) -> None:
    with contextlib.suppress(DriverError):
        control = read_answer(json.dumps(answer).encode())
        assert all(map(math.isfinite, (control.steer, control.throttle, control.brake)))
    with contextlib.suppress(DriverError):
        assert all(isinstance(part, str) and " " not in part for part in read_ready(json.dumps(answer).encode())[:2])


# ---- addresses ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("external", "names no program; write external:COMMAND"),
        ("external:  ", "names no program"),
        ("external:python3 'x", "cannot be split"),
        ("external:no_such_program_here x", "there is no program 'no_such_program_here'"),
        ("pdm:fast", "takes no argument"),
    ],
)
def test_a_wrong_address_is_said_before_anything_runs(address: str, why: str) -> None:
    with allowing([address]), pytest.raises(DriverError, match=why):
        load_driver(address)


@pytest.mark.parametrize("setting", ["0", "-1", "nan", "soon", "1e9"])
def test_a_wrong_deadline_is_said(setting: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_STEP_DEADLINE_S", setting)
    allow(EXAMPLE)
    with pytest.raises(DriverError, match="FORESEE_STEP_DEADLINE_S is"):
        load_driver(EXAMPLE)


@pytest.mark.parametrize(
    ("address", "written"),
    [
        ("pdm", "pdm 1"),
        ("external:python3 keeper.py", "probe 7 via external:python3 keeper.py"),
        ('external:python3 keeper.py --name "two words"', "probe 7 via external:python3 keeper.py --name 'two words'"),
        ("""external:run '{"a": 1}' 100%22""", "probe 7 via external:run '{%22a%22: 1}' 100%2522"),
        ("external:x 'it via external:y'", "probe 7 via external:x 'it via external:y'"),
    ],
)
def test_what_is_recorded_starts_the_same_again(address: str, written: str) -> None:
    recorded = recorded_driver(address, "1" if address == "pdm" else "probe 7")
    assert recorded == written
    assert '"' not in recorded
    again = recorded_address(recorded)
    assert recorded_driver(again, "1" if address == "pdm" else "probe 7") == written
    assert recorded_address("external:python3 by_hand.py") == "external:python3 by_hand.py"


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ('python3 "two words.py" on', "external:python3 'two words.py' on"),
        ("""python3 x.py '{"a": 1}'""", "external:python3 x.py '{%22a%22: 1}'"),
    ],
)
def test_a_command_may_have_double_quotes(command: str, name: str) -> None:
    with allowing([f"external:{command}"]):
        assert load_driver(f"external:{command}").name == name


# ---- the process ----------------------------------------------------------------------------------------------------


def test_a_whole_conversation(program: Write) -> None:
    address = program("""
first = hear()
say('{"type": "ready", "name": "probe", "version": "7"}')
assert (first["foresee"], first["type"], first["seed"]) == (1, "reset", 3), first
for k in range(2):
    assert hear()["type"] == "step"
    say(json.dumps({"steer": k, "throttle": 0.25, "brake": 0}))
open(__file__ + ".end", "w").write(json.dumps(hear()))
""")
    with loaded(address) as driver:
        assert isinstance(driver, Driver) and isinstance(driver, Closing)
        assert driver.name == address
        driver.reset(TASK, SEDAN, 3)
        assert driver.version == "probe 7"
        assert [driver.step(SEEN) for _ in range(2)] == [Control(0.0, 0.25, 0.0), Control(1.0, 0.25, 0.0)]
    said = Path(address.split()[-1] + ".end")
    assert json.loads(said.read_text()) == {"type": "end"}
    driver.close()  # again: nothing happens


BREAKS = {
    "dies": ("ready(); hear(); sys.exit(3)", r"it ended \(exit code 3\) without an answer$"),
    "raises": (
        "ready(); hear(); raise ValueError('no map \"x\"')",
        r"exit code 1\).*; the end of its stderr: .*ValueError: no map",
    ),
    "is killed": ("ready(); hear(); os.kill(os.getpid(), 9)", r"by signal 9"),
    "never starts": ("sys.exit('no licence')", r"exit code 1\) without an answer; the end of its stderr: no licence"),
    "closes its output": ("ready(); hear(); os.close(1); time.sleep(60)", r"closed its output"),
    "hangs": ("ready(); hear(); time.sleep(60)", r"did not answer within 0.5 s"),
    "hangs at reset": ("time.sleep(60)", r"did not (answer|read its line) within 1 s"),
    "does not end its line": (
        "ready(); hear(); sys.stdout.write(GO); sys.stdout.flush(); time.sleep(60)",
        "within 0.5",
    ),
    "wrong first line": ('hear(); say(\'{"type": "hello"}\')', r'first line must be .*"ready"'),
    "bad name": ('hear(); say(\'{"type": "ready", "name": "a b", "version": "1"}\')', "name must be"),
    "says NaN": ("ready(); hear(); say(GO.replace('0.5', 'NaN'))", "not JSON"),
    "two lines": ("ready(); hear(); say(GO + chr(10) + GO)", "one message with more than one line"),
    "speaks unasked": ("ready(); say(GO); hear(); say(GO); hear()", "no message was waiting|more than one line"),
    "a long line": ("ready(); hear(); say('x' * 100_000); time.sleep(60)", f"more than {LONGEST_LINE} bytes"),
    "floods": ("ready()\nwhile True: sys.stdout.write('x' * 8000)", "no message was waiting|bytes|more than one line"),
    "floods lines": ("ready(); hear()\nwhile True: say(GO)", "more than one line|no message was waiting"),
    "floods stderr": (
        "ready(); hear()\nwhile True: sys.stderr.write('x' * 8000)",
        "did not answer within 0.5 s; .*xxx",
    ),
}


@pytest.mark.parametrize("how", BREAKS)
def test_every_way_to_break_ends_the_program(how: str, program: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    text, why = BREAKS[how]
    if "0.5" in why or "1 s" in why:  # the others have their time, on a busy machine too
        monkeypatch.setenv("FORESEE_STEP_DEADLINE_S", "0.5")
    if "1 s" in why:
        monkeypatch.setenv("FORESEE_RESET_DEADLINE_S", "1")
    pids: list[int] = []
    with loaded(program(text)) as driver, pytest.raises(DriverError, match=why) as caught:
        try:
            driver.reset(TASK, SEDAN, 0)
        finally:
            pids += [driver._program.pid] if driver._program else []
        for _ in range(3):
            time.sleep(0.05)  # what is said unasked has arrived
            driver.step(SEEN)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 1000
    assert sys.executable in str(caught.value)
    assert all(map(is_gone, pids))
    with pytest.raises(DriverError, match="after it broke"):
        driver.step(SEEN)


CHILDREN = """
subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(60)"])
ready()
signal.signal(signal.SIGTERM, signal.SIG_IGN)
while True:
    hear()
    say(GO)
"""


def group_of(pid: int) -> list[int]:
    """All living processes of a process's group."""
    group = os.getpgid(pid)
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parts = (entry / "stat").read_text().rpartition(")")[2].split()
            if int(parts[2]) == group and parts[0] != "Z":
                found.append(int(entry.name))
    return sorted(found)


needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")


@needs_proc
def test_its_children_end_with_it(program: Write) -> None:
    with loaded(program(CHILDREN.replace("hear()\n    say", "assert hear()['type'] == 'step'\n    say"))) as driver:
        driver.reset(TASK, SEDAN, 0)
        driver.step(SEEN)
        assert driver._program is not None
        pid = driver._program.pid
        group = group_of(pid)
        assert len(group) == 3  # the guard, the program, its child
        assert os.getpgid(pid) != os.getpgid(0)
    assert is_gone(pid)
    assert wait_until(lambda: all(map(is_dead, group)))


@needs_proc
def test_a_driver_that_is_dropped_takes_its_program_along(program: Write) -> None:
    driver = load_driver(program(CHILDREN))
    assert isinstance(driver, ExternalDriver)
    driver.reset(TASK, SEDAN, 0)
    assert driver._program is not None
    group = group_of(driver._program.pid)
    del driver
    assert wait_until(lambda: all(map(is_dead, group)))


PARENT = """
import sys, time
from foresee_dsl.drivers.consent import allow
from foresee_dsl.drivers.registry import load_driver
from tests.support.driving import SEDAN, line, mission
allow({address!r})
driver = load_driver({address!r})
driver.reset(mission(line((60, float("inf")))), SEDAN, 0)
print(driver._program.pid, flush=True)
{then}
"""


@needs_proc
@pytest.mark.parametrize(
    ("then", "how"),
    [
        ("time.sleep(60)", signal.SIGTERM),
        ("time.sleep(60)", signal.SIGKILL),
        ("sys.stdin.readline(); raise SystemError", None),
    ],
)
def test_the_program_ends_with_its_parent(program: Write, then: str, how: int | None) -> None:
    text = PARENT.format(address=program(CHILDREN), then=then)
    pipe = subprocess.PIPE
    parent = subprocess.Popen(
        [sys.executable, "-c", text], cwd=ROOT, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL
    )
    try:
        assert parent.stdout is not None and parent.stdin is not None
        group = group_of(int(parent.stdout.readline()))
        assert len(group) == 3
        if how is not None:
            parent.send_signal(how)
        else:
            parent.stdin.write(b"\n")
            parent.stdin.flush()
        parent.wait(10)
        assert wait_until(lambda: all(map(is_dead, group)))
    finally:
        parent.kill()
        parent.communicate()


# ---- whole runs -----------------------------------------------------------------------------------------------------


def test_the_documented_example_drives_to_its_goal(tmp_path: Path, scenarios: Path) -> None:
    allow(EXAMPLE)
    file = town(tmp_path, scenarios, stage="ns_go", end=60)
    result = drive_through(file, EXAMPLE)
    assert result.verdict is Verdict.PASS, result.reason
    assert result.trace.meta["driver"] == EXAMPLE
    assert result.trace.meta["driver_version"] == "example 1"
    assert drive_through(file, EXAMPLE).trace.digest == result.trace.digest


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("ready(); hear(); say(GO); hear(); sys.exit(4)", r"the driver broke: .*it ended \(exit code 4\)"),
        ("sys.exit('\"quoted\"')", r"the driver broke: .*the end of its stderr: 'quoted'$"),
    ],
)
def test_a_program_that_breaks_is_a_crash(
    text: str, reason: str, program: Write, tmp_path: Path, scenarios: Path
) -> None:
    result = drive_through(town(tmp_path, scenarios, end=5), program(text))
    assert result.verdict is Verdict.CRASH
    assert result.reason.startswith("the driver broke: ")
    assert re.search(reason, result.reason), result.reason
    result.trace.save(tmp_path / "trace.npz")


LOSES_ITS_WAY = """
import itertools, runpy
first = sys.stdin.readline()
if json.loads(first)["mission"]["start_s"] > 80:
    say('{"type": "ready", "name": "probe", "version": "7"}')
    for _ in range(30): hear(); say(GO)
    sys.exit("lost my way")
sys.stdin = itertools.chain([first], sys.stdin)
runpy.run_path(EXAMPLE)
"""


def foresee(*arguments: object, code: int = 0) -> str:
    done = subprocess.run([command.program(), *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


def test_a_campaign_goes_on_when_the_program_dies_in_one_test_case(
    program: Write, tmp_path: Path, scenarios: Path
) -> None:
    far, near = town(tmp_path, scenarios, start=100, goal=5), town(tmp_path, scenarios, goal=5)
    driver = program(LOSES_ITS_WAY.replace("EXAMPLE", repr(EXAMPLE.rsplit(maxsplit=1)[-1])))
    data = json.loads(foresee("campaign", far, near, "--driver", driver, "--out", tmp_path / "out", "--json", code=1))
    by_file = {Path(case["test_case"]).name: case for case in data["test_cases"]}
    assert by_file[far.name]["verdict"] == "crash"
    assert "it ended (exit code 1) without an answer; the end of its stderr: lost my way" in by_file[far.name]["reason"]
    assert by_file[near.name]["verdict"] == "pass"
    assert data["broken"] == []


def test_what_is_recorded_is_verified_with_its_program(scenarios: Path, tmp_path: Path) -> None:
    with allowing([EXAMPLE]):
        case = load_test_case(scenarios / "scenario9.foresee::r03")
        trace = run_test_case(case, EXAMPLE, 0).trace
        point = load_ranker("proximity").rank(trace)[0]
        file = tmp_path / "p1.foresee"
        draft = clip_around(case, trace, point, file, before_s=2.0, after_s=1.0)
        clip, _, _, found = measure_clip(draft, case, trace, file, DriverSetup(EXAMPLE))
        assert found.largest_m < 0.1  # a fresh process knows nothing of the run before, and drives alike
        file.write_text(print_model(clip), encoding="utf-8")
        (child,) = mutate_file(file, preset="focused", count=1, driver=EXAMPLE, seed=0)
        mutant = Path(child.file)
        mutant.write_text(child.text, encoding="utf-8")
        assert f'driver "example 1 via {EXAMPLE}"' in child.text

    with pytest.raises(DriverError, match=r"name programs as drivers: external:.*--run-programs"):
        verify_files([mutant])
    (again,) = verify_files([mutant], run_programs=True)
    assert (again.driver, again.now) == (f"example 1 via {EXAMPLE}", child.reason)
    assert again.status is (Status.AS_EXPECTED if child.verdict.is_failure else Status.NEW)
