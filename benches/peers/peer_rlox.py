"""rlox's PPO and TRPO, whose policy has two equal hidden layers: these are replaced."""

import rlox.algorithms.ppo
import rlox.algorithms.trpo
import rlox.policies
import torch
from rlox.callbacks import Callback

from common import EPOCHS, ROLLOUT, gymnasium_id, mlp


class Policy(rlox.policies.ContinuousPolicy):
    """rlox's policy with the networks compared here."""

    def __init__(self, obs_dim, act_dim, hidden=None):
        super().__init__(obs_dim, act_dim)
        self.actor, self.critic = mlp(obs_dim, act_dim), mlp(obs_dim, 1)


class Iterations(Callback):
    def __init__(self, clock):
        super().__init__()
        self.clock, self.steps = clock, 0

    def on_training_start(self, **_):
        self.clock.read(0)

    def on_step(self, **_):
        self.steps += ROLLOUT
        self.clock.read(self.steps)
        return True


def train(task, clock):
    torch.set_num_threads(1)
    torch.manual_seed(0)
    rlox.policies.ContinuousPolicy = Policy
    shared = dict(seed=0, callbacks=[Iterations(clock)], n_envs=task.environments, n_steps=task.steps_each)
    name = gymnasium_id(task.env)
    if task.algorithm == "ppo":
        rates = dict(learning_rate=1e-4, anneal_lr=False, ent_coef=0.0)
        algorithm = rlox.algorithms.ppo.PPO(name, n_epochs=EPOCHS, batch_size=task.minibatch, **rates, **shared)
    else:
        # Its value network takes the whole rollout as one minibatch.
        cg = task.cg_iterations
        algorithm = rlox.algorithms.trpo.TRPO(name, cg_iters=cg, vf_epochs=EPOCHS, max_kl=5e-3, **shared)
        clock.count_calls(algorithm, "_fisher_vector_product")
    assert isinstance(algorithm.policy, Policy), "rlox took its own networks"
    actor, critic = algorithm.policy.actor, algorithm.policy.critic
    clock.count_torch(actor[-1], critic[-1])
    algorithm.train(task.timesteps)
    return actor[0].in_features, actor[-1].out_features, "Gymnasium"
