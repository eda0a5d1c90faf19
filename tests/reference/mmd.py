#!/usr/bin/env python3
"""MMD^2, its gradient, its witness and the median heuristic by scikit-learn, for the tests.

    pip install numpy scikit-learn
    python mmd.py                  prints the numbers and writes mmd.json beside this file

Points are rounded to f32 first, since that is what the program gets; everything else is f64.
"""

import json
import pathlib

import numpy
from sklearn.metrics.pairwise import euclidean_distances, rbf_kernel

FOLDER = pathlib.Path(__file__).parent


def mmd(samples, target, sigma):
    gamma = 1 / (2 * sigma**2)
    n, m = len(samples), len(target)
    own, cross, other = (rbf_kernel(*pair, gamma=gamma) for pair in [(samples, samples), (samples, target), (target, target)])
    v = own.mean() - 2 * cross.mean() + other.mean()
    u = (own.sum() - n) / (n * (n - 1)) - 2 * cross.mean() + (other.sum() - m) / (m * (m - 1))
    witness_v = own.mean(axis=1) - cross.mean(axis=1)
    witness_u = (own.sum(axis=1) - 1) / (n - 1) - cross.mean(axis=1)
    # d/dx of both double sums.
    pull = lambda kernel, points: samples * kernel.sum(axis=1, keepdims=True) - kernel @ points
    gradient = -4 * gamma * (pull(own, samples) / n**2 - pull(cross, target) / (n * m))
    return {
        "sigma": sigma,
        "v": v,
        "u": u,
        "witness_v": witness_v.tolist(),
        "witness_u": witness_u.tolist(),
        "gradient_v": gradient.tolist(),
    }


def main():
    rng = numpy.random.default_rng(1911)
    cases = []
    for n, m, dim, near in [(6, 9, 3, None), (10, 10, 23, 0.05), (8, 5, 4, None)]:
        target = rng.normal(2.0, 1.0, (m, dim)).astype("f4").astype("f8")
        samples = rng.normal(1.5, 1.2, (n, dim)) if near is None else target + rng.normal(0, near, (n, dim))
        samples = samples.astype("f4").astype("f8")
        distances = euclidean_distances(target)[numpy.triu_indices(m, 1)]
        case = {"samples": samples.tolist(), "target": target.tolist(), "median": float(numpy.median(distances))}
        case["results"] = [mmd(samples, target, sigma) for sigma in (1.0, case["median"])]
        for result in case["results"]:
            print(f"n {n} m {m} dim {dim} sigma {result['sigma']:.6f}: V {result['v']:.9f} U {result['u']:.9f}")
        cases.append(case)
    (FOLDER / "mmd.json").write_text(json.dumps(cases, indent=0).replace("\n", " ") + "\n")


if __name__ == "__main__":
    main()
