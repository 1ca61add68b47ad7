"""Finds the errors of a text that an editor holds, and of the files on which it builds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from foresee_dsl.errors import Diagnostic, ForeseeError, InputError
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.parser import parse

_NO_CODE = "FS001"


def find(path: Path, text: str, overlay: Mapping[Path, str], *, places: bool) -> tuple[Diagnostic, ...]:
    """Return the diagnostics of a file and of the files on which it builds.

    The file need not exist on the disk; `overlay` holds the texts of the editor by absolute path. With `places` the
    network is built and every actor placed, which takes up to some seconds. Errors in the text, or missing programs of
    SUMO, become diagnostics; they do not raise.
    """
    try:
        result = check_paths([str(path)], {**overlay, path: text})
        diagnostics = result.diagnostics
        if result.campaigns:
            from foresee_dsl.campaign.campaign_file import mistakes_of  # slow: it searches for plug-ins

            for campaign in result.campaigns:
                diagnostics += mistakes_of(campaign, with_goal=places)
        if not places:
            return diagnostics
        from foresee_dsl.compile import with_placements

        return with_placements(diagnostics, result.cases)
    except InputError as error:
        return error.diagnostics
    except ForeseeError as error:
        return (Diagnostic(_NO_CODE, str(error), "", str(path), severity="warning"),)


def find_alone(text: str, name: str) -> tuple[Diagnostic, ...]:
    """Return the diagnostics of a text that was never saved as a file."""
    try:
        return check_document(parse(text, name))
    except InputError as error:
        return error.diagnostics
