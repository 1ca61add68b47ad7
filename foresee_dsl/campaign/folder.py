"""A campaign's folder: written beside the old one, put in its place only when whole."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from foresee_dsl.campaign.results import CampaignResult

_PARTS = ("children", "traces")


class CampaignFolder:
    """`campaign.json`, `children/` (clips and mutants that failed) and `traces/` under one folder.

    While a campaign runs, its files gather in `.work-PID` inside; nothing of an earlier campaign is touched until the
    end.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self._work = out / f".work-{os.getpid()}"

    @contextmanager
    def working(self) -> Iterator[Path]:
        """Make the folder where files gather, and remove it at the end.

        Raises:
            OSError: the folder cannot be made or written to.
        """
        self.out.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(self._work, ignore_errors=True)
        for part in _PARTS:
            (self._work / part).mkdir(parents=True)
        try:
            yield self._work
        finally:
            shutil.rmtree(self._work, ignore_errors=True)

    def publish(self, result: CampaignResult) -> None:
        """Write the children that failed, with their clips, and `campaign.json`; then put all in place."""
        for clip in result.clips:
            if clip.failing:
                self._write(clip.file, clip.text)
            for child in clip.failing:
                self._write(child.file, child.text)
        self._write("campaign.json", json.dumps(result.as_dict(), indent=2) + "\n")
        for part in _PARTS:
            shutil.rmtree(self.out / part, ignore_errors=True)
            (self._work / part).replace(self.out / part)
        (self._work / "campaign.json").replace(self.out / "campaign.json")

    def _write(self, name: str, text: str) -> None:
        file = self._work / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8", newline="\n")
