"""The driver `python`: a class in a file."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from foresee_dsl.drivers.consent import allowing
from foresee_dsl.drivers.protocol import Control, Driver
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError

MINE = """
from foresee_dsl.drivers.protocol import Control
import beside
from beside_too import brake

brake_s = 2.0

class Mine:
    def reset(self, mission, vehicle, seed): pass
    def step(self, observation): return Control(0.0, beside.THROTTLE, brake())

class Named(Mine):
    name, version = "named", "7"

class Broken:
    def __init__(self): raise ValueError("no weights")

class Needs(Mine):
    def __init__(self, weights, scale=1.0): pass

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


SHARING = """
from foresee_dsl.drivers.protocol import Control
import params

class Mine:
    def reset(self, mission, vehicle, seed): pass
    def step(self, observation):
        from pedals import late
        return Control(0.0, params.THROTTLE, late.BRAKE)
"""


def version_of(folder: Path, throttle: float) -> Path:
    """Write a driver whose modules have the names of another version's."""
    (folder / "pedals").mkdir(parents=True)
    (folder / "pedals" / "__init__.py").touch()
    (folder / "pedals" / "late.py").write_text(f"BRAKE = {throttle / 10}\n", encoding="utf-8")
    (folder / "params.py").write_text(f"THROTTLE = {throttle}\n", encoding="utf-8")
    file = folder / "mine.py"
    file.write_text(SHARING, encoding="utf-8")
    return file


def answer(file: Path) -> tuple[float, float]:
    control = load(file, "Mine").step(None)  # type: ignore[arg-type]  # it does not look
    assert isinstance(control, Control)
    return control.throttle, control.brake


def test_two_drivers_with_modules_of_one_name_get_their_own(tmp_path: Path) -> None:
    first, second = version_of(tmp_path / "v1", 0.1), version_of(tmp_path / "v2", 0.2)
    for _ in range(2):
        assert answer(first) == (0.1, 0.01)
        assert answer(second) == (0.2, 0.02)


def test_an_edited_module_is_read_again_and_an_unchanged_one_is_not(tmp_path: Path) -> None:
    file = version_of(tmp_path, 0.1)
    assert answer(file) == (0.1, 0.01)
    params = sys.modules["params"]
    assert answer(file) == (0.1, 0.01)
    assert sys.modules["params"] is params
    (tmp_path / "params.py").write_text("THROTTLE = 0.3\n", encoding="utf-8")
    assert answer(file) == (0.3, 0.01)
    (tmp_path / "pedals" / "late.py").write_text("BRAKE = 0.045\n", encoding="utf-8")
    assert answer(file) == (0.3, 0.045)


def test_a_module_that_python_takes_from_elsewhere_is_an_error(file: Path) -> None:
    (file.parent / "json.py").write_text("x = 1\n", encoding="utf-8")
    file.write_text(f"import json\n{MINE}", encoding="utf-8")
    with pytest.raises(DriverError, match="imports json, and another module called json is in use already; give"):
        load(file, "Mine")


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("python:mine.py", "names no class of a file; write python:FILE.py:CLASS"),
        ("python:nowhere.py:Mine", "nowhere.py cannot be read: No such file"),
        ("python:FILE:Yours", "has no class Yours"),
        ("python:FILE:brake_s", "has no class brake_s"),
        ("python:FILE:Needs", "is created without arguments; give weights a default value"),
        ("python:FILE:Broken", "cannot be created: ValueError: no weights"),
        ("python:FILE:NotADriver", "is not a driver: it has no method reset"),
    ],
)
def test_mistakes_say_what_to_write(file: Path, address: str, message: str) -> None:
    address = address.replace("FILE", str(file))
    with allowing([address]), pytest.raises(DriverError, match=message) as caught:
        load_driver(address)
    # An exception of the driver's own code is the outcome of its runs; the other errors are known before them.
    assert (caught.value.__cause__ is not None) == address.endswith("Broken")
