"""Where the learned drivers' weights come from, what is wrong with them, and that they are part of what is stored."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from foresee_learned.session import network_of
from foresee_learned.weights import FOLDER_VARIABLE, SUMS, checked, find_weights
from training.small_networks import write_networks

from foresee_dsl.campaign.keys import driver_identity
from foresee_dsl.drivers.registry import describe_drivers, find_driver, handover_of, load_driver
from foresee_dsl.errors import DriverError, DriverUnavailableError
from tests.support.command import program


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "weights"))
    return write_networks(tmp_path / "weights", sums=True)


def test_the_hash_is_in_the_version_and_in_the_keys(folder: Path) -> None:
    before = driver_identity("fusion")
    driver = load_driver("fusion")
    found = find_weights("fusion")
    assert getattr(driver, "weights_hash", "") == found.sha256
    assert driver.version == f"1 (weights {found.sha256[:8]})"
    assert found.sha256 in before
    write_networks(folder, speed_mps=5.0, sums=True)
    assert driver_identity("fusion") != before
    write_networks(folder, sums=True)
    assert driver_identity("fusion") == before


def test_a_flipped_byte_is_found(folder: Path) -> None:
    file = folder / "fusion_safe.onnx"
    whole = find_weights("fusion_safe")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    with pytest.raises(DriverError, match=r"fusion_safe\.onnx is not the file that was trained.*reinstall the package"):
        load_driver("fusion_safe")
    with pytest.raises(DriverError, match="not the file that was trained"):
        whole.content()  # it was whole when the driver was made
    row = next(d for d in describe_drivers() if d.name == "fusion_safe")
    assert (row.version, row.unavailable) == ("", False)
    done = subprocess.run(
        [program(), "run", "scenarios/scenario9.foresee::r01", "--driver", "fusion_safe"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (1, ""), "an error of the input, and nothing was simulated"
    assert re.match(
        r"error: \S+fusion_safe\.onnx is not the file that was trained.*export the file again\n$", done.stderr
    )


def test_half_a_file_that_no_sums_name_is_found_before_a_run(folder: Path) -> None:
    (folder / SUMS).unlink()
    file = folder / "fusion.onnx"
    find_driver("fusion")
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises(DriverError, match=r"fusion\.onnx is not a network that onnxruntime can read.*export it again"):
        find_driver("fusion")


def test_a_folder_of_ones_own_needs_no_sums_but_a_line_for_each_file_where_it_has_some(folder: Path) -> None:
    (folder / SUMS).unlink()
    assert network_of(find_weights("fusion"))
    with pytest.raises(FileNotFoundError):
        checked(folder / "fusion.onnx")
    (folder / SUMS).write_text("0123  other.onnx\n")
    with pytest.raises(DriverError, match=re.escape("has no line for fusion.onnx: write one with `sha256sum")):
        find_weights("fusion")


def test_without_weights_or_without_onnxruntime_it_says_what_to_do(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "fusion.onnx").unlink()
    with pytest.raises(DriverUnavailableError, match=f"has no weights.*set {FOLDER_VARIABLE} to a folder"):
        load_driver("fusion")
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(DriverUnavailableError, match=r"pip install 'foresee-dsl\[learned\]'"):
        load_driver("fusion_safe")
    rows = {d.name: d for d in describe_drivers()}
    assert rows["fusion"].unavailable
    assert "pip install 'foresee-dsl[learned]'" in rows["fusion_safe"].doc
    assert rows["pdm"].version


def test_nothing_of_onnxruntime_is_imported_before_a_driver_drives(folder: Path) -> None:
    code = (
        "import sys\nfrom foresee_dsl.drivers.registry import describe_drivers, load_driver\n"
        "assert all(d.version for d in describe_drivers() if d.name.startswith('fusion'))\nload_driver('fusion')\n"
        "print([name for name in sys.modules if name.startswith(('onnx', 'foresee_learned.session'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_they_ask_to_watch_for_a_second(folder: Path) -> None:
    assert handover_of(load_driver("fusion"), 4.0) == 1.0
    assert handover_of(load_driver("fusion_safe"), 0.5) == 0.5  # the clip has no room for more
    assert handover_of(load_driver("pdm"), 4.0) == 0.0
