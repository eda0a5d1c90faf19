"""Shared by the two lean programs: the physics, a rollout's memory and its advantages, with as little as possible around."""

import numpy as np

from common import ROLLOUT, gymnasium_id
from work import Passes

GAMMA, LAMBDA, CLIP, CLIP_GRADIENT, RATE = 0.99, 0.95, 0.2, 0.5, 1e-4
HALF_LOG_2PI = 0.5 * np.log(2 * np.pi)


class EnvPool:
    """All environments in one call of C++ code. An ended one starts again by itself in the next step."""

    physics = "EnvPool"

    def __init__(self, env, count):
        import envpool

        more = {"use_contact_force": True} if env.startswith("Ant") else {}
        self.pool = envpool.make(env, env_type="gymnasium", num_envs=count, num_threads=1, seed=0, **more)
        self.observation, self.action = self.pool.observation_space.shape[0], self.pool.action_space.shape[0]
        self.bound = self.pool.action_space.high[0]

    def reset(self):
        return self.pool.reset()[0].astype(np.float32)

    def step(self, actions):
        clipped = np.clip(actions, -self.bound, self.bound).astype(np.float64)
        observations, rewards, terminated, truncated, _ = self.pool.step(clipped)
        observations = observations.astype(np.float32)
        return observations, rewards, terminated, truncated, observations


class Loop:
    """Gymnasium's environments one after the other, where there is no EnvPool."""

    physics = "Gymnasium"

    def __init__(self, env, count):
        import gymnasium

        name = gymnasium_id(env)
        self.envs = [gymnasium.make(name) for _ in range(count)]
        self.observation = self.envs[0].observation_space.shape[0]
        self.action, self.bound = self.envs[0].action_space.shape[0], self.envs[0].action_space.high[0]

    def reset(self):
        return np.stack([env.reset(seed=seed)[0] for seed, env in enumerate(self.envs)]).astype(np.float32)

    def step(self, actions):
        steps = [env.step(action) for env, action in zip(self.envs, np.clip(actions, -self.bound, self.bound))]
        last, rewards, terminated, truncated = (np.array(column) for column in list(zip(*steps))[:4])
        last = last.astype(np.float32)
        following = last.copy()
        for i in np.flatnonzero(terminated | truncated):
            following[i] = self.envs[i].reset()[0]
        return following, rewards, terminated, truncated, last


def physics(env, count):
    """EnvPool where it is installed, otherwise Gymnasium; the table names it."""
    try:
        return EnvPool(env, count)
    except ModuleNotFoundError:
        return Loop(env, count)


class Buffer:
    """A rollout, `[steps x environments]`, and with a last axis for vectors."""

    def __init__(self, task, env):
        shape = task.steps_each, task.environments
        self.observations = np.empty((*shape, env.observation), np.float32)
        self.actions = np.empty((*shape, env.action), np.float32)
        self.log_densities, self.values, self.rewards = (np.empty(shape, np.float32) for _ in range(3))
        self.ends = np.zeros(shape, bool)

    def collect(self, env, observations, act, value):
        """Steps until the rollout is full; returns the observations after it. `act(t, observations)` is an action, its log
        density and a value for each environment, `value(observations)` the values alone, which an episode cut short
        goes on with."""
        for t in range(len(self.observations)):
            self.observations[t] = observations
            self.actions[t], self.log_densities[t], self.values[t] = act(t, observations)
            observations, self.rewards[t], terminated, truncated, last = env.step(self.actions[t])
            self.ends[t] = terminated | truncated
            cut = truncated & ~terminated
            if cut.any():
                self.rewards[t] += GAMMA * np.where(cut, value(last), 0)
        return observations

    def flat(self, last_values):
        """Observations, actions, log densities, advantages and returns, sample by sample."""
        advantages = np.empty_like(self.rewards)
        advantage, following = np.zeros_like(last_values), last_values
        for t in reversed(range(len(advantages))):
            go_on = ~self.ends[t]
            error = self.rewards[t] + GAMMA * go_on * following - self.values[t]
            advantages[t] = advantage = error + GAMMA * LAMBDA * go_on * advantage
            following = self.values[t]
        columns = (self.observations, self.actions, self.log_densities, advantages, advantages + self.values)
        return [column.reshape(ROLLOUT, *column.shape[2:]) for column in columns]


def passes(task, epochs):
    """The passes of one iteration of a lean program, from its code: compiled code cannot be hooked. Episodes cut
    short, each of which costs a value of every environment, are one in a thousand steps and left out."""
    update = ROLLOUT * epochs
    forward = {"policy": ROLLOUT + update, "value": ROLLOUT + task.environments + update}
    return Passes(forward=forward, back={"policy": update, "value": update})
