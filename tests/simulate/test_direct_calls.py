"""Kernels that are called without the check of types get the types that they were compiled for."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.files import data_folder
from foresee_dsl.kernels import direct as module
from foresee_dsl.kernels.compiling import Kernel
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.runner import run

CASES = (
    ("scenario3/behind_the_bus.foresee::schoolchild", "pdm"),
    ("scenario7.foresee::r03", "idm"),
    ("scenario9/into_the_roundabout.foresee::lorry_past_the_far_arm", "pdm"),
)


def checked(called: set[str]) -> Callable[[Any], Any]:
    """Return what `direct` is replaced by: the kernel itself, which compares each argument with its type first."""

    def direct(kernel: Any) -> Any:
        def call(*arguments: Any) -> Any:
            assert len(arguments) == len(kernel.kinds), kernel.__name__
            called.add(kernel.__name__)
            return kernel(*arguments)

        return call

    return direct


@pytest.mark.parametrize(("address", "driver"), CASES)
def test_arguments_are_of_the_compiled_types(address: str, driver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    called: set[str] = set()
    case = load_test_case(f"{data_folder('scenarios') / address}")
    run(compile_test_case(case), load_driver(driver))  # imports what is used
    ours = [one for name, one in sys.modules.items() if name.startswith("foresee_dsl.") and one is not module]
    kernels = {id(value.entry): value for one in ours for value in vars(one).values() if isinstance(value, Kernel)}
    for user in ours:
        for name, value in list(vars(user).items()):
            if value is module.direct:
                monkeypatch.setattr(user, name, checked(called))
            elif id(value) in kernels:  # made when the module was imported
                monkeypatch.setattr(user, name, checked(called)(kernels[id(value)]))
    run(compile_test_case(case), load_driver(driver))
    assert len(called) >= 8, called
