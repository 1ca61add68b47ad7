"""Writes a campaign's folder: new files are collected beside the old ones and replace them only when complete."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.assembly import trace_of
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.storage.lock import only_writer
from foresee_dsl.campaign.storage.traces import Blobs
from foresee_dsl.campaign.triage.history import append_campaign
from foresee_dsl.documents import plain
from foresee_dsl.measuring import Part

PARTS = ("children", "findings", "traces")
"""The folders of a campaign's files."""


class CampaignFolder:
    """The folder of one campaign's results.

    It contains `campaign.json`, `children/` (mutants that failed or broke an expectation, and their clips), `findings/`
    (minimised representatives) and `traces/`.

    While a campaign runs, its files are collected in `.work-PID` inside; files of an earlier campaign remain until the
    end.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self.work = out.absolute() / f".work-{os.getpid()}"  # absolute, because a driver may change the working folder

    @contextmanager
    def working(self) -> Iterator[Path]:
        """Create the working folder, and remove it at the end; also remove those of killed campaigns.

        Raises:
            ForeseeError: another process writes into the campaign's folder.
            OSError: the folder cannot be created or written to.
        """
        with only_writer(self.out):
            for left in self.out.glob(".work-*"):
                shutil.rmtree(left, ignore_errors=True)
            for part in PARTS:
                (self.work / part).mkdir(parents=True)
            try:
                yield self.work
            finally:
                shutil.rmtree(self.work, ignore_errors=True)

    @Part.FOLDER.measured
    def publish(self, result: CampaignResult, traces: Mapping[str, tuple[str, str]], blobs: Blobs) -> None:
        """Write the failures (as found and minimised), the traces and `campaign.json`; then move all of them into
        place.

        `traces`: blob by file, with the test case's id if the trace has another one.
        """
        for clip in result.clips:
            if clip.written:
                self._write(clip.file, clip.text)
            for child in clip.written:
                self._write(child.file, child.text)
        for small in result.minimised:
            self._write(f"{small.folder}/{small.clip}.foresee", small.clip_text)
            self._write(f"{small.folder}/{small.child.name}.foresee", small.child.text)
        for file, (name, test_case) in traces.items():
            self._show(file, name, test_case, blobs)
        document = as_text(campaign_document(result))
        self._write("campaign.json", document)
        for part in (*PARTS, "campaign.json"):
            self._put_in_place(part)
        if not result.interrupted:
            append_campaign(self.out, result, document)

    def _put_in_place(self, part: str) -> None:
        """Replace an old part of the folder by the finished new one; the old one is deleted with the working folder."""
        old = self.out / part
        if old.is_dir():
            old.replace(self.work / f"old-{part}")
        (self.work / part).replace(old)

    def _show(self, file: str, name: str, test_case: str, blobs: Blobs) -> None:
        """Add a trace to the folder: a hard link to the store's file if possible, otherwise a copy."""
        source, target = blobs.path(name), self.work / file
        target.parent.mkdir(parents=True, exist_ok=True)
        if test_case:
            data = blobs.get(name)
            if data is not None:
                target.write_bytes(trace_of(data, test_case))
            return
        try:
            os.link(source, target)
        except OSError:
            shutil.copyfile(source, target)

    def _write(self, name: str, text: str) -> None:
        """Write a file; if the old one has the same content, link it, because a new file takes a millisecond."""
        file, old, data = self.work / name, self.out / name, text.encode()
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            if old.read_bytes() == data:
                os.link(old, file)
                return
        except OSError:
            pass  # there is no old file, or the disk does not have hard links
        file.write_bytes(data)


def campaign_document(result: CampaignResult) -> dict[str, Any]:
    """Return the contents of `campaign.json`."""
    return {"schema": 1, "document": "campaign", **plain(result)}


def as_text(campaign: Mapping[str, Any]) -> str:
    """Return the contents of `campaign.json` as JSON, one line per test case, clip and mutant.

    `json.dumps` with indentation is pure Python: for 34,000 mutants it would take seconds.
    """
    parts = []
    for name, value in campaign.items():
        if name == "clip_runs":
            parts.append(f'  "{name}": {_listed([_clip_text(clip) for clip in value], 2)}')
        elif isinstance(value, list):
            parts.append(f'  "{name}": {_listed([json.dumps(item) for item in value], 2)}')
        else:
            parts.append(f'  "{name}": {json.dumps(value)}')
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _clip_text(clip: Mapping[str, Any]) -> str:
    children = _listed([json.dumps(child) for child in clip["children"]], 4)
    own = json.dumps({name: value for name, value in clip.items() if name != "children"})
    return f'{own[:-1]}, "children": {children}}}'


def _listed(items: list[str], depth: int) -> str:
    """Return a JSON list with one item per line."""
    inner, outer = " " * (depth + 2), " " * depth
    return "[" + ",".join(f"\n{inner}{item}" for item in items) + f"\n{outer}]" if items else "[]"
