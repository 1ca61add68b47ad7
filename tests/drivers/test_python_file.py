"""The driver `python`: a class in a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.drivers.consent import allowing
from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError

MINE = """
from foresee_dsl.drivers.protocol import Control
import beside
from beside_too import brake

class Mine:
    def reset(self, mission, vehicle, seed): pass
    def step(self, observation): return Control(0.0, beside.THROTTLE, brake())

class Named(Mine):
    name, version = "named", "7"

class Broken:
    def __init__(self): raise ValueError("no weights")

class NotADriver:
    def step(self, observation): pass
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "beside.py").write_text("THROTTLE = 0.5\n", encoding="utf-8")
    (tmp_path / "beside_too.py").write_text("def brake(): return 0.0\n", encoding="utf-8")
    file = tmp_path / "mine.py"
    file.write_text(MINE, encoding="utf-8")
    return file


def load(file: Path, name: str) -> Driver:
    address = f"python:{file}:{name}"
    with allowing([address]):
        return load_driver(address)


def test_it_starts_with_consent_only(file: Path) -> None:
    with pytest.raises(DriverError, match="starts only with your consent"):
        load_driver(f"python:{file}:Mine")
    assert load(file, "Mine").name == "Mine"


def test_its_version_changes_with_the_files_that_it_imports(file: Path) -> None:
    before = load(file, "Named").version
    assert before.startswith("7 ") and before == load(file, "Named").version
    (file.parent / "unrelated.py").write_text("x = 1\n", encoding="utf-8")
    assert load(file, "Named").version == before
    (file.parent / "beside_too.py").write_text("def brake(): return 0.1\n", encoding="utf-8")
    assert load(file, "Named").version != before


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("python:mine.py", "names no class of a file; write python:FILE.py:CLASS"),
        ("python:nowhere.py:Mine", "nowhere.py cannot be read: No such file"),
        ("python:FILE:Yours", "has no class Yours"),
        ("python:FILE:Broken", "cannot be created: ValueError: no weights"),
        ("python:FILE:NotADriver", "is not a driver: it has no method reset"),
    ],
)
def test_mistakes_say_what_to_write(file: Path, address: str, message: str) -> None:
    address = address.replace("FILE", str(file))
    with allowing([address]), pytest.raises(DriverError, match=message):
        load_driver(address)
