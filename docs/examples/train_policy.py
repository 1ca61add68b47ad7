"""Train a small policy on test cases: it imitates a driver, and PPO may go on from there. Writes policy.zip.

pip install 'foresee-bridges[sb3]'
python train_policy.py scenarios --imitate pdm --rounds 4
foresee run scenarios/scenario3.foresee --driver gym:policy.zip
"""

import argparse

import numpy as np
import torch
from foresee_bridges import gym
from foresee_bridges.gym.observations import ObjectList, control_of
from stable_baselines3 import PPO

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.episode import Episode
from foresee_dsl.simulate.results.verdict import Verdict


def demonstrate(paths, driver_name, policy):
    """Return what was seen on test cases and what the driver would do there: [N, SIZE] vectors and [N, 2] actions.

    The driver itself drives (policy None), or the policy, so that the driver shows how to recover from its errors
    (DAgger: Ross, Gordon, Bagnell 2011).
    """
    seen, actions, passes = [], [], 0
    cases = load_test_cases(paths)
    for case in cases:
        driver, episode = load_driver(driver_name), Episode(compile_test_case(case))
        driver.reset(episode.mission, episode.vehicle, 0)
        objects, place_s = ObjectList(episode.mission, episode.vehicle), None
        while episode.result is None:
            place_s = objects.place(episode.observation, place_s)
            seen.append(objects.vector(episode.observation, place_s))
            control = driver.step(episode.observation)
            actions.append((control.steer, control.throttle - control.brake))
            if policy is not None:
                control = control_of(policy.predict(seen[-1], deterministic=True)[0])
            episode.step(control)
        passes += episode.result.verdict == Verdict.PASS
    print(f"{len(seen)} steps of {'the policy' if policy else driver_name}: {passes} of {len(cases)} cases passed")
    return np.array(seen, dtype=np.float32), np.array(actions, dtype=np.float32)


def imitate(policy, seen, actions, epochs, rng):
    """Fit the policy's mean action to the demonstrated ones; steering and pedals count the same."""
    optimizer = torch.optim.Adam(policy.parameters(), lr=1e-3)
    inputs, answers = torch.as_tensor(seen), torch.as_tensor(actions)
    spread = answers.std(dim=0) + 1e-3
    for _ in range(epochs):
        order, losses = rng.permutation(len(seen)), []
        for part in np.array_split(order, max(len(seen) // 256, 1)):
            errors = (policy.get_distribution(inputs[part]).mode() - answers[part]) / spread
            loss = errors.square().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
    print(f"{epochs} epochs: mean squared error {np.mean(losses):.3f} of the variance", flush=True)


def main():
    """Read the options, train, save."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("paths", nargs="+", help="files, folders or file.foresee::case")
    options.add_argument("--imitate", default="pdm", help="the driver to imitate")
    options.add_argument("--rounds", type=int, default=4, help="rounds of correction: the policy drives")
    options.add_argument("--epochs", type=int, default=15, help="passes over the data in each round")
    options.add_argument("--steps", type=int, default=0, help="steps of PPO after the imitation")
    options.add_argument("--out", default="policy.zip")
    wanted = options.parse_args()
    torch.manual_seed(0)
    torch.set_num_threads(1)
    rng = np.random.default_rng(0)
    model = PPO("MlpPolicy", gym.make(*wanted.paths), seed=0, device="cpu", policy_kwargs={"net_arch": [128, 128]})
    seen, actions = demonstrate(wanted.paths, wanted.imitate, None)
    imitate(model.policy, seen, actions, wanted.epochs, rng)
    for _ in range(wanted.rounds):
        more_seen, more_actions = demonstrate(wanted.paths, wanted.imitate, model.policy)
        seen, actions = np.concatenate([seen, more_seen]), np.concatenate([actions, more_actions])
        imitate(model.policy, seen, actions, wanted.epochs, rng)
    if wanted.steps:
        model.learn(wanted.steps)
    model.save(wanted.out)
    print(wanted.out)


if __name__ == "__main__":
    main()
