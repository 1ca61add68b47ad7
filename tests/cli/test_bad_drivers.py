"""Drivers that raise, hang, exit or print, in `run`, `assess` and `campaign`: a verdict, its place, exit code 1."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.support import command
from tests.support.bad_driver import install

REASONS = {
    "raise": ("crash", "the driver raised ValueError: no \x1b[31midea, at bad.py:36 (Bad.go_wrong)"),
    "reset": ("crash", "the driver raised KeyError: 'weights', at bad.py:22 (Bad.reset)"),
    "sys_exit": ("crash", "the driver called sys.exit(0), at bad.py:47 (Bad.go_wrong)"),
    "os_exit": ("crash", "its process died with exit code 0"),
    "loop": (
        "timeout",
        "timeout: the driver took longer than 1 s of wall time for step 11, at bad.py:38 (Bad.go_wrong); "
        "--step-deadline allows more",
    ),
    "lock": (
        "timeout",
        "timeout: the run did not return from a library's code in time, at bad.py:42 (go_wrong); "
        "--step-deadline allows more (with --retry)",
    ),
    "print": ("pass", "arrived at 5.55 s"),
}
"""How each ends: verdict and reason."""
Foresee = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def bad(tmp_path_factory: pytest.TempPathFactory) -> tuple[Foresee, Path]:
    """The command with the driver installed, and a file of two cases."""
    environment, file = install(tmp_path_factory.mktemp("bad"))

    def foresee(*arguments: object, code: int) -> subprocess.CompletedProcess[str]:
        done = command.foresee(*arguments, env=environment, expect=code)
        assert "foresee has a fault" not in done.stderr
        assert "\x1b" not in done.stderr and "\u202e" not in done.stdout + done.stderr, "what is foreign is made safe"
        return done

    return foresee, file


def ended(one: dict[str, Any]) -> tuple[str, str]:
    return one["verdict"], one["reason"].removesuffix(", 3 times")


def test_assess(bad: tuple[Foresee, Path]) -> None:
    foresee, file = bad
    reasons = {how: REASONS[how] for how in ("raise", "os_exit", "lock", "print")}
    drivers = [word for how in reasons for word in ("--driver", f"bad:{how}")]
    options = ("--first", 1, "--step-deadline", 1, "--jobs", 2)
    found = json.loads(foresee("assess", file, *drivers, *options, "--json", code=1).stdout)
    assert {one["driver"].removeprefix("bad:"): ended(one) for one in found["runs"]} == reasons
    by_driver = {one["driver"].removeprefix("bad:"): one for one in found["runs"]}
    assert by_driver["os_exit"]["output"] == "so long\n"
    printed = sorted(by_driver["print"]["output"].splitlines())  # C and Python have buffers of their own
    assert printed == ["\x1b[31mred\u202e", "the library says hello", "weights loaded"]
    assert "in go_wrong" in by_driver["raise"]["traceback"] and "foresee_dsl" not in by_driver["raise"]["traceback"]


def test_assess_tells_people(bad: tuple[Foresee, Path]) -> None:
    foresee, file = bad
    done = foresee("assess", file, "--driver", "bad:raise", "--driver", "bad:print", "--jobs", 1, "--failures", code=1)
    first, second, *_ = done.stdout.splitlines()
    assert first.startswith(
        "bad:raise: the driver crashed in 2 of 2 test cases: ValueError: no \\x1b[31midea, at bad.py:36"
    )
    assert second == "bad:print: 2 test cases passed"
    assert done.stdout.count("Traceback (most recent call last):") == 1, "once for each place in the driver"


def test_a_campaign_with_each_of_them(bad: tuple[Foresee, Path], tmp_path: Path) -> None:
    foresee, file = bad
    study, out = tmp_path / "study.foresee", tmp_path / "out"
    names = ", ".join(f'"bad:{how}"' for how in REASONS)
    searched = f'seeds "{file}::w60"\n  drivers [{names}]\n  rankers [foresee]\n  preset focused'
    study.write_text(f"foresee 1\n\ncampaign study {{\n  {searched}\n}}\n")
    options = ("--out", out, "--step-deadline", 1, "--jobs", 2, "--allow-outside", "--quiet", "--run-programs")
    text = " ".join(foresee("campaign", study, *options, code=1).stdout.split())
    for how, (verdict, reason) in REASONS.items():
        data = json.loads((out / f"bad_{how}_foresee" / "campaign.json").read_text())
        case = data["test_cases"][0]
        assert ended(case) == (verdict, reason)
        if verdict == "crash":
            short = reason.removeprefix("the driver raised ").replace("\x1b", "\\x1b")
            assert f"the driver crashed in 1 of 1 test case: {short}" in text
        elif verdict == "timeout":
            assert f"the driver hangs in 1 of 1 test case: {reason.removeprefix('timeout: ')}" in text
        if how in ("raise", "os_exit"):
            assert case["notes"]["output" if how == "os_exit" else "traceback"]
    # What hung is not tried again with the same deadline; the exit code is that of the result, unless it is not wanted.
    log = tmp_path / "again.jsonl"
    foresee("campaign", study, *options, "--log-json", log, "--exit-zero", code=0)
    assert '"event": "done"' not in log.read_text()


def test_run(bad: tuple[Foresee, Path]) -> None:
    foresee, file = bad
    text = foresee("run", f"{file}::w60", "--driver", "bad:raise", code=1).stdout
    first, *more = text.splitlines()
    assert first.startswith(f"{file}::w60: crash, the driver raised ValueError: no \\x1b[31midea, at bad.py:36 ")
    assert "  Traceback (most recent call last):" in more and "  ValueError: no \\x1b[31midea" in more
    assert sum("File " in line for line in more) == 2 and all("bad.py" in line for line in more if "File " in line)

    text = foresee("run", f"{file}::w60", "--driver", "bad:loop", "--step-deadline", 1, "--exit-zero", code=0).stdout
    assert f"{file}::w60: timeout, the driver took longer than 1 s" in text.splitlines()[0]
    assert "in go_wrong" in text and "DriverHangs" not in text

    text = foresee("run", f"{file}::w60", "--driver", "bad:init", code=1).stdout
    assert "crash, the driver raised ValueError: no licence, at bad.py:14 (Bad.__init__)" in text
    assert "registry.py" not in text

    data = json.loads(foresee("run", f"{file}::w60", "--driver", "bad:os_exit", "--json", code=1).stdout)
    assert ended(data) == REASONS["os_exit"] and data["output"] == "so long\n" and data["digest"] == ""


def test_all_cases_of_a_file(bad: tuple[Foresee, Path]) -> None:
    foresee, file = bad
    text = foresee("run", file, "--driver", "bad:print", code=0).stdout
    assert text.startswith("2 test cases passed\n")
    assert [line.split()[:2] for line in text.splitlines()[-2:]] == [[f"{file}::w60", "pass"], [f"{file}::w62", "pass"]]
    stopped = foresee("run", file, "--driver", "bad:reset", "--fail-fast", code=1).stdout
    assert "the driver crashed in 1 of 1 test case: KeyError: 'weights', at bad.py:22" in stopped
    assert "stopped at the first failure (--fail-fast): 1 were not run" in stopped
    said = foresee("run", file, "--only", "8", code=2).stderr
    assert "no test case has the family or tag '8'" in " ".join(said.replace("│", " ").split())


@pytest.mark.parametrize("verb", ["run", "assess"])
@pytest.mark.parametrize(
    "address",
    ["external:no_such_program_here", "external:python3 'x", "python:no_such_file.py:Mine", "gym:missing.onnx"],
)
def test_an_address_that_names_nothing_is_an_error_of_the_command(
    bad: tuple[Foresee, Path], verb: str, address: str
) -> None:
    foresee, file = bad
    done = foresee(verb, file, "--driver", address, "--jobs", 1, code=1)
    assert done.stdout == "" and "Traceback" not in done.stderr
    assert done.stderr.startswith("error: ") and address.split(":")[1] in done.stderr
