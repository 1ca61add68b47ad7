"""Codes of what a campaign's file names that is not there. No heavy import: `foresee explain` reads it."""

from __future__ import annotations

from foresee_dsl.language.codes.code import Code

NOT_INSTALLED = "FS058"
NOTHING_THERE = "FS059"

CODES = (
    Code(
        NOT_INSTALLED,
        "a driver, ranker or preset that is not installed",
        "Drivers and rankers come with packages; `foresee drivers` lists those that are here.",
        'foresee 1\n\ncampaign nightly {\n  seeds "parent.foresee"\n  drivers [pmd]\n}',
        'foresee 1\n\ncampaign nightly {\n  seeds "parent.foresee"\n  drivers [pdm]\n}',
        "file",
    ),
    Code(
        NOTHING_THERE,
        "seeds that match no scenario",
        "Paths and patterns begin at the folder of the campaign's file; `**` stands for any folders.",
        'foresee 1\n\ncampaign nightly {\n  seeds "nowhere/**"\n}',
        'foresee 1\n\ncampaign nightly {\n  seeds "par*.foresee"\n}',
        "file",
    ),
)
"""In order."""
