"""The plant of a design: disturbances and controls in, performance and measurements out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv.equilibration import is_singular
from symheli.values.arrays import Array
from symheli.values.signal import Signal, indices
from symheli.values.summary import summarized
from synthesis.numerics.linear.norm import to_continuous

SIZE_LIMITS = 1e-100, 1e100
"""Least and largest entries: Riccati equations square control weights and measurement noise, and
invert the squares.
"""


class Generalized(NamedTuple):
    """x' = A x + B1 w + B2 u, z = C1 x + D11 w + D12 u, y = C2 x + D21 w + D22 u, or sampled.

    w disturbances, u controls, z performance, y measurements. Every matrix may have leading axes,
    one entry for each model of a family.
    """

    A: Array
    B1: Array
    B2: Array
    C1: Array
    C2: Array
    D11: Array
    D12: Array
    D21: Array
    D22: Array

    __repr__ = summarized

    @classmethod
    def of(
        cls,
        model: LinearModel,
        controls: Sequence[str],
        measurements: Sequence[str],
        disturbances: Sequence[str] | None = None,
        performance: Sequence[str] | None = None,
    ) -> Generalized:
        """Return the channels of a model by name; see `Channels.of`."""
        return cls.between(
            model, Channels.of(model, controls, measurements, disturbances, performance)
        )

    @classmethod
    def between(cls, model: LinearModel, channels: Channels) -> Generalized:
        """Return the matrices of a model that has these channels.

        Raises `InputError` for numbers whose squares are no numbers, see `checked`.
        """
        w = indices(channels.disturbances, model.inputs, "input")
        u = indices(channels.controls, model.inputs, "input")
        z = indices(channels.performance, model.outputs, "output")
        y = indices(channels.measurements, model.outputs, "output")
        B, C, D = model.B, model.C, model.D
        through = (D[np.ix_(rows, columns)] for rows in (z, y) for columns in (w, u))
        return cls(model.A, B[:, w], B[:, u], C[z], C[y], *through).checked(channels)

    def checked(self, channels: Channels) -> Generalized:
        """Return the plant; raise `InputError` for numbers whose squares are no numbers.

        These are an entry beyond the second of `SIZE_LIMITS`, and a price or an effect of a
        control, noise or reading of a measurement below the first.
        """
        for what, signals, M, axis in (
            ("price", channels.controls, self.D12, -2),
            ("effect", channels.controls, self.B2, -2),
            ("noise", channels.measurements, self.D21, -1),
            ("reading", channels.measurements, self.C2, -1),
        ):
            sizes = np.abs(M).max(axis=axis, initial=0.0)
            for at in np.argwhere((sizes > 0) & (sizes < SIZE_LIMITS[0])):
                raise InputError(
                    f"the {what} of {signals[at[-1]]} is {sizes[tuple(at)]:.3g}, whose square"
                    " underflows; increase its weight, or choose other units"
                )
        if max(np.abs(M).max(initial=0.0) for M in self) > SIZE_LIMITS[1]:
            raise InputError(
                f"a model with entries beyond {SIZE_LIMITS[1]:.0e} cannot be squared; choose other"
                " units or weights"
            )
        return self

    @classmethod
    def split(
        cls, A: Array, B: Array, C: Array, D: Array, controls: int, measured: int
    ) -> Generalized:
        """Return the plant of one model whose last `controls` inputs and last `measured` outputs
        are u and y.
        """
        w, z = B.shape[-1] - controls, C.shape[-2] - measured
        through = (
            D[..., rows, columns]
            for rows in (slice(z), slice(z, None))
            for columns in (slice(w), slice(w, None))
        )
        return cls(A, B[..., :w], B[..., w:], C[..., :z, :], C[..., z:, :], *through)

    @property
    def joined(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D from (w, u) to (z, y)."""
        return (
            self.A,
            blocks([[self.B1, self.B2]]),
            blocks([[self.C1], [self.C2]]),
            blocks([[self.D11, self.D12], [self.D21, self.D22]]),
        )

    def at_rest(self, states: int, dt: float | None) -> Generalized:
        """Return the plant of the first so many `states`, with the others where they come to rest.

        Raises `numpy.linalg.LinAlgError` where one of these integrates.
        """
        A, B, C, D = self.joined
        n = states
        left = A[..., n:, n:] - (0.0 if dt is None else np.eye(A.shape[-1] - n))
        rest = -np.linalg.solve(left, blocks([[A[..., n:, :n], B[..., n:, :]]]))
        x, w = rest[..., :n], rest[..., n:]
        return Generalized.split(
            A[..., :n, :n] + A[..., :n, n:] @ x,
            B[..., :n, :] + A[..., :n, n:] @ w,
            C[..., :n] + C[..., n:] @ x,
            D + C[..., n:] @ w,
            self.B2.shape[-1],
            self.C2.shape[-2],
        )

    @property
    def dual(self) -> Generalized:
        """The transposed plant: measurements become controls, disturbances performance."""
        A, B1, B2, C1, C2, D11, D12, D21, D22 = (np.swapaxes(M, -1, -2) for M in self)
        return Generalized(A, C1, C2, B1, B2, D11, D21, D12, D22)

    def closed(
        self, Ak: Array, Bk: Array, Ck: Array, Dk: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return A, B, C, D from w to z of the loop u = K y, the states of the plant first.

        Raises `InputError` where I - Dk D22 is singular: the loop is not well posed.
        """
        through = np.eye(self.D22.shape[-1]) - Dk @ self.D22
        if any(is_singular(each) for each in through.reshape(-1, *through.shape[-2:])):
            raise InputError(
                "the loop is not well posed: I - Dk D22 is singular; put an actuator or a delay"
                " between, or change the controller"
            )
        n, nk, nw, nz = (M.shape[-1] for M in (self.A, Ak, self.B1, np.swapaxes(self.C1, -1, -2)))
        x_k, k_x, k_w, z_k = (np.zeros(s) for s in ((n, nk), (nk, n), (nk, nw), (nz, nk)))
        y_k = np.zeros((self.C2.shape[-2], nk))
        # each of x', xk', z, and u and y before them, from (x, xk, w)
        u = np.linalg.inv(through) @ blocks([[Dk @ self.C2, Ck, Dk @ self.D21]])
        y = blocks([[self.C2, y_k, self.D21]]) + self.D22 @ u
        loop = blocks([[self.B2 @ u], [Bk @ y], [self.D12 @ u]]) + blocks(
            [[self.A, x_k, self.B1], [k_x, Ak, k_w], [self.C1, z_k, self.D11]]
        )
        states = slice(n + nk)
        rest = slice(n + nk, None)
        return (
            loop[..., states, states],
            loop[..., states, rest],
            loop[..., rest, states],
            loop[..., rest, rest],
        )


class Channels(NamedTuple):
    """The signal names of a `Generalized`, in its order."""

    states: tuple[Signal, ...]
    disturbances: tuple[Signal, ...]
    controls: tuple[Signal, ...]
    performance: tuple[Signal, ...]
    measurements: tuple[Signal, ...]

    @classmethod
    def of(
        cls,
        model: LinearModel,
        controls: Sequence[str],
        measurements: Sequence[str],
        disturbances: Sequence[str] | None = None,
        performance: Sequence[str] | None = None,
    ) -> Channels:
        """Assign the inputs and outputs of a model to the four channels.

        What is no control is a disturbance, what is not measured is performance, unless they are
        named. Raises `UnknownNameError` for a name the model does not have, `InputError` for a
        group without a name or with one twice.
        """
        groups = {
            "controls": (controls, model.inputs),
            "measurements": (measurements, model.outputs),
            "disturbances": (disturbances, model.inputs),
            "performance": (performance, model.outputs),
        }
        found: dict[str, tuple[Signal, ...]] = {}
        for group, (given, known) in groups.items():
            if given is not None and len({*map(str, given)}) != len(tuple(given)):
                raise InputError(f"{group}: expected every name once, got {tuple(given)}")
            if given is None:
                taken = found["controls" if known is model.inputs else "measurements"]
                found[group] = tuple(s for s in known if s not in taken)
            else:
                kind = "input" if known is model.inputs else "output"
                found[group] = tuple(known[i] for i in indices(given, known, kind))
            if not found[group]:
                raise InputError(
                    f"{group}: none is left; the model goes from {', '.join(model.inputs)} to"
                    f" {', '.join(model.outputs)}; name some, or give a synthesis.Plant"
                )
        if both := [s for s in found["controls"] if s in found["disturbances"]]:
            raise InputError(f"{', '.join(both)} cannot be both a control and a disturbance")
        return cls(
            model.states,
            *(
                found[group]
                for group in ("disturbances", "controls", "performance", "measurements")
            ),
        )


def continuous_plant(plant: Generalized) -> Generalized:
    """Return the continuous plant of a sampled one: stability and H-infinity norms of loops are the
    same.

    Its state is (x(k+1) + x(k))/sqrt(2), in the coordinates of x. Raises `InputError` where the
    plant has a mode at z = -1.
    """
    if is_singular(plant.A + np.eye(len(plant.A))):
        raise InputError(
            "the sampled plant has a mode at z = -1 (half the sample frequency), which the bilinear"
            " transformation cannot take; sample at another rate or leave the mode out"
        )
    controls, measured = plant.B2.shape[1], plant.C2.shape[0]
    return Generalized.split(*to_continuous(*plant.joined), controls, measured)


def sampled_controller(
    A: Array, B: Array, C: Array, D: Array
) -> tuple[Array, Array, Array, Array] | None:
    """Return the sampled controller of a continuous one, the inverse map; None where it has a pole
    at s = 1, which is one at infinite z.
    """
    eye = np.eye(len(A))
    if is_singular(eye - A):
        return None
    inverse, root = np.linalg.inv(eye - A), math.sqrt(2.0)
    return inverse @ (eye + A), root * inverse @ B, root * C @ inverse, D + C @ inverse @ B


def blocks(rows: Sequence[Sequence[Array]]) -> Array:
    """Return a block matrix of blocks that may have leading axes, which are broadcast."""
    leading = np.broadcast_shapes(*(M.shape[:-2] for row in rows for M in row))
    return np.concatenate(
        [
            np.concatenate([np.broadcast_to(M, (*leading, *M.shape[-2:])) for M in row], axis=-1)
            for row in rows
        ],
        axis=-2,
    )
