"""Motions of any nonlinear model, and the feedback about them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi
import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False)
class Motions:
    """Motions that a model dx/dt = f(x, u, w) is to follow with u = u_r + K (x - x_r).

    Parameters
    ----------
    reference : casadi.Function
        c -> x_r (n,), u_r (k,): every motion of the equations whose state and control have this
        form for some history of the commands c. Or c -> x_r, u_r, dx_r/dt: what that misses of the
        equations is enclosed, and c is such that x_r has this derivative.
    gain : array (k, n) or (nodes, k, n)
        K, the same everywhere, or at each node and linear between.
    schedule : array (nodes,), optional
        Nodes of the scheduling command p, increasing, over its range: then c = (p, dp/dt, others),
        and the tube may change with p. None: c are the others, and the tube is the same for all.
    rate : (float, float)
        Limits of dp/dt, per second.
    others : array (r, 2)
        Limits of each other command, which may change at any rate.
    pieces : tuple of int
        Parts of the range of dp/dt and of each other command, each with a proof of its own. Default
        1.
    states, inputs : tuple of str
        Names; by default x0, x1, ... and u0, u1, ...

    Raises
    ------
    InputError
        Shapes or numbers that do not fit.

    Examples
    --------
    >>> import casadi
    >>> c = casadi.SX.sym("c", 1)
    >>> turning = casadi.Function("turning", [c], [casadi.vertcat(c, 0), casadi.SX.zeros(1)])
    >>> Motions(turning, [[-1.0, -2.0]], others=[[-0.5, 0.5]]).ranges
    ((0.0, 0.0), (-0.5, 0.5))
    """

    reference: casadi.Function
    gain: Array
    schedule: Any = None
    rate: tuple[float, float] = (0.0, 0.0)
    others: Any = ()
    pieces: tuple[int, ...] = ()
    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()

    whole = ()
    """Commands that no cell splits."""
    jump = None
    """The deviation does not jump."""
    jumps = False
    """Whether a state of the reference may jump: by hypothesis none does."""

    __repr__ = summarized

    def __post_init__(self) -> None:
        others = np.array(self.others, float).reshape(-1, 2)
        rate = np.array(self.rate, float).reshape(-1)
        limits = np.vstack([rate[:2], others])
        if len(rate) != 2 or not (np.all(np.isfinite(limits)) and np.all(limits @ [-1, 1] >= 0)):
            raise InputError("limits of commands must be finite, (lower, upper)")
        scheduled = self.schedule is not None
        nodes = np.array(self.schedule, float) if scheduled else np.zeros(1)
        if scheduled and (nodes.ndim != 1 or len(nodes) < 2 or not np.all(np.diff(nodes) > 0)):
            raise InputError(f"schedule needs two or more increasing numbers; got {self.schedule}")
        if not scheduled and np.any(rate):
            raise InputError("a rate needs the schedule of the command that changes at it")
        n, k = self._sizes(2 * scheduled + len(others))
        gain = np.array(self.gain, float)
        if gain.shape not in ((k, n), (len(nodes), k, n)) or not np.all(np.isfinite(gain)):
            raise InputError(
                f"gain must be {k} by {n} finite numbers, or as many for each of the {len(nodes)}"
                f" nodes; got {gain.shape}"
            )
        pieces = tuple(self.pieces) or (1,) * len(limits)
        if len(pieces) != len(limits) or not all(int(p) == p > 0 for p in pieces):
            raise InputError(f"pieces must be {len(limits)} whole numbers >= 1; got {self.pieces}")
        states = tuple(self.states) or tuple(f"x{i}" for i in range(n))
        inputs = tuple(self.inputs) or tuple(f"u{i}" for i in range(k))
        if (len(states), len(inputs)) != (n, k):
            raise InputError(f"states and inputs need {n} and {k} names")
        for word, names in (("states", states), ("inputs", inputs)):
            if len(set(names)) < len(names):
                raise InputError(f"{word}: expected a name once each, got {', '.join(names)}")
        made = {
            "schedule": nodes if scheduled else None,
            "rate": (float(rate[0]), float(rate[1])),
            "others": others,
            "pieces": tuple(map(int, pieces)),
            "gain": np.broadcast_to(gain, (len(nodes), k, n)).copy(),
            "states": states,
            "inputs": inputs,
        }
        for name, value in made.items():
            object.__setattr__(self, name, value)

    def _sizes(self, commands: int) -> tuple[int, int]:
        """Numbers of states and controls."""
        f = self.reference
        if (
            not isinstance(f, casadi.Function)
            or [f.size_in(i) for i in range(f.n_in())] != [(commands, 1)]
            or f.n_out() not in (2, 3)
        ):
            raise InputError(
                f"reference must be a casadi.Function of one vector of {commands} commands with the"
                f" outputs x_r, u_r and, if it is no motion of the equations, dx_r/dt; got {f}"
            )
        return f.size1_out(0), f.size1_out(1)

    @property
    def nodes(self) -> Array:
        """Nodes of the scheduling command; one, 0, where there is none."""
        return np.zeros(1) if self.schedule is None else self.schedule

    @property
    def drifts(self) -> bool:
        """Whether the reference may miss the equations."""
        return self.reference.n_out() == 3

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Ranges of dp/dt and of the other commands."""
        return (self.rate, *((float(low), float(high)) for low, high in self.others))

    @property
    def jacobian_parts(self) -> tuple[int, ...]:
        """Parts of a cell along p and its ranges over which the Jacobian is enclosed,"""
        return (4,) + (2,) * len(self.ranges)

    @property
    def drift_parts(self) -> tuple[int, ...]:
        """and what the reference misses."""
        return (16,) + (4,) * len(self.ranges)

    def hypotheses(self, name: str, gust: float, states: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Hypotheses of a tube about them, in sentences."""
        limits = [f"[{low:g}, {high:g}]" for low, high in self.ranges]
        command = []
        if self.schedule is not None:
            low, high = self.nodes[[0, -1]]
            command.append(
                f"the scheduling command stays within [{low:g}, {high:g}], its rate within"
                f" {limits[0]} 1/s"
            )
        if len(limits) > 1:
            command.append(f"the other commands within {', '.join(limits[1:])}, at any rate")
        own = "has the derivative given" if self.drifts else "is a motion of the equations if w = 0"
        return (
            f"the equations {name}; u = u_r + K e in continuous time with all states known",
            "; ".join([*command, f"the reference {own}; |w| <= {gust:g}, any history"]),
        )

    @property
    def intervals(self) -> int:
        """Number of intervals between nodes, 1 without a schedule."""
        return max(len(self.nodes) - 1, 1)

    @cached_property
    def data(self) -> Array:
        """Data that `between` takes of each interval, (intervals, .)."""
        i = np.arange(self.intervals)
        ends = [i, i + (len(self.nodes) > 1)]
        p = np.stack([self.nodes[k] for k in ends], axis=1)
        return np.hstack([p, *(self.gain[k].reshape(len(i), -1) for k in ends)])

    def between(self, data: Any, c: Any) -> tuple[Any, Any, Any, Any]:
        """(x_r, dx_r/dt or None, u_r, K) in CasADi; data: of an interval; c = (s, dp/dt, others), s
        in [0, 1] the position between its nodes.
        """
        s, k, n = c[0], *self.gain.shape[1:]
        given = c[2:]
        if self.schedule is not None:
            given = casadi.vertcat(data[0] + s * (data[1] - data[0]), c[1:])
        found = self.reference(given)
        start = [2 + i * k * n for i in range(3)]
        K0, K1 = (casadi.reshape(data[a:b], n, k).T for a, b in pairwise(start))
        moving = found[2] if len(found) == 3 else None
        return found[0], moving, found[1], K0 + s * (K1 - K0)

    def place(self, values: Any) -> tuple[Array, Array]:
        """Intervals of values (N,) of the scheduling command, and their shares of the way along
        it, (N,).
        """
        p = np.asarray(values, float)
        if len(self.nodes) == 1:
            return np.zeros(len(p), int), np.zeros(len(p))
        i = np.clip(np.searchsorted(self.nodes, p) - 1, 0, self.intervals - 1)
        low, high = self.nodes[i], self.nodes[i + 1]
        return i, (p - low) / (high - low)


def held(x: Any, u: Any, gain: Any, states: Any = (), inputs: Any = ()) -> Motions:
    """A state x (n,) held with the controls u (k,): what f(x, u, 0) differs from 0 is enclosed."""
    x, u = casadi.SX(casadi.DM(np.asarray(x, float))), casadi.SX(casadi.DM(np.asarray(u, float)))
    c = casadi.SX.sym("c", 0)
    reference = casadi.Function("held", [c], [x, u, casadi.SX.zeros(x.shape)])
    return Motions(reference, gain, states=states, inputs=inputs)
