"""A folder received from another person: every kind of file, each naming a program that leaves a mark when it is
started."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import subprocess
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from foresee_dsl.campaign.regression.keeping import keep, source_of
from foresee_dsl.simulate.trace import Trace
from tests.support.small_campaign import SETTINGS, finished, write_project

ORIGINAL = 'driver "idm 1"'
SIGNER = """#!/bin/sh
cat > /dev/null
echo '[GNUPG:] SIG_CREATED ' >&2
printf -- '-----BEGIN PGP SIGNATURE-----\\n\\nx\\n-----END PGP SIGNATURE-----\\n'
"""
NETWORK = """foresee 1

network street {
  junction a at (0 m, 0 m)
  junction b at (100 m, 0 m)
  road main from a to b { lanes 1; back 0; speed 50 km/h }
}
"""
MODELS = """foresee 1

models more {
  model car.mine: car {
    length 4.5 m
    width 1.8 m
  }
}
"""


class Received:
    """The folder, and its files by kind.

    Attributes:
        address: the program as a driver's address. mark: the file that it writes.
    """

    def __init__(self, root: Path) -> None:
        self.root, self.mark = root, root / "mark"
        self.program = root / "program.sh"
        self.program.write_text(f"#!/bin/sh\necho \"$0 $*\" >> '{self.mark}'\n", encoding="utf-8")
        self.program.chmod(0o755)
        self.address = f"external:{self.program}"
        work = root / "work"
        self.scenario = write_project(work)
        finished([f"{self.scenario}::after"], work / "out", replace(SETTINGS, risky_points=1, children=2))
        self.out = work / "out"
        self.network = self._write("work/street.foresee", NETWORK)
        self.models = self._write("work/more.foresee", MODELS)
        self.drivers = self._write("work/drivers.foresee", self._campaign_file(f'drivers ["{self.address}"]'))
        self.against = self._write("work/against.foresee", self._campaign_file(f'against ["{self.address}"]'))
        self.suite = work / "regressions"
        keep([source_of(str(min((self.out / "children").rglob("*_p1_m*.foresee"))), self.out)], self.suite)
        self._rename_drivers()
        self.mutant = min((self.out / "children").rglob("*_p1_m*.foresee"))
        self.clip = min((self.out / "children").rglob("*_p1.foresee"))
        self.trace = min((self.out / "traces").glob("*after.npz"))
        self.child_trace = min((self.out / "traces").glob("*_p1_m*.npz"))
        self._make_repository(work)
        self.repository = root / "repository"
        shutil.copytree(work, self.repository, symlinks=True)
        edited = self.scenario.read_text(encoding="utf-8").replace("end after 12 s", "end after 11 s")
        self._write("repository/crosser.foresee", edited)

    def kinds(self) -> dict[str, Path]:
        """Return a file or folder of each kind."""
        return {
            "scenario": self.scenario, "network": self.network, "models": self.models, "clip": self.clip,
            "mutant": self.mutant, "campaign file": self.drivers, "campaign file's references": self.against,
            "trace": self.trace, "trace of a mutant": self.child_trace, "store": self.out / "store",
            "campaign.json": self.out, "regression folder": self.suite, "repository": self.repository,
        }  # fmt: skip

    def _write(self, name: str, text: str) -> Path:
        file = self.root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        return file

    def _campaign_file(self, line: str) -> str:
        settings = "risky_points 1\n  children 1"
        return f'foresee 1\n\ncampaign all {{\n  seeds "crosser.foresee"\n  {line}\n  {settings}\n}}\n'

    def _rename_drivers(self) -> None:
        """Write the program wherever the campaign has written its driver."""
        recorded = f'driver "probe 7 via {self.address}"'
        for file in [*self.out.rglob("*.foresee"), *self.suite.rglob("*.foresee")]:
            text = file.read_text(encoding="utf-8").replace(ORIGINAL, recorded)
            file.write_text(text, encoding="utf-8")
        with self.scenario.open("r+", encoding="utf-8") as file:
            text = file.read()
            file.seek(0)
            line = f'  expected "{self.address}" in case after passes\n'
            file.write(text.replace("  case after", f"{line}  case after"))
        data = (self.out / "campaign.json").read_text(encoding="utf-8")
        renamed = data.replace('"idm"', json.dumps(self.address)).replace('"idm 1"', json.dumps(f"{self.address} 7"))
        (self.out / "campaign.json").write_text(renamed, encoding="utf-8")
        for file in self.out.rglob("*.npz"):
            trace = Trace.load(file)
            if trace.meta.get("driver") == "idm":
                replace(trace, meta={**trace.meta, "driver": self.address}).save(file)
        with closing(sqlite3.connect(self.out / "store" / "runs.sqlite")) as store, store:
            store.execute("update runs set driver = ?", (self.address,))

    def _make_repository(self, folder: Path) -> None:
        """Make a repository with a signed commit whose configuration names the program wherever git starts one."""
        signer = self._write("signer.sh", SIGNER)
        signer.chmod(0o755)
        git = ("git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@example.org")
        environment = {**os.environ, "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}

        def call(*words: str) -> None:
            subprocess.run([*git, *words], check=True, capture_output=True, env=environment)

        call("init", "--quiet")
        call("add", "--force", "--all")
        call("-c", f"gpg.program={signer}", "commit", "--quiet", "--gpg-sign=x", "--message", "x")
        self._write("work/.gitattributes", "*.foresee diff=mine filter=mine\n")
        for name in (
            "gpg.program", "gpg.ssh.program", "core.fsmonitor", "core.pager", "pager.log", "core.editor",
            "core.sshCommand", "core.askPass", "core.alternateRefsCommand", "credential.helper", "diff.external",
            "diff.mine.command", "diff.mine.textconv", "filter.mine.process", "filter.mine.clean",
            "filter.mine.smudge", "remote.origin.uploadpack", "core.gitProxy",
        ):  # fmt: skip
            call("config", name, str(self.program))
        hooks = folder / ".git" / "hooks"
        for name in ("post-index-change", "reference-transaction", "pre-auto-gc", "post-checkout"):
            (hooks / name).symlink_to(self.program)
        for name, value in (
            ("log.showSignature", "true"),
            ("remote.origin.url", f"{folder}/elsewhere"),
            ("remote.origin.promisor", "true"),
            ("remote.origin.partialclonefilter", "blob:none"),
            ("protocol.allow", "always"),
            ("core.hooksPath", str(hooks)),
        ):
            call("config", name, value)
