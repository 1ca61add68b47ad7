"""Reads `campaign.json`; content that no campaign writes is reported with its place in the file."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.documents import shape
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import read_outside

JSON = "campaign.json"


def read_written(campaign: Path) -> dict[str, Any]:
    """Return the contents of a folder's `campaign.json`; {} if there is none.

    All values have the types that a campaign writes. Keys that an older version did not write may be missing; access as
    `data[key]` then raises.

    Raises:
        ForeseeError: it cannot be read, or a value is not one that a campaign writes.
    """
    file = campaign / JSON
    try:
        data = json.loads(read_outside(file, "results"), object_hook=lambda pairs: _Object(file, pairs))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as err:
        raise ForeseeError(f"{file} cannot be read: {err}") from err
    try:
        _written().validate_python(data)
    except ValidationError as err:
        wrong = next((problem for problem in err.errors() if problem["type"] != "missing"), None)
        if wrong is not None:
            where = ".".join(map(str, wrong["loc"])) or "the whole file"
            raise ForeseeError(
                f"{file} was not written by a campaign of this version ({where}: {wrong['msg']}): "
                "run the campaign again"
            ) from err
    return _Object(file, data)


class _Object(dict[str, Any]):
    """A JSON object of the file; access to a missing key raises an error that says what to do."""

    def __init__(self, file: Path, pairs: dict[str, Any]) -> None:
        super().__init__(pairs)
        self._file = file

    def __missing__(self, key: str) -> Any:  # noqa: ANN401 - it always raises
        raise ForeseeError(f"{self._file} lacks {key!r} where a campaign of this version writes it: run the campaign "
                           "again")  # fmt: skip


@cache
def _written() -> TypeAdapter[Any]:
    return TypeAdapter(shape(CampaignResult))
