#!/usr/bin/env python3
"""Losses, gradients, advantages and densities of the algorithms by numpy, for the tests.

    pip install numpy
    python algorithms.py           prints the numbers and writes algorithms.json beside this file

Inputs are rounded to f32 first, since that is what the program gets; everything else is f64. Gradients are by
backpropagation written out here, and checked here against central differences.
"""

import json
import pathlib

import numpy

FOLDER = pathlib.Path(__file__).parent
RNG = numpy.random.default_rng(1911)
HIDDEN = [5, 4]
OBSERVATION, ACTION, SAMPLES = 3, 2, 12


def rounded(array):
    return numpy.asarray(array).astype("f4").astype("f8")


def normal(*shape, scale=1.0):
    return rounded(RNG.normal(0.0, scale, shape))


def network(widths):
    """Flat parameters: layer by layer the weights [out x in] by columns, then the biases."""
    return numpy.concatenate([normal((i + 1) * o, scale=0.6) for i, o in zip(widths, widths[1:])])


def layers(parameters, widths):
    at = 0
    for i, o in zip(widths, widths[1:]):
        yield parameters[at : at + i * o].reshape((o, i), order="F"), parameters[at + i * o : at + (i + 1) * o]
        at += (i + 1) * o


def forward(parameters, widths, x):
    """Activations of every layer [width x n]; the last is the output."""
    activations = [x]
    for number, (weights, biases) in enumerate(layers(parameters, widths), start=2):
        z = weights @ activations[-1] + biases[:, None]
        activations.append(z if number == len(widths) else numpy.tanh(z))
    return activations


def backward(parameters, widths, activations, cotangent):
    """The gradient of sum(cotangent * output)."""
    parts = []
    for (weights, _), below in reversed(list(zip(layers(parameters, widths), activations))):
        parts.append(numpy.concatenate([(cotangent @ below.T).flatten(order="F"), cotangent.sum(axis=1)]))
        cotangent = (weights.T @ cotangent) * (1 - below**2)
    return numpy.concatenate(parts[::-1])


def checked(loss_and_gradient, parameters):
    """The loss and its gradient, once central differences agree."""
    loss, gradient = loss_and_gradient(parameters)
    for i in range(len(parameters)):
        step = numpy.zeros(len(parameters))
        step[i] = 1e-6
        slope = (loss_and_gradient(parameters + step)[0] - loss_and_gradient(parameters - step)[0]) / 2e-6
        assert abs(slope - gradient[i]) < 1e-7 * max(1, abs(slope)), (i, slope, gradient[i])
    return loss, gradient


def adam(parameters, gradient, rate):
    """The first step: both moments, corrected for their start, are the gradient and its square."""
    return parameters - rate * gradient / (numpy.sqrt(gradient**2) + 1e-8)


POLICY = [OBSERVATION, *HIDDEN, ACTION]


def log_density(parameters, observations, actions):
    """log pi(a|s) [n], and the gradient of its sum weighted by `weights`."""
    activations = forward(parameters[:-ACTION], POLICY, observations)
    log_std = parameters[-ACTION:, None]
    z = (actions - activations[-1]) / numpy.exp(log_std)
    densities = (-0.5 * z**2 - log_std - 0.5 * numpy.log(2 * numpy.pi)).sum(axis=0)

    def gradient(weights):
        by_mean = backward(parameters[:-ACTION], POLICY, activations, weights * z / numpy.exp(log_std))
        return numpy.concatenate([by_mean, (weights * (z**2 - 1)).sum(axis=1)])

    return densities, gradient


def softplus(x):
    return numpy.logaddexp(0, x)


def main():
    policy = numpy.concatenate([network(POLICY), rounded([-0.7, 0.2])])
    other = numpy.concatenate([policy[:-ACTION] + normal(len(policy) - ACTION, scale=0.05), rounded([-0.65, 0.15])])
    observations, actions = normal(OBSERVATION, SAMPLES), normal(ACTION, SAMPLES)
    shared = {"policy": policy, "other_policy": other, "observations": observations.T, "actions": actions.T}

    # The Gaussian: KL(policy || other), by its textbook formula.
    means, other_means = (forward(p[:-ACTION], POLICY, observations)[-1] for p in (policy, other))
    variance, other_variance = (numpy.exp(2 * p[-ACTION:, None]) for p in (policy, other))
    kl = 0.5 * (numpy.log(other_variance / variance) + (variance + (means - other_means) ** 2) / other_variance - 1)
    gaussian = {
        "log_densities": log_density(policy, observations, actions)[0],
        "kl": kl.sum(axis=0).mean(),
        "entropy": 0.5 * numpy.log(2 * numpy.pi * numpy.e * variance).sum(),
    }

    # Behaviour cloning on the normalised demonstration (mean and deviation by n - 1).
    mean, std = observations.mean(axis=1, keepdims=True), observations.std(axis=1, ddof=1, keepdims=True)
    inputs = (observations - mean) / (std + 1e-8)

    def mse(parameters):
        activations = forward(parameters[:-ACTION], POLICY, inputs)
        errors = activations[-1] - actions
        by_mean = backward(parameters[:-ACTION], POLICY, activations, 2 * errors / SAMPLES)
        return (errors**2).sum() / SAMPLES, numpy.concatenate([by_mean, numpy.zeros(ACTION)])

    def nll(parameters):
        densities, gradient = log_density(parameters, inputs, actions)
        return -densities.mean(), gradient(numpy.full(SAMPLES, -1 / SAMPLES))

    cloning = {}
    for name, loss_of in [("mse", mse), ("nll", nll)]:
        loss, gradient = checked(loss_of, policy)
        after = adam(policy, gradient, 1e-2)
        cloning[name] = {"loss": loss, "gradient": gradient, "after": after, "loss_after": loss_of(after)[0]}

    # PPO: the mean of min(ratio A, clip(ratio, 0.8, 1.2) A), with scaled advantages; old densities from `other`.
    advantages = normal(SAMPLES)
    scaled = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
    old = log_density(other, observations, actions)[0]

    def clipped(parameters):
        densities, gradient = log_density(parameters, observations, actions)
        ratios = numpy.exp(densities - old)
        surrogate = numpy.minimum(ratios * scaled, numpy.clip(ratios, 0.8, 1.2) * scaled)
        counts = ratios * scaled <= numpy.clip(ratios, 0.8, 1.2) * scaled
        return -surrogate.mean(), gradient(-numpy.where(counts, ratios * scaled, 0.0) / SAMPLES)

    loss, gradient = checked(clipped, policy)
    ratios = numpy.exp(log_density(policy, observations, actions)[0] - old)
    outside = int((numpy.abs(ratios - 1) > 0.2).sum())
    assert 2 < outside < SAMPLES - 2
    ppo = {"advantages": advantages, "loss": loss, "gradient": gradient, "outside": outside, "after": adam(policy, gradient, 1e-2)}

    # GAE over an episode that terminated, one that the time limit cut, and one that the rollout's end cut.
    widths = [OBSERVATION, *HIDDEN, 1]
    value, rewards, last = network(widths), normal(SAMPLES), normal(OBSERVATION, 2)
    values = forward(value, widths, observations)[-1][0]
    last_values = forward(value, widths, last)[-1][0]
    found = numpy.zeros(SAMPLES)
    for start, end, after in [(0, 4, 0.0), (4, 9, last_values[0]), (9, SAMPLES, last_values[1])]:
        next_values = numpy.append(values[start + 1 : end], after)
        errors = rewards[start:end] + 0.9 * next_values - values[start:end]
        found[start:end] = [sum((0.9 * 0.7) ** k * error for k, error in enumerate(errors[i:])) for i in range(end - start)]
    gae = {"value": value, "rewards": rewards, "last": last.T, "advantages": found, "returns": found + values}

    # The discriminator: D near 1 on the agent's pairs, 0 on the demonstration's.
    widths = [OBSERVATION + ACTION, *HIDDEN, 1]
    discriminator = network(widths)
    theirs = numpy.vstack([normal(OBSERVATION, 7), normal(ACTION, 7)])
    ours = numpy.vstack([observations, actions])

    def binary(parameters):
        activations = forward(parameters, widths, numpy.hstack([ours, theirs]))
        d = 1 / (1 + numpy.exp(-activations[-1][0]))
        agent, demonstration = d[:SAMPLES], d[SAMPLES:]
        loss = -numpy.log(agent).mean() - numpy.log(1 - demonstration).mean()
        slope = numpy.concatenate([(agent - 1) / SAMPLES, demonstration / 7])
        return loss, backward(parameters, widths, activations, slope[None])

    loss, gradient = checked(binary, discriminator)
    after = adam(discriminator, gradient, 1e-2)
    logits = forward(after, widths, ours)[-1][0]
    adversarial = {
        "network": discriminator,
        "demonstration_observations": theirs[:OBSERVATION].T,
        "demonstration_actions": theirs[OBSERVATION:].T,
        "loss": loss,
        "after": after,
        "rewards": rewards + 0.1 * softplus(-logits),
    }

    found = {**shared, "gaussian": gaussian, "cloning": cloning, "ppo": ppo, "gae": gae, "discriminator": adversarial}
    for name in ("gaussian", "ppo", "discriminator"):
        print(name, {key: float(number) for key, number in found[name].items() if numpy.ndim(number) == 0})
    print("cloning", {name: float(case["loss"]) for name, case in cloning.items()})
    text = json.dumps(found, default=lambda array: array.tolist())
    (FOLDER / "algorithms.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
