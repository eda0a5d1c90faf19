"""A lean PPO in JAX: acting is one compiled call, and so are all epochs of an update."""

import one_thread  # isort: skip  (before JAX)
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import optax

import lean
from common import EPOCHS, HIDDEN, ROLLOUT


def network(key, inputs, outputs, scale):
    """Weights and biases, layer by layer."""
    widths = (inputs, *HIDDEN, outputs)
    scales = (1.0, 1.0, scale)
    return [
        (scale * jax.random.uniform(key, (a, b), minval=-1, maxval=1) / a**0.5, jnp.zeros(b))
        for key, a, b, scale in zip(jax.random.split(key, 3), widths, widths[1:], scales)
    ]


def apply(layers, x):
    for weights, biases in layers[:-1]:
        x = jnp.tanh(x @ weights + biases)
    weights, biases = layers[-1]
    return x @ weights + biases


def log_density(log_std, mean, actions):
    z = (actions - mean) * jnp.exp(-log_std)
    return (-0.5 * z * z - log_std - lean.HALF_LOG_2PI).sum(-1)


@jax.jit
def act(parameters, observations, noise):
    mean = apply(parameters["policy"], observations)
    actions = mean + noise * jnp.exp(parameters["log_std"])
    return actions, log_density(parameters["log_std"], mean, actions), value(parameters, observations)


@jax.jit
def value(parameters, observations):
    return apply(parameters["value"], observations)[:, 0]


def loss(parameters, observations, actions, old, advantages, returns):
    advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
    mean = apply(parameters["policy"], observations)
    ratio = jnp.exp(log_density(parameters["log_std"], mean, actions) - old)
    clipped = jnp.clip(ratio, 1 - lean.CLIP, 1 + lean.CLIP)
    surrogate = jnp.minimum(ratio * advantages, clipped * advantages).mean()
    return 0.5 * ((value(parameters, observations) - returns) ** 2).mean() - surrogate


ADAM = optax.chain(optax.clip_by_global_norm(lean.CLIP_GRADIENT), optax.adam(lean.RATE, eps=1e-5))


@partial(jax.jit, static_argnames="minibatch", donate_argnums=(0, 1))
def update(parameters, state, key, batch, minibatch):
    def step(carry, chosen):
        parameters, state = carry
        gradient = jax.grad(loss)(parameters, *(column[chosen] for column in batch))
        changes, state = ADAM.update(gradient, state)
        return (optax.apply_updates(parameters, changes), state), None

    orders = [jax.random.permutation(key, ROLLOUT) for key in jax.random.split(key, EPOCHS)]
    return jax.lax.scan(step, (parameters, state), jnp.concatenate(orders).reshape(-1, minibatch))[0]


def train(task, clock):
    assert task.algorithm == "ppo", "the lean programs are of PPO"
    env = lean.physics(task.env, task.environments)
    policy_key, value_key, key = jax.random.split(jax.random.PRNGKey(0), 3)
    parameters = {
        "policy": network(policy_key, env.observation, env.action, 0.01),
        "value": network(value_key, env.observation, 1, 1.0),
        "log_std": jnp.zeros(env.action),
    }
    state = ADAM.init(parameters)
    buffer, rng = lean.Buffer(task, env), np.random.default_rng(0)
    clock.passes = lean.passes(task, EPOCHS)
    observations = env.reset()
    clock.read(0)
    for iteration in range(1, 2 + task.iterations):
        noise = rng.standard_normal(buffer.actions.shape, dtype=np.float32)
        now = partial(value, parameters)
        observations = buffer.collect(env, observations, lambda t, seen: act(parameters, seen, noise[t]), now)
        batch = buffer.flat(np.asarray(now(observations)))
        key, own = jax.random.split(key)
        parameters, state = update(parameters, state, own, batch, task.minibatch)
        jax.block_until_ready(parameters)
        clock.read(iteration * ROLLOUT)
    return env.observation, env.action, env.physics
