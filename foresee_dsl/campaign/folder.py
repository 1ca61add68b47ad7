"""A campaign's folder: written beside the old one, put in its place only when whole."""

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
from foresee_dsl.documents import plain
from foresee_dsl.measuring import Part

_PARTS = ("children", "findings", "traces")


class CampaignFolder:
    """`campaign.json`, `children/` (clips and mutants that failed), `findings/` (one of each kind, made smaller) and
    `traces/` under one folder.

    While a campaign runs, its files gather in `.work-PID` inside; nothing of an earlier campaign is touched until the
    end.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self.work = out.absolute() / f".work-{os.getpid()}"  # workers read there, whatever folder a driver goes to

    @contextmanager
    def working(self) -> Iterator[Path]:
        """Make the folder where files gather, and remove it at the end; also what killed campaigns left.

        Raises:
            ForeseeError: another process writes into the campaign's folder.
            OSError: the folder cannot be made or written to.
        """
        with only_writer(self.out, "--out"):
            for left in self.out.glob(".work-*"):
                shutil.rmtree(left, ignore_errors=True)
            for part in _PARTS:
                (self.work / part).mkdir(parents=True)
            try:
                yield self.work
            finally:
                shutil.rmtree(self.work, ignore_errors=True)

    @Part.FOLDER.measured
    def publish(self, result: CampaignResult, traces: Mapping[str, tuple[str, str]], blobs: Blobs) -> None:
        """Write what failed, as it was found and made smaller, the traces, and `campaign.json`; put all in place.

        `traces`: by file, the blob's name, and the test case's id where the trace has another one.
        """
        for clip in result.clips:
            if clip.failing:
                self._write(clip.file, clip.text)
            for child in clip.failing:
                self._write(child.file, child.text)
        for small in result.minimised:
            self._write(f"{small.folder}/{small.clip}.foresee", small.clip_text)
            self._write(f"{small.folder}/{small.child.name}.foresee", small.child.text)
        for file, (name, test_case) in traces.items():
            self._show(file, name, test_case, blobs)
        self._write("campaign.json", as_text(campaign_document(result)))
        for part in (*_PARTS, "campaign.json"):
            self._put_in_place(part)

    def _put_in_place(self, part: str) -> None:
        """Put a finished part where the old one is; the old one is deleted with the working folder."""
        old = self.out / part
        if old.is_dir():
            old.replace(self.work / f"old-{part}")
        (self.work / part).replace(old)

    def _show(self, file: str, name: str, test_case: str, blobs: Blobs) -> None:
        """Put a trace into the folder: the store's own file where the disk can give it a second name."""
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
        """Write a file; one that is there with the same content is taken over, as a new one costs a millisecond."""
        file, old, data = self.work / name, self.out / name, text.encode()
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            if old.read_bytes() == data:
                os.link(old, file)
                return
        except OSError:
            pass  # it is not there, or the disk gives no file a second name
        file.write_bytes(data)


def campaign_document(result: CampaignResult) -> dict[str, Any]:
    """Return what `campaign.json` holds."""
    return {"schema": 1, "document": "campaign", **plain(result)}


def as_text(campaign: Mapping[str, Any]) -> str:
    """Return what `campaign.json` holds as JSON, a line for each test case, clip and child.

    Python's own indentation is written by Python itself: of 34,000 children it would take seconds.
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
    """Return a JSON list with an item a line."""
    inner, outer = " " * (depth + 2), " " * depth
    return "[" + ",".join(f"\n{inner}{item}" for item in items) + f"\n{outer}]" if items else "[]"
