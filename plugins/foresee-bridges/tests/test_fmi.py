"""FMUs as drivers: FMI 3 and 2, their variables, their names, and what is wrong with an FMU."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("fmpy", reason="the extra `fmi` is not installed")
pytest.importorskip("pythonfmu3", reason="pythonfmu3, which makes the FMUs of these tests, is not installed")

import fmpy
from foresee_bridges.fmi import variables
from foresee_bridges.fmi.driver import FmuDriver
from foresee_bridges.fmi.instance import FmuFile
from foresee_bridges.fmi.variables import INPUTS, OUTPUTS, PARAMETERS, SERIES, InputValues, Variable
from foresee_bridges.fmi.wiring import Names, wire
from pythonfmu3 import FmuBuilder

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.drivers import consent
from foresee_dsl.drivers.protocol import EgoState, JunctionPassage, Mission, Observation, SeenActor, VehicleLimits
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case

CASE = f"{data_folder('scenarios') / 'scenario3.foresee'}::r01"
DOCS = Path(__file__).parents[3] / "docs"
CAR = VehicleLimits("car.sedan", 4.6, 1.8, 2.8, 0.9, 50.0, 3.0, 4.0, 8.0, 0.6, 0.5)


def built(folder: Path, source: str, name: str) -> Path:
    """Build the FMU of the class `name` in this Python text."""
    script = folder / f"{name.lower()}_source.py"
    script.write_text(source)
    FmuBuilder.build_FMU(script, dest=folder)
    return folder / f"{name}.fmu"


@pytest.fixture(scope="module")
def keeper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    source = (DOCS / "examples" / "fmu_driver.py").read_text()
    return built(tmp_path_factory.mktemp("fmu"), source, "KeepingDriver")


def other(folder: Path, name: str, *, inputs: dict[str, str] | None = None, step: str = "pass", size: int = 0) -> Path:
    """Build an FMU with these inputs (`attribute: variable`), outputs of the driver, and lines of `do_step`."""
    dimensions = f", dimensions=[Dimension(start='{size}')]" if size else ""
    lines = [
        f"        self.{attribute} = {f'np.zeros({size})' if size else 0.0}\n"
        f"        self.register_variable(Float64({variable!r}, causality=Fmi3Causality.input, "
        f"getter=lambda: self.{attribute}, setter=lambda value: setattr(self, {attribute!r}, value){dimensions}))\n"
        for attribute, variable in (inputs or {}).items()
    ]
    outputs = "".join(
        f"        self.register_variable(Float64('control.{name}', causality=Fmi3Causality.output, "
        f"getter=lambda: self.{name}))\n"
        for name in ("steer", "throttle", "brake")
    )
    text = (
        "import numpy as np\n"
        "from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave\n\n\n"
        f"class {name}(Fmi3Slave):\n    def __init__(self, **kwargs):\n        super().__init__(**kwargs)\n"
        f"        self.steer = self.throttle = self.brake = 0.0\n{''.join(lines)}{outputs}\n"
        f"    def do_step(self, time, step):\n        {step}\n        return True\n"
    )
    return built(folder, text, name)


def observation(ego: EgoState, *actors: SeenActor, time_s: float = 0.0, **signals: str) -> Observation:
    return Observation(time_s, ego, actors, dict(signals), measured_s=time_s - 0.1)


def straight(start_m: float = 50.0, length_m: float = 200.0) -> Mission:
    """A mission along the x axis with a signal at 100 m and a lower limit from 150 m on."""
    s = np.arange(0.0, length_m + 1)
    limits = np.where(s < 150, 14.0, 6.0)
    junction = JunctionPassage("j", 100.0, 120.0, "straight", "j:1")
    half = np.full(len(s), 1.75)
    return Mission(np.stack([s, np.zeros(len(s))], axis=1), s, limits, half, half, start_m, 190.0, (junction,))


def test_an_fmu_drives_and_leaves_nothing_behind(keeper: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    address = f"fmi:{keeper}"
    with pytest.raises(DriverError, match="is a program, which starts only with your consent"):
        load_driver(address)
    consent.allow(address)
    result = run_test_case(load_test_case(CASE), driver=address, seed=0)
    assert (result.verdict.value, result.notes.traceback) == ("pass", "")
    assert not list(tmp_path.glob("foresee-fmu-*"))
    environment = os.environ | {"PYTHONHASHSEED": "1"}
    command = [sys.executable, "-m", "foresee_dsl", "run", CASE, "--driver", address, "--json"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert result.trace.digest in done.stdout, done.stdout + done.stderr


def test_inputs_of_a_straight_road() -> None:
    values = InputValues(straight(), CAR).at(
        observation(
            EgoState(51.4, 1.0, 0.1, 10.0, 0.5, 0.02, 0.05),
            SeenActor(7, "pedestrian", 90.0, 10.0, math.pi / 2, 1.5, 0.5, 0.6),
            SeenActor(3, "car", 80.0, 0.2, 0.0, 8.0, 4.0, 1.8),
            **{"j:1": "red"},
        )
    )
    axle = (51.4 - 1.4 * math.cos(0.1), 1.0 - 1.4 * math.sin(0.1))
    assert {name for name in values if name not in SERIES} == set(INPUTS)
    expected = {
        "host_vehicle_data.vehicle_motion.position.x": axle[0],
        "host_vehicle_data.vehicle_motion.velocity.x": 10.0,
        "host_vehicle_data.vehicle_motion.current_curvature": math.tan(0.05) / 2.8,
        "sensor.delay": 0.1,
        "route.lateral_deviation": axle[1],
        "route.heading_deviation": 0.1,
        "route.curvature": 0.0,
        "route.speed_limit": 14.0,
        "route.bend_speed": 14.0,
        "route.speed_error": 4.0,
        "route.stop_distance": 100.0 - axle[0] - 3.7,
        "route.goal_distance": 190.0 - axle[0] - 1.4,
        "route.signal.color": 2.0,
        "lead.distance": 80.0 - 2.0 - axle[0] - 3.7,
        "lead.speed": 8.0,
        "number_of_moving_objects": 2.0,
    }
    assert {name: values[name] for name in expected} == pytest.approx(expected)
    assert values["moving_object.header.tracking_id"].tolist() == [3.0, 7.0]
    assert values["moving_object.candidate.type"].tolist() == [2.0, 3.0]
    first = [values[f"moving_object.base.{name}"][0] for name in ("position.x", "velocity.x", "velocity.y")]
    dx, dy = 80.0 - axle[0], 0.2 - axle[1]
    ahead = (dx * math.cos(0.1) + dy * math.sin(0.1), 8 * math.cos(0.1) - 10, -8 * math.sin(0.1))
    assert first == pytest.approx(ahead)
    look = [float(values[f"route.look_ahead.{axis}"]) for axis in "xy"]
    assert math.hypot(look[0], look[1]) == pytest.approx(math.hypot(10.0, axis_gap := axle[1])) and axis_gap > 0
    curvature = 2 * look[1] / (look[0] ** 2 + look[1] ** 2)
    assert values["route.steering_angle"] == pytest.approx(math.atan(2.8 * curvature)) and curvature < 0


def test_bends_and_lower_limits_ahead_lower_the_speed() -> None:
    inputs = InputValues(straight(100.0), CAR)
    speeds = [
        float(inputs.at(observation(EgoState(x + 1.4, 0, 0, 6, 0, 0, 0)))["route.bend_speed"])
        for x in (100, 109, 125, 140, 151)
    ]
    assert speeds == pytest.approx([14.0, 14.0, math.sqrt(36 + 100), math.sqrt(36 + 40), 6.0], abs=0.01)
    angles = np.linspace(0, math.pi, 90)
    bend = 30 * np.stack([np.sin(angles), 1 - np.cos(angles)], axis=1)
    s = 30 * angles
    half = np.full(90, 2.0)
    mission = Mission(bend, s, np.full(90, 20.0), half, half, float(s[40]), 80.0)
    values = InputValues(mission, CAR).at(observation(EgoState(*bend[45], math.pi / 2, 8, 0, 0, 0)))
    assert values["route.curvature"] == pytest.approx(1 / 30, rel=0.03)
    assert values["route.bend_speed"] == pytest.approx(math.sqrt(variables.BEND_MPS2 * 30), rel=0.02)


def test_arrays_and_their_elements_reach_the_fmu(tmp_path: Path) -> None:
    names = {"xs": "moving_object.base.position.x"}
    fmu = other(tmp_path, "Arrays", inputs=names, step="self.steer, self.brake = self.xs[0] / 1000, self.xs[2]", size=3)
    driver = FmuDriver.from_argument(str(fmu))
    actors = [SeenActor(k, "car", 60.0 + 10 * k, 0.0, 0.0, 5.0, 4.0, 1.8) for k in range(1, 3)]
    seen = observation(EgoState(51.4, 0, 0, 10, 0, 0, 0), *actors)
    driver.reset(straight(), CAR, 0)
    assert driver.step(seen).steer == pytest.approx(0.02) and driver.step(seen).brake == 0.0
    driver.close()
    fmu = other(
        tmp_path, "Element", inputs={"x": "moving_object[2].base.position.x"}, step="self.steer = self.x / 1000"
    )
    driver = FmuDriver.from_argument(str(fmu))
    driver.reset(straight(), CAR, 0)
    assert driver.step(seen).steer == pytest.approx(0.03)
    driver.close()
    with pytest.raises(DriverError, match="stepped before reset"):
        driver.step(seen)


def test_an_fmu_with_other_names_is_wired_by_a_file(tmp_path: Path) -> None:
    source = (DOCS / "examples" / "fmu_driver.py").read_text()
    for ours, theirs in (("route.steering_angle", "delta_ref"), ("control.acceleration", "a_cmd")):
        source = source.replace(f'"{ours}"', f'"{theirs}"')
    built(tmp_path, source, "KeepingDriver")
    with pytest.raises(DriverError, match="that this tool does not know: delta_ref"):
        FmuDriver.from_argument(str(tmp_path / "KeepingDriver.fmu"))
    rows = [f'"{name}" = "{name}"' for name in ("route.bend_speed", "host_vehicle_data.vehicle_motion.velocity.x")]
    names = tmp_path / "names.toml"
    names.write_text(
        'fmu = "KeepingDriver.fmu"\n[inputs]\n"route.steering_angle" = "delta_ref"\n' + "\n".join(rows) + "\n"
        '[outputs]\n"control.steering_angle" = "control.steering_angle"\n"control.acceleration" = "a_cmd"\n'
        "[start]\n" + '"lead.distance" = 200\n'
    )
    driver = FmuDriver.from_argument(str(names))
    driver.reset(straight(), CAR, 0)
    control = driver.step(observation(EgoState(51.4, -1.0, 0, 10, 0, 0, 0)))
    driver.close()
    assert control.steer > 0 and control.throttle == pytest.approx(2.0 / 3.0)


def test_an_fmu_of_fmi_2_drives(tmp_path: Path) -> None:
    pythonfmu = pytest.importorskip("pythonfmu", reason="pythonfmu makes the FMU of this test")
    script = tmp_path / "second.py"
    script.write_text(
        "from pythonfmu import Fmi2Causality, Fmi2Slave, Real\n\n\nclass Second(Fmi2Slave):\n"
        "    def __init__(self, **kwargs):\n        super().__init__(**kwargs)\n"
        "        self.error = self.angle = self.pedals = self.x = 0.0\n"
        "        for name, attribute in (('route.speed_error', 'error'), ('route.steering_angle', 'angle'),\n"
        "                                ('moving_object[1].base.position.x', 'x')):\n"
        "            self.register_variable(Real(name, causality=Fmi2Causality.input,\n"
        "                getter=lambda a=attribute: getattr(self, a),\n"
        "                setter=lambda v, a=attribute: setattr(self, a, v)))\n"
        "        self.register_variable(Real('control.steering_angle', causality=Fmi2Causality.output,\n"
        "            getter=lambda: self.angle))\n"
        "        self.register_variable(Real('control.acceleration', causality=Fmi2Causality.output,\n"
        "            getter=lambda: self.error - 0.1 * self.x))\n\n"
        "    def do_step(self, time, step):\n        return True\n"
    )
    pythonfmu.FmuBuilder.build_FMU(script, dest=tmp_path)
    driver = FmuDriver.from_argument(str(tmp_path / "Second.fmu"))
    driver.reset(straight(), CAR, 0)
    control = driver.step(observation(EgoState(51.4, 0, 0, 10, 0, 0, 0), SeenActor(1, "car", 110, 0, 0, 5.0, 4.0, 1.8)))
    hard = driver.step(observation(EgoState(51.4, 0, 0, 90, 0, 0, 0), time_s=0.05))
    driver.close()
    assert (control.steer, control.throttle, control.brake) == pytest.approx((0.0, 0.0, 2.0 / 8.0))
    assert hard.brake == 1.0  # more braking than there is


def test_an_fmu_that_fails_is_a_crash_of_the_driver(tmp_path: Path) -> None:
    address = f"fmi:{other(tmp_path, 'Failing', step='raise RuntimeError(repr(time))')}"
    consent.allow(address)
    result = run_test_case(load_test_case(CASE), driver=address, seed=0)
    assert result.verdict.value == "crash" and "the driver broke: the FMU failed: fmi3DoStep" in result.reason


def edited(fmu: Path, file: Path, edit) -> Path:
    """Copy an FMU with each file `edit`ed: (name, content) to (name, content), or None to leave it out."""
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            entry = edit(name, old.read(name))
            if entry is not None:
                new.writestr(*entry)
    return file


def test_what_is_wrong_with_an_fmu_is_said(keeper: Path, tmp_path: Path) -> None:
    def described(old: str, new: str):
        return lambda name, data: (name, data.replace(old.encode(), new.encode()) if name.endswith(".xml") else data)

    text = tmp_path / "text.fmu"
    text.write_text("no archive")
    empty = edited(keeper, tmp_path / "empty.fmu", lambda name, data: None if name.endswith(".xml") else (name, data))
    outside = edited(keeper, tmp_path / "outside.fmu", lambda n, d: (f"../{n}" if n.endswith(".dll") else n, d))
    elsewhere = edited(keeper, tmp_path / "else.fmu", lambda name, d: None if "linux" in name else (name, d))
    old = edited(keeper, tmp_path / "old.fmu", described('fmiVersion="3.0"', 'fmiVersion="1.0"'))
    exchange = edited(keeper, tmp_path / "exchange.fmu", described("CoSimulation", "ModelExchange"))
    unknown = edited(keeper, tmp_path / "unknown.fmu", described("route.steering_angle", "route.steering_angel"))
    idle = edited(keeper, tmp_path / "idle.fmu", described("control.acceleration", "control.acc"))
    toml = tmp_path / "names.toml"
    toml.write_text('fmu = "old.fmu"\nnames = 3\n')
    for argument, message in (
        (tmp_path / "none.fmu", "none.fmu cannot be read: No such file"),
        (tmp_path / "none.zip", "is not an FMU; write fmi:FILE.fmu"),
        (text, "it is not a ZIP archive"),
        (empty, "it has no modelDescription.xml"),
        (outside, "paths that lead out of it: '../binaries"),
        (elsewhere, r"has no binary for this platform \(.*\); it has win64"),
        (exchange, "is not for co-simulation"),
        (unknown, "does not know: route.steering_angel; did you mean 'route.steering_angle'"),
        (idle, "needs one of .*, and either control.acceleration"),
        (toml, "unknown: names"),
    ):
        with pytest.raises(DriverError, match=message):
            FmuDriver.from_argument(str(argument))
    with pytest.raises(DriverError, match=r"old.fmu (is an FMU of FMI 1.0|is not an FMU that fmpy can read)"):
        FmuDriver.from_argument(str(old))
    shaped = fmpy.read_model_description(str(keeper)).modelVariables
    for variable in shaped:
        variable.shape = (4,) if variable.name == "lead.distance" else variable.shape
    with pytest.raises(DriverError, match=r"lead.distance has the shape \[4\]"):
        wire(shaped, Names(keeper), "fmi:x")


def test_an_fmu_larger_than_the_limit_is_refused(keeper: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_LIMITS", "file=0.5")
    with pytest.raises(DriverError, match=r"MB unpacked; .*--limit file="):
        FmuFile(edited(keeper, keeper.with_name("large.fmu"), lambda name, data: (name, data)))


def table(title: str, rows: dict[str, Variable]) -> str:
    lines = [f"| {title} | unit | meaning |", "| --- | --- | --- |"]
    return "\n".join([*lines, *(f"| `{name}` | {row.unit} | {row.meaning} |" for name, row in rows.items())])


def test_the_page_lists_all_variables() -> None:
    tables = {
        "input": INPUTS, "array": SERIES, "parameter or input": PARAMETERS, "output": OUTPUTS,
    }  # fmt: skip
    wanted = "\n\n".join(table(title, dict(rows)) for title, rows in tables.items())
    page = (DOCS / "guide" / "fmi.md").read_text()
    assert wanted in page, wanted
