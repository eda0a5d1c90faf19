"""Our speed beside the peers': the same work on the same core, in turns. Prints a Markdown table.

    python benches/peers/compare.py [--env HalfCheetah Hopper Ant] [--minibatch 1024] [--rounds 3] [--core 0]

with the Python that setup.sh made and named. Speeds are steps a second of CPU time, medians over the rounds; each
round starts every program anew. A peer that is not installed, or that fails, has its row say so.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
ONE_THREAD = dict.fromkeys(["OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"], "1")
ONE_THREAD["TORCHINDUCTOR_COMPILE_THREADS"] = "1"
ENVIRONMENTS = 8
# The same work as the peers do: not the defaults, which take shorter rollouts and fewer samples for the Fisher matrix.
SAME_WORK = {
    "ppo": ["algorithms.ppo.minibatch={minibatch}", "algorithms.ppo.epochs=10"],
    "mcpo": [
        "algorithms.mcpo.minibatch={minibatch}",
        "algorithms.mcpo.value_epochs=10",
        "algorithms.mcpo.fisher_samples=4096",
        "algorithms.mcpo.cg_iterations=10",
    ],
}


@dataclass
class Program:
    """A program to run, and its results round by round."""

    name: str
    peer: str
    environments: int = ENVIRONMENTS
    runs: list = field(default_factory=list)
    trouble: str | None = None

    def label(self):
        physics = f", on {self.runs[0]['physics']}" if self.runs and self.name.startswith("lean") else ""
        return f"{self.name}{physics}"


def peers(algorithm):
    """The programs that ours is compared with."""
    if algorithm == "mcpo":
        names = [("sb3-contrib TRPO", "sb3", 8), ("sb3-contrib TRPO", "sb3", 1)]
        names += [("tianshou TRPO", "tianshou", 8), ("rlox TRPO", "rlox", 8)]
    else:
        names = [("lean JAX", "jax", 8), ("lean torch", "torch", 8), ("rlox PPO", "rlox", 8), ("SBX PPO", "sbx", 8)]
        names += [("Stable-Baselines3 PPO", "sb3", 8), ("Stable-Baselines3 PPO", "sb3", 1)]
        names += [("tianshou PPO", "tianshou", 8)]
    return [Program(*name) for name in names]


class Machine:
    """One core, and a folder for the files that programs leave where they run, such as MuJoCo's log."""

    def __init__(self, core, folder):
        self.core, self.folder = core, folder

    def run(self, command, where=None):
        command = ["taskset", "-c", str(self.core), *map(str, command)]
        own = {"TORCHINDUCTOR_CACHE_DIR": f"{self.folder}/compiled", "PYTHONDONTWRITEBYTECODE": "1"}
        where = where or self.folder
        return subprocess.run(command, cwd=where, env=os.environ | ONE_THREAD | own, capture_output=True, text=True)


def ours(machine, algorithm, arguments, env):
    """Runs ours on the dense reward, so that there is a gradient from the first iteration on, as for the peers."""
    same = [setting.format(minibatch=arguments.minibatch) for setting in SAME_WORK[algorithm]]
    settings = ["reward=dense", "rollout.steps=4096", f"rollout.environments={ENVIRONMENTS}", *same, *arguments.set]
    options = [f"--env={env}-v2", f"--algorithm={algorithm}", f"--iterations={arguments.iterations}"]
    command = [arguments.program, "bench", "--json", *options, *(f"--set={setting}" for setting in settings)]
    done = machine.run(command, ROOT)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}:\n{done.stderr}")
    return json.loads(done.stdout)


def theirs(machine, program, algorithm, arguments, env, own):
    """Runs a peer, unless it had trouble before. `own` is the result of ours, which sets the number of products."""
    if program.trouble:
        return
    options = [f"--environments={program.environments}", f"--minibatch={arguments.minibatch}"]
    options += [f"--iterations={arguments.iterations}"]
    if algorithm == "mcpo":
        options += [f"--cg-iterations={round(own['cg_iterations'] / own['iterations'])}"]
    kind = {"ppo": "ppo", "mcpo": "trpo"}[algorithm]
    done = machine.run([sys.executable, HERE / "peer.py", program.peer, kind, f"{env}-v4", *options])
    if done.returncode != 0:
        program.trouble = "failed: " + ([line for line in done.stderr.splitlines() if line.strip()] or ["no word"])[-1]
    else:
        result = json.loads(done.stdout)
        shapes = {name: own["shapes"][name] for name in ("observation", "action")}
        if "missing" in result:
            program.trouble = f"skipped: no module `{result['missing']}`"
        elif any(result[name] != number for name, number in shapes.items()):
            program.trouble = f"failed: {result['observation']} observations, {result['action']} actions; ours {shapes}"
        else:
            program.runs.append(result)
    if program.trouble:
        print(f"{program.name}: {program.trouble}\n{done.stderr}", file=sys.stderr)


def speed(runs):
    return statistics.median(run["env_steps"] / run["cpu_seconds"] for run in runs)


def row(*cells):
    print("|", " | ".join(cells), "|", flush=True)


def compare(machine, algorithm, arguments, env):
    """Measures in turns and prints our row, the peers' and the floor's. Returns the failures."""
    programs, own = peers(algorithm), []
    if arguments.only:
        programs = [program for program in programs if program.peer in arguments.only]
    for _ in range(arguments.rounds):
        own.append(ours(machine, algorithm, arguments, env))
        for program in programs:
            theirs(machine, program, algorithm, arguments, env, own[-1])
    best = speed(own)
    work = statistics.median(sum(run["floor"]["operations"].values()) / run["iterations"] / 1e9 for run in own)
    floor = statistics.median(run["floor"]["steps_per_cpu_s"] for run in own)
    row(env, f"**ours, {algorithm.upper()}**", f"{ENVIRONMENTS}", f"{best:,.0f}", "1.00", f"{work:.1f}")
    for program in programs:
        cells = [env, program.label(), f"{program.environments}"]
        if program.runs:
            other, done = speed(program.runs), program.runs[-1]["gflop"]
            row(*cells, f"{other:,.0f}", f"{best / other:.2f}", f"{done:.1f}")
        else:
            row(*cells, program.trouble, "", "")
    row(env, "the floor of `bench`", f"{ENVIRONMENTS}", f"{floor:,.0f}", f"{best / floor:.2f}", f"{work:.1f}")
    return [program.name for program in programs if (program.trouble or "").startswith("failed")]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", nargs="+", default=["HalfCheetah"], help="HalfCheetah, Hopper, Walker2d, Ant")
    parser.add_argument("--algorithm", nargs="+", choices=SAME_WORK, default=list(SAME_WORK))
    parser.add_argument("--only", nargs="+", help="peers: sb3, sbx, rlox, tianshou, jax, torch")
    parser.add_argument("--minibatch", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=3)
    parser.add_argument("--core", type=int, default=0)
    parser.add_argument("--set", action="append", default=[], help="KEY=VALUE, for ours")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "target" / "release" / "mcpo-run")
    arguments = parser.parse_args()

    row("environment", "program", "environments", "steps a second of CPU time", "ours / it", "Gflop an iteration")
    print("|---|---|---:|---:|---:|---:|")
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        machine = Machine(arguments.core, folder)
        for env in arguments.env:
            for algorithm in arguments.algorithm:
                failed += compare(machine, algorithm, arguments, env)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
