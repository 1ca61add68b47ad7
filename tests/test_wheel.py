"""The wheel: built, installed into another environment, and used from an empty folder."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

LARGEST_BYTES = 30e6
"""What the wheel may weigh, with all networks."""


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


def test_the_wheel_carries_its_data(root: Path, wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    for part in ("grammars/foresee.lark", "scenarios/models.foresee", "scenarios/networks/town.foresee"):
        assert f"foresee_dsl/_data/{part}" in names
    assert any(n.startswith("foresee_dsl/_data/templates/") and n.endswith(".j2") for n in names)
    assert not [n for n in names if n.startswith("tests/")]
    assert {n.rpartition("/")[2] for n in names if "/learned/weights/" in n} == {
        file.name for file in (root / "foresee_dsl" / "drivers" / "learned" / "weights").glob("*")
    }
    assert wheel.stat().st_size < LARGEST_BYTES


def test_another_environment_runs_a_scenario_from_an_empty_folder(wheel: Path, tmp_path: Path) -> None:
    home = tmp_path / "environment"
    venv.create(home, with_pip=True)
    python = home / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "--no-deps", "--quiet", wheel], check=True)
    # The libraries are borrowed from here; a `.pth` inside a borrowed folder is not read, so our own checkout is not.
    site = next(home.glob("lib/python*/site-packages"))
    (site / "borrowed.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
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
    # Without the package of the learned drivers all is as usual, and the list says what is missing.
    without = "import sys; sys.modules['onnxruntime'] = None; from foresee_dsl.cli import main; main()"
    listed = subprocess.run(
        [python, "-c", without, "drivers", "--json"], cwd=empty, capture_output=True, text=True, check=True
    )
    rows = {row["name"]: row for row in json.loads(listed.stdout)["drivers"]}
    assert rows["pdm"]["version"]
    assert "pip install 'foresee-dsl[learned]'" in rows["fusion"]["about"]
