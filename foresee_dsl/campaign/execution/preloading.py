"""What the fork server imports, so that a new worker starts warm. Workers import what is missing when they need it."""

from __future__ import annotations

import pkgutil
from contextlib import suppress
from importlib import import_module

from foresee_dsl.campaign import steps
from foresee_dsl.kernels import compiling

MODULES = (
    *(f"{steps.__name__}.{found.name}" for found in pkgutil.iter_modules(steps.__path__)),
    "foresee_dsl.forecast.foresee",
    "foresee_dsl.drivers.idm",
    "foresee_dsl.drivers.pdm",
)

for _name in MODULES:
    with suppress(Exception):  # the task that needs it reports why it does not load
        import_module(_name)
compiling.ensure()
compiling.load()
