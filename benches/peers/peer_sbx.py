"""SBX's PPO: Stable-Baselines3's, with networks and minibatch steps in JAX."""

import one_thread  # isort: skip  (before JAX)
import flax.linen
import jax
import torch
from sbx import PPO

from common import EPOCHS, ROLLOUT
from peer_sb3 import Iterations, settings, shapes


def settle(model):
    jax.block_until_ready((model.policy.actor_state.params, model.policy.vf_state.params))


def train(task, clock):
    assert task.algorithm == "ppo", "SBX has no TRPO"
    torch.set_num_threads(1)
    model = PPO(n_epochs=EPOCHS, **settings(task, flax.linen.tanh))
    update = model._one_update

    def counted(**batch):
        for passes in (clock.passes.forward, clock.passes.back):
            for network in passes:
                passes[network] += len(batch["observations"])
        return update(**batch)

    model._one_update = counted
    clock.hooks.append(lambda: setattr(model, "_one_update", update))
    # The rollout's passes are compiled and cannot be hooked: one of each network a step, and values after the last.
    clock.passes.forward = {"policy": ROLLOUT, "value": ROLLOUT + task.environments}
    model.learn(task.timesteps, callback=Iterations(clock, settle))
    return shapes(model)
