"""The modules that the fork server imports in advance, so that new workers start quickly."""

from __future__ import annotations

import pkgutil
from contextlib import suppress
from importlib import import_module

from foresee_dsl.campaign import steps
from foresee_dsl.kernels import compiling

MODULES = (
    *(f"{steps.__name__}.{module.name}" for module in pkgutil.iter_modules(steps.__path__)),
    "foresee_dsl.forecast.foresee",
    "foresee_dsl.drivers.idm",
    "foresee_dsl.drivers.pdm",
)

for _name in MODULES:
    with suppress(Exception):  # the task that needs the module reports the error
        import_module(_name)
compiling.ensure()
compiling.load()
