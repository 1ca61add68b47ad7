"""Which edit of the code changes which keys: a step's key contains the code that its class imports, and no other."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from foresee_dsl.campaign.import_closure import import_closure, imports_of
from foresee_dsl.campaign.stages import STEPS

PARTS = {step.kind: step.__module__ for step in STEPS} | {
    "pdm": "foresee_dsl.drivers.pdm",
    "idm": "foresee_dsl.drivers.idm",
    "foresee": "foresee_dsl.forecast.foresee",
    "random": "foresee_dsl.forecast.baselines",
}
"""The steps, and some drivers and rankers, with the modules that their code begins with."""
RUNS = {"seed", "clip", "child"}
ALL = {step.kind for step in STEPS}
EDITS = {
    "language/units.py": ALL | {"foresee", "random"},
    "compile/compiler.py": ALL | {"foresee", "random"},
    "simulate/runner.py": ALL,
    "kernels/__init__.py": ALL | {"pdm", "idm", "foresee", "random"},
    "drivers/protocol.py": ALL | {"pdm", "idm", "foresee", "random"},
    "drivers/idm.py": {"idm"},
    "forecast/foresee.py": {"mutants", "foresee", "random"},
    "forecast/geometry.py": {"forecast", "mutants", "foresee", "random"},
    "forecast/settings.py": {"forecast", "mutants", "minimise", "minimised_reference", "foresee", "random"},
    "forecast/registry.py": {"forecast"},
    "forecast/protocol.py": {"forecast", "mutants", "minimise", "minimised_reference", "foresee", "random"},
    "derive/clipping/clip.py": {"forecast", "minimise", "minimised_reference"},
    "derive/clipping/fidelity.py": {"clip", "check", "minimise", "minimised_reference"},
    "derive/minimise/minimise.py": {"minimise", "minimised_reference"},
    "derive/operators/paper.py": {"mutants"},
    "campaign/records.py": ALL,
    "campaign/steps/child.py": {"child", "minimise", "reference", "minimised_reference"},
    "campaign/steps/step.py": ALL,
    "campaign/stages.py": set(),
    "campaign/execution/engine.py": set(),
    "campaign/storage/store.py": set(),
    "campaign/settings.py": set(),
    "exchange/outcome.py": set(),
    "editor/lexer.py": set(),
    "report/terminal/tables.py": set(),
    "cli/options/common.py": set(),
}
"""What an edit of a file of the package changes."""
_CODE = """
from foresee_dsl.campaign.import_closure import code_of

def answer():
    return {name: code_of(module) for name, module in json.loads(sys.argv[1]).items()}
"""
_FORKS = """
import json, os, sys
{program}
for _ in sys.stdin:
    if os.fork() == 0:
        print(json.dumps(answer()), flush=True)
        os._exit(0)
    os.wait()
"""
Answers = Callable[[], dict[str, object]]


@contextmanager
def asked(program: str, *path: Path) -> Iterator[Answers]:
    """Return what a program with these folders on its path answers each time: as a new process would, without its cost.

    Each answer is that of a fork of a process which has imported what the program needs, and has read no source since.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path))}
    command = [sys.executable, "-c", _FORKS.format(program=program), json.dumps(PARTS)]
    with subprocess.Popen(
        command, env=environment, cwd=path[0], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        asking, answers = process.stdin, process.stdout
        assert asking is not None and answers is not None

        def answer() -> dict[str, object]:
            asking.write("\n")
            asking.flush()
            found: dict[str, object] = json.loads(answers.readline())
            return found

        yield answer
        asking.close()


@pytest.fixture(scope="module")
def tree(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package, laid out as a wheel does it: the data files inside."""
    copy = tmp_path_factory.mktemp("tree")
    shutil.copytree(root / "foresee_dsl", copy / "foresee_dsl", ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.fixture(scope="module")
def code(tree: Path) -> Iterator[Answers]:
    """Hashes of the code, by what it is the code of, as a process in the copy of the tree finds them."""
    with asked(_CODE, tree) as answer:
        yield answer


@pytest.fixture(scope="module")
def unedited(code: Answers) -> dict[str, object]:
    return code()


def changed(tree: Path, code: Answers, unedited: dict[str, object], file: str, text: str) -> set[str]:
    """What another text of a file changes."""
    edited = tree / "foresee_dsl" / file
    before = edited.read_text()
    assert text != before
    edited.write_text(text)
    try:
        after = code()
    finally:
        edited.write_text(before)
    return {name for name in PARTS if after[name] != unedited[name]}


def test_a_copy_of_the_tree_has_the_same_code(unedited: dict[str, object], root: Path) -> None:
    with asked(_CODE, root) as answer:
        assert unedited == answer()
    assert len(set(unedited.values())) == len(PARTS)


@pytest.mark.parametrize("file", EDITS)
def test_an_edit_changes_the_keys_of_what_runs_it(
    tree: Path, code: Answers, unedited: dict[str, object], file: str
) -> None:
    text = (tree / "foresee_dsl" / file).read_text()
    assert changed(tree, code, unedited, file, f"{text}\nEDITED = 1\n") == EDITS[file]


def test_a_careful_drivers_delay_decides_what_seeds_and_children_say(
    tree: Path, code: Answers, unedited: dict[str, object]
) -> None:
    """What `preventability` answers is in both results."""
    file = "avoidance/r157/risk.py"
    text = (tree / "foresee_dsl" / file).read_text()
    edited = re.sub(r"^DELAY_S = .*$", "DELAY_S = 0.8", text, flags=re.M)
    assert changed(tree, code, unedited, file, edited) >= {"seed", "child"}


def test_imports_inside_functions_count_and_those_for_type_checkers_do_not() -> None:
    source = b"""
import foresee_dsl.errors
from typing import TYPE_CHECKING
import numpy
from .near import by
if TYPE_CHECKING:
    from foresee_dsl.simulate import world
else:
    import foresee_dsl.files
def later():
    from foresee_dsl.language import model, parser
"""
    names = ("errors", "files", "language", "language.model", "language.parser")
    other = {"typing", "typing.TYPE_CHECKING", "numpy", ".near", ".near.by"}
    assert set(imports_of(source)) == {f"foresee_dsl.{name}" for name in names} | other


def test_a_module_brings_its_packages_and_what_is_no_module_is_left_out() -> None:
    found = import_closure(["foresee_dsl.errors", "foresee_dsl.errors.ForeseeError", "foresee_dsl.gone"])
    assert {"foresee_dsl", "foresee_dsl.errors"} <= set(found)
    assert "foresee_dsl.gone" not in found and "foresee_dsl.errors.ForeseeError" not in found


def test_no_module_of_ours_imports_relatively(root: Path) -> None:
    relative = re.compile(r"^\s*from \.", re.M)
    assert not [file for file in (root / "foresee_dsl").rglob("*.py") if relative.search(file.read_text())]


# ---- plug-ins --------------------------------------------------------------------------------------------------------

PLUG_IN = {
    "acme_search/__init__.py": "",
    "acme_search/ranker.py": "from .picking import pick\nimport acme_words\n\n\nclass Ranker:\n    name = 'acme'\n\n"
    "    def rank(self, trace, *, seed=0, before_s=5.0, after_s=5.0):\n        return pick(trace)\n",
    "acme_search/picking.py": "from foresee_dsl.forecast.baselines import RandomRanker\n\n\ndef pick(trace):\n"
    "    return ()\n",
    "acme_search/page.py": "PAGE = 1\n",
    "acme_search/table.csv": "1,2\n",
    "acme_words.py": "WORDS = ()\n",
    "unrelated.py": "",
    "acme_search-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: acme-search\nVersion: 1\n",
    "acme_search-1.dist-info/entry_points.txt": "[foresee_dsl.rankers]\nacme = acme_search.ranker:Ranker\n",
    "acme_words-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: acme-words\nVersion: 1\n",
    "acme_words-1.dist-info/entry_points.txt": "[foresee_dsl.raster_views]\nwords = acme_words:WORDS\n",
}
_IDENTITIES = """
from foresee_dsl.campaign.import_closure import import_closure
from foresee_dsl.campaign.keys import driver_identity, ranker_identity, step_code

def answer():
    return {
        "ranker": ranker_identity("acme", "pdm"), "step": step_code("acme_search.ranker"),
        "pdm": driver_identity("pdm"), "foresee": ranker_identity("foresee", "pdm"),
        "closure": [name for name in import_closure(["acme_search.ranker"]) if not name.startswith("foresee_dsl")],
    }
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two installed packages: a ranker, and another plug-in, which it imports."""
    folder = tmp_path_factory.mktemp("site")
    for name, text in PLUG_IN.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return folder


@pytest.fixture(scope="module")
def identities(tree: Path, site: Path) -> Iterator[Answers]:
    """Identities of a plug-in's ranker, of a step in it, and of ours, in a process with both on its path."""
    with asked(_IDENTITIES, tree, site) as answer:
        yield answer


@pytest.fixture(scope="module")
def with_plug_in(identities: Answers) -> dict[str, object]:
    return identities()


def test_a_step_of_a_plug_in_has_the_code_that_it_imports_there(with_plug_in: dict[str, object]) -> None:
    assert with_plug_in["closure"] == ["acme_search", "acme_search.picking", "acme_search.ranker", "acme_words"]


@pytest.mark.parametrize(
    ("file", "changes"),
    [
        ("acme_search/picking.py", {"ranker", "step"}),  # it is imported relatively
        ("acme_search/page.py", {"ranker"}),  # of a plug-in's ranker the whole package counts
        ("acme_search/table.csv", {"ranker"}),
        ("acme_words.py", {"ranker", "step"}),  # another plug-in
        ("unrelated.py", set()),
    ],
)
def test_an_edit_of_a_plug_in_changes_its_keys_and_none_of_ours(
    file: str, changes: set[str], site: Path, identities: Answers, with_plug_in: dict[str, object]
) -> None:
    before = (site / file).read_text()
    (site / file).write_text(f"{before}\nEDITED = 1\n")
    try:
        after = identities()
    finally:
        (site / file).write_text(before)
    assert {name for name in after if after[name] != with_plug_in[name]} == changes


def test_an_edit_of_ours_changes_the_keys_of_a_plug_in_that_imports_it(
    tree: Path, identities: Answers, with_plug_in: dict[str, object]
) -> None:
    edited = tree / "foresee_dsl" / "forecast" / "baselines.py"
    before = edited.read_text()
    edited.write_text(f"{before}\nEDITED = 1\n")
    try:
        after = identities()
    finally:
        edited.write_text(before)
    assert {name for name in after if after[name] != with_plug_in[name]} == {"ranker", "step"}
