"""What differs between the outputs: parameters that are swept, sampled, or bound to values of an item.

* ``--sweep fog.visibility=50,100,200`` makes every combination of the listed values for each image.
* ``--sample fog.visibility=lognormal(150,0.5)`` draws one value for each image (``draws`` of them, if asked).
* ``--bind density.time=time`` hands on a value of the item: of a column, or the time of a video frame.

A draw depends on the seed of the set, on the image (or the video it belongs to), on the parameter and on the number of
the draw, and on nothing else: order, shards and workers change nothing.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import yaml

from fogpipe.datasets.item import Item
from fogpipe.errors import InputError, RequestError, suggestion
from fogpipe.pipeline.reading import read_value

Draw = Callable[..., Any]
_DISTRIBUTIONS: dict[str, tuple[tuple[str, ...], Draw]] = {
    "uniform": (("low", "high"), lambda rng, low, high: rng.uniform(low, high)),
    "loguniform": (("low", "high"), lambda rng, low, high: math.exp(rng.uniform(math.log(low), math.log(high)))),
    "normal": (("mean", "deviation"), lambda rng, mean, deviation: rng.normal(mean, deviation)),
    "lognormal": (("median", "sigma"), lambda rng, median, sigma: median * math.exp(rng.normal(0, sigma))),
}
DISTRIBUTIONS = ", ".join(
    [*(f"{name}({', '.join(of)})" for name, (of, _) in _DISTRIBUTIONS.items()), "choice(a, b, …)"]
)
"""Every distribution, for people."""


@dataclass(frozen=True)
class Sweep:
    """One parameter and the values it takes in turn."""

    parameter: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Sample:
    """One parameter and the distribution it is drawn from."""

    parameter: str
    distribution: str
    arguments: tuple[Any, ...]

    def draw(self, rng: np.random.Generator) -> Any:
        """One value."""
        if self.distribution == "choice":
            return self.arguments[rng.integers(len(self.arguments))]
        return float(_DISTRIBUTIONS[self.distribution][1](rng, *self.arguments))


@dataclass(frozen=True)
class Variant:
    """One way in which an item is rendered.

    Attributes
    ----------
    key : tells it from the other variants of its item; empty where there is one only.
    settings : the parameters it sets.
    draw : number of the draw.
    seed : of everything random in it; variants that differ by a sweep share it.
    said_by : the option or column that sets each of the parameters, for messages.
    """

    key: str
    settings: Mapping[str, Any]
    draw: int
    seed: int
    said_by: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Variation:
    """Everything that differs between the outputs of a batch."""

    sweeps: tuple[Sweep, ...] = ()
    samples: tuple[Sample, ...] = ()
    binds: tuple[tuple[str, str], ...] = ()
    draws: int = 1

    @classmethod
    def parse(
        cls, sweeps: Sequence[str] = (), samples: Sequence[str] = (), binds: Sequence[str] = (), draws: int = 1
    ) -> Variation:
        """Read what the command line says.

        Raises
        ------
        RequestError
            If a text has another form, or a parameter is named twice.
        """
        bound = tuple(_split(text, "--bind", "STAGE.PARAMETER=VALUE_OF_THE_ITEM") for text in binds)
        found = cls(tuple(map(parse_sweep, sweeps)), tuple(map(parse_sample, samples)), bound, draws)
        if twice := [name for name in found.parameters if found.parameters.count(name) > 1]:
            raise RequestError(f"{twice[0]} is swept, sampled or bound twice; name it once.")
        if draws > 1 and not samples:
            raise RequestError(f"--draws {draws} needs something to draw: --sample STAGE.PARAMETER=DISTRIBUTION.")
        return found

    @property
    def parameters(self) -> list[str]:
        """Every parameter that is set here."""
        return [*self.differing, *(parameter for parameter, _ in self.binds)]

    @property
    def options(self) -> dict[str, str]:
        """The option that sets each parameter."""
        sweeps = {sweep.parameter: "--sweep" for sweep in self.sweeps}
        samples = {sample.parameter: "--sample" for sample in self.samples}
        return sweeps | samples | {parameter: "--bind" for parameter, _ in self.binds}

    @property
    def differing(self) -> list[str]:
        """Every parameter of which names must tell the value."""
        return [*(sweep.parameter for sweep in self.sweeps), *(sample.parameter for sample in self.samples)]

    def variants(self, item: Item, seed: int) -> list[Variant]:
        """Every variant of an item, in the order of the sweeps.

        Raises
        ------
        InputError
            If a value that is bound is none of the item's.
        """
        fixed = {name: _setting(value) for name, value in item.settings.items()}
        said_by = dict.fromkeys(fixed, f"{item.id}:") | self.options
        for parameter, name in self.binds:
            if name not in item.values:
                raise InputError(f'{item.id} has no value "{name}" to bind.{suggestion(name, item.values)}')
            fixed[parameter] = item.values[name]
        found = []
        for draw in range(self.draws):
            own_seed = seed_for(seed, owner(item), str(draw))
            drawn = {sample.parameter: self._drawn(sample, item, seed, draw) for sample in self.samples}
            for values in itertools.product(*(sweep.values for sweep in self.sweeps)):
                swept = dict(zip((sweep.parameter for sweep in self.sweeps), values, strict=True))
                parts = [f"{name}={value!r}" for name, value in swept.items()]
                parts += [f"draw={draw}"] if self.draws > 1 else []
                found.append(Variant(",".join(parts), fixed | drawn | swept, draw, own_seed, said_by))
        return found

    @staticmethod
    def _drawn(sample: Sample, item: Item, seed: int, draw: int) -> Any:
        return sample.draw(np.random.default_rng(seed_for(seed, owner(item), sample.parameter, str(draw))))


def owner(item: Item) -> str:
    """What random numbers belong to: frames of a video share them, or the fog would flicker."""
    return item.id if item.sequence is None else f"sequence {item.sequence}"


def seed_for(seed: int, *names: str) -> int:
    """A seed that depends on the seed of the set and these names, and on nothing else."""
    text = "\0".join([str(seed), *names])
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=7).digest(), "little")


def parse_sweep(text: str) -> Sweep:
    """Read ``stage.parameter=value,value,…``; RequestError where it is something else."""
    parameter, listed = _split(text, "--sweep", "STAGE.PARAMETER=VALUE,VALUE,…")
    values = _values(listed, f"--sweep {text}")
    if len({repr(value) for value in values}) < len(values):
        raise RequestError(f"--sweep {text}: a value is there twice.")
    return Sweep(parameter, values)


def parse_sample(text: str) -> Sample:
    """Read ``stage.parameter=distribution(number, …)``; RequestError where it is something else."""
    parameter, described = _split(text, "--sample", "STAGE.PARAMETER=DISTRIBUTION(…)")
    form = re.fullmatch(r"\s*(\w+)\s*\((.*)\)\s*", described)
    if not form or form[1] not in (*_DISTRIBUTIONS, "choice"):
        raise RequestError(f"--sample {text}: is not a distribution. There is: {DISTRIBUTIONS}.")
    arguments = _values(form[2], f"--sample {text}")
    if form[1] == "choice":
        return Sample(parameter, form[1], arguments)
    names = _DISTRIBUTIONS[form[1]][0]
    if len(arguments) != len(names) or not all(_is_number(value) for value in arguments):
        raise RequestError(f"--sample {text}: {form[1]} takes two numbers, {' and '.join(names)}.")
    first, second = map(float, arguments)
    if names == ("low", "high") and not first < second:
        raise RequestError(f"--sample {text}: low must be below high.")
    if form[1].startswith("log") and not first > 0:
        raise RequestError(f"--sample {text}: {names[0]} must be above 0.")
    if names[1] in ("deviation", "sigma") and second < 0:
        raise RequestError(f"--sample {text}: {names[1]} must be 0 or more.")
    return Sample(parameter, form[1], (first, second))


def _split(text: str, option: str, form: str) -> tuple[str, str]:
    name, equals, value = (part.strip() for part in text.partition("="))
    if not (equals and name and value):
        raise RequestError(f"{option} {text}: write it as {form}.")
    return name, value


def _values(text: str, where: str) -> tuple[Any, ...]:
    """Values separated by commas, each as a pipeline file would read it; a list is one value."""
    try:
        values = read_value(f"[{text}]")
    except yaml.YAMLError as error:
        raise RequestError(f"{where}: the values cannot be read; separate them by commas.") from error
    if not values:
        raise RequestError(f"{where}: names no value.")
    return tuple(values)


def _setting(value: Any) -> Any:
    return read_value(value) if isinstance(value, str) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
