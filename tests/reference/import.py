#!/usr/bin/env python3
"""Writes small demonstrations as others do, for the tests of the import.

    pip install numpy pyarrow
    python import.py               writes import_* beside this file

Two episodes of InvertedPendulum, of 3 and 2 steps; numbers are exact in f32, so that every format gives the same.
"""

import bz2
import pathlib
import pickle

import numpy
import pyarrow
import pyarrow.parquet

FOLDER = pathlib.Path(__file__).parent
LENGTHS = [3, 2]
N = sum(LENGTHS)
OBSERVATIONS = numpy.array([[j + 0.25 * i for i in range(4)] for j in range(N)])
ACTIONS = numpy.array([[-0.5 * j] for j in range(N)], numpy.float32)
REWARDS = numpy.ones(N, numpy.float32)


def rlframe(protocol):
    """The structure of the authors' files, with states filtered by a mean of 1 and a deviation of 2; one is clipped."""
    mean, count = numpy.ones(4), 101
    states = (OBSERVATIONS - mean) / 2
    states[4, 3] = 5.0
    steps = [{"s": s, "a": a, "extra": 0} for s, a in zip(states, ACTIONS)]
    content = {
        "trajectory": [steps[: LENGTHS[0]], steps[LENGTHS[0] :]],
        "filter state dict": {
            "zfilter mean": mean,
            "zfilter errsum": numpy.full(4, 4.0 * (count - 1)),
            "zfilter n_step": numpy.int64(count) if protocol == 4 else count,
            "fixed filter": True,
        },
        "policy": "ppo",
        "env name": "InvertedPendulum-v2",
    }
    data = pickle.dumps(content, protocol=protocol)
    # The name that numpy 1 gives to the module.
    return data.replace(b"numpy._core.multiarray", b"numpy.core.multiarray") if protocol == 3 else data


def main():
    for protocol in (2, 3, 4):
        (FOLDER / f"import_protocol{protocol}.pkl").write_bytes(bz2.compress(rlframe(protocol)))

    # D4RL: flat arrays with flags.
    ends = numpy.cumsum(LENGTHS) - 1
    terminals, timeouts = numpy.zeros(N, bool), numpy.zeros(N, bool)
    terminals[ends[0]], timeouts[ends[1]] = True, True
    d4rl = dict(observations=OBSERVATIONS.astype("f4"), actions=ACTIONS, rewards=REWARDS)
    numpy.savez_compressed(FOLDER / "import_d4rl.npz", terminals=terminals, timeouts=timeouts, **d4rl)

    # imitation: one observation more a trajectory, a flag a trajectory, pickled infos that are not looked into.
    with_last = numpy.vstack([OBSERVATIONS[:3], [[9.0] * 4], OBSERVATIONS[3:], [[9.0] * 4]])
    infos = numpy.array([{}] * N, dtype=object)
    numpy.savez(
        FOLDER / "import_imitation.npz",
        obs=with_last,
        acts=ACTIONS,
        rews=REWARDS,
        infos=infos,
        terminal=numpy.array([True, False]),
        indices=numpy.array([3]),
    )

    # Parquet with a column a number.
    columns = {f"obs_{i}": OBSERVATIONS[:, i].astype("f4") for i in range(4)}
    columns |= {"episode": numpy.repeat([7, 8], LENGTHS), "action": ACTIONS[:, 0], "reward": REWARDS}
    pyarrow.parquet.write_table(pyarrow.table(columns), FOLDER / "import_columns.parquet")


if __name__ == "__main__":
    main()
