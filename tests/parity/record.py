#!/usr/bin/env python3
"""Records transitions of Gymnasium's own environments, in the demonstration format, for the parity tests.

    pip install "gymnasium[mujoco]==1.4.0" mujoco==3.17.0 pyarrow
    python record.py --env Hopper-v2 --seed 1 --episodes 5 --actions normal --out hopper.parquet

Each row is a step: what was seen before it, the raw action, and what Gymnasium gave for it. Poses are recorded before
the step; an episode is reproduced from its first.
"""

import argparse
import warnings

import gymnasium
import mujoco
import numpy
import pyarrow
import pyarrow.parquet

# Gymnasium's environments with Gym v2's rewards and ends.
ENVIRONMENTS = {
    "MountainCarContinuous-v0": ("MountainCarContinuous-v0", {}),
    "InvertedPendulum-v2": ("InvertedPendulum-v4", {}),
    "InvertedDoublePendulum-v2": ("InvertedDoublePendulum-v4", {}),
    "HalfCheetah-v2": ("HalfCheetah-v4", {}),
    "Hopper-v2": ("Hopper-v4", {}),
    "Walker2d-v2": ("Walker2d-v4", {}),
    "Ant-v2": ("Ant-v4", {"use_contact_forces": True}),
}


def pose(env):
    """Positions and velocities now."""
    inner = env.unwrapped
    if hasattr(inner, "data"):
        return inner.data.qpos.tolist(), inner.data.qvel.tolist()
    return [float(inner.state[0])], [float(inner.state[1])]


def draw(kind, rng, bound, dim):
    """An action in f64: as f32, Gymnasium would compute the control's cost in f32."""
    if kind == "uniform":
        return rng.uniform(-bound, bound, dim)
    if kind == "normal":
        return rng.normal(0.0, bound, dim)  # a third of them beyond the bounds
    return rng.uniform(-0.05 * bound, 0.05 * bound, dim)


def record(name, seed, episodes, steps, actions, max_steps):
    gym_id, options = ENVIRONMENTS[name]
    if max_steps is not None:
        options = options | {"max_episode_steps": max_steps}
    env = gymnasium.make(gym_id, disable_env_checker=True, **options)
    bound, dim = float(env.action_space.high[0]), env.action_space.shape[0]
    rng = numpy.random.default_rng(seed)
    columns = ("episode", "step", "observation", "action", "reward", "terminated", "truncated", "qpos", "qvel")
    rows = {column: [] for column in columns}
    for episode in range(episodes):
        observation, _ = env.reset(seed=seed + episode)
        for step in range(steps):
            qpos, qvel = pose(env)
            action = draw(actions, rng, bound, dim)
            after, reward, terminated, truncated, _ = env.step(action)
            row = (episode, step, observation.tolist(), action.tolist(), float(reward), terminated, truncated, qpos, qvel)
            for column, value in zip(columns, row):
                rows[column].append(value)
            observation = after
            if terminated or truncated:
                break
    numbers = pyarrow.list_(pyarrow.float64())
    schema = pyarrow.schema(
        [
            ("episode", pyarrow.int64()),
            ("step", pyarrow.int64()),
            ("observation", numbers),
            ("action", numbers),
            ("reward", pyarrow.float64()),
            ("terminated", pyarrow.bool_()),
            ("truncated", pyarrow.bool_()),
            ("qpos", numbers),
            ("qvel", numbers),
        ],
        metadata={
            "env": name,
            "recorded_from": gym_id,
            "seed": str(seed),
            "actions": actions,
            "gymnasium": gymnasium.__version__,
            "mujoco": mujoco.__version__,
            "numpy": numpy.__version__,
        },
    )
    return pyarrow.table(rows, schema=schema)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", required=True, choices=ENVIRONMENTS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=3)
    parser.add_argument("--steps", type=int, default=1000, help="most steps recorded of an episode")
    parser.add_argument("--max-steps", type=int, help="time limit, instead of Gymnasium's own")
    parser.add_argument("--actions", choices=["uniform", "normal", "small"], default="uniform")
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    warnings.filterwarnings("ignore", message=".*out of date.*")
    gymnasium.logger.min_level = gymnasium.logger.ERROR
    table = record(
        arguments.env,
        arguments.seed,
        arguments.episodes,
        arguments.steps,
        arguments.actions,
        arguments.max_steps,
    )
    pyarrow.parquet.write_table(table, arguments.out, compression="zstd", compression_level=19)


if __name__ == "__main__":
    main()
