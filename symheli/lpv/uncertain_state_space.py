"""An LPV model known up to a matrix of bounded norm: every model of a set, as one value."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.linear_model import feedback_matrix
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.operators import Operators
from symheli.lpv.scheduling import Rates, Scheduling
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized

SAFETY = 2.0
"""Safety factor of a covering set on the largest measured difference."""

ROUNDING = 1e-12
"""Relative excess of a perturbation over its bound that counts as rounding."""


class DeltaPart(NamedTuple):
    """A full block on the diagonal of Delta, of this many rows and columns: a matrix, constant or
    moving in any way; `dynamic`: any causal dynamics of that gain, at rest at the start.
    """

    inputs: int
    outputs: int
    dynamic: bool = False


@dataclass(frozen=True, eq=False)
class UncertainStateSpace(Operators):
    """An uncertain LPV model is the set of the models with any block Delta, |Delta|_2 <= bound,
    between two of its signals.

    dx/dt = A x + B u + E d, y = C x + D u + F d, d = Delta v, v = G x + H u + J d; or sampled.

    All matrices are functions of the scheduling parameters, E, F, G, H and J known: `model` has the
    inputs (u, d) and the outputs (y, v). What is derived of the set (a loop closed around it, fewer
    or scaled channels) is derived of `model`; the block stays what it is.

    Parameters
    ----------
    model : LPVStateSpace
        With the block left open.
    perturbation_inputs, perturbation_outputs : sequence of str
        Its inputs d and outputs v: Delta is (nd, nv).
    bound : float
        Largest spectral norm of Delta, >= 0, in units of d per unit of v.
    probability : float
        With which the bound holds of what was modelled, in (0, 1].
    source : str
        What the bound promises, and by which argument: a sentence of every certificate.
    parts : sequence of DeltaPart, optional
        Delta = diag(Delta_1, ...), each of the parts of norm at most `bound`; empty: one full
        matrix.

    Raises
    ------
    InputError
        Names that the model does not have, a block without channels, a bound that is negative or
        not finite, a probability outside (0, 1], no source, parts that are not those of Delta.

    See Also
    --------
    synthesis.robust.robust_margin : how much more uncertainty a loop bears
    synthesis.l2_gain : worst-case gain while p moves

    Examples
    --------
    >>> import symheli
    >>> p = symheli.Scheduling("p", "1", low=0.0, high=1.0, rate=0.5)
    >>> open_block = symheli.LPVStateSpace.polynomial(
    ...     A=[[[0.5]]], B=[[[1.0, 1.0]]], C=[[[1.0], [1.0]]], D=[np.zeros((2, 2))], scheduling=p,
    ...     dt=0.1, states=["x"], inputs=["u", "d"], outputs=["y", "v"])
    >>> pole = symheli.UncertainStateSpace(  # x(k+1) = (0.5 + delta) x(k) + u(k)
    ...     open_block, ["d"], ["v"], bound=0.2, probability=0.95, source="a pole read off a plot")
    >>> float(pole.perturbed([[0.2]]).at(0.0).A[0, 0])
    0.7
    """

    model: LPVStateSpace
    perturbation_inputs: tuple[Signal, ...]
    perturbation_outputs: tuple[Signal, ...]
    bound: float
    probability: float
    source: str
    parts: tuple[DeltaPart, ...] = ()

    if TYPE_CHECKING:  # names that are given become signals

        def __init__(
            self,
            model: LPVStateSpace,
            perturbation_inputs: Sequence[str],
            perturbation_outputs: Sequence[str],
            bound: float,
            probability: float,
            source: str,
            parts: tuple[DeltaPart, ...] = (),
        ) -> None: ...

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        if not isinstance(self.model, LPVStateSpace):
            raise InputError(f"model: expected an LPVStateSpace, got {type(self.model).__name__}")
        for name, of, kind in (
            ("perturbation_inputs", self.model.inputs, "input of the model"),
            ("perturbation_outputs", self.model.outputs, "output of the model"),
        ):
            given = getattr(self, name)
            given = (given,) if isinstance(given, str) else tuple(given)
            if not given:
                raise InputError(f"{name}: expected one name or more, got none")
            known = tuple(of[i] for i in indices(given, of, kind))
            object.__setattr__(self, name, signals(known))
        for name, low, high in (("bound", 0.0, math.inf), ("probability", 0.0, 1.0)):
            value = getattr(self, name)
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            if not number or not math.isfinite(value) or not low <= value <= high:
                wanted = "a finite number >= 0" if name == "bound" else "a number in (0, 1]"
                raise InputError(f"{name}: expected {wanted}, got {value!r:.60}")
            object.__setattr__(self, name, float(value))
        if self.probability == 0.0:
            raise InputError("probability: expected a number in (0, 1], got 0")
        if not isinstance(self.source, str) or not self.source.strip():
            raise InputError(
                f"source: expected a sentence on the meaning of the bound, got {self.source!r:.60}"
            )
        object.__setattr__(self, "parts", tuple(DeltaPart(*part) for part in self.parts))
        sums = tuple(sum(part[i] for part in self.parts) for i in range(2))
        if self.parts and (sums != self.shape or min(min(part[:2]) for part in self.parts) < 1):
            raise InputError(
                f"parts: expected blocks of at least 1 x 1 that make a Delta of {self.shape}, got"
                f" {self.parts!r:.80}"
            )

    @classmethod
    def covering(cls, model: LPVStateSpace, differences: Array) -> UncertainStateSpace:
        """Return the set of all models that differ from `model` by up to `SAFETY` times the
        `differences` (K, nx, nx + nu) of [A B] that were measured.

        dx/dt = A x + B u + rows d, v = columns (x, u), d = Delta v, |Delta| <= 1, with the inputs
        d_<state> and the outputs z_<state>, z_<input>; every entry is covered, if only by a
        millionth of the largest. Raises `InputError` for differences of another size.

        Examples
        --------
        >>> import symheli, synthesis
        >>> lag = symheli.LPVStateSpace.polynomial(
        ...     [[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], symheli.Scheduling("p", "1", 0.0, 1.0))
        >>> around = symheli.UncertainStateSpace.covering(lag, np.array([[[0.0025, 0.0]]]))
        >>> cert = synthesis.l2_gain(around, 0.0, form=synthesis.forms.Spline(degree=0))
        >>> bool(1 / (1 - 0.005) <= cert.gamma < 1.006)
        True
        """
        nx, nu, ny = len(model.states), len(model.inputs), len(model.outputs)
        rows, columns = _sizes(frozen(differences, "differences", (None, nx, nx + nu)))
        one = model.basis.constant()
        noise = np.multiply.outer(one, np.diag(rows))
        seen = np.multiply.outer(one, np.diag(columns))
        d = tuple(f"d_{s}" for s in model.states)
        v = tuple(f"z_{s}" for s in (*model.states, *model.inputs))
        apart = np.zeros((len(one), ny + nx + nu, nx))
        wide = replace(
            model,
            B=np.concatenate([model.B, noise], axis=2),
            C=np.concatenate([model.C, seen[:, :, :nx]], axis=1),
            D=np.concatenate([np.concatenate([model.D, seen[:, :, nx:]], axis=1), apart], axis=2),
            inputs=(*model.inputs, *d),
            outputs=(*model.outputs, *v),
            trim=None,
            residuals=None,
        )
        source = f"{SAFETY:g} times the largest difference measured of the models that are covered"
        return cls(wide, signals(d), signals(v), 1.0, 1.0, source)

    @classmethod
    def in_sector(
        cls,
        model: LPVStateSpace,
        inputs: Sequence[str],
        outputs: Sequence[str],
        low: float = 0.0,
        high: float = 1.0,
    ) -> UncertainStateSpace:
        """Return the set of all loops of a model whose `inputs` are functions in a sector of its
        `outputs`, each of its own: low v^2 <= d v <= high v^2 at every time.

        A saturation is in the sector from 0 to 1; up to |v| = limit/low it is in that from `low`
        on. d = (low + high)/2 v + Delta v with a diagonal Delta of norm (high - low)/2 that moves
        in any way: what `l2_gain` and `stability` prove of the set is the circle criterion with a
        multiplier for each function, itself a function of p. `perturbed(Delta)` has the gain (low +
        high)/2 + Delta.

        Raises `InputError` for numbers of inputs and outputs that differ and for a low end that is
        not below the high one, `UnknownNameError` for other names.

        Examples
        --------
        x' = -x - sat(2 x) decays whatever the limit:

        >>> import symheli, synthesis
        >>> p = symheli.Scheduling("p", "1", low=0.0, high=1.0)
        >>> lag = symheli.LPVStateSpace.polynomial(
        ...     [[[-1.0]]], [[[-1.0]]], [[[2.0]]], [[[0.0]]], p, inputs=["held"], outputs=["asked"])
        >>> loops = symheli.UncertainStateSpace.in_sector(lag, ["held"], ["asked"])
        >>> synthesis.stability(loops).verified, loops.bound
        (True, 0.5)
        """
        d, v = ((g,) if isinstance(g, str) else tuple(g) for g in (inputs, outputs))
        if len(d) != len(v):
            raise InputError(
                f"in_sector: expected an output for each input, got {len(d)} inputs and {len(v)}"
                " outputs"
            )
        if not -math.inf < low < high < math.inf:
            raise InputError(
                f"in_sector: expected finite numbers low < high, got {low!r:.40} and {high!r:.40}"
            )
        middle = 0.5 * (low + high)
        turned = model.feedback({pair: middle for pair in zip(d, v, strict=True)})
        source = f"static functions in the sector from {low:g} to {high:g}, or time-varying gains"
        half, parts = 0.5 * (high - low), (DeltaPart(1, 1),) * len(d)
        return cls(turned, signals(d), signals(v), half, 1.0, source, parts if len(d) > 1 else ())

    @classmethod
    def of_blocks(
        cls,
        model: LPVStateSpace | UncertainStateSpace,
        blocks: Sequence[Any],
        source: str = "blocks of bounded gain",
    ) -> UncertainStateSpace:
        """Return `synthesis.robust.uncertain(model, blocks, source)`, which takes its place."""
        warnings.warn(
            "UncertainStateSpace.of_blocks: write synthesis.robust.uncertain(model, blocks)",
            FutureWarning,
            stacklevel=2,
        )
        if not (blocks and hasattr(blocks[0], "around")):
            raise InputError("blocks: expected one or more synthesis.robust.DynamicBlock")
        return blocks[0].around(model, blocks, source)

    @property
    def every_part(self) -> tuple[DeltaPart, ...]:
        """The blocks on the diagonal of Delta, of a full one that itself."""
        return self.parts or (DeltaPart(*self.shape),)

    @property
    def places(self) -> tuple[tuple[slice, slice], ...]:
        """Rows and columns of Delta of each part."""
        ends = np.cumsum([(0, 0), *(part[:2] for part in self.every_part)], axis=0)
        return tuple((slice(a, b), slice(c, d)) for (a, c), (b, d) in pairwise(ends.tolist()))

    @property
    def states(self) -> tuple[Signal, ...]:
        """Names of the states."""
        return self.model.states

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Names of the inputs u, those of the block left out."""
        return tuple(u for u in self.model.inputs if u not in self.perturbation_inputs)

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """Names of the outputs y, those of the block left out."""
        return tuple(y for y in self.model.outputs if y not in self.perturbation_outputs)

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The scheduling parameters."""
        return self.model.parameters

    @property
    def scheduling(self) -> Scheduling:
        """The scheduling parameter; raises `InputError` where there are several."""
        return self.model.scheduling

    @property
    def dt(self) -> float | None:
        """Sample period, s; None in continuous time."""
        return self.model.dt

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of Delta: (nd, nv)."""
        return len(self.perturbation_inputs), len(self.perturbation_outputs)

    @property
    def nominal(self) -> LPVStateSpace:
        """The model of Delta = 0."""
        return self.model.select(inputs=self.inputs, outputs=self.outputs)

    def perturbed(self, delta: object) -> LPVStateSpace:
        """The model of one Delta (nd, nv), exactly.

        Where both E and G depend on the parameters a polynomial model has up to twice the degree.
        Raises `InputError` for a Delta of another shape or beyond the bound, a basis that cannot
        hold the products, and a block that is not well posed.
        """
        from symheli.lpv.lower_feedback import close_static

        delta = frozen(delta, "delta", self.shape)
        own = np.zeros(self.shape)
        for place in self.places:
            own[place] = delta[place]
        if not np.array_equal(own, delta):
            raise InputError(f"delta: expected zeros outside its parts, {self.every_part!r:.80}")
        size = float(np.linalg.norm(delta, 2))
        if size > self.bound * (1 + ROUNDING):
            raise InputError(f"delta: expected a norm of at most {self.bound:g}, got {size:g}")
        K = np.zeros((len(self.model.inputs), len(self.model.outputs)))
        rows = indices(self.perturbation_inputs, self.model.inputs, "input")
        columns = indices(self.perturbation_outputs, self.model.outputs, "output")
        K[np.ix_(rows, columns)] = delta
        return close_static(self.model, K).select(inputs=self.inputs, outputs=self.outputs)

    def perturbations(
        self, count: int, seed: int, where: Literal["ball", "boundary"] = "ball"
    ) -> Array:
        """`count` matrices Delta (count, nd, nv) within the bound.

        "ball": uniform in the ball of spectral norms <= bound; "boundary": uniform among its
        extreme points, all singular values at the bound. Neither is the distribution of an
        estimate. Raises `InputError` for a count below 1 or another `where`.
        """
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            raise InputError(f"count: expected an integer >= 1, got {count!r:.60}")
        if where not in ("ball", "boundary"):
            raise InputError(f"where: expected 'ball' or 'boundary', got {where!r:.60}")
        rng, out = np.random.default_rng(seed), np.zeros((count, *self.shape))
        for place, part in zip(self.places, self.every_part, strict=True):
            out[(slice(None), *place)] = self._drawn(rng, count, part[:2], where)
        return out

    def _drawn(
        self, rng: np.random.Generator, count: int, shape: tuple[int, int], where: str
    ) -> Array:
        short, long = sorted(shape)
        X = rng.standard_normal((count, short, long))
        inner = X @ np.swapaxes(X, -1, -2)
        if where == "ball":
            # with Y Wishart of short + 1 degrees of freedom (X X' + Y)^-1/2 X is uniform
            # (Gupta and Nagar, Matrix Variate Distributions (2000), ch. 4)
            Y = rng.standard_normal((count, short, short + 1))
            inner = inner + Y @ np.swapaxes(Y, -1, -2)
        values, vectors = np.linalg.eigh(inner)
        root = (vectors / np.sqrt(values)[:, None, :]) @ np.swapaxes(vectors, -1, -2)
        delta = self.bound * root @ X
        return delta if shape[0] == short else np.swapaxes(delta, -1, -2)

    def draws(
        self, count: int, seed: int, where: Literal["ball", "boundary"] = "ball"
    ) -> tuple[LPVStateSpace, ...]:
        """`count` models of the set, those of `perturbations`."""
        return tuple(self.perturbed(delta) for delta in self.perturbations(count, seed, where))

    def feedback(self, gains: Mapping[tuple[str, str], float]) -> UncertainStateSpace:
        """Close the positive loops u_i = gain * y_j + (new u_i) around every model of the set; see
        `LPVStateSpace.feedback`. Raises `UnknownNameError` for the channels of the block.
        """
        feedback_matrix(gains, self.inputs, self.outputs)
        return replace(self, model=self.model.feedback(gains))

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> UncertainStateSpace:
        """Keep these states, inputs and outputs; see `LPVStateSpace.select`. The block is kept."""
        kept = self.model.select(states, self._with_block(inputs, "inputs"))
        return replace(self, model=kept.select(outputs=self._with_block(outputs, "outputs")))

    def _with_block(
        self, names: Sequence[str] | None, group: Literal["inputs", "outputs"]
    ) -> list[str] | None:
        if names is None:
            return None
        own, block = getattr(self, group), getattr(self, f"perturbation_{group}")
        return [*(own[i] for i in indices(names, own, group[:-1])), *block]

    def scaled(
        self, inputs: Mapping[str, float] | None = None, outputs: Mapping[str, float] | None = None
    ) -> UncertainStateSpace:
        """Return the set with inputs and outputs {name: size} measured in that size; see
        `LPVStateSpace.scaled`. Raises `UnknownNameError` for the channels of the block.
        """
        indices(inputs or {}, self.inputs, "input")
        indices(outputs or {}, self.outputs, "output")
        return replace(self, model=self.model.scaled(inputs, outputs))

    def with_scheduling(self, scheduling: Scheduling | Sequence[Scheduling]) -> UncertainStateSpace:
        """Return the same set over narrower ranges or with other rate limits."""
        return replace(self, model=self.model.with_scheduling(scheduling))

    def with_rate(self, rate: Rates) -> UncertainStateSpace:
        """Return the same set with |dp/dt| <= rate; see `LPVStateSpace.with_rate`."""
        return replace(self, model=self.model.with_rate(rate))

    def with_bound(self, bound: float) -> UncertainStateSpace:
        """Return the same block with another bound; the meaning of `source` is then up to
        the user.
        """
        return replace(self, bound=bound)


def _sizes(differences: Array) -> tuple[Array, Array]:
    """rows (nx,) and columns (nx + nu,): every difference is diag(rows) Delta diag(columns) with
    |Delta| <= 1/`SAFETY`.
    """
    size = np.abs(differences).max(axis=0)
    floor = 1e-6 * size.max() or 1e-300  # every row and column is covered, if only by a millionth
    rows, columns = np.ones(size.shape[0]), np.ones(size.shape[1])
    for _ in range(10):  # rows columns' >= size; settles in a few rounds
        rows = np.sqrt(rows * np.maximum((size / columns).max(axis=1), floor))
        columns = np.sqrt(columns * np.maximum((size / rows[:, None]).max(axis=0), floor))
    norm = np.linalg.norm(differences / (rows[:, None] * columns), 2, axis=(1, 2)).max()
    return SAFETY * norm * rows, columns
