"""How speed and memory grow with the size of a run. Prints Markdown tables.

    python benches/growth.py [--only environments width minibatch demonstration jobs idle start] [--iterations 3]

needs numpy, which the Python of benches/peers/setup.sh has. Speeds are those of `mcpo-run bench` on HalfCheetah, steps a second
of CPU time, but for `jobs` and `idle`, where the wall's clock counts. Memory is the greatest of the process.
"""

import argparse
import json
import os
import pathlib
import subprocess
import tempfile
import time

import numpy

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target" / "release" / "mcpo-run"
ENV = "HalfCheetah-v2"


def table(*header):
    print("\n| " + " | ".join(header) + " |\n|" + "---|" * len(header))


def row(*cells):
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def called(*arguments):
    """The output of the program, and the most megabytes that it or a worker took."""
    process = subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, cwd=ROOT)
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{arguments}: exit status {status}")
    return output, usage.ru_maxrss / 1024


def bench(iterations, algorithm, *settings):
    options = [f"--set={setting}" for setting in ["reward=dense", *settings]]
    arguments = ["bench", "--json", f"--env={ENV}", f"--algorithm={algorithm}", f"--iterations={iterations}", *options]
    output, megabytes = called(*arguments)
    return json.loads(output), megabytes


def speeds(title, iterations, cases):
    """One row per case with speed, share of the floor's speed and memory, for both algorithms."""
    table(title, *(f"{name} {what}" for name in ["ppo", "mcpo"] for what in ["steps/s", "of the floor", "MB"]))
    for label, settings in cases:
        cells = []
        for algorithm in ["ppo", "mcpo"]:
            own = [setting.replace("ALGORITHM", algorithm) for setting in settings]
            measured, megabytes = bench(iterations, algorithm, *own)
            cells += [f"{measured['steps_per_cpu_s']:,.0f}", f"{measured['floor_ratio']:.0%}", f"{megabytes:.0f}"]
        row(label, *cells)


def environments(iterations):
    cases = [(n, [f"rollout.environments={n}"]) for n in [1, 2, 4, 8, 16, 32]]
    speeds("environments", iterations, cases)


def width(iterations):
    layers = [[64, 64], [128, 128], [300, 400], [512, 512], [1024, 1024]]
    speeds("hidden layers", iterations, [(hidden, [f"network.hidden={hidden}"]) for hidden in layers])


def minibatch(iterations):
    cases = [(n, [f"algorithms.ALGORITHM.minibatch={n}"]) for n in [64, 256, 1024]]
    speeds("minibatch", iterations, cases)


def demonstration(iterations):
    """Points are random: what D costs does not depend on where they lie, as long as none coincide."""
    table("demonstration", "steps/s", "of the floor", "mimicry, ms", "share of an iteration", "MB")
    with tempfile.TemporaryDirectory() as folder:
        for points in [250, 1000, 4000, 20_000]:
            random = numpy.random.default_rng(0)
            arrays = dict(observations=random.normal(size=(points, 17)), actions=random.normal(size=(points, 6)))
            ends = numpy.arange(1, points + 1) % 250 == 0
            source, imported = f"{folder}/{points}.npz", f"{folder}/{points}.parquet"
            numpy.savez(source, **arrays, rewards=numpy.zeros(points), timeouts=ends)
            called("demo", "import", source, f"--env={ENV}", f"--out={imported}")
            # A tolerance that holds, so that no recovery of 500 passes over the demonstration comes in between.
            settings = [f"demonstrations={imported}", "algorithms.mcpo.d=10"]
            measured, megabytes = bench(iterations, "mcpo", *settings)
            seconds = measured["phases"]["mimicry"]
            share = seconds / measured["seconds"]
            speed = f"{measured['steps_per_cpu_s']:,.0f}"
            milliseconds = f"{1e3 * seconds / measured['iterations']:.1f}"
            row(f"{points:,}", speed, f"{measured['floor_ratio']:.0%}", milliseconds, f"{share:.1%}", f"{megabytes:.0f}")


def matrix(folder, seeds, more, envs=(ENV,)):
    path = pathlib.Path(folder, "growth.toml")
    seeds, demos = list(range(seeds)), ROOT / "experiments" / "demos" / "{env}.parquet"
    path.write_text(
        f"name = 'growth'\ndemonstrations = '{demos}'\n{more}\n"
        f"[[matrix]]\nseed = {seeds}\nenv = {list(envs)}\nalgorithm = ['ppo']\n"
    )
    return path


def jobs(_):
    """A campaign of eight runs with everything that belongs to one: evaluations, records, the report."""
    steps = 40_960
    table("jobs", "steps/s of wall time", "MB of the largest process")
    for count in range(1, (os.cpu_count() or 1) + 1):
        with tempfile.TemporaryDirectory() as folder:
            path = matrix(folder, 8, f"budget.env_steps = {steps}\nevaluation.final_episodes = 2")
            began = time.perf_counter()
            _, megabytes = called("run", path, f"--results={folder}/results", f"--jobs={count}", "--quiet")
            row(count, f"{8 * steps / (time.perf_counter() - began):,.0f}", f"{megabytes:.0f}")


def idle(_):
    """How much of the cores' time goes by without training while runs wait: ten runs of five lengths, one a core.

    Counted from the call to the first rollout of the last run, in which the queue becomes empty. A place trains while its
    run does what run.json counts as its seconds: rollouts, updates, evaluations, the writing of tables. All else is idle: the
    start of the program, and of each run's process, the last renaming, the end of the process and the hand-over to the next.
    That takes as long for runs of any length, so that the share is the smaller the longer the runs are.

    run.json names times to the second; but it is written as a run's seconds end, so that the file's time is their end.
    """
    count = min(os.cpu_count() or 1, 5)  # half of the runs wait at least
    envs = [ENV, "Hopper-v2", "Walker2d-v2", "InvertedPendulum-v2", "InvertedDoublePendulum-v2"]
    with tempfile.TemporaryDirectory() as folder:
        # Two seeds are too few for a verdict on the paper's numbers, which would decide the exit status.
        path = matrix(folder, 2, "budget.env_steps = 81_920", envs)
        called_at = time.time()
        called("run", path, f"--results={folder}/results", f"--jobs={count}", "--quiet")
        files = list(pathlib.Path(folder).glob("results/**/run.json"))
        ends = [file.stat().st_mtime_ns / 1e9 for file in files]
        begins = [end - json.loads(file.read_text())["seconds"] for file, end in zip(files, ends)]
    last = max(begins)
    span = last - called_at
    trained = sum(min(end, last) - begin for begin, end in zip(begins, ends))
    table("runs", "jobs", "s until the last run starts", "of the places' time without training")
    row(len(files), count, f"{span:.1f}", f"{1 - trained / (count * span):.1%}")


def start(_):
    """From the start of a worker process to the end of its first step in each of eight environments, and the update."""
    with tempfile.TemporaryDirectory() as folder:
        tiny = "budget.env_steps = 8\nrollout.steps = 8\nmax_steps = 1\nalgorithms.ppo.minibatch = 8"
        path = matrix(folder, 1, tiny + "\nevaluation = { episodes = 1, final_episodes = 1 }")
        called("run", path, f"--results={folder}/results", "--quiet")
        [manifest] = pathlib.Path(folder).glob("results/**/run.json")
        stamp = json.loads(manifest.read_text())["stamp"]
        walls, cpus = [], []
        for attempt in range(20):
            results = {"Unix": list(os.fsencode(f"{folder}/{attempt}"))}  # paths travel as bytes
            job = {"results": results, "stamp": stamp, "verbose": False, "threads": 1}
            began = time.perf_counter()
            process = subprocess.Popen([PROGRAM, "worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            process.stdin.write(json.dumps(job) + "\n")
            process.stdin.flush()
            for line in process.stdout:
                if "iteration" in line:
                    walls.append(1e3 * (time.perf_counter() - began))
                    nanoseconds = pathlib.Path(f"/proc/{process.pid}/schedstat").read_text().split()[0]
                    cpus.append(1e-6 * int(nanoseconds))
                    break
            process.communicate()
        table("start of a worker to its first iteration's end", "ms of wall time", "ms on the core")
        row("least of 20", f"{min(walls):.0f}", f"{min(cpus):.0f}")
        row("median", f"{numpy.median(walls):.0f}", f"{numpy.median(cpus):.0f}")


def main():
    parts = [environments, width, minibatch, demonstration, jobs, idle, start]
    names = [part.__name__ for part in parts]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=names, default=names)
    parser.add_argument("--iterations", type=int, default=3)
    arguments = parser.parse_args()
    for part in parts:
        if part.__name__ in arguments.only:
            part(arguments.iterations)


if __name__ == "__main__":
    main()
