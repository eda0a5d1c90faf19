"""Tianshou's PPO and TRPO, collected and updated as its trainer for on-policy algorithms does it."""

import gymnasium
import torch
from tianshou.algorithm import PPO, TRPO
from tianshou.algorithm.algorithm_base import policy_within_training_step
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, CollectStats, VectorReplayBuffer
from tianshou.env import DummyVectorEnv
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic
from torch.distributions import Independent, Normal

from common import EPOCHS, HIDDEN, ROLLOUT, gymnasium_id


def train(task, clock):
    torch.set_num_threads(1)
    torch.manual_seed(0)
    name = gymnasium_id(task.env)
    env = DummyVectorEnv([lambda: gymnasium.make(name)] * task.environments)
    space, actions = env.observation_space[0], env.action_space[0]

    def hidden():
        return Net(state_shape=space.shape, hidden_sizes=list(HIDDEN), activation=torch.nn.Tanh)

    actor = ContinuousActorProbabilistic(preprocess_net=hidden(), action_shape=actions.shape, unbounded=True)
    critic = ContinuousCritic(preprocess_net=hidden())
    policy = ProbabilisticActorPolicy(
        actor=actor,
        dist_fn=lambda mean_and_deviation: Independent(Normal(*mean_and_deviation), 1),
        action_space=actions,
        action_bound_method="clip",
    )
    adam = AdamOptimizerFactory(lr=1e-4)
    shared = dict(policy=policy, critic=critic, optim=adam, gae_lambda=0.95, max_batchsize=ROLLOUT)
    if task.algorithm == "ppo":
        algorithm = PPO(ent_coef=0.0, vf_coef=0.5, max_grad_norm=0.5, advantage_normalization=True, **shared)
        passes = dict(batch_size=task.minibatch, repeat=EPOCHS)
    else:
        # Its value network takes the whole rollout as one minibatch; its conjugate gradient would go round 10 times.
        algorithm = TRPO(max_kl=5e-3, optim_critic_iters=EPOCHS, **shared)
        solve = algorithm._conjugate_gradients
        algorithm._conjugate_gradients = lambda b, kl, nsteps: solve(b, kl, nsteps=task.cg_iterations)
        clock.count_calls(algorithm, "_MVP")
        passes = dict(batch_size=None, repeat=1)
    clock.count_torch(actor.mu.model[-1], critic.last.model[-1])

    collector = Collector[CollectStats](algorithm, env, VectorReplayBuffer(ROLLOUT, task.environments))
    collector.reset()
    steps = 0
    clock.read(steps)
    for _ in range(1 + task.iterations):
        with policy_within_training_step(algorithm.policy):
            steps += collector.collect(n_step=ROLLOUT).n_collected_steps
            algorithm.update(buffer=collector.buffer, **passes)
        collector.reset_buffer(keep_statistics=True)
        clock.read(steps)
    return space.shape[0], actions.shape[0], "Gymnasium"
