#!/usr/bin/env python3
"""Records transitions of Gymnasium's own environments, in the demonstration format.

    pip install "gymnasium[mujoco]==1.4.0" mujoco==3.17.0 packaging pyarrow
    python record.py                                     # the committed files again, beside this script
    python record.py --env Hopper-v2 --seed 1 --episodes 5 --actions normal --out hopper.parquet

Each row is a step: what was observed before it, the raw action, and what Gymnasium gave for it. Poses are of before the
step; the first pose of an episode and its actions reproduce it. --actions and --steps take several values, which the
episodes use in turn.
"""

import argparse
import pathlib
import warnings

import gymnasium
import mujoco
import numpy
import pyarrow
import pyarrow.parquet

# Gymnasium's environments that have Gym v2's rewards and ends.
ENVIRONMENTS = {
    "MountainCarContinuous-v0": ("MountainCarContinuous-v0", {}),
    "InvertedPendulum-v2": ("InvertedPendulum-v4", {}),
    "InvertedDoublePendulum-v2": ("InvertedDoublePendulum-v4", {}),
    "HalfCheetah-v2": ("HalfCheetah-v4", {}),
    "Hopper-v2": ("Hopper-v4", {}),
    "Walker2d-v2": ("Walker2d-v4", {}),
    "Ant-v2": ("Ant-v4", {"use_contact_forces": True}),
    "Swimmer-v2": ("Swimmer-v4", {}),
    "Reacher-v2": ("Reacher-v4", {}),
    "Humanoid-v2": ("Humanoid-v4", {}),
}


def unpaid(name, env):
    """What Gym's v2 takes from a step's reward and Gymnasium's v4 does not: of Humanoid the cost of contacts, as v3 and v5
    have it too."""
    if name != "Humanoid-v2":
        return 0.0
    return min(5e-7 * float(numpy.sum(numpy.square(env.unwrapped.data.cfrc_ext))), 10.0)


# What is committed: terminations, truncations at Gymnasium's limit and actions beyond the bounds, in little space.
COMMITTED = {
    "MountainCarContinuous-v0": {"episodes": 3, "actions": ["uniform", "slow", "normal"], "seed": 1},
    "InvertedPendulum-v2": {"episodes": 9, "actions": ["uniform", "normal", "small"]},
    "InvertedDoublePendulum-v2": {"episodes": 9, "actions": ["uniform", "normal", "small"]},
    "HalfCheetah-v2": {"episodes": 4, "actions": ["slow", "normal", "uniform", "small"], "steps": [1000, 80, 80, 80]},
    "Hopper-v2": {"episodes": 8, "actions": ["uniform", "normal", "small", "slow"]},
    "Walker2d-v2": {"episodes": 8, "actions": ["uniform", "normal", "small", "slow"]},
    "Ant-v2": {"episodes": 5, "actions": ["normal", "uniform", "small", "slow"], "steps": [150]},
    "Swimmer-v2": {"episodes": 4, "actions": ["slow", "normal", "uniform", "small"], "steps": [150]},
    "Reacher-v2": {"episodes": 5, "actions": ["normal", "uniform", "small", "slow"]},
    "Humanoid-v2": {"episodes": 5, "actions": ["normal", "uniform", "small", "slow"]},
}


def pose(env):
    """Positions and velocities now."""
    inner = env.unwrapped
    if hasattr(inner, "data"):
        return inner.data.qpos.tolist(), inner.data.qvel.tolist()
    return [float(inner.state[0])], [float(inner.state[1])]


def drawer(kind, rng, bound, dim):
    """How the actions of an episode are drawn. They are f64: with f32, Gymnasium computes control costs in f32."""
    if kind == "uniform":
        return lambda step: rng.uniform(-bound, bound, dim)
    if kind == "normal":  # a third of them beyond the bounds
        return lambda step: rng.normal(0.0, bound, dim)
    if kind == "small":
        return lambda step: rng.uniform(-0.05 * bound, 0.05 * bound, dim)
    period, phase = rng.uniform(5.0, 15.0, dim), rng.uniform(0.0, 6.0, dim)
    return lambda step: 1.2 * bound * numpy.sin(step / period + phase)


def record(name, seed, episodes, actions, steps):
    """A table of `episodes` episodes."""
    gym_id, options = ENVIRONMENTS[name]
    env = gymnasium.make(gym_id, disable_env_checker=True, **options)
    bound, dim = float(env.action_space.high[0]), env.action_space.shape[0]
    rng = numpy.random.default_rng(seed)
    numbers = pyarrow.list_(pyarrow.field("item", pyarrow.float64()))
    columns = {
        "episode": pyarrow.int64(),
        "step": pyarrow.int64(),
        "observation": numbers,
        "action": numbers,
        "reward": pyarrow.float64(),
        "terminated": pyarrow.bool_(),
        "truncated": pyarrow.bool_(),
        "qpos": numbers,
        "qvel": numbers,
    }
    rows = []
    for episode in range(episodes):
        draw = drawer(actions[episode % len(actions)], rng, bound, dim)
        observation, _ = env.reset(seed=seed + episode)
        for step in range(steps[episode % len(steps)]):
            qpos, qvel = pose(env)
            action = draw(step)
            after, reward, terminated, truncated, _ = env.step(action)
            reward -= unpaid(name, env)
            values = (episode, step, observation.tolist(), action.tolist(), reward, terminated, truncated, qpos, qvel)
            rows.append(dict(zip(columns, values)))
            observation = after
            if terminated or truncated:
                break
    metadata = {
        "env": name,
        "recorded_from": gym_id,
        "seed": str(seed),
        "actions": ",".join(actions),
        "gymnasium": gymnasium.__version__,
        "mujoco": mujoco.__version__,
        "numpy": numpy.__version__,
    }
    return pyarrow.Table.from_pylist(rows, schema=pyarrow.schema(columns, metadata=metadata))


def write(path, **what):
    table = record(**what)
    pyarrow.parquet.write_table(table, path, compression="zstd", compression_level=19, use_dictionary=False)
    print(f"{path}: {table.num_rows} steps")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", choices=ENVIRONMENTS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=3)
    parser.add_argument("--steps", type=int, nargs="+", default=[1000], help="most steps recorded of an episode")
    parser.add_argument("--actions", nargs="+", choices=["uniform", "normal", "small", "slow"], default=["uniform"])
    parser.add_argument("--out", help="the file to write")
    arguments = parser.parse_args()
    warnings.filterwarnings("ignore")
    gymnasium.logger.min_level = gymnasium.logger.ERROR
    if arguments.env is None:
        for name, what in COMMITTED.items():
            write(pathlib.Path(__file__).parent / f"{name}.parquet", name=name, **{"seed": 0, "steps": [1000], **what})
    elif arguments.out is None:
        parser.error("--out is needed with --env")
    else:
        what = {key: getattr(arguments, key) for key in ("seed", "episodes", "actions", "steps")}
        write(arguments.out, name=arguments.env, **what)


if __name__ == "__main__":
    main()
