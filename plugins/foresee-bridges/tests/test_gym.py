"""Test cases as environments of Gymnasium, and policies as drivers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import onnx
import pytest
from foresee_bridges import gym
from foresee_bridges.gym.driver import PolicyDriver
from foresee_bridges.gym.env import FAILURE, PER_METRE, Transition
from foresee_bridges.gym.observations import ROUTE_POINTS, ObjectList, control_of
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv
from onnx import TensorProto, helper, numpy_helper

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers import consent
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError, InputError, SimulationError
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.episode import Episode
from foresee_dsl.simulate.runner import run

CASE = f"{data_folder('scenarios') / 'scenario3.foresee'}::r01"
POLICY = """
import numpy as np

def act(observation):
    speed, left, limit = observation[0], observation[4], observation[5]
    ahead = observation[11:17].reshape(3, 2)
    return np.array([4 * ahead[1, 1] - 0.1 * left, 5 * (0.7 * limit - speed)])
"""


@pytest.fixture
def policy(tmp_path: Path) -> str:
    (tmp_path / "mine.py").write_text(POLICY)
    return f"gym:{tmp_path / 'mine.py'}:act"


def network(file: Path, width: int = ObjectList.SIZE) -> Path:
    """Write a policy that follows the route at half the limit: one linear layer."""
    weights = np.zeros((width, 2), dtype=np.float32)
    if width == ObjectList.SIZE:
        weights[14, 0], weights[0, 1], weights[5, 1] = 4.0, -5.0, 2.5
    nodes = [helper.make_node("MatMul", ["seen", "w"], ["action"])]
    graph = helper.make_graph(
        nodes, "policy",
        [helper.make_tensor_value_info("seen", TensorProto.FLOAT, [1, width])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, [1, 2])],
        [numpy_helper.from_array(weights, "w")],
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.save(model, str(file))
    return file


def driven(env: gymnasium.Env, act, **options: object) -> dict[str, object]:
    """Drive an episode to its end; return its info, with the sum of its rewards."""
    seen, _ = env.reset(options=options)
    total, ended = 0.0, False
    while not ended:
        seen, reward, terminated, truncated, info = env.step(act(seen))
        total, ended = total + reward, terminated or truncated
    return {**info, "return": total, "truncated": truncated}


def test_the_environment_passes_gymnasiums_own_check() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(CASE), skip_render_check=True)


def test_an_episode_gives_the_trace_of_a_run() -> None:
    bundle = compile_test_case(load_test_case(CASE))
    result = run(bundle, load_driver("pdm"), seed=3)
    driver, episode = load_driver("pdm"), Episode(bundle, seed=3)
    driver.reset(episode.mission, episode.vehicle, 3)
    while episode.result is None:
        episode.step(driver.step(episode.observation))
    assert episode.result.trace.digest == result.trace.digest
    assert (episode.result.verdict, episode.result.steps) == (result.verdict, result.steps)


def test_a_policy_drives_as_in_its_environment(policy: str, tmp_path: Path) -> None:
    consent.allow(policy)
    act = load_driver(policy)._policy
    info = driven(gym.make(CASE), act, run_seed=5)
    result = run_test_case(load_test_case(CASE), driver=policy, seed=5)
    assert (info["digest"], info["verdict"]) == (result.trace.digest, result.verdict.value)
    assert result.duration_s > 5 and info["margins"].keys() == {e.text for e in result.expectations}


@pytest.mark.parametrize("hash_seed", ["0", "1"])
def test_a_network_gives_the_same_trace_in_other_processes(tmp_path: Path, hash_seed: str) -> None:
    address = f"gym:{network(tmp_path / 'policy.onnx')}"
    consent.allow(address)
    here = run_test_case(load_test_case(CASE), driver=address, seed=0)
    environment = os.environ | {"PYTHONHASHSEED": hash_seed}
    command = [sys.executable, "-m", "foresee_dsl", "run", CASE, "--driver", address, "--json"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert here.trace.digest in done.stdout, done.stdout + done.stderr
    assert here.notes.traceback == "" and json.loads(done.stdout)


def test_the_reward_is_the_way_and_a_penalty_and_can_be_replaced() -> None:
    def stand(_: np.ndarray) -> np.ndarray:
        return np.array([0.0, -1.0])

    def ahead(_: np.ndarray) -> np.ndarray:
        return np.array([1.0, 1.0])

    standing = driven(gym.make(CASE), stand, run_seed=0)
    assert standing["truncated"] == (standing["verdict"] == "timeout")
    off = driven(gym.make(CASE), ahead, run_seed=0)
    assert off["verdict"] in {"F1", "F2", "F3", "F4"} and off["return"] < FAILURE + 20 * PER_METRE
    steps: list[Transition] = []

    def counted(transition: Transition) -> float:
        steps.append(transition)
        return 1.0

    assert driven(gym.make(CASE, reward=counted), ahead, run_seed=0)["return"] == len(steps)
    assert steps[-1].result is not None and steps[0].result is None
    assert sum(step.progress_m for step in steps) < 40


def test_a_reset_with_a_seed_repeats_case_and_run() -> None:
    env = gym.make(CASE.partition("::")[0])
    drawn = [env.reset(seed=7)[1], *(env.reset()[1] for _ in range(3))]
    assert drawn == [env.reset(seed=7)[1], *(env.reset()[1] for _ in range(3))]
    assert len({info["run_seed"] for info in drawn}) == 4 and len({info["case"] for info in drawn}) > 1
    assert env.reset(options={"case": "r02"})[1]["case"].endswith("::r02")
    with pytest.raises(ValueError, match=r"'r99' names no test case of this environment; name one of .*r01"):
        env.reset(options={"case": "r99"})
    with pytest.raises(ValueError, match="reset has no option 'cse'; its options are case and run_seed"):
        env.reset(options={"cse": "r01"})


def test_pictures_can_be_observed() -> None:
    env = gym.make(CASE, observation="birds_eye")
    seen, _ = env.reset(seed=0)
    assert seen in env.observation_space and seen.dtype == np.uint8 and seen.ndim == 3
    assert env.step(np.array([0.0, 1.0]))[0].any()


def test_environments_in_processes_of_their_own() -> None:
    envs = AsyncVectorEnv([lambda: gym.make(CASE)] * 2, context="spawn")
    try:
        seen, _ = envs.reset(seed=[1, 2])
        assert seen.shape == (2, ObjectList.SIZE)
        for _ in range(3):
            seen, *_ = envs.step(np.array([[0.0, 0.5], [0.0, -1.0]]))
        assert seen[0, 0] > seen[1, 0], "one accelerates, one brakes"
    finally:
        envs.close()


def test_two_environments_in_one_process_are_refused_clearly() -> None:
    first, second = gym.make(CASE), gym.make(CASE)
    first.reset()
    second.reset()
    second.step(np.zeros(2))
    with pytest.raises(SimulationError, match="give each episode a process of its own"):
        first.step(np.zeros(2))
    with pytest.raises(gymnasium.error.ResetNeeded):
        gym.make(CASE).step(np.zeros(2))


def test_the_vector_says_where_things_are() -> None:
    bundle = compile_test_case(load_test_case(CASE))
    episode = Episode(bundle)
    objects = ObjectList(episode.mission, episode.vehicle)
    place_s = objects.place(episode.observation)
    vector = objects.vector(episode.observation, place_s)
    assert vector[0] == pytest.approx(episode.observation.ego.speed_mps / 30, abs=1e-6)
    route = vector[11 : 11 + 2 * ROUTE_POINTS].reshape(-1, 2) * 80
    assert route[0] == pytest.approx((5, 0), abs=0.6), "the next point of the route is 5 m ahead"
    assert abs(place_s - episode.mission.start_s) < episode.vehicle.length_m / 2 + 1 and np.abs(vector).max() <= 1
    first = vector[11 + 2 * ROUTE_POINTS :][:3]
    if episode.observation.actors:
        assert first[0] == 1 and np.hypot(*first[1:]) * 80 == pytest.approx(
            min(np.hypot(a.x - episode.observation.ego.x, a.y - episode.observation.ego.y)
                for a in episode.observation.actors), abs=1e-3)  # fmt: skip


def test_an_action_is_steer_and_pedals() -> None:
    assert control_of(np.array([0.5, 0.25])) == Control(0.5, 0.25, 0.0)
    assert control_of(np.array([-2.0, -0.5])) == Control(-1.0, 0.0, 0.5)
    for wrong in (np.zeros(3), np.array([np.nan, 0.0])):
        with pytest.raises(ValueError, match="an action has two numbers, steer and pedals"):
            control_of(wrong)


def test_what_is_no_policy_is_refused_with_a_reason(tmp_path: Path) -> None:
    (tmp_path / "text.onnx").write_text("no network")
    (tmp_path / "text.zip").write_text("no model")
    (tmp_path / "broken.py").write_text("import nowhere_at_all")
    (tmp_path / "number.py").write_text("act = 3")
    small = network(tmp_path / "small.onnx", 12)
    for argument, message in (
        (tmp_path / "gone.onnx", "No such file"),
        (f"{tmp_path / 'gone.py'}:act", "gone.py cannot be read: No such file or directory; write gym:POLICY.onnx"),
        (tmp_path / "text.onnx", "not a network that onnxruntime can read"),
        (small, "the first with 12 numbers"),
        (tmp_path / "text.zip", "Stable-Baselines3"),
        ("policy", "names no policy; write gym:POLICY.onnx"),
        (f"{tmp_path / 'broken.py'}:act", "nowhere_at_all"),
        (f"{tmp_path / 'number.py'}:act", "is not a function"),
    ):
        with pytest.raises(DriverError, match=message):
            PolicyDriver.from_argument(str(argument))
    with pytest.raises(InputError):
        gym.make(str(tmp_path / "nowhere.foresee"))


def test_policies_import_the_files_beside_them_each_its_own(tmp_path: Path) -> None:
    """As drivers `python:` do (tests/drivers/test_python_file.py)."""

    def policy(folder: str, throttle: float) -> PolicyDriver:
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / "policy_params.py").write_text(f"THROTTLE = {throttle}")
        file = tmp_path / folder / "mine.py"
        file.write_text("import policy_params\ndef act(seen): return [0.0, policy_params.THROTTLE]")
        return PolicyDriver.from_argument(f"{file}:act")

    drivers = [policy("a", 0.1), policy("b", 0.2), policy("a", 0.1), policy("a", 0.3)]
    assert [driver._policy(np.zeros(ObjectList.SIZE, np.float32))[1] for driver in drivers] == [0.1, 0.2, 0.1, 0.3]
    versions = [driver.version for driver in drivers]
    assert versions[0] == versions[2] and len({*versions}) == 3


def test_a_reason_names_the_policys_own_line(tmp_path: Path) -> None:
    (tmp_path / "failing_policy.py").write_text(
        "def fails(seen):\n    raise ValueError('no idea')\n\ndef nothing(seen):\n    return None\n"
    )

    def reason(name: str) -> str:
        address = f"gym:{tmp_path / 'failing_policy.py'}:{name}"
        consent.allow(address)
        return run_test_case(load_test_case(CASE), driver=address, seed=0).reason

    assert reason("fails") == "the driver raised ValueError: no idea, at failing_policy.py:2 (fails)"
    assert reason("nothing").endswith("each from -1 to 1, not None")


def test_a_policy_that_a_file_names_is_not_started_unasked(policy: str) -> None:
    with pytest.raises(DriverError, match="program"):
        load_driver(policy)
