"""A lean PPO in torch: acting and the loss with its way back are compiled, and Adam is one fused kernel."""

import torch

import lean
from common import EPOCHS, ROLLOUT, mlp


class Agent(torch.nn.Module):
    def __init__(self, observation, action):
        super().__init__()
        self.policy, self.critic = mlp(observation, action), mlp(observation, 1)
        self.log_std = torch.nn.Parameter(torch.zeros(action))
        with torch.no_grad():
            self.policy[-1].weight.mul_(0.01)

    def log_density(self, mean, actions):
        z = (actions - mean) * torch.exp(-self.log_std)
        return (-0.5 * z * z - self.log_std - lean.HALF_LOG_2PI).sum(-1)

    def value(self, observations):
        return self.critic(observations).squeeze(-1)

    def act(self, observations, noise):
        mean = self.policy(observations)
        actions = mean + noise * torch.exp(self.log_std)
        return actions, self.log_density(mean, actions), self.value(observations)

    def loss(self, observations, actions, old, advantages, returns):
        advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
        ratio = torch.exp(self.log_density(self.policy(observations), actions) - old)
        clipped = torch.clamp(ratio, 1 - lean.CLIP, 1 + lean.CLIP)
        surrogate = torch.minimum(ratio * advantages, clipped * advantages).mean()
        return 0.5 * (self.value(observations) - returns).square().mean() - surrogate


def train(task, clock):
    assert task.algorithm == "ppo", "the lean programs are of PPO"
    torch.set_num_threads(1)
    torch.manual_seed(0)
    env = lean.physics(task.env, task.environments)
    agent = Agent(env.observation, env.action)
    adam = torch.optim.Adam(agent.parameters(), lr=lean.RATE, eps=1e-5, fused=True)
    act, value, loss = (torch.compile(part, dynamic=False) for part in (agent.act, agent.value, agent.loss))
    buffer = lean.Buffer(task, env)
    clock.passes = lean.passes(task, EPOCHS)

    def act_at(t, observations):
        return [x.numpy() for x in act(torch.from_numpy(observations), noise[t])]

    def value_of(observations):
        return value(torch.from_numpy(observations)).numpy()

    observations = env.reset()
    clock.read(0)
    for iteration in range(1, 2 + task.iterations):
        with torch.no_grad():
            noise = torch.randn(buffer.actions.shape)
            observations = buffer.collect(env, observations, act_at, value_of)
            batch = [torch.from_numpy(column) for column in buffer.flat(value_of(observations))]
        for _ in range(EPOCHS):
            order = torch.randperm(ROLLOUT)
            shuffled = [column[order] for column in batch]
            for minibatch in zip(*(column.split(task.minibatch) for column in shuffled)):
                adam.zero_grad(set_to_none=True)
                loss(*minibatch).backward()
                torch.nn.utils.clip_grad_norm_(agent.parameters(), lean.CLIP_GRADIENT)
                adam.step()
        clock.read(iteration * ROLLOUT)
    return env.observation, env.action, env.physics
