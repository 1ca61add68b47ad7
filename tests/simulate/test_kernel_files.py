"""A kernel is kept until its own file or one of those in `made_of` changes: nothing may come from elsewhere."""

from __future__ import annotations

import ast
from pathlib import Path
from types import ModuleType

import pytest

from foresee_dsl.simulate import traffic_kernels
from foresee_dsl.simulate.actors.moved_actors import path_followers as followers


@pytest.mark.parametrize("module", [traffic_kernels, followers], ids=lambda m: m.__name__.rpartition(".")[2])
def test_what_a_kernel_takes_from_other_files_is_in_made_of(module: ModuleType) -> None:
    tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
    comes_from = {
        alias.asname or alias.name: f"{node.module.rpartition('.')[2]}.py"
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("foresee_dsl.simulate.")
        for alias in node.names
    }
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    seen = 0
    for function in functions.values():
        named = [
            keyword.value.value.split()
            for decorator in function.decorator_list
            if isinstance(decorator, ast.Call)
            for keyword in decorator.keywords
            if keyword.arg == "made_of" and isinstance(keyword.value, ast.Constant)
        ]
        if not named:
            continue
        seen += 1
        names = {n.id for n in ast.walk(function) if isinstance(n, ast.Name)}
        names |= {n.id for own in names & set(functions) for n in ast.walk(functions[own]) if isinstance(n, ast.Name)}
        assert {comes_from[name] for name in names & set(comes_from)} <= set(named[0]), function.name
    assert seen > 1
