"""Drivers are found by entry point, and broken plug-ins are named."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from dataclasses import astuple
from pathlib import Path

import pytest

from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.drivers.registry import DRIVERS, describe_drivers, load_driver
from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.plugins import BESIDE, not_installed

PLUGIN = '''
class Coasting:
    """Does nothing, on purpose."""

    name = "coast"
    version = "7"

    def reset(self, mission, vehicle, seed):
        pass

    def step(self, observation):
        raise NotImplementedError


class Headless:
    name = "headless"
    version = "1"


class Explodes:
    def __init__(self):
        raise RuntimeError("no licence")
'''


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An installed package with a good driver and three broken ones."""
    (tmp_path / "acme_drivers.py").write_text(PLUGIN)
    info = tmp_path / "acme_drivers-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-drivers\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[foresee_dsl.drivers]\n"
        "coast = acme_drivers:Coasting\n"
        "headless = acme_drivers:Headless\n"
        "explodes = acme_drivers:Explodes\n"
        "missing = acme_drivers_missing:Driver\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    yield
    sys.modules.pop("acme_drivers", None)
    importlib.invalidate_caches()


def test_pdm_is_installed() -> None:
    assert "pdm" in DRIVERS.names()
    driver = load_driver("pdm")
    assert isinstance(driver, PdmDriver)
    assert load_driver("pdm") is not driver
    (pdm,) = [d for d in describe_drivers() if d.name == "pdm"]
    assert (pdm.version, pdm.package) == ("2", "foresee-dsl")
    assert pdm.doc.endswith(".")


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    with pytest.raises(DriverError, match=r"unknown driver 'pmd', did you mean 'pdm'\? installed: .*pdm"):
        load_driver("pmd")
    with pytest.raises(DriverError, match=r"unknown driver 'zzz'; installed: .*pdm"):
        load_driver("zzz")
    with pytest.raises(
        DriverError, match=r"'pdm\+ideal_eyes' names no part .*write one or more of \+ideal, \+ideal_tr"
    ):
        load_driver("pdm+ideal_eyes")


@pytest.mark.parametrize(
    ("python", "machine", "system", "there"),
    [
        ((3, 12), "x86_64", "linux", True),
        ((3, 11), "x86_64", "darwin", True),
        ((3, 13), "x86_64", "linux", False),
        ((3, 12), "aarch64", "linux", False),
        ((3, 12), "x86_64", "win32", False),
    ],
)
def test_where_nothing_installs_frenetix_that_is_said(
    monkeypatch: pytest.MonkeyPatch, python: tuple[int, int], machine: str, system: str, *, there: bool
) -> None:
    monkeypatch.setattr(sys, "version_info", (*python, 0, "final", 0))
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr("platform.machine", lambda: machine)
    said = not_installed("frenetix")
    assert ("pip install ./plugins/foresee-frenetix in a checkout of foresee-dsl" in said) is there
    assert ("wheels for Python up to 3.12 on x86_64 Linux and macOS only" in said) is not there
    assert not_installed("study") == "not installed: pip install ./plugins/foresee-study in a checkout of foresee-dsl"


def test_a_plug_in_beside_that_is_missing_is_named_with_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The real ones: `test_wheel.py`, in an environment without them."""
    monkeypatch.setitem(BESIDE, "gliding", {"foresee_dsl.drivers": ("glider", "pdm")})
    how = r"comes with the plug-in foresee-gliding, which is not installed: pip install ./plugins/foresee-gliding in a "
    with pytest.raises(DriverUnavailableError, match=f"the driver 'glider' {how}"):
        load_driver("glider")
    assert isinstance(load_driver("pdm"), PdmDriver), "what is installed is not missing"
    glider = next(d for d in describe_drivers() if d.name == "glider")
    assert (glider.version, glider.unavailable) == ("", True)
    assert "pip install ./plugins/foresee-gliding in a checkout of foresee-dsl" in glider.doc
    assert "glider" not in DRIVERS.names()


def test_a_plug_in_that_needs_another_one_beside_says_which(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The ranker `selforacle` of foresee-study looks at the pictures of foresee-learned."""
    (tmp_path / "towed.py").write_text("import foresee_gliding.winch\n")
    info = tmp_path / "towed-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: towed\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[foresee_dsl.drivers]\ntowed = towed:Towed\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(BESIDE, "gliding", {})
    needs = r"needs the plug-in foresee-gliding, which is not installed: pip install ./plugins/foresee-gliding in a "
    with pytest.raises(DriverError, match=f"driver 'towed' of package towed {needs}"):
        load_driver("towed")


@pytest.mark.usefixtures("plugin")
def test_another_package_brings_a_driver() -> None:
    assert set(DRIVERS.names()) >= {"pdm", "coast"}
    assert isinstance(load_driver("coast"), Driver)
    (coast,) = [d for d in describe_drivers() if d.name == "coast"]
    assert astuple(coast) == ("coast", "7", "Does nothing, on purpose.", "acme-drivers", False)


@pytest.mark.usefixtures("plugin")
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("headless", "is not a driver: it has no method reset and no method step; a driver has"),
        ("explodes", "RuntimeError: no licence"),
        ("missing", "ModuleNotFoundError"),
    ],
)
def test_a_broken_plugin_is_named(name: str, why: str) -> None:
    with pytest.raises(DriverError, match=f"driver '{name}' of package acme-drivers .*{why}"):
        load_driver(name)
    (info,) = [d for d in describe_drivers() if d.name == name]
    assert info.version == ""
    assert why in info.doc


def test_the_list_shows_how_a_driver_that_is_made_from_a_text_is_used() -> None:
    found = {d.name: d for d in describe_drivers()}
    assert set(found) >= {"pdm", "idm", "external"}
    assert found["external"].version == "1"
    assert '--driver "external:python3 my_driver.py"' in found["external"].doc
