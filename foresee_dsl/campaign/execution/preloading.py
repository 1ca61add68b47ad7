"""What the fork server imports, so that a new worker starts warm. Workers import what is missing when they need it."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module

MODULES = (
    "foresee_dsl.campaign.work",
    "foresee_dsl.forecast.foresee",
    "foresee_dsl.drivers.idm",
    "foresee_dsl.drivers.pdm",
)

for _name in MODULES:
    with suppress(Exception):  # whoever needs it is told why it does not load; nobody else has to care
        import_module(_name)
