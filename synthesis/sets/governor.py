"""A reference governor that keeps the state inside a proven set around the governed reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, cast

import numpy as np

from symheli.errors import InputError
from symheli.lpv.scheduling import UNSCHEDULED
from symheli.lpv.tools import TrimSchedule
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized
from synthesis.sets.invariant_set import InvariantSet

HALVINGS = 40
"""Halvings of the share of the way to the wanted reference."""


@dataclass(frozen=True, eq=False)
class ReferenceGovernor:
    """The scalar reference governor of a proven set; made by `governor`.

    Attributes
    ----------
    set : InvariantSet
        Of the deviations from the steady state.
    steady : callable
        The steady states (N, n) of references (N,).
    parameters : array (m,) or None
        Where the set is taken; None: the reference is the scheduling parameter.

    Examples
    --------
    >>> import numpy as np
    >>> from symheli import LinearModel
    >>> cart = LinearModel(
    ...     [[0, 1.0], [0, 0]], [[0], [1.0]], np.eye(2), np.zeros((2, 1)),
    ...     ["x", "v"], ["u"], ["x_m", "v_m"])
    >>> found = synthesis.sets.invariant_set(
    ...     cart, state_bounds={"x": 1.0, "v": 1.0}, input_bounds={"u": 1.0})
    >>> made = synthesis.sets.reference_governor(found, [1.0, 0.0])  # at rest: x = r, v = 0
    >>> bool(0.9 < made.next([0.0, 0.0], 5.0, 0.0) < 1.0), float(made.next([0.0, 0.0], 0.5, 0.0))
    (True, 0.5)
    """

    set: InvariantSet
    steady: Callable[[Array], Array]
    parameters: Array | None

    __repr__ = summarized

    def level(self, x: Any, reference: Any) -> Array:
        """(x - x_r)' Q^-1 (x - x_r) of states (..., n) around references (...): at most 1
        inside.
        """
        v = frozen(reference, "reference")
        x, n = frozen(x, "x"), len(self.set.shape.states)
        if x.ndim == 0 or x.shape[-1] != n or x.shape[:-1] not in ((), v.shape):
            raise InputError(
                f"x: expected {n} states along the last axis, for one reference or one each of"
                f" {v.shape}, got shape {x.shape}"
            )
        e = x - self.steady(v)
        if self.parameters is None:
            return self.set.levels(e, v)
        return ((e @ self._whitening) ** 2).sum(axis=-1)

    @cached_property
    def _whitening(self) -> Array:
        """S (n, n) with V = |e S|^2 at the parameters."""
        assert self.parameters is not None  # noqa: S101 - asked by the caller
        return np.linalg.inv(np.linalg.cholesky(self.set.gramian(*self.parameters))).T

    def next(self, x: Any, wanted: Any, now: Any) -> Array:
        """The governed reference: as far from `now` towards `wanted` as the state stays inside the
        set around it, by bisection; `now` where nothing further does.

        A reference that is the scheduling parameter stays in its range. The state is (..., n), both
        references (...), and the reference is held until the next call. A state that starts inside
        never leaves, whatever is wanted: the set is invariant while the reference is held, and
        where the governor steps the state is inside again.
        """
        now, wanted = np.broadcast_arrays(frozen(now, "now"), frozen(wanted, "wanted"))
        if self.parameters is None:
            (s,) = self.set.shape.parameters
            wanted = np.clip(wanted, s.low, s.high)
        arrives = self.level(x, wanted) <= 1
        if np.all(arrives):
            return wanted
        low, high = np.zeros(now.shape), np.ones(now.shape)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            stays = self.level(x, now + middle * (wanted - now)) <= 1
            low, high = np.where(stays, middle, low), np.where(stays, high, middle)
        return np.where(arrives, wanted, now + low * (wanted - now))


def reference_governor(
    found: InvariantSet, steady: Any = None, *, at: Sequence[float] | None = None
) -> ReferenceGovernor:
    """The reference governor of a proven invariant set, whose states are deviations from the steady
    state of a reference.

    Parameters
    ----------
    found : InvariantSet
        Proven, at least for constant parameters.
    steady : array (n,) or callable, optional
        x_r per unit of the reference, or x_r (N, n) of references (N,); by default the trim of the
        set's model, x0(p), with its one parameter as the reference.
    at : sequence of float, optional
        Values of the parameters where the set is taken; by default the reference is the parameter
        of a model that has one.

    Returns
    -------
    Governor
        `next(x, wanted, now)` is called once each sample.

    Raises
    ------
    InputError
        A set without a proof, a missing steady state, shapes that do not fit.

    References
    ----------
    Gilbert, Kolmanovsky and Tan, "Discrete-time reference governors and the nonlinear control of
    systems with state and control constraints", Int. J. Robust and Nonlinear Control 5 (1995).

    Examples
    --------
    >>> from symheli import LinearModel
    >>> plant = LinearModel([[1.0]], [[2.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["x_m"])
    >>> found = synthesis.sets.invariant_set(plant, input_bounds={"u": 1.0})  # |x| <= 2
    >>> print(synthesis.sets.reference_governor(found, [1.0]).next([0.5], 9.0, 0.0).round(4))
    2.5
    """
    if not isinstance(found, InvariantSet) or not found.verified:
        raise InputError("found: expected an InvariantSet with a proof (found.verified)")
    n, m = len(found.shape.states), len(found.shape.parameters)
    moved: Callable[[Array], Array]
    trim = found.statement.model.trim
    if callable(steady):
        moved = cast("Callable[[Array], Array]", steady)
    elif steady is not None:
        moved = partial(_along, frozen(steady, "steady", (n,)))
    elif trim is not None:
        moved = partial(_trimmed, trim)
    else:
        raise InputError("steady: the model of the set has no trim; give the steady state")
    if at is None and found.shape.parameters == (UNSCHEDULED,):
        at = [UNSCHEDULED.middle]
    own = None if at is None else frozen(at, "at", (m,))
    if own is None and m > 1:
        raise InputError(f"at: the set has {m} parameters; give the values where it is taken")
    return ReferenceGovernor(found, moved, own)


def _along(direction: Array, v: Array) -> Array:
    return v[..., None] * direction


def _trimmed(trim: TrimSchedule, v: Array) -> Array:
    return trim.state(v)
