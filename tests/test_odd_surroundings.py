"""Surroundings that are not as expected: names of files, the cache's folder, drivers, many actors."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from foresee_dsl.compile import placement_mistakes
from foresee_dsl.drivers import registry
from foresee_dsl.errors import DriverError
from foresee_dsl.language.project.loading import load_test_case
from tests.support.command import program

FORESEE = Path(sys.executable).parent / "foresee"
SCENE = Path(__file__).parent.parent / "scenarios" / "scenario1.foresee"


def foresee(folder: Path, *words: str, **settings: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, **settings}
    return subprocess.run([program(), *words], cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("form", ["full", "concise", "json", "github", "sarif"])
def test_a_file_whose_name_is_not_utf8_is_checked(tmp_path: Path, form: str) -> None:
    (tmp_path / os.fsdecode(b"bad\xff.foresee")).write_text("foresee 1\n\nnetwork a {\n}\n")
    done = subprocess.run([FORESEE, "check", ".", "--format", form], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 1, done.stderr
    assert b"FS014" in done.stdout + done.stderr


def test_a_cache_folder_that_cannot_be_used_is_replaced_and_said_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "x.foresee").write_text("foresee 1\n\nnetwork a {\n}\n")
    done = foresee(tmp_path, "check", ".", FORESEE_CACHE=str(tmp_path / "file" / "cache"))
    assert done.returncode == 1 and "FS014" in done.stderr + done.stdout
    warning = (
        f"warning: the cache folder {tmp_path}/file/cache cannot be used (Not a directory): a temporary one is used"
    )
    assert done.stderr.count("cannot be used") == 1 and done.stderr.startswith(warning)


def test_a_driver_whose_version_has_a_double_quote_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from foresee_dsl.drivers.idm import IdmDriver

    monkeypatch.setattr(IdmDriver, "version", 'a"b')
    with pytest.raises(DriverError, match=r"as its name or version.*leave out double quotes and line ends"):
        registry.load_driver("idm")


_STREET = (
    "foresee 1\n\nscenario x {\n  network {\n    junction a at (0 m, 0 m)\n    junction b at (300 m, 0 m)\n"
    "    road main from a to b {\n      speed 50 km/h\n    }\n  }\n"
    "  ego: car.sedan {\n    route [main]\n    start at 10 m along main\n    goal 200 m along main\n  }\n"
)


def test_hundreds_of_mistakes_of_a_kind_are_few_messages(tmp_path: Path) -> None:
    """300 vehicles off the road, and 300 that are to be faster than they can; all of both kinds are counted."""
    lines = [
        f"  vehicle {kind}{n}: car.compact {{\n    route [main]\n    start at {place}\n    speed {speed} km/h\n  }}\n"
        for n in range(300)
        for kind, place, speed in (
            ("off", f"(30 m, {100 + 20 * n} m)", 50),
            ("fast", f"{30 + 10 * n} m along main", 900),
        )
    ]
    (tmp_path / "x.foresee").write_text(f"{_STREET.replace('300 m', '4000 m')}{''.join(lines)}  end after 10 s\n}}\n")
    done = foresee(tmp_path, "check", "x.foresee", "--format", "json")
    found = [d["message"] for d in json.loads(done.stdout)["diagnostics"] if d["severity"] == "error"]
    assert done.returncode == 1 and len(found) == 42, found[:3]
    assert [message for message in found if "more errors of this kind" in message] == [
        "280 more errors of this kind: the last is that off299 starts 6081.6 m off its route",
        "280 more errors of this kind: the last is that fast299 has a speed of 900 km/h, "
        "but car.compact can reach only 180 km/h",
    ]


def test_hundreds_of_actors_in_one_place_are_few_messages(tmp_path: Path) -> None:
    actors = "".join(
        f"  vehicle v{n}: car.compact {{\n    route [main]\n    start at 100 m along main\n  }}\n" for n in range(300)
    )
    (tmp_path / "x.foresee").write_text(f"{_STREET}{actors}  end after 10 s\n}}\n")
    done = foresee(tmp_path, "check", "x.foresee", "--format", "json")
    found = [d for d in json.loads(done.stdout)["diagnostics"] if d["severity"] == "error"]
    assert done.returncode == 1 and len(found) == 21, found[:3]
    assert found[-1]["message"].startswith("at least 10,000 more errors of this kind: the last is that v")
    mistakes = placement_mistakes([load_test_case(str(tmp_path / "x.foresee"))])
    assert [len(d.names) for d in mistakes] == [1] * 21, "code finds the actor, whatever the words are"
    assert all(re.fullmatch(r"v\d+", name) for d in mistakes for name in d.names)
