#!/usr/bin/env python3
"""Plays a saved policy in Python. It needs numpy; to play whole episodes, Gymnasium too.

    python3 examples/play.py results/smoke/runs/HalfCheetah-v2/mcpo/seed-0
    pip install "gymnasium[mujoco]" && python3 examples/play.py RUN --episodes 5

The first prints the run, the networks and the mean action at an average observation, the second returns of episodes.
"""

import argparse
import json
import pathlib

import numpy

# Gymnasium's environments that have Gym v2's rewards and ends.
GYMNASIUM = {
    "MountainCarContinuous-v0": ("MountainCarContinuous-v0", {}),
    "InvertedPendulum-v2": ("InvertedPendulum-v4", {}),
    "InvertedDoublePendulum-v2": ("InvertedDoublePendulum-v4", {}),
    "HalfCheetah-v2": ("HalfCheetah-v4", {}),
    "Hopper-v2": ("Hopper-v4", {}),
    "Walker2d-v2": ("Walker2d-v4", {}),
    "Ant-v2": ("Ant-v4", {"use_contact_forces": True}),
}


def load(path):
    """The tensors of a safetensors file by name, and its metadata."""
    data = pathlib.Path(path).read_bytes()
    start = 8 + int.from_bytes(data[:8], "little")  # the header's length, the header in JSON, the numbers
    header = json.loads(data[8:start])
    metadata = header.pop("__metadata__", {})
    types = {"F32": numpy.dtype("<f4"), "F64": numpy.dtype("<f8")}
    tensors = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        numbers = numpy.frombuffer(data[start + begin : start + end], types[entry["dtype"]])
        tensors[name] = numbers.reshape(entry["shape"])
    return tensors, metadata


class Policy:
    """The mean action of a policy, and the specification of the run that it comes from."""

    def __init__(self, path):
        tensors, metadata = load(path)
        self.run = json.loads(metadata["mcpo-run"])["spec"]
        self.mean, self.std = tensors["normalizer.mean"], tensors["normalizer.std"]
        self.clip = tensors["normalizer.clip"]
        count = sum(name.startswith("policy.mean.") for name in tensors) // 2
        names = [f"policy.mean.{layer}" for layer in range(count)]
        self.layers = [(tensors[f"{name}.weight"], tensors[f"{name}.bias"]) for name in names]
        self.log_std = tensors["policy.log_std"]

    def act(self, observation):
        """The mean action `[action_dim]` at a raw observation `[observation_dim]`."""
        x = numpy.clip((observation - self.mean) / (self.std + 1e-8), -self.clip, self.clip)
        x = x.astype(numpy.float32)
        for weight, bias in self.layers[:-1]:
            x = numpy.tanh(weight @ x + bias)
        weight, bias = self.layers[-1]
        return weight @ x + bias


def play(policy, env, seed):
    """The dense return of an episode and its length."""
    observation, _ = env.reset(seed=seed)
    total, steps, over = 0.0, 0, False
    while not over:
        observation, reward, terminated, truncated, _ = env.step(policy.act(observation).astype(float))
        total, steps, over = total + reward, steps + 1, terminated or truncated
    return total, steps


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path, help="a run's folder, or its policy.safetensors")
    parser.add_argument("--episodes", type=int, default=0)
    arguments = parser.parse_args()
    path = arguments.run / "policy.safetensors" if arguments.run.is_dir() else arguments.run
    policy = Policy(path)
    widths = [policy.layers[0][0].shape[1], *(weight.shape[0] for weight, _ in policy.layers)]
    print("run           ", policy.run["experiment"] + "/" + policy.run["id"])
    print("widths        ", widths)
    print("deviation     ", numpy.exp(policy.log_std).round(4))
    print("average action", policy.act(policy.mean).round(4))
    if arguments.episodes == 0:
        return

    import gymnasium

    name, options = GYMNASIUM[policy.run["env"]]
    env = gymnasium.make(name, max_episode_steps=policy.run["max_steps"], **options)
    returns = []
    for seed in range(arguments.episodes):
        total, steps = play(policy, env, seed)
        returns.append(total)
        print(f"episode {seed}      return {total:.1f} in {steps} steps")
    print(f"mean           {numpy.mean(returns):.1f}")


if __name__ == "__main__":
    main()
