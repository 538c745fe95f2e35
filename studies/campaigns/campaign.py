"""A campaign, declared: every combination of a grid, each with draws of what is random."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from studies.campaigns.trial import Trial, Value
from symheli.errors import InputError, UnknownNameError

SEED = "seed"
SEEDS_BELOW = 2**31


@dataclass(frozen=True)
class Normal:
    """A parameter drawn from a normal distribution."""

    mean: float
    deviation: float

    def __post_init__(self) -> None:
        if not self.deviation >= 0:
            raise InputError(f"a deviation is at least 0, got {self.deviation!r}")

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        return float(rng.normal(self.mean, self.deviation))


@dataclass(frozen=True)
class Uniform:
    """A parameter drawn evenly between `low` and `high`."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise InputError(f"low is at most high, got {self.low!r} and {self.high!r}")

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        return float(rng.uniform(self.low, self.high))


@dataclass(frozen=True)
class Case:
    """One run of a trial: all its parameters. `key` is a digest of them, the same in every
    campaign.
    """

    parameters: Mapping[str, Value]

    @property
    def key(self) -> str:
        """Twenty hexadecimal digits."""
        return _digest(self.parameters)[:20]


@dataclass(frozen=True, eq=False)
class Campaign:
    """Cases of a trial: every combination of the values in `grid`, each `draws` times with the
    parameters in `random` drawn anew and a new `seed`.

    Seeds and draws come from what a case is, never from its place: from the number of the draw,
    `root`, and the grid values but those of the axes in `paired`. Cases that differ along a paired
    axis alone have the same draws, so that what is compared is not what was drawn. A seed that is
    in the grid or in `fixed` is taken as it is.

    Parameters
    ----------
    trial : Trial
        What is repeated.
    grid : mapping of str to sequence
        Values by parameter.
    draws : int
        Of each combination.
    random : mapping of str to Normal or Uniform
        Parameters that are drawn.
    paired : sequence of str
        Axes of the grid along which draws stay the same.
    fixed : mapping of str to value
        Parameters of all cases; those not named anywhere have the default of the trial.
    root : int
        Another one draws everything anew.

    Raises
    ------
    InputError
        A parameter the trial does not have, a value of another kind, an axis without values, two
        cases that are one, or draws of what is not random.

    Examples
    --------
    >>> def pendulum(*, length: float = 1.0, seed: int = 0) -> dict[str, float]:
    ...     rng = np.random.default_rng(seed)
    ...     return {"period": 2 * np.pi * np.sqrt(length / rng.normal(9.81, 0.01))}
    >>> trial = Trial(pendulum, {"period": "s"})
    >>> campaign = Campaign(trial, grid={"length": [0.5, 1.0]}, draws=3, paired=["length"])
    >>> [case.parameters["length"] for case in campaign.cases]
    [0.5, 1.0, 0.5, 1.0, 0.5, 1.0]
    >>> seeds = [case.parameters["seed"] for case in campaign.cases]
    >>> seeds[0] == seeds[1], seeds[0] == seeds[2]
    (True, False)
    """

    trial: Trial
    grid: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    draws: int = 1
    random: Mapping[str, Normal | Uniform] = field(default_factory=dict)
    paired: Sequence[str] = ()
    fixed: Mapping[str, Any] = field(default_factory=dict)
    root: int = 0
    cases: tuple[Case, ...] = field(init=False, repr=False)
    """In order: all combinations of the first draw, then of the second: more draws come last."""

    def __post_init__(self) -> None:
        self._refuse()
        kind = self.trial.of_kind
        fixed = {n: kind(n, v) for n, v in (self.trial.defaults | dict(self.fixed)).items()}
        axes = {n: [kind(n, v) for v in values] for n, values in self.grid.items()}
        seeded = SEED in fixed and SEED not in axes and SEED not in self.fixed
        cases = []
        for draw in range(self.draws):
            for point in itertools.product(*axes.values()):
                at = dict(zip(axes, point, strict=True))
                sources = self._sources(fixed, at, draw)
                drawn: dict[str, Value] = {
                    name: kind(name, what.draw(sources(name))) for name, what in self.random.items()
                }
                if seeded:
                    drawn[SEED] = int(sources(SEED).integers(SEEDS_BELOW))
                cases.append(Case(fixed | at | drawn))
        if len({case.key for case in cases}) < len(cases):
            raise InputError("two cases of this campaign are the same: name each value once")
        object.__setattr__(self, "cases", tuple(cases))

    def _sources(self, fixed: dict[str, Value], at: dict[str, Value], draw: int) -> Any:
        """A generator for each name, from what the case is."""
        whole = {n: v for n, v in (fixed | at).items() if n not in self.paired and n != SEED}
        about = _digest({"trial": self.trial.name, "case": whole, "root": self.root, "draw": draw})

        def source(name: str) -> np.random.Generator:
            words = (int(about, 16), int(_digest(name), 16))
            return np.random.default_rng(np.random.SeedSequence(words))

        return source

    def _refuse(self) -> None:
        for one, other in itertools.combinations((self.grid, self.random, self.fixed), 2):
            if twice := sorted(set(one) & set(other)):
                raise InputError(
                    f"{', '.join(twice)}: given twice; give each parameter in one place only"
                )
        for name, values in self.grid.items():
            if isinstance(values, str) or not len(values):
                raise InputError(f"the axis {name} needs a list of values, got {values!r}")
        for name in self.paired:
            if name not in self.grid:
                raise UnknownNameError("axis of the grid", name, self.grid)
        if isinstance(self.draws, bool) or not isinstance(self.draws, int) or self.draws < 1:
            raise InputError(f"draws must be a whole number of at least 1, got {self.draws!r}")
        given = SEED in self.grid or SEED in self.fixed or SEED not in self.trial.defaults
        if self.draws > 1 and given and not self.random:
            raise InputError(
                f"nothing is random in {self.trial.name} with these parameters: leave the seed to"
                " the campaign, draw a parameter, or set draws to 1"
            )


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
