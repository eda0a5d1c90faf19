"""One run of a peer on one core, timed as `mcpo-run bench` times ours: compare.py calls it.

Prints JSON: environment steps, and the seconds of the iterations after the first by the wall's clock and on the
core, with what an iteration computed; or which package is `missing`.
"""

import argparse
import importlib
import json
import os
import sys
import warnings

from common import Clock, Task
from work import gflop

PEERS = ["sb3", "sbx", "rlox", "tianshou", "jax", "torch"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("peer", choices=PEERS)
    parser.add_argument("algorithm", choices=["ppo", "trpo"])
    parser.add_argument("env")
    parser.add_argument("--environments", type=int, default=8)
    parser.add_argument("--minibatch", type=int, default=1024)
    parser.add_argument("--iterations", type=int, default=3, help="after one that is not measured")
    parser.add_argument("--cg-iterations", type=int, default=10)
    task = vars(parser.parse_args())

    # What MuJoCo and others print belongs to nobody's result.
    result = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    warnings.filterwarnings("ignore")
    peer = task.pop("peer")
    try:
        train = importlib.import_module(f"peer_{peer}").train
    except ModuleNotFoundError as missing:
        print(json.dumps({"missing": missing.name}), file=result)
        return
    clock = Clock()
    # Numbers in an observation and in an action, and where the physics comes from.
    observation, action, physics = train(Task(**task), clock)
    work = gflop(observation, action, clock.passes)
    shapes = {"observation": observation, "action": action, "physics": physics}
    print(json.dumps(clock.measured() | shapes | {"gflop": work, "passes": vars(clock.passes)}), file=result)


if __name__ == "__main__":
    sys.exit(main())
