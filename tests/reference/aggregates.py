#!/usr/bin/env python3
"""Aggregate scores, probability of improvement and performance profile by rliable (Agarwal et al., 2021), for the tests.

    pip install rliable 'pandas<3'
    python aggregates.py           writes aggregates.json beside this file
"""

import json
import pathlib

import numpy
from rliable import library, metrics

FOLDER = pathlib.Path(__file__).parent
SEEDS, TASKS, RESAMPLES = 5, 7, 50_000
THRESHOLDS = numpy.linspace(-0.25, 1.5, 8)

draw = numpy.random.RandomState(20210830)
# Runs by tasks, as rliable has them; one method with a failing task, one above the expert.
ours = numpy.round(draw.normal(numpy.linspace(0.2, 1.2, TASKS), 0.15, (SEEDS, TASKS)), 6)
others = numpy.round(draw.normal(numpy.linspace(0.4, 0.8, TASKS), 0.25, (SEEDS, TASKS)), 6)


def intervals(scores, function):
    """The value, and the ends of rliable's stratified percentile bootstrap."""
    values, ends = library.get_interval_estimates(
        {"ours": scores}, function, method="percentile", reps=RESAMPLES, random_state=numpy.random.RandomState(1)
    )
    return [numpy.ravel(part).tolist() for part in (values["ours"], *ends["ours"])]


aggregate = lambda scores: numpy.array(
    [metrics.aggregate_iqm(scores), metrics.aggregate_median(scores), metrics.aggregate_mean(scores), metrics.aggregate_optimality_gap(scores)]
)
profile, ends = library.create_performance_profile({"ours": ours}, THRESHOLDS, use_score_distribution=True, reps=RESAMPLES)
improvement, between = library.get_interval_estimates(
    {"ours": (ours, others)},
    lambda x, y: numpy.array([metrics.probability_of_improvement(x, y)]),
    method="percentile",
    reps=RESAMPLES // 10,  # scipy's test takes long
    random_state=numpy.random.RandomState(1),
)
(FOLDER / "aggregates.json").write_text(
    json.dumps(
        {
            "ours": ours.T.tolist(),
            "others": others.T.tolist(),
            "iqm median mean optimality_gap": intervals(ours, aggregate),
            "thresholds": THRESHOLDS.tolist(),
            "profile": [profile["ours"].tolist(), *ends["ours"].tolist()],
            "improvement": [numpy.ravel(part).tolist() for part in (improvement["ours"], *between["ours"])],
        },
        indent=1,
    )
    + "\n"
)
