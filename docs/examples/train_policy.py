"""Train a small policy on test cases: first it imitates a driver, then PPO goes on from there. Writes policy.zip.

pip install 'foresee-bridges[sb3]'
python train_policy.py scenarios/scenario3.foresee --imitate pdm --steps 20000
foresee run scenarios/scenario3.foresee --driver gym:policy.zip
"""

import argparse

import numpy as np
import torch
from foresee_bridges import gym
from foresee_bridges.gym.observations import ObjectList
from stable_baselines3 import PPO

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.episode import Episode

NOISE = 0.02  # driven on top of the steering, so that the policy sees how the driver comes back to the route


def demonstrate(paths, driver_name, rng):
    """Return what a driver saw and answered on test cases: [N, SIZE] vectors and [N, 2] actions."""
    seen, actions = [], []
    for case in load_test_cases(paths):
        driver, episode = load_driver(driver_name), Episode(compile_test_case(case))
        driver.reset(episode.mission, episode.vehicle, 0)
        objects, place_s, noise = ObjectList(episode.mission, episode.vehicle), None, 0.0
        while episode.result is None:
            observation = episode.observation
            place_s = objects.place(observation, place_s)
            answer = driver.step(observation)
            seen.append(objects.vector(observation, place_s))
            actions.append((answer.steer, answer.throttle - answer.brake))
            noise = 0.95 * noise + NOISE * rng.normal()
            episode.step(type(answer)(answer.steer + noise, answer.throttle, answer.brake))
    return np.array(seen, dtype=np.float32), np.array(actions, dtype=np.float32)


def imitate(policy, seen, actions, epochs, rng):
    """Fit the policy's mean action to the demonstrated ones."""
    optimizer = torch.optim.Adam(policy.parameters(), lr=1e-3)
    inputs, answers = torch.as_tensor(seen), torch.as_tensor(actions)
    for epoch in range(epochs):
        order, losses = rng.permutation(len(seen)), []
        for part in np.array_split(order, max(len(seen) // 256, 1)):
            loss = torch.nn.functional.mse_loss(policy.get_distribution(inputs[part]).mode(), answers[part])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        print(f"epoch {epoch + 1}: mean squared error {np.mean(losses):.4f}", flush=True)


def main():
    """Read the options, train, save."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("paths", nargs="+", help="files, folders or file.foresee::case")
    options.add_argument("--imitate", default="pdm", help="the driver to imitate")
    options.add_argument("--epochs", type=int, default=30)
    options.add_argument("--steps", type=int, default=0, help="steps of PPO after the imitation")
    options.add_argument("--out", default="policy.zip")
    wanted = options.parse_args()
    torch.manual_seed(0)
    torch.set_num_threads(1)
    rng = np.random.default_rng(0)
    model = PPO("MlpPolicy", gym.make(*wanted.paths), seed=0, device="cpu", policy_kwargs={"net_arch": [128, 128]})
    seen, actions = demonstrate(wanted.paths, wanted.imitate, rng)
    print(f"{len(seen)} steps of {wanted.imitate}")
    imitate(model.policy, seen, actions, wanted.epochs, rng)
    if wanted.steps:
        model.learn(wanted.steps)
    model.save(wanted.out)
    print(wanted.out)


if __name__ == "__main__":
    main()
