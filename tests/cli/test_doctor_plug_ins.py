"""`foresee doctor` names each plug-in of the repository once: with its version, or with what installs it."""

from __future__ import annotations

import json
from importlib import metadata
from pathlib import Path

from foresee_dsl.cli.added import ADDED
from foresee_dsl.plugins import BESIDE, not_installed, package_of
from tests.support.command import foresee
from tests.support.without_plug_ins import foresee_of, installed_without


def details(text: str) -> dict[str, str]:
    return {finding["what"]: finding["detail"] for finding in json.loads(text)["findings"]}


def test_missing_plug_ins_are_named_with_what_installs_them(tmp_path: Path) -> None:
    found = details(foresee_of(installed_without(tmp_path), "doctor", "--json", code=0).stdout)
    assert found["plug-ins"] == "; ".join(f"foresee-{extra} is {not_installed(extra)}" for extra in sorted(BESIDE))
    assert found["commands of plug-ins"] == "none"


def test_installed_plug_ins_are_named_with_their_versions() -> None:
    installed = {dist.name: dist.version for dist in metadata.distributions() if dist.name.startswith("foresee-")}
    found = details(foresee("doctor", "--json").stdout)
    named = dict(part.split(" ", 1) for part in found["plug-ins"].split("; "))
    assert set(named) == {f"foresee-{extra}" for extra in BESIDE}
    assert {name: version for name, version in named.items() if name in installed} == {
        name: version for name, version in installed.items() if name in named
    }
    commands = [f"{entry.name} ({package_of(entry)})" for entry in ADDED.entries()]
    assert found["commands of plug-ins"] == (", ".join(commands) or "none")
