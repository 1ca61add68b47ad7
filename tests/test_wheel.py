"""The wheel: built, installed into another environment, and used from an empty folder."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from foresee_dsl.kernels.compiling import ensure

LARGEST_BYTES = 3e6
"""What the wheel may weigh: networks and research are in the plug-ins. Measured: 1.6 MB."""
PLUG_INS = ("foresee_", "_editable_impl_foresee_")
"""How the names of what is installed of this package and its plug-ins begin."""

LOOKS = """
import sys

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.runner import run


class Looks:
    name, version = "looks", "1"

    def reset(self, mission, vehicle, seed):
        pass

    def step(self, observation):
        observation.views.birds_eye()
        return Control(0.0, 0.0, 1.0)


result = run(compile_test_case(load_test_case(sys.argv[1])), Looks())
print(result.verdict.value, result.reason)
"""
"""A driver of another author that asks for a picture."""


@pytest.fixture(scope="module")
def wheel(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    source = tmp_path_factory.mktemp("source")
    for name in ("foresee_dsl", "grammars", "templates", "scenarios"):
        shutil.copytree(root / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(root / name, source / name)
    command = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(source / "dist"),
        str(source),
    ]
    subprocess.run(command, check=True, capture_output=True)
    return next((source / "dist").glob("*.whl"))


def test_the_wheel_carries_its_data(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    for part in ("grammars/foresee.lark", "scenarios/models.foresee", "scenarios/networks/town.foresee"):
        assert f"foresee_dsl/_data/{part}" in names
    assert any(n.startswith("foresee_dsl/_data/templates/") and n.endswith(".j2") for n in names)
    assert not [n for n in names if n.startswith("tests/")]
    assert wheel.stat().st_size < LARGEST_BYTES


def _take_machine_code(source: Path, installed: Path) -> None:
    """Give installed kernels the machine code of the checkout's, which takes a minute to compile.

    numba takes it for a source of the same size and time, and `ensure` for files with the same contents; otherwise the
    kernels are compiled.
    """
    ensure()
    for file in source.rglob("*"):
        target = installed / file.relative_to(source)
        if file.suffix == ".py" and target.exists():
            os.utime(target, ns=(file.stat().st_atime_ns, file.stat().st_mtime_ns))
        elif file.suffix in (".nbi", ".nbc") or file.name.startswith("kernels-"):
            target.parent.mkdir(exist_ok=True)
            shutil.copy(file, target)


def test_another_environment_runs_a_scenario_from_an_empty_folder(root: Path, wheel: Path, tmp_path: Path) -> None:
    home = tmp_path / "environment"
    here = find_spec("pip") is not None  # an environment that uv made has none
    venv.create(home, with_pip=not here)
    python = home / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python] if here else [python, "-m", "pip"]
    subprocess.run([*pip, "install", "--no-deps", "--quiet", wheel], check=True)
    # The libraries are borrowed from here, without our own checkout and the plug-ins beside it.
    borrowed = tmp_path / "borrowed"
    borrowed.mkdir()
    for entry in Path(sysconfig.get_paths()["purelib"]).iterdir():
        if not entry.name.startswith(PLUG_INS):
            (borrowed / entry.name).symlink_to(entry)
    site = next(home.glob("lib/python*/site-packages"))
    (site / "borrowed.pth").write_text(f"{borrowed}\n")
    _take_machine_code(root / "foresee_dsl" / "kernels", site / "foresee_dsl" / "kernels")
    empty = tmp_path / "empty"
    empty.mkdir()
    where = subprocess.run(
        [python, "-c", "import foresee_dsl; print(foresee_dsl.__file__)"],
        cwd=empty,
        capture_output=True,
        text=True,
        check=True,
    )
    assert where.stdout.startswith(str(site))
    bundled = site / "foresee_dsl" / "_data" / "scenarios" / "scenario3.foresee"
    done = subprocess.run(
        [home / "bin" / "foresee", "run", f"{bundled}::r01", "--json"],
        cwd=empty,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] in {"pass", "F1", "F2", "F3", "F4", "F5", "stuck", "timeout"}
    assert list(empty.iterdir()) == []
    # Without the plug-ins all is as usual, and the messages name what is missing.
    listed = subprocess.run(
        [home / "bin" / "foresee", "drivers", "--json"], cwd=empty, capture_output=True, text=True, check=True
    )
    rows = {row["name"]: row for row in json.loads(listed.stdout)["drivers"]}
    assert rows["pdm"]["version"]
    for driver, extra in (("fusion", "learned"), ("fusion_safe", "learned"), ("frenetix", "frenetix")):
        assert not rows[driver]["version"]
        assert f"pip install ./plugins/foresee-{extra} in a checkout of foresee-dsl" in rows[driver]["about"]
    refused = subprocess.run(
        [home / "bin" / "foresee", "run", f"{bundled}::r01", "--driver", "fusion"],
        cwd=empty, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (refused.returncode, refused.stdout) == (1, "")
    assert refused.stderr == (
        "error: the driver 'fusion' comes with the plug-in foresee-learned, which is not installed: "
        "pip install ./plugins/foresee-learned in a checkout of foresee-dsl\n"
    )
    command = [home / "bin" / "foresee", "doctor"]
    doctor = subprocess.run(command, cwd=empty, capture_output=True, text=True, check=False)
    assert "foresee-learned is not installed: pip install ./plugins/foresee-learned" in " ".join(doctor.stdout.split())
    (empty / "looks.py").write_text(LOOKS)
    looks = [python, "looks.py", f"{bundled}::r01"]
    looked = subprocess.run(looks, cwd=empty, capture_output=True, text=True, check=True)
    assert looked.stdout == (
        "crash the driver broke: the raster view 'birds_eye' comes with the plug-in foresee-learned, which is not "
        "installed: pip install ./plugins/foresee-learned in a checkout of foresee-dsl\n"
    )
