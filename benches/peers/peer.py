"""One run of Stable-Baselines3's PPO or sb3-contrib's TRPO on one core, timed as `mcpo-run bench` times ours.

Prints JSON: environment steps, and the seconds of the iterations after the first by the wall's clock and on the core.
"""

import argparse
import json
import time
import warnings

warnings.filterwarnings("ignore")

import gymnasium
import torch
from sb3_contrib import TRPO
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

gymnasium.logger.min_level = gymnasium.logger.ERROR  # v4 is old, and what this project runs

MINIBATCH = 1024
EPOCHS = 10


class Clock(BaseCallback):
    """Both clocks at the start of each rollout."""

    def __init__(self):
        super().__init__()
        self.readings = []

    def read(self):
        self.readings.append((self.num_timesteps, time.perf_counter(), time.process_time()))

    def _on_rollout_start(self):
        self.read()

    def _on_step(self):
        return True

    def _on_training_end(self):
        self.read()


def environment(name):
    # 111 observations, as here.
    options = {"use_contact_forces": True} if name.startswith("Ant") else {}
    return lambda: Monitor(gymnasium.make(name, **options))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("algorithm", choices=["ppo", "trpo"])
    parser.add_argument("env")
    parser.add_argument("--environments", type=int, default=1)
    parser.add_argument("--rollout", type=int, default=4096, help="steps of an iteration, over all environments")
    parser.add_argument("--iterations", type=int, default=3, help="after one that is not measured")
    parser.add_argument("--cg-iterations", type=int, default=20)
    arguments = parser.parse_args()

    torch.set_num_threads(1)
    environments = DummyVecEnv([environment(arguments.env) for _ in range(arguments.environments)])
    shared = dict(
        policy="MlpPolicy",
        env=environments,
        seed=0,
        device="cpu",
        n_steps=arguments.rollout // arguments.environments,
        batch_size=MINIBATCH,
        learning_rate=1e-4,
        policy_kwargs=dict(net_arch=dict(pi=[300, 400], vf=[300, 400]), activation_fn=torch.nn.Tanh),
    )
    if arguments.algorithm == "ppo":
        model = PPO(n_epochs=EPOCHS, **shared)
    else:
        # Like MCPO: all samples in the Fisher product, which is sub_sampling_factor's default.
        cg = arguments.cg_iterations
        model = TRPO(n_critic_updates=EPOCHS, cg_max_steps=cg, target_kl=5e-3, sub_sampling_factor=1, **shared)
    clock = Clock()
    model.learn(arguments.rollout * (1 + arguments.iterations), callback=clock)
    (first_steps, first_wall, first_cpu), (steps, wall, cpu) = clock.readings[1], clock.readings[-1]
    print(json.dumps({"env_steps": steps - first_steps, "seconds": wall - first_wall, "cpu_seconds": cpu - first_cpu}))


if __name__ == "__main__":
    main()
