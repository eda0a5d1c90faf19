"""Stable-Baselines3's PPO and sb3-contrib's TRPO."""

import gymnasium
import torch
from sb3_contrib import TRPO
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from common import EPOCHS, HIDDEN, gymnasium_id


class Iterations(BaseCallback):
    """Reads the clock where one iteration ends and the next begins, when `settle` says that no work is under way."""

    def __init__(self, clock, settle=lambda model: None):
        super().__init__()
        self.clock, self.settle = clock, settle

    def _on_rollout_start(self):
        self.settle(self.model)
        self.clock.read(self.num_timesteps)

    def _on_step(self):
        return True

    def _on_training_end(self):
        self._on_rollout_start()


def settings(task, activation):
    """The common arguments of Stable-Baselines3's algorithms."""
    name = gymnasium_id(task.env)
    return dict(
        policy="MlpPolicy",
        env=DummyVecEnv([lambda: Monitor(gymnasium.make(name))] * task.environments),
        seed=0,
        device="cpu",
        n_steps=task.steps_each,
        batch_size=task.minibatch,
        learning_rate=1e-4,
        policy_kwargs=dict(net_arch=dict(pi=list(HIDDEN), vf=list(HIDDEN)), activation_fn=activation),
    )


def shapes(model):
    return model.observation_space.shape[0], model.action_space.shape[0], "Gymnasium"


def train(task, clock):
    torch.set_num_threads(1)
    shared = settings(task, torch.nn.Tanh)
    if task.algorithm == "ppo":
        model = PPO(n_epochs=EPOCHS, **shared)
    else:
        # Like MCPO: all samples in the Fisher product, which is sub_sampling_factor's default.
        cg = task.cg_iterations
        model = TRPO(n_critic_updates=EPOCHS, cg_max_steps=cg, target_kl=5e-3, sub_sampling_factor=1, **shared)
        clock.count_calls(model, "hessian_vector_product")
    clock.count_torch(model.policy.action_net, model.policy.value_net)
    model.learn(task.timesteps, callback=Iterations(clock))
    return shapes(model)
