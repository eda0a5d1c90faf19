"""Shared by all peers: the task, the clock, the counting of passes, and the environments' names."""

import time
from dataclasses import dataclass

from work import HIDDEN, Passes

ROLLOUT = 4096
EPOCHS = 10


@dataclass
class Task:
    """The training task, and its length."""

    algorithm: str
    env: str
    environments: int
    minibatch: int
    iterations: int
    cg_iterations: int

    @property
    def steps_each(self):
        """Steps of a rollout in each environment."""
        return ROLLOUT // self.environments

    @property
    def timesteps(self):
        """Steps of the whole training, with the iteration that is not measured."""
        return ROLLOUT * (1 + self.iterations)


class Clock:
    """Reads the time at the start of training and after each iteration. The first iteration is not measured:
    compilation falls into it, and so does the counting of passes, which takes time."""

    def __init__(self):
        self.passes = Passes()
        self.readings = []
        self.hooks = []

    def read(self, steps):
        if len(self.readings) == 1:
            for remove in self.hooks:
                remove()
        self.readings.append((steps, time.perf_counter(), time.process_time()))

    def measured(self):
        (steps, wall, cpu), (last_steps, last_wall, last_cpu) = self.readings[1], self.readings[-1]
        return {"env_steps": last_steps - steps, "seconds": last_wall - wall, "cpu_seconds": last_cpu - cpu}

    def count_torch(self, policy, value):
        """Counts the samples that pass the modules' last layers, until the first iteration ends. Each pass counts as
        one backward pass: differentiating again is counted as a Fisher product."""

        for name, layer in (("policy", policy), ("value", value)):

            def count(_, inputs, output, name=name):
                samples = output.numel() // output.shape[-1]
                self.passes.forward[name] += samples
                if output.requires_grad:

                    def count_back(_):
                        handle.remove()
                        self.passes.back[name] += samples

                    handle = output.register_hook(count_back)

            self.hooks.append(layer.register_forward_hook(count).remove)

    def count_calls(self, owner, product):
        """Likewise counts the calls of `owner`'s method `product`, as Fisher products on the whole rollout."""
        original = getattr(owner, product)
        self.passes.fisher_samples = ROLLOUT

        def counted(*positional, **named):
            self.passes.fisher_products += 1
            return original(*positional, **named)

        setattr(owner, product, counted)
        self.hooks.append(lambda: setattr(owner, product, original))


def mlp(inputs, outputs):
    """A torch network from `inputs` to `outputs` numbers through the hidden layers."""
    from torch import nn

    first, second = HIDDEN
    return nn.Sequential(
        nn.Linear(inputs, first), nn.Tanh(), nn.Linear(first, second), nn.Tanh(), nn.Linear(second, outputs)
    )


def gymnasium_id(env):
    """The name under which `gymnasium.make` knows the environment: Ant's has 111 observations here."""
    import gymnasium

    gymnasium.logger.min_level = gymnasium.logger.ERROR  # v4 is old, and what this project runs
    if env != "Ant-v4":
        return env
    kwargs = gymnasium.spec(env).kwargs | {"use_contact_forces": True}
    entry = gymnasium.spec(env).entry_point
    gymnasium.register("AntWithContacts-v4", entry_point=entry, max_episode_steps=1000, kwargs=kwargs)
    return "AntWithContacts-v4"
