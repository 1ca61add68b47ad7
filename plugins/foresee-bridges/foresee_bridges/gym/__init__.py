"""Gymnasium: test cases as environments for training, and trained policies as drivers (`--driver gym:policy.onnx`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from foresee_dsl.errors import ForeseeError

if TYPE_CHECKING:
    from foresee_bridges.gym.env import ForeseeEnv, Reward

__all__ = ["make"]


def make(*cases: str, observation: str = "objects", reward: Reward | None = None, ideal: bool = False) -> ForeseeEnv:
    """Return an environment over test cases.

    A process has one SUMO: environments that are used in turn each need a process of their own, such as those of
    `gymnasium.vector.AsyncVectorEnv` and Stable-Baselines3's `SubprocVecEnv`.

    Args:
        cases: files, folders, or `file.foresee::case`; each reset takes one of their test cases.
        observation: `objects` (`observations.ObjectList`), or the name of an installed picture, such as `birds_eye`.
        reward: the reward of a step; None: `env.progress_reward`.
        ideal: whether the sensors are ideal: all actors within 80 m, exact and without delay.

    Raises:
        ForeseeError: Gymnasium is not installed.
        InputError: a file or test case is wrong or does not exist.
    """
    try:
        from foresee_bridges.gym.env import ForeseeEnv, progress_reward
    except ModuleNotFoundError as err:
        if err.name != "gymnasium":
            raise
        raise ForeseeError("environments need Gymnasium: pip install 'foresee-bridges[gym]'") from err
    return ForeseeEnv(cases, observation=observation, reward=reward or progress_reward, ideal=ideal)
