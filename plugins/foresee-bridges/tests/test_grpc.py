"""Policies behind alpasim's gRPC service as drivers: the reference policies of carla-driver-interface, unmodified."""

from __future__ import annotations

import gc
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("carla_driver_interface", reason="the extra `grpc` is not installed")

from carla_driver_interface.driver import BaseDriver, DriveContext, DriveResult
from carla_driver_interface.geometry import Pose
from carla_driver_interface.geometry import Trajectory as Plan
from carla_driver_interface.policies.route_follower import RouteFollowerPolicy
from carla_driver_interface.protocol import TrafficLightState
from carla_driver_interface.server import build_server, serving
from foresee_bridges.grpc.driver import PolicyServerDriver

from foresee_dsl.campaign import conformance
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.drivers import consent
from foresee_dsl.drivers.protocol import (
    EgoState,
    JunctionPassage,
    Mission,
    Observation,
    SeenActor,
    Trajectory,
    VehicleLimits,
)
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError, DriverLateError
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case

CASE = f"{data_folder('scenarios') / 'scenario3.foresee'}::r01"
SERVER = """
import sys

from carla_driver_interface.policies.route_follower import RouteFollowerPolicy
from carla_driver_interface.server import serving

with serving(RouteFollowerPolicy(), port=0, host="127.0.0.1") as port:
    print(port, flush=True)
    sys.stdin.read()
"""
CAR = VehicleLimits("car.sedan", 4.6, 1.8, 2.8, 0.9, 50.0, 3.0, 4.0, 8.0, 0.6, 0.5)


@pytest.fixture(scope="module", autouse=True)
def _nothing_left_behind() -> None:
    """Collect the garbage of earlier tests here: a thread of a server that collected it ended the process (SIGSEGV)."""
    gc.collect()


@pytest.fixture(scope="module")
def follower() -> Iterator[str]:
    """The address of the package's own route follower, in a process of its own as users run it."""
    with subprocess.Popen(
        [sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:
        assert server.stdin is not None and server.stdout is not None
        yield f"grpc:127.0.0.1:{int(server.stdout.readline())}"
        server.stdin.close()


class Recorded(BaseDriver):
    """A policy that keeps what it gets, and answers with the lines of a function."""

    name = "recorded"

    def __init__(self, answer=lambda _: Plan.empty(), ends: bool = False, cameras: bool = False) -> None:
        self.contexts: list[DriveContext] = []
        self._answer, self._ends, self._cameras = answer, ends, cameras

    def on_session_start(self, session) -> None:
        if self._cameras and not session.cameras:
            raise ValueError("this policy needs a camera")

    def drive(self, ctx: DriveContext) -> DriveResult:
        self.contexts.append(ctx)
        return DriveResult(trajectory_in_rig=self._answer(ctx), terminate_session=self._ends)


def mission() -> Mission:
    s = np.arange(0.0, 201.0)
    half = np.full(len(s), 1.75)
    junction = JunctionPassage("j", 100.0, 120.0, "straight", "j:1")
    return Mission(
        np.stack([s, np.zeros(len(s))], axis=1), s, np.full(len(s), 14.0), half, half, 50.0, 190.0, (junction,)
    )


def seen(time_s: float = 0.0) -> Observation:
    actor = SeenActor(7, "pedestrian", 80.0, 5.0, math.pi / 2, 1.5, 0.5, 0.6)
    return Observation(time_s, EgoState(51.4, 1.0, 0.1, 10.0, 0.5, 0.02, 0.05), (actor,), {"j:1": "red"}, time_s)


def test_the_packages_route_follower_drives_the_same_in_two_processes(follower: str) -> None:
    with pytest.raises(DriverError, match="is a program, which starts only with your consent"):
        load_driver(follower)
    consent.allow(follower)
    assert load_driver(follower).version.startswith("route_follower-carla-driver-interface-2")
    result = run_test_case(load_test_case(CASE), driver=follower, seed=0)
    assert (result.verdict.value, result.notes.traceback) == ("pass", "")
    environment = os.environ | {"PYTHONHASHSEED": "1"}
    command = [sys.executable, "-m", "foresee_dsl", "run", CASE, "--driver", follower, "--json"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert result.trace.digest in done.stdout, done.stdout + done.stderr


def test_the_route_follower_keeps_to_bends(follower: str) -> None:
    """Its plans begin on the route, beside the ego: the way from the ego to the first point is no part of the plan."""
    consent.allow(follower)
    case = Path(conformance.__file__).parent / "cases" / "02_two_bends.foresee"
    result = run_test_case(load_test_case(str(case)), driver=follower, seed=0)
    assert (result.verdict.value, result.reason.partition(" at ")[0]) == ("pass", "arrived")


def test_a_policy_gets_the_ego_the_route_and_what_is_seen() -> None:
    policy = Recorded()
    with serving(policy, port=0, host="127.0.0.1") as port:
        driver = PolicyServerDriver.from_argument(f"127.0.0.1:{port}")
        driver.reset(mission(), CAR, 5)
        answers = [driver.step(seen(time_s)) for time_s in (0.0, 0.05, 0.1)]
        session = policy.contexts[0].session
        assert len(policy.contexts) == 2 and session.seed == 5  # a plan each 0.1 s
        driver.close()
    assert all(answer.brake == 0.5 for answer in answers)  # an empty plan: the ego shall stop
    axle = (51.4 - 1.4 * math.cos(0.1), 1.0 - 1.4 * math.sin(0.1))
    pose = session.ego_trajectory.poses[0]
    assert (*pose.position[:2], pose.yaw) == pytest.approx((*axle, 0.1))
    assert session.ego_trajectory.timestamps_us == [0, 50_000, 100_000]
    assert session.speed_mps() == pytest.approx(10.0, rel=1e-6)
    local = pose.transform_points(session.route_waypoints_in_rig)
    assert local[0, :2] == pytest.approx((axle[0], 0.0), abs=1e-4) and np.abs(local[:, 1]).max() < 1e-4
    assert np.diff(local[:, 0]) == pytest.approx(2.0, abs=1e-4) and len(local) == 50
    data = policy.contexts[0].renderer_data
    assert data.ego_traffic_light == TrafficLightState.TRAFFIC_LIGHT_STATE_RED
    assert data.ego_traffic_light_distance_m == pytest.approx(100.0 - axle[0] - 1.4, abs=1e-4)
    assert data.speed_limit_mps == pytest.approx(14.0)
    (actor,) = data.actors
    assert (actor.track_id, actor.type_id, actor.aabb.size_x) == ("7", "walker.pedestrian", 0.5)
    assert actor.dynamic_state.linear_velocity.y == pytest.approx(1.5)


def test_a_plan_of_the_rear_axle_becomes_one_of_the_centre() -> None:
    def ahead(ctx: DriveContext) -> Plan:
        plan = Plan.empty()
        for k in range(1, 11):
            plan.append(ctx.time_now_us + k * 100_000, Pose.from_xyz_yaw(1.0 * k, 0.0, 0.0, 0.0))
        return plan

    with serving(Recorded(ahead), port=0, host="127.0.0.1") as port:
        driver = PolicyServerDriver.from_argument(f"127.0.0.1:{port}")
        driver.reset(mission(), CAR, 0)
        answer = driver.step(seen())
        assert driver.step(seen(0.05)) is answer
        driver.close()
    assert isinstance(answer, Trajectory) and answer.heading_rad == pytest.approx([0.1] * 11)
    assert answer.time_s == pytest.approx(np.arange(11) / 10)
    assert answer.points[0] == pytest.approx((51.4, 1.0))
    assert answer.points[10] == pytest.approx((51.4 + 10 * math.cos(0.1), 1.0 + 10 * math.sin(0.1)))


def test_what_goes_wrong_with_a_server_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DriverError, match="is not the address of a server; write grpc:HOST:PORT"):
        PolicyServerDriver.from_argument("localhost")
    with pytest.raises(DriverError, match="no server answers; start one, such as `carla-driver-interface serve"):
        PolicyServerDriver.from_argument("127.0.0.1:1")
    server, port = build_server(Recorded(), port=0, host="127.0.0.1")
    server.start()
    driver = PolicyServerDriver.from_argument(f"127.0.0.1:{port}")
    driver.reset(mission(), CAR, 0)
    driver.step(seen())
    server.stop(grace=None).wait()
    with pytest.raises(DriverError, match="the server ended"):
        driver.step(seen(0.05))
    with pytest.raises(DriverError, match="stepped before reset, or after its session ended"):
        driver.step(seen(0.1))
    with serving(Recorded(ends=True), port=0, host="127.0.0.1") as port:
        driver = PolicyServerDriver.from_argument(f"127.0.0.1:{port}")
        driver.reset(mission(), CAR, 0)
        with pytest.raises(DriverError, match="the policy ended the session at 0 s"):
            driver.step(seen())
        driver.close()
    with serving(Recorded(cameras=True), port=0, host="127.0.0.1") as port:
        driver = PolicyServerDriver.from_argument(f"127.0.0.1:{port}")
        with pytest.raises(DriverError, match="FAILED_PRECONDITION: recorded: this policy needs a camera"):
            driver.reset(mission(), CAR, 0)
    monkeypatch.setenv("FORESEE_STEP_DEADLINE_S", "0.2")
    wait = threading.Event()

    def slowly(_: DriveContext) -> Plan:
        wait.wait(2.0)
        return Plan.empty()

    with serving(Recorded(slowly), port=0, host="127.0.0.1") as port:
        driver = PolicyServerDriver.from_argument(f"127.0.0.1:{port}")
        driver.reset(mission(), CAR, 0)
        began = time.monotonic()
        with pytest.raises(DriverLateError, match=r"did not answer within 0.2 s"):
            driver.step(seen())
        assert time.monotonic() - began < 2.0
        wait.set()


class Dying(RouteFollowerPolicy):
    """The route follower, whose server ends at its twentieth plan."""

    def drive(self, ctx: DriveContext) -> DriveResult:
        if ctx.session.drive_count == 20:
            threading.Thread(target=self.server.stop, args=(None,)).start()
        return super().drive(ctx)


def test_a_server_that_dies_is_a_crash_of_the_driver() -> None:
    policy = Dying()
    policy.server, port = build_server(policy, port=0, host="127.0.0.1")
    policy.server.start()
    address = f"grpc:127.0.0.1:{port}"
    consent.allow(address)
    result = run_test_case(load_test_case(CASE), driver=address, seed=0)
    policy.server.wait_for_termination()
    assert result.verdict.value == "crash" and result.duration_s >= 1.9
    assert f"the driver broke: {address}: the server" in result.reason
