"""Reads what `mcpo-run report --export tensorboard,rliable,marl-eval,csv,json` wrote with the programs that it is for.

    pip install tensorboard 'setuptools<81' rliable 'pandas<3' id-marl-eval
    python tests/report/read_exports.py results/comparison/report/export

Each part is skipped, which it says, where its program is not installed. Exits with 1 where one of them reads something else than
`evaluations.csv` holds.
"""

import csv
import json
import math
import sys
from collections import defaultdict
from pathlib import Path

folder = Path(sys.argv[1])
rows = list(csv.DictReader((folder / "evaluations.csv").open()))
final, every = defaultdict(list), defaultdict(lambda: defaultdict(list))
for row in rows:
    run = (row["env"], row["method"], row["seed"])
    every[run][int(row["env_steps"])].append(float(row["dense_return"]))
    if row["last"] == "true":
        final[run].append(float(row["dense_return"]))
mean = lambda values: sum(values) / len(values)


def tensorboard():
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
    from tensorboard.plugins.hparams import metadata

    for (env, method, seed), steps in every.items():
        events = EventAccumulator(str(folder / "tensorboard" / env / method / f"seed-{seed}"))
        events.Reload()
        read = {event.step: event.value for event in events.Scalars("evaluation/return")}
        assert read.keys() == steps.keys(), (read.keys(), steps.keys())
        assert all(math.isclose(read[step], mean(returns), rel_tol=1e-6, abs_tol=1e-6) for step, returns in steps.items())
        content = events.SummaryMetadata("_hparams_/session_start_info").plugin_data.content
        settings = metadata.parse_session_start_info_plugin_data(content).hparams
        assert settings["env"].string_value == env and settings["seed"].number_value == int(seed), settings
        assert len(settings) > 10 and len(events.Tags()["scalars"]) > 1, events.Tags()
        metadata.parse_session_end_info_plugin_data(events.SummaryMetadata("_hparams_/session_end_info").plugin_data.content)
    return f"{len(every)} runs"


def rliable():
    import numpy
    from rliable import metrics

    data = json.loads((folder / "rliable.json").read_text())
    for method, returns in data["returns"].items():
        envs = data["environments"][method]
        for column, env in enumerate(envs):
            wanted = {seed: mean(values) for (of, name, seed), values in final.items() if (of, name) == (env, method)}
            assert all(any(math.isclose(row[column], value) for value in wanted.values()) for row in returns), (method, env)
        scores = numpy.array(data["scores"][method])
        if scores.size:
            assert scores.shape == (len(returns), len(envs)) and math.isfinite(metrics.aggregate_iqm(scores))
    return f"{len(data['scores'])} methods"


def marl_eval():
    from marl_eval.utils.data_processing_utils import create_matrices_for_rliable, data_process_pipeline

    data = json.loads((folder / "marl-eval.json").read_text())
    (experiment, tasks), = data.items()
    for env, algorithms in tasks.items():
        for method, seeds in algorithms.items():
            for seed, steps in seeds.items():
                (read,) = steps["absolute_metrics"]["mean_episode_return"]
                assert math.isclose(read, mean(final[env, method, seed.removeprefix("seed_")]))
    # Its own pipeline needs as many seeds of every method, and as many evaluations in every environment.
    for env, algorithms in tasks.items():
        if len({len(seeds) for seeds in algorithms.values()}) == 1:
            processed = data_process_pipeline(raw_data={experiment: {env: algorithms}}, metrics_to_normalize=["mean_episode_return"])
            matrices, _ = create_matrices_for_rliable(processed, experiment, ["mean_episode_return"])
            assert matrices, processed.keys()
    return f"{len(tasks)} environments"


failed = False
for part in (tensorboard, rliable, marl_eval):
    try:
        print(f"{part.__name__}: {part()}")
    except ModuleNotFoundError as missing:
        print(f"{part.__name__}: skipped, {missing}")
    except AssertionError as wrong:
        failed = True
        print(f"{part.__name__}: reads something else: {wrong}")
sys.exit(failed)
