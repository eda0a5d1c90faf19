"""Our speed beside the peers': the same shapes on the same core, in turns. Prints a Markdown table.

    python benches/peers/compare.py [--env HalfCheetah Hopper Ant] [--rounds 3] [--core 0]

with the Python that setup.sh made and named. Speeds are steps a second of CPU time, medians over the rounds. `at the floor` is
how many times as fast the same steps' physics and the same products at this core's best rate would be: what no program can pass
that does the same work.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PROGRAM = ROOT / "target" / "release" / "mcpo-run"
ONE_THREAD = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
PEERS = {"ppo": "SB3 PPO", "trpo": "sb3-contrib TRPO"}
# The same work as the peer does: not the defaults, which leave most samples out of the Fisher matrix.
ALL_SAMPLES = ["algorithms.mcpo.fisher_samples=4096", "algorithms.mcpo.cg_iterations=10"]
# Ours, its peer, the peer's environments, and how many times as fast ours is meant to be.
PAIRS = [("ppo", "ppo", 1, 5.0), ("ppo", "ppo", 8, 2.3), ("mcpo", "trpo", 1, 4.0), ("mcpo", "trpo", 8, 2.3)]


def run(core, folder, command):
    command = ["taskset", "-c", str(core), *map(str, command)]
    options = dict(cwd=folder, env=os.environ | ONE_THREAD, stdout=subprocess.PIPE, check=True)
    return json.loads(subprocess.run(command, **options).stdout)


def speed(measured):
    return measured["env_steps"] / measured["cpu_seconds"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", nargs="+", default=["HalfCheetah", "Hopper", "Ant"])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=3)
    parser.add_argument("--core", type=int, default=0)
    parser.add_argument("--set", action="append", default=[], help="KEY=VALUE, for ours")
    arguments = parser.parse_args()

    scratch = tempfile.TemporaryDirectory()  # MuJoCo in Python leaves a log where it runs
    print("| environment | ours | steps/s | of the floor | peer | steps/s | times as fast | at the floor | target |")
    print("|---|---|---|---|---|---|---|---|---|")
    for env in arguments.env:
        ours = {"ppo": [], "mcpo": []}
        peers = {(peer, environments): [] for _, peer, environments, _ in PAIRS}
        cg_iterations = None
        for _ in range(arguments.rounds):
            for algorithm, runs in ours.items():
                # On the dense reward, so that there is a gradient from the first iteration on, as the peers have.
                same_work = ALL_SAMPLES if algorithm == "mcpo" else []
                settings = [f"--set={setting}" for setting in ["reward=dense", *same_work, *arguments.set]]
                iterations = f"--iterations={arguments.iterations}"
                options = [f"--env={env}-v2", f"--algorithm={algorithm}", iterations, *settings]
                runs.append(run(arguments.core, ROOT, [PROGRAM, "bench", "--json", *options]))
            done = ours["mcpo"][-1]
            cg_iterations = round(done["cg_iterations"] / done["iterations"])
            for (peer, environments), runs in peers.items():
                options = ["--environments", environments, "--iterations", arguments.iterations]
                options += ["--cg-iterations", cg_iterations]
                command = [sys.executable, HERE / "peer.py", peer, f"{env}-v4", *options]
                runs.append(run(arguments.core, scratch.name, command))
        for algorithm, peer, environments, target in PAIRS:
            own = statistics.median(map(speed, ours[algorithm]))
            floor = statistics.median(measured["floor_ratio"] for measured in ours[algorithm])
            other = statistics.median(map(speed, peers[peer, environments]))
            count = f"{environments} environment" + ("s" if environments > 1 else "")
            details = count if peer == "ppo" else f"{count}, {cg_iterations} CG iterations"
            row = [env, algorithm, f"{own:,.0f}", f"{floor:.0%}", f"{PEERS[peer]}, {details}", f"{other:,.0f}"]
            times = own / other
            print("|", " | ".join([*row, f"{times:.2f}", f"{times / floor:.2f}", f"{target:g}"]), "|", flush=True)


if __name__ == "__main__":
    main()
