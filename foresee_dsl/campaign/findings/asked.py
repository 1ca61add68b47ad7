"""A failure that a command names: a finding or a child of a campaign by its name, or a mutant's file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.addresses import absolute, is_file, kind_of

JSON = "campaign.json"


@dataclass(frozen=True)
class Asked:
    """A failing mutant as it was found.

    Attributes:
        name: the mutant's. file: its file, unreduced.
        campaign: the folder of the campaign that found it, None where there is none. data: what its JSON says.
    """

    name: str
    file: Path
    campaign: Path | None = None
    data: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def store(self) -> Path | None:
        """The store of its campaign, None where there is none."""
        folder = self.campaign / "store" if self.campaign is not None else None
        return folder if folder is not None and (folder / "runs.sqlite").is_file() else None

    @property
    def finding(self) -> Mapping[str, Any] | None:
        """What the campaign says of the finding that it represents or belongs to."""
        all_found: list[Mapping[str, Any]] = list(self.data.get("findings", ()))
        own = (one for one in all_found if one["name"] == self.name)
        return next(own, next((one for one in all_found if self.name in one["siblings"]), None))


def asked(wanted: str, campaign: Path, *, tests: bool = False) -> Asked:
    """Find the failure that is meant.

    Args:
        campaign: the folder in which names are looked up. tests: a test case that fails unmutated will do too.

    Raises:
        ForeseeError: there is none of that name, or it is no mutant.
    """
    path = Path(wanted)
    if is_file(path):
        return _by_file(path)
    data = _read(campaign)
    known = {str(child["mutant"]): child for child in _children(data) if child.get("file")}
    if wanted in known:
        return Asked(wanted, campaign / str(known[wanted]["file"]), campaign, data)
    if (test := next((one for one in data.get("findings", ()) if one["name"] == wanted), None)) is not None:
        if tests:
            return Asked(wanted, Path(str(test["file"])), campaign, data)
        raise ForeseeError(f"{wanted} is a test case that fails as it is written: there is no mutation to minimise")
    if not data:
        raise ForeseeError(f"there is no file {wanted!r}, and no campaign in {campaign} that could have a finding of "
                           "that name (`--campaign OUT` says where it is)")  # fmt: skip
    hint = did_you_mean(wanted, sorted(known)) if known else "that campaign found no failing mutant"
    raise ForeseeError(f"there is no file {wanted!r}, and no finding of that name in {campaign}: {hint}")


def _by_file(path: Path) -> Asked:
    kind = kind_of(path)
    if kind != "mutant":
        what = f"a {kind}" if kind else "no definition"
        raise ForeseeError(f"{path} holds {what}, not a mutant: name a mutant's file, or a finding of a campaign")
    above = next((folder for folder in absolute(path).parents if is_file(folder / JSON)), None)
    data = _read(above) if above is not None else {}
    child = next((child for child in _children(data) if child["mutant"] == path.stem and child.get("file")), None)
    if above is None or child is None:
        return Asked(path.stem, path)
    # A file in `findings` is minimised already: what is meant is the child that it was made of.
    own = above / str(child["file"])
    inside = absolute(path).parent in (absolute(own).parent, absolute(above / "findings" / path.stem))
    return Asked(path.stem, own, above, data) if inside else Asked(path.stem, path)


def _children(data: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    for clip in data.get("clip_runs", ()):
        yield from clip.get("children", ())


def _read(campaign: Path) -> dict[str, Any]:
    try:
        data = json.loads((campaign / JSON).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as err:
        raise ForeseeError(f"{campaign / JSON} cannot be read: {err}") from err
    if not isinstance(data, dict):
        raise ForeseeError(f"{campaign / JSON} is no campaign's JSON")
    return data
