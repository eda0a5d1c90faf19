"""How much an iteration computes, counted from shapes and passes: the counts of `mcpo-run bench`
(src/algo/operations.rs), for any program."""

from dataclasses import dataclass, field

HIDDEN = (300, 400)


@dataclass
class Passes:
    """The work of one iteration: the samples of the networks' forward passes, and of the backward passes to the
    weights' gradient; and the number of Fisher products, each on `fisher_samples`."""

    forward: dict[str, int] = field(default_factory=lambda: {"policy": 0, "value": 0})
    back: dict[str, int] = field(default_factory=lambda: {"policy": 0, "value": 0})
    fisher_products: int = 0
    fisher_samples: int = 0


def gflop(observation, action, passes):
    """1e9 floating-point operations of matrix products, 2 for a multiplication with its addition. With P weights, P_1 of
    them the first layer's and P_L the last's, A outputs and hidden layers of h_1 and h_2, a sample takes

        forward            2 P
        back               4 P - 2 P_1     the weights' gradient, and the way to it but for the last step
        Fisher product     4 P + 4 P_L + 4 A h_1, and 2 A h_1 h_2 once for all products on the same samples

    the last being what `bench` counts: a program that differentiates twice does more for the same product."""
    total = 0
    for name, outputs in (("policy", action), ("value", 1)):
        widths = (observation, *HIDDEN, outputs)
        layers = [a * b for a, b in zip(widths, widths[1:])]
        total += passes.forward[name] * 2 * sum(layers)
        total += passes.back[name] * (4 * sum(layers) - 2 * layers[0])
        if name == "policy" and passes.fisher_products:
            product = 4 * sum(layers) + 4 * layers[-1] + 4 * outputs * HIDDEN[0]
            total += passes.fisher_samples * (passes.fisher_products * product + 2 * outputs * layers[1])
    return total / 1e9
