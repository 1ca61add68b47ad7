"""The checker of ASAM for OpenSCENARIO: it exits with 0 whatever it finds, so its report is read."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest

_CONFIG = """<?xml version="1.0" encoding="UTF-8"?>
<Config>
  <Param name="InputFile" value="{file}"/>
  <CheckerBundle application="xoscBundle"><Param name="resultFile" value="{report}"/></CheckerBundle>
</Config>
"""


def issues(file: Path, folder: Path) -> list[str]:
    """Return the checker's complaints; skip the test if the checker is not installed."""
    if find_spec("qc_openscenario") is None:
        pytest.skip("the package asam-qc-openscenarioxml is not installed")
    config, report = folder / "config.xml", folder / "report.xqar"
    config.write_text(_CONFIG.format(file=file.resolve(), report=report.resolve()))
    command = [sys.executable, "-m", "qc_openscenario.main", "-c", str(config.resolve())]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    root = ElementTree.parse(report).getroot()
    checkers = root.findall(".//Checker")
    assert len(checkers) > 10, "the checker has looked at nothing"
    broken = [f"{c.get('checkerId')}: {c.get('status')}" for c in checkers if c.get("status") == "error"]
    return broken + [f"{i.get('issueId')} {i.get('description')}" for i in root.iter("Issue")]
