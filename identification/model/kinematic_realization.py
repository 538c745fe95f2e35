"""State-space forms of identified aerodynamics within known kinematics, linear about the trim."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.model.matrix_ellipsoid import MatrixEllipsoid, matrix_ellipsoid
from identification.model.realization import one_value
from identification.structure.kinematic_arx import MOVING, STATES, KinematicARX
from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.polynomials import interpolation_points, lobatto_points, polynomials
from symheli.lpv.tools import Matrices
from symheli.lpv.uncertain_state_space import DeltaPart
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.kinematics import RIGID_BODY, kinematic_jacobian
from symheli.values.signal import indices

INTERPOLATION_TOLERANCE = 1e-9
"""Largest error of an interpolated entry, as a fraction of the largest entry."""

ROUNDING = 1e-10
"""Relative error of the factor between two covariances: eigenvalues of matrices scaled to a unit
diagonal below it are rounding.
"""

MAX_DEGREE = 16
"""Highest degree in each parameter that interpolation tries."""


@dataclass(frozen=True, eq=False)
class BoundedCoefficients:
    """Coefficients (n, m) known to left D right + apart diag(delta), |D|_2 <= bound and |delta| <=
    bound: of the lagged signals `kept` and the equations `rows`, as coefficients of `functions` of
    the parameters that move. `apart` (n, m) or None; `wind`: along the heading, m/s a unit of a
    delta, in each equation of a velocity (`blown`); 0: none.
    """

    kept: tuple[int, ...]
    rows: tuple[int, ...]
    functions: FunctionSpace
    left: Array
    right: Array
    apart: Array | None
    wind: float
    blown: tuple[int, ...]

    @property
    def perturbations(self) -> tuple[Signal, ...]:
        """Names of d, part by part."""
        equations = [RIGID_BODY[i] for i in self.rows]
        apart = equations if self.apart is not None else []
        blown = [RIGID_BODY[i] for i in self.blown]
        groups = ("delta", equations), ("apart", apart), ("wind", blown)
        return tuple(Signal(f"{name}_{s}", s.unit) for name, of in groups for s in of)

    @property
    def excited(self) -> tuple[Signal, ...]:
        """Names of v, part by part."""
        count = self.left.shape[1]
        names = [f"excited_{i}" for i in range(1, count + 1)]
        names += [f"excited_{d}" for d in self.perturbations[len(self.rows) :]]
        return tuple(Signal(name, "1") for name in names)

    @property
    def parts(self) -> tuple[DeltaPart, ...]:
        """The parts of Delta; none where it is one full matrix."""
        single = len(self.perturbations) - len(self.rows)
        whole = DeltaPart(len(self.rows), self.left.shape[1])
        return (whole, *(DeltaPart(1, 1),) * single) if single else ()


@dataclass(frozen=True, eq=False)
class Realization:
    """x(k+1) = A x(k) + B u(k), y = C x: y(k) first, then what is remembered: z and u of earlier
    samples, those only that a coefficient multiplies.

        M y(k+1) = N y(k) + [sum_i A_i z(k+1-i) + sum_j B_j u(k+1-j); 0],
        M = I - dt/2 J(p), N = I + dt/2 J(p), J the kinematics linearized at the trim.

    In straight flight J^3 = 0, so that M^-1 = I + dt/2 J + (dt/2 J)^2 and the entries are
    polynomials of the trim.
    """

    kin: KinematicARX
    theta: Array
    trim: Array
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    memory: tuple[tuple[int, int], ...]
    """(column of z and u side by side, how many samples back) of each state after y(k)."""
    dt: float
    rotor: tuple[Signal, ...] = ()
    """The speed of a governed rotor and its integral: the last states."""
    head_wind: float = 0.0
    """Steady, along the heading, m/s: the velocity over ground is that of the trim less this."""

    @classmethod
    def of(
        cls,
        kin: KinematicARX,
        theta: Array,
        trim: Array,
        inputs: tuple[Signal, ...],
        dt: float,
        rotor: tuple[Signal, ...] = (),
    ) -> Realization:
        """Return the realization of coefficients (n, 6), with a rotor (n, 7), and the trim (basis
        size, 8).
        """
        lags = [len(r) for r in kin.aerodynamics.input_lag_ranges[0]]
        names = (*RIGID_BODY[: len(MOVING)], *inputs, *rotor)
        memory = tuple((c, back) for c, n in enumerate(lags) for back in range(1, n))
        remembered = tuple(Signal(f"{names[c]}_lag{b}", names[c].unit) for c, b in memory)
        states = (*RIGID_BODY, *remembered, *rotor)
        return cls(kin, theta, trim, states, inputs, memory, dt, rotor)

    def matrices(self, p: Array) -> Matrices:
        """Return the matrices at each p (K,) or (K, parameters)."""
        A, B = self._linear(p)
        C = np.broadcast_to(np.eye(len(STATES), A.shape[-1]), (len(p), len(STATES), A.shape[-1]))
        return Matrices(A, B, C, np.zeros((len(p), len(STATES), B.shape[-1])))

    def solved(self, p: Array) -> Array:
        """M^-1 (K, 8, 6): what an aerodynamic increment does to y(k+1)."""
        return np.linalg.inv(np.eye(len(STATES)) - 0.5 * self.dt * self._jacobian(p))[
            :, :, : len(MOVING)
        ]

    def _jacobian(self, p: Array) -> Array:
        y = self.kin.basis(p) @ self.trim
        y[..., :3] -= self.head_wind * _along_the_heading(y)
        y[..., 3:6] = 0.0  # straight flight
        return kinematic_jacobian(y)

    def regressor(self) -> tuple[Array, Array]:
        """Selection (lagged signals, nx) and (lagged signals, nu): the signals that coefficients
        multiply, in the order of the regression, from x(k) and u(k).
        """
        entries = [e for e in self.kin.aerodynamics.entries if e.kind == "input"]
        X, U = (
            np.zeros((len(entries), len(self.states))),
            np.zeros((len(entries), len(self.inputs))),
        )
        nz, ny = len(MOVING), len(STATES)
        for row, e in enumerate(entries):
            if e.lag > 1:
                X[row, ny + self.memory.index((e.channel, e.lag - 1))] = 1.0
            elif e.channel < nz:
                X[row, e.channel] = 1.0
            elif e.channel < nz + len(self.inputs):
                U[row, e.channel - nz] = 1.0
            else:
                X[row, e.channel - nz - len(self.inputs) - len(self.rotor)] = 1.0
        return X, U

    def _linear(self, p: Array) -> tuple[Array, Array]:
        X, U = self.regressor()
        ny, f = len(STATES), self.kin.basis(p)
        blocks = self.theta.reshape(-1, f.shape[-1], self.theta.shape[1])[: len(X)]
        C = np.einsum("kf,sfo->kos", f, blocks)
        solved = self.solved(p)
        half = 0.5 * self.dt * self._jacobian(p)
        nx, nu = X.shape[1], U.shape[1]
        A, B = np.zeros((len(f), nx, nx)), np.zeros((len(f), nx, nu))
        A[:, :ny, :ny] = np.linalg.solve(np.eye(ny) - half, np.eye(ny) + half)
        nz = len(MOVING)
        A[:, :ny] += solved @ C[:, :nz] @ X
        B[:, :ny] = solved @ C[:, :nz] @ U
        if self.rotor:  # its integral by the trapezoidal rule
            speed = np.eye(nx)[-2]
            A[:, -2], B[:, -2] = speed + C[:, nz] @ X, C[:, nz] @ U
            A[:, -1] = np.eye(nx)[-1] - 0.5 * self.dt * (speed + A[:, -2])
            B[:, -1] = -0.5 * self.dt * B[:, -2]
        for row, (column, back) in enumerate(self.memory, start=ny):
            if back > 1:
                A[:, row, ny + self.memory.index((column, back - 1))] = 1.0
            elif column < nz:
                A[:, row, column] = 1.0
            else:
                B[:, row, column - nz] = 1.0
        return A, B

    def at(
        self, p: object, outputs: Sequence[str] | None, inputs: Sequence[str] | None
    ) -> LinearModel:
        """The model with p held."""
        value = one_value(p, self.kin.basis)
        x, u, y = self.kept(outputs, inputs)
        A, B, C, D = (M[0] for M in self.matrices(value[None]))
        return LinearModel(
            A[np.ix_(x, x)],
            B[np.ix_(x, u)],
            C[np.ix_(y, x)],
            D[np.ix_(y, u)],
            tuple(self.states[i] for i in x),
            tuple(self.inputs[i] for i in u),
            tuple(RIGID_BODY[i] for i in y),
            dt=self.dt,
        )

    def kept(
        self, outputs: Sequence[str] | None, inputs: Sequence[str] | None
    ) -> tuple[list[int], list[int], list[int]]:
        """Positions of the states, inputs and outputs that stay where only some signals do."""
        y = indices(STATES if outputs is None else outputs, RIGID_BODY, "output")
        u = indices(self.inputs if inputs is None else inputs, self.inputs, "input")
        nz, ny = len(MOVING), len(STATES)
        stays = {c for c in y if c < nz} | {nz + i for i in u}
        x = y + [ny + i for i, (column, _) in enumerate(self.memory) if column in stays]
        x += range(len(self.states) - len(self.rotor), len(self.states))
        return x, u, y

    def lpv(
        self,
        parameters: tuple[Signal, ...],
        outputs: Sequence[str] | None,
        inputs: Sequence[str] | None,
        held: Mapping[str, float],
        degree: int | None,
        block: BoundedCoefficients | None = None,
    ) -> LPVStateSpace:
        """Polynomials through the matrices, of a degree or of that at which they are exact; with
        `block` its inputs d and outputs v after the others.
        """
        x, u, y = (np.array(i) for i in self.kept(outputs, inputs))
        line = MovingParameters.of(self.kin, parameters, held)

        def part(p: Array) -> Matrices:
            whole = line.whole(p)
            A, B, C, D = self.matrices(whole)
            y_, x_ = y[:, None], x[:, None]
            found = Matrices(A[:, x_, x], B[:, x_, u], C[:, y_, x], D[:, y_, u])
            if block is None:
                return found
            return self._opened(found, block, whole, p, x, u)

        basis, fitted, nodes = interpolated(part, line, degree)
        more = ((), ()) if block is None else (block.perturbations, block.excited)
        model = LPVStateSpace(
            basis,
            *fitted,
            tuple(
                Scheduling(str(s), s.unit, low, high)
                for s, (low, high) in zip(line.moving, line.ranges, strict=True)
            ),
            tuple(self.states[i] for i in x),
            (*(self.inputs[i] for i in u), *more[0]),
            (*(RIGID_BODY[i] for i in y), *more[1]),
            self.dt,
        )
        return model.with_residuals(nodes, part(nodes))

    def uncertain_part(
        self,
        parameters: tuple[Signal, ...],
        outputs: Sequence[str] | None,
        inputs: Sequence[str] | None,
        held: Mapping[str, float],
        covariances: Sequence[Array],
        probability: float,
        draws: int,
        apart: Array | None = None,
        wind: float = 0.0,
        emphasis: Array | None = None,
    ) -> tuple[BoundedCoefficients, MatrixEllipsoid]:
        """The ellipsoid of the coefficients that stay where only some signals do, on the line of
        parameters that move: offsets are no dynamics, and what is left out is left out. It covers
        each of the `covariances`; `apart` (n, 6): how far off in each equation coefficients may be
        besides; `wind` (m/s): how far off along the heading; `emphasis`: see `matrix_ellipsoid`.
        """
        _, u, y = self.kept(outputs, inputs)
        line = MovingParameters.of(self.kin, parameters, held)
        nz, f = len(MOVING), self.kin.basis
        signals = {i for i in y if i < nz} | {nz + i for i in u}
        entries = [e for e in self.kin.aerodynamics.entries if e.kind == "input"]
        kept = [row for row, e in enumerate(entries) if e.channel in signals]
        own = polynomials(line.degrees, line.ranges)
        points = interpolation_points(line.degrees, line.ranges)
        project = own.fit(points, f(line.whole(points)))  # f(p) = project' own(p)
        rows = np.array([i for i in y if i < nz])
        n, size = f.size, len(kept) * own.size

        def along(covariance: Array) -> Array:
            blocks = covariance.reshape(nz, -1, n, nz, covariance.shape[1] // n, n)
            part = blocks[rows][:, kept][:, :, :, rows][:, :, :, :, kept]
            part = np.einsum("gf,asfbth,kh->asgbtk", project, part, project, optimize=True)
            part = part.reshape(len(rows), size, len(rows), size)
            return 0.5 * (part + part.transpose(2, 3, 0, 1))

        cover = covering([along(P) for P in covariances])
        found = matrix_ellipsoid(cover, probability, draws, emphasis=emphasis)
        if apart is not None:
            blocks = apart.reshape(-1, n, nz)[kept][:, :, rows]
            apart = np.einsum("gf,sfa->sga", project, blocks).reshape(size, -1) / found.bound
        block = BoundedCoefficients(
            tuple(kept),
            tuple(int(i) for i in rows),
            own,
            found.left,
            found.right,
            apart,
            wind / found.bound,
            tuple(int(i) for i in rows if i < 3) if wind else (),
        )
        return block, found

    def _opened(
        self,
        model: Matrices,
        block: BoundedCoefficients,
        whole: Array,
        p: Array,
        x: Array,
        u: Array,
    ) -> Matrices:
        """The matrices with what the errors of a block do as inputs, and what shows them as
        outputs.
        """
        A, B, C, D = model
        E, G, H = self._block(block, whole, p, x, u)
        J = np.zeros((len(p), G.shape[1], E.shape[2]))
        if block.blown:
            # M0 y+ = N0 y + .. + dt/2 W J1 (y+ + y): W acts on both ends of the step
            blown, turned = self._blown(block, whole)
            E = np.concatenate([E, blown[:, x]], axis=2)
            J = np.concatenate([J, np.zeros((len(p), J.shape[1], blown.shape[2]))], axis=2)
            later = turned[:, :, x]
            G = np.concatenate([G, later @ A + later], axis=1)
            H, J = np.concatenate([H, later @ B], axis=1), np.concatenate([J, later @ E], axis=1)
        nothing = np.zeros((len(p), D.shape[1], E.shape[2]))
        return Matrices(
            A,
            np.concatenate([B, E], axis=2),
            np.concatenate([C, G], axis=1),
            np.block([[D, nothing], [H, J]]),
        )

    def _block(
        self, block: BoundedCoefficients, whole: Array, p: Array, x: Array, u: Array
    ) -> tuple[Array, Array, Array]:
        """E (K, nx, m), G (K, n, nx), H (K, n, nu): what an error of the coefficients does, and
        what shows it.
        """
        X, U = self.regressor()
        lefts, rights = [block.left], [block.right]
        if block.apart is not None:
            lefts.append(block.apart)
            rights.append(np.eye(len(block.rows)))
        E = np.zeros((len(p), len(self.states), sum(map(len, rights))))
        solved = self.solved(whole)[:, :, list(block.rows)]
        E[:, : len(STATES)] = solved @ np.hstack([right.T for right in rights])
        g = block.functions(p)
        seen = np.hstack(lefts).T.reshape(-1, len(block.kept), block.functions.size)
        seen = np.einsum("vsg,kg->kvs", seen, g)
        rows = list(block.kept)
        return E[:, x], seen @ X[rows][:, x], seen @ U[rows][:, u]

    def _blown(self, block: BoundedCoefficients, whole: Array) -> tuple[Array, Array]:
        """What a wind along the heading does, (K, nx, rows), and half a step of how it turns the
        velocity in each equation of one, (K, rows, nx).
        """
        rows, size = list(block.blown), len(STATES)
        enters = np.zeros((len(whole), len(self.states), len(rows)))
        enters[:, :size] = self.solved(whole)[:, :, rows]
        y = self.kin.basis(whole) @ self.trim
        still = np.zeros_like(y)
        still[:, 6:] = y[:, 6:]
        along = still.copy()
        along[:, :3] = -_along_the_heading(y)
        change = kinematic_jacobian(along) - kinematic_jacobian(still)
        turned = np.zeros((len(whole), len(rows), len(self.states)))
        turned[:, :, :size] = 0.5 * self.dt * block.wind * change[:, rows]
        return enters, turned

    def remembered(self, y: Array, u: Array, segments: Sequence[slice]) -> Array:
        """x (n, nx) along samples y (n, 8), u (n, nu)."""
        signals = np.hstack([y[:, : len(MOVING)], u])
        out = np.full((len(y), len(self.states)), np.nan)
        out[:, : y.shape[1]] = y
        for part in segments:
            for i, (column, back) in enumerate(self.memory, start=y.shape[1]):
                out[part.start + back : part.stop, i] = signals[
                    part.start : max(part.stop - back, part.start), column
                ]
        if self.rotor:
            out[:, -len(self.rotor) :] = u[:, -len(self.rotor) :]
        return out


def _along_the_heading(y: Array) -> Array:
    """Horizontal unit vector (..., 3) along the heading in body axes, at roll and pitch of y."""
    phi, theta = y[..., 6], y[..., 7]
    across = np.sin(theta)
    return np.stack([np.cos(theta), np.sin(phi) * across, np.cos(phi) * across], axis=-1)


def covering(covariances: Sequence[Array]) -> Array:
    """Return a covariance (m, n, m, n) that is at least each of these: their mean, times the least
    factor that does.
    """
    mean = np.asarray(np.mean(covariances, axis=0))
    if len(covariances) == 1:
        return mean
    size = int(np.sqrt(mean.size))
    joint = mean.reshape(size, size)
    scale = 1.0 / np.sqrt(np.where(np.diag(joint) > 0, np.diag(joint), 1.0))
    values, vectors = np.linalg.eigh(joint * np.outer(scale, scale))
    told = values > ROUNDING * values[-1]
    root = vectors[:, told] / np.sqrt(values[told])
    factor = 1.0
    for P in covariances:
        own = P.reshape(size, size) * np.outer(scale, scale)
        factor = max(factor, float(np.linalg.eigvalsh(root.T @ own @ root)[-1]))
    return min(factor * (1 + ROUNDING), float(len(covariances))) * mean  # each is at most their sum


class MovingParameters(NamedTuple):
    """The parameters that move, their ranges and degrees, where the others are `held` (NaN for
    those that move).
    """

    moving: tuple[Signal, ...]
    ranges: tuple[tuple[float, float], ...]
    degrees: tuple[int, ...]
    held: Array

    @classmethod
    def of(
        cls, kin: KinematicARX, parameters: tuple[Signal, ...], held: Mapping[str, float]
    ) -> MovingParameters:
        """Raises `UnknownNameError` for another parameter, `InputError` where none moves, or where
        the basis has no polynomials.
        """
        degrees = kin.basis.degrees
        if degrees is None:
            raise InputError(
                "a state-space form needs polynomial functions of the scheduling, the model has"
                f" {kin.basis}; identify with Polynomial, or take .at(p)"
            )
        indices(list(held), parameters, "scheduling parameter")
        values = np.array([held.get(str(s), np.nan) for s in parameters])
        kept = np.flatnonzero(np.isnan(values))
        if not len(kept):
            raise InputError("held: leave at least one parameter moving, or take .at(p)")
        return cls(
            tuple(parameters[i] for i in kept),
            tuple(kin.basis.ranges[i] for i in kept),
            tuple(degrees[i] for i in kept),
            values,
        )

    def whole(self, p: Array) -> Array:
        """All parameters (K, d) at the moving ones p; (K,) where there is one in all."""
        out = np.tile(self.held, (len(p), 1))
        out[:, np.isnan(self.held)] = p.reshape(len(p), -1)
        return out[:, 0] if len(self.held) == 1 else out


def interpolated(
    part: Callable[[Array], Matrices], line: MovingParameters, degree: int | None
) -> tuple[FunctionSpace, Matrices, Array]:
    """Return basis, coefficients and check points of polynomials through matrices at any p, of
    `degree` in each parameter, or raised until the error is below `INTERPOLATION_TOLERANCE`.
    """
    for more in range(1, MAX_DEGREE):
        degrees = [degree if degree is not None else d + more if d else 0 for d in line.degrees]
        basis = polynomials(degrees, line.ranges)
        points = interpolation_points(degrees, line.ranges)
        fitted = Matrices(*(basis.fit(points, M) for M in part(points)))
        nodes = lobatto_points(max(degrees) + 2, line.ranges)
        f, exact = basis(nodes), part(nodes)
        error = max(
            float(np.abs(np.tensordot(f, M, axes=1) - E).max(initial=0.0))
            for M, E in zip(fitted, exact, strict=True)
        )
        size = max(float(np.abs(M).max(initial=0.0)) for M in exact)
        if degree is not None or error <= INTERPOLATION_TOLERANCE * size:
            break
    return basis, fitted, nodes
