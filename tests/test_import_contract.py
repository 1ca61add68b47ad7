"""The import contract sees imports by a module's name, which tools that read `import` statements do not."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.import_contract import imports_by_name


def test_a_call_of_import_module_is_an_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "some_package"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "inner" / "__init__.py").write_text(
        "from importlib import import_module\n\n\ndef f():\n    return import_module('some_package.other').f()\n"
    )
    (package / "other.py").write_text(
        "import importlib\n\nimportlib.import_module('some_package.inner')\nimportlib.import_module('json')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert sorted(imports_by_name("some_package")) == [
        ("some_package.inner", "some_package.other"),
        ("some_package.other", "some_package.inner"),
    ]
