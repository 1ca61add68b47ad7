"""The import contract sees circles of files and of folders, and imports by a module's name, which tools that read
`import` statements do not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.import_contract import imports_by_name

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = {
    "left/first.py": "import some_package.right.middle\n",
    "left/second.py": "def f():\n    from some_package.right import middle\n\n    return middle\n",
    "left/last.py": "",
    "right/middle.py": "import some_package.left.last\n",
}
"""Files without a circle, in two folders with one."""
CLOSES = "some_package.right.middle -> some_package.left.last"
CONTRACT = """
[tool.importlinter]
root_package = "some_package"
contract_types = ["no_circles: tests.support.import_contract.NoCircles"]

[[tool.importlinter.contracts]]
name = "Imports"
type = "no_circles"
package = "some_package"
facades = {facades}
"""


def write_package(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        file = folder / "some_package" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        for above in file.relative_to(folder).parents[:-1]:
            (folder / above / "__init__.py").touch()
        file.write_text(text)


def lint(folder: Path, files: dict[str, str], *facades: str) -> tuple[int, str]:
    """Return the exit code and the output of the contract for a package with these files."""
    write_package(folder, files)
    (folder / "contract.toml").write_text(CONTRACT.format(facades=list(facades)))
    command = [Path(sys.executable).parent / "lint-imports", "--no-logo", "--no-cache", "contract.toml"]
    environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}", "COLUMNS": "200"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_a_circle_of_folders_is_named_by_the_imports_that_close_it(tmp_path: Path) -> None:
    code, output = lint(tmp_path, FOLDERS)
    assert code == 1
    assert f"circles in the folder some_package, closed by:\n  {CLOSES}\n" in output
    assert output.count("circle") == output.count("->") == 1


def test_a_folder_and_a_file_beside_it_make_a_circle_too(tmp_path: Path) -> None:
    files = {
        "inner/folder/first.py": "import some_package.inner.beside\n",
        "inner/beside.py": "import some_package.inner.folder.last\n",
        "inner/folder/last.py": "",
    }
    code, output = lint(tmp_path, files)
    assert code == 1
    assert "circles in the folder some_package.inner, closed by:\n  some_package.inner." in output


def test_imports_that_may_close_a_circle_are_listed(tmp_path: Path) -> None:
    code, output = lint(tmp_path, FOLDERS, CLOSES)
    assert code == 0, output
    code, output = lint(tmp_path, FOLDERS | {"right/middle.py": ""}, CLOSES)
    assert code == 1
    assert f"a facade that does not exist: {CLOSES}" in output


def test_a_circle_of_files_is_named(tmp_path: Path) -> None:
    code, output = lint(tmp_path, {"__init__.py": "import some_package.api", "api.py": "import some_package"})
    assert code == 1
    assert "a circle: some_package, some_package.api\n" in output


def test_a_call_of_import_module_is_an_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = {
        "inner/__init__.py": "from importlib import import_module\n\n\ndef f():\n"
        "    return import_module('some_package.other').f()\n",
        "other.py": "import importlib\n\nimportlib.import_module('some_package.inner')\n"
        "importlib.import_module('json')\n",
    }
    write_package(tmp_path, package)
    monkeypatch.syspath_prepend(tmp_path)
    assert sorted(imports_by_name("some_package")) == [
        ("some_package.inner", "some_package.other"),
        ("some_package.other", "some_package.inner"),
    ]
