"""A linear time-invariant model that keeps its names, units and operating point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from scipy.linalg import block_diag

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.equilibration import is_singular, loop_inverse
from symheli.lpv.operators import Operators
from symheli.values.aligned import matrix
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.numbers import by_name, finite
from symheli.values.operating_point import OperatingPoint
from symheli.values.sample_period import same_period
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from symheli.lpv.linear_models import LinearModels
    from symheli.lpv.step_response import StepResponse


@dataclass(frozen=True, eq=False)
class LinearModel(Operators):
    """A linear model describes small deviations from an operating `point` in state space, with
    named signals that carry their units.

    dx/dt = A x + B u, y = C x + D u, or x(k+1) = A x(k) + B u(k).

    Parameters
    ----------
    A, B, C, D : array (nx, nx), (nx, nu), (ny, nx), (ny, nu)
        SI units and radians.
    states, inputs, outputs : tuple of Signal
        Strings that carry their unit.
    dt : float, optional
        Sample period, s; None: continuous.
    point : OperatingPoint, optional
        What x and u are measured from.

    Raises
    ------
    InputError
        Shapes that do not fit the names, or a period that is not positive.

    See Also
    --------
    symheli.linearize : the exact linear model about a trim
    symheli.LPVStateSpace : matrices as functions of parameters

    Examples
    --------
    >>> lag = symheli.LinearModel([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("x",), ("u",), ("y",))
    >>> print(lag.poles(), lag.frequency_response([0.0]).round(3))
    [-2.] [[[1.+0.j]]]
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float | None = None
    point: OperatingPoint | None = None

    if TYPE_CHECKING:  # what is given becomes arrays and signals

        def __init__(
            self,
            A: ArrayLike,
            B: ArrayLike,
            C: ArrayLike,
            D: ArrayLike,
            states: Sequence[str],
            inputs: Sequence[str],
            outputs: Sequence[str],
            dt: float | None = None,
            point: OperatingPoint | None = None,
        ) -> None: ...

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        nx, nu, ny = len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in (("A", (nx, nx)), ("B", (nx, nu)), ("C", (ny, nx)), ("D", (ny, nu))):
            given = getattr(self, name)
            if 0 in shape and np.size(given) == 0:  # [] of a model without states, of any shape
                given = np.zeros(shape)
            object.__setattr__(self, name, frozen(given, name, shape))
        if self.dt is not None and not self.dt > 0:
            raise InputError(f"dt must be a positive number of seconds or None, got {self.dt}")

    def __str__(self) -> str:
        """The matrices that are not trivial with the names of rows and columns."""
        time = "continuous" if self.dt is None else f"sampled every {self.dt:g} s"
        rows = "derivative of the state" if self.dt is None else "state at the next sample"
        speed = None if self.point is None else self.point.airspeed
        around = "" if speed is None else f", about {speed:g} m/s"
        lines = [
            f"linear model, {time}{around}: {len(self.states)} states, {len(self.inputs)} inputs,"
            f" {len(self.outputs)} outputs; SI and radians",
            f"A (rows: {rows})",
            matrix(self.A, self.states, self.states),
            "B",
            matrix(self.B, self.states, self.inputs),
        ]
        if self.outputs != self.states or not np.array_equal(self.C, np.eye(len(self.C))):
            lines += ["C (rows: outputs)", matrix(self.C, self.outputs, self.states)]
        if np.any(self.D):
            lines += ["D", matrix(self.D, self.outputs, self.inputs)]
        return "\n".join(lines)

    def poles(self) -> np.ndarray:
        """Eigenvalues of A (nx,), complex; rad/s where continuous."""
        return np.linalg.eigvals(self.A)

    def is_stable(self) -> bool:
        """Whether every pole lies strictly inside the stability region."""
        poles = self.poles()
        return bool(np.all(np.real(poles) < 0) if self.dt is None else np.all(np.abs(poles) < 1))

    def select(
        self,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LinearModel:
        """Keep these states (rows and columns of the others are deleted), inputs and outputs, in
        this order.
        """
        return selected(self, states, inputs, outputs)

    def residualize(self, states: Sequence[str]) -> LinearModel:
        """Remove these states by setting their derivatives to zero (quasi-steady), continuous time
        only.
        """
        if self.dt is not None:
            raise InputError("residualize continuous models, then discretize")
        gone = indices(states, self.states, "state")
        kept = [i for i in range(len(self.states)) if i not in gone]
        rows = [i for i, y in enumerate(self.outputs) if y not in states]
        A, B, C, D = self.A, self.B, self.C[rows], self.D[rows]
        ss = A[np.ix_(gone, gone)]
        if is_singular(ss):
            raise InputError(
                f"cannot residualize {', '.join(states)}: they do not settle (singular dynamics)"
            )
        X, U = np.linalg.solve(ss, A[np.ix_(gone, kept)]), np.linalg.solve(ss, B[gone])
        return replace(
            self,
            A=A[np.ix_(kept, kept)] - A[np.ix_(kept, gone)] @ X,
            B=B[kept] - A[np.ix_(kept, gone)] @ U,
            C=C[:, kept] - C[:, gone] @ X,
            D=D - C[:, gone] @ U,
            states=tuple(self.states[i] for i in kept),
            outputs=tuple(self.outputs[i] for i in rows),
        )

    def reduce(
        self, order: int | None = None, *, by: str | None = None, loss: float | None = None
    ) -> LinearModel:
        """Return the model with fewer states; see `LPVStateSpace.reduce`."""
        from symheli.lpv.balanced_truncation import reduced

        return reduced(self, order, by, loss)

    def discretize(self, dt: float, method: Literal["hold", "tustin"] = "hold") -> LinearModel:
        """Equivalent at sample period `dt` (s): "hold", with inputs held between the samples, exact
        at these; "tustin", s = (2/dt) (z - 1)/(z + 1), which keeps stability and the largest gain.
        """
        if self.dt is not None:
            raise InputError(f"the model is already discrete (dt = {self.dt} s)")
        if method not in (names := {"hold": "zoh", "tustin": "bilinear"}):
            raise UnknownNameError("method", method, names)
        from scipy.signal import cont2discrete

        system = self.A, self.B, self.C, self.D
        A, B, C, D = cont2discrete(system, dt, names[method])[:4]  # type: ignore[index]
        return replace(self, A=A, B=B, C=C, D=D, dt=dt)

    def driven_by(self, actuators: Mapping[str, LinearModel]) -> LinearModel:
        """This model behind single-input single-output `actuators` {input: model}; the inputs keep
        their names, C and D their rows.

        Both must be continuous, or discrete with one sample period; `InputError` otherwise.
        """
        at = indices(actuators, self.inputs, "input")
        for name, part in actuators.items():
            single = isinstance(part, LinearModel) and len(part.inputs) == len(part.outputs) == 1
            if not single or not same_period(part.dt, self.dt):
                got = f"{type(part).__name__} with dt = {getattr(part, 'dt', None)}"
                raise InputError(
                    f"the actuator of {name}: expected a LinearModel of one input and output with"
                    f" dt = {self.dt}, got {got}"
                )
        parts = list(actuators.values())
        A, B, C, D = (
            np.asarray(block_diag(*(getattr(part, matrix) for part in parts))) for matrix in "ABCD"
        )
        direct = np.eye(len(self.inputs))
        direct[np.ix_(at, at)] = D
        into = np.zeros((len(A), len(self.inputs)))
        into[:, at] = B
        return replace(
            self,
            A=np.block([[self.A, self.B[:, at] @ C], [np.zeros((len(A), len(self.A))), A]]),
            B=np.vstack([self.B @ direct, into]),
            C=np.hstack([self.C, self.D[:, at] @ C]),
            D=self.D @ direct,
            states=(*self.states, *(s for part in parts for s in part.states)),
            point=None,
        )

    def feedback(self, gains: Mapping[tuple[str, str], float]) -> LinearModel:
        """Close the positive loops u_i = gain y_j + (new u_i) for each {(input, output): gain}; a
        negative loop has a negative gain.

        Raises `InputError` where I - K D is singular.

        See Also
        --------
        symheli.lpv.feedback : with a dynamic controller, and a sign
        """
        K = feedback_matrix(gains, self.inputs, self.outputs)
        N = loop_inverse(K @ self.D)
        NKC = N @ K @ self.C
        return replace(
            self, A=self.A + self.B @ NKC, B=self.B @ N, C=self.C + self.D @ NKC, D=self.D @ N
        )

    def __call__(self, s: object) -> np.ndarray:
        """Evaluate the transfer matrix C (s I - A)^-1 B + D at a point of the complex plane.

        Parameters
        ----------
        s : complex, or array (...) of complex
            s in rad/s of a continuous model, z of a sampled one, as in python-control; inf: D.

        Returns
        -------
        array (ny, nu), or (..., ny, nu)
            Complex, outputs per unit of the inputs; a matrix also for one input and one output.

        Raises
        ------
        InputError
            A pole of the model, where it has no value.

        See Also
        --------
        LinearModel.frequency_response : on the imaginary axis, or the unit circle

        Examples
        --------
        >>> lag = symheli.LinearModel([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("x",), ("u",), ("y",))
        >>> lag(2.0).real, lag([0.0, 2j]).shape
        (array([[0.5]]), (2, 1, 1))
        """
        at = np.asarray(s, complex)
        if np.any(np.isnan(at)):
            raise InputError(f"s: expected complex numbers, got {s!r:.60}")
        infinite = np.isinf(at)
        away = 1.0 + 2.0 * np.linalg.norm(self.A)  # no pole, whatever stands there is not taken
        try:
            found = self._values(np.where(infinite, away, at))
        except np.linalg.LinAlgError:
            poles = ", ".join(f"{pole:.6g}" for pole in self.poles())
            raise InputError(
                f"the transfer matrix has no value at a pole of the model, one of {poles}"
            ) from None
        return np.where(infinite[..., None, None], self.D, found)

    def _values(self, s: np.ndarray) -> np.ndarray:
        """The transfer matrix (..., ny, nu) at finite s (...), complex."""
        pencil = s[..., None, None] * np.eye(len(self.states)) - self.A
        return (
            self.C @ np.linalg.solve(pencil, np.broadcast_to(self.B, (*s.shape, *self.B.shape)))
            + self.D
        )

    def frequency_response(self, omega: object) -> np.ndarray:
        """G(j omega) (n, ny, nu), complex, at `omega` (n,) in rad/s.

        See Also
        --------
        LinearModel.__call__ : anywhere in the complex plane, P(s)
        """
        omega = frozen(omega, "omega", (None,))
        return self._values(1j * omega if self.dt is None else np.exp(1j * omega * self.dt))

    def step_response(self, duration: float, samples: int = 501) -> StepResponse:
        """Outputs after a unit step of each input from rest, over `duration` (s): exact at the
        `samples`, which of a discrete model are its own. Raises `InputError` for a duration that is
        not positive.
        """
        from symheli.lpv.step_response import step_response

        return step_response(self, duration, samples)

    def plot(self, ax: Axes | None = None) -> Axes:
        """The poles in the complex plane, those that are not stable in red; returns the axes."""
        from symheli.lpv.pole_plot import plot_poles

        return plot_poles(self, ax)

    def to_control(self) -> Any:
        """A python-control `StateSpace` with the same names (dt = 0 where continuous)."""
        import control

        return control.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            self.dt or 0,
            states=[str(s) for s in self.states],
            inputs=[str(s) for s in self.inputs],
            outputs=[str(s) for s in self.outputs],
        )

    @classmethod
    def gain(cls, matrix: Any, inputs: Sequence[str], outputs: Sequence[str]) -> LinearModel:
        """y = matrix u without states; `matrix` (ny, nu)."""
        nu, ny = len(inputs), len(outputs)
        return cls(
            np.zeros((0, 0)),
            np.zeros((0, nu)),
            np.zeros((ny, 0)),
            matrix,
            (),
            signals(inputs),
            signals(outputs),
        )

    @classmethod
    def from_control(
        cls,
        system: Any,
        *,
        units: Mapping[str, str] | None = None,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> LinearModel:
        """Return the model of a python-control `StateSpace` (a `TransferFunction` is realised
        first); nothing is converted.

        Its labels become the names where `states`, `inputs` or `outputs` give none. `units` {name:
        unit} says what the signals are in; for the others the unit of a well-known name, "1" else.
        Raises `InputError` for another type, a sample period of unknown length (dt = True) and
        wrong numbers of names, `UnknownNameError` for the unit of a signal that is not there.
        """
        if not is_control_system(system):
            raise InputError(
                "expected a StateSpace or a TransferFunction of python-control, got"
                f" {type(system).__name__}"
            )
        if not hasattr(system, "A"):
            import control

            try:
                system = control.ss(system)
            except (TypeError, ValueError, NotImplementedError) as error:
                raise InputError(
                    f"this {type(system).__name__} has no realization that python-control finds"
                    f" ({error})"
                ) from error
        if system.dt is True:
            raise InputError(
                "the system is discrete with a sample period of unknown length (dt = True); set .dt"
                " to seconds"
            )
        groups = [
            list(given or labels)
            for given, labels in (
                (states, system.state_labels),
                (inputs, system.input_labels),
                (outputs, system.output_labels),
            )
        ]
        indices(units or {}, [name for group in groups for name in group], "signal")
        return cls(
            system.A,
            system.B,
            system.C,
            system.D,
            *(signals(group, units) for group in groups),
            dt=float(system.dt) if system.dt else None,
        )


Models = TypeVar("Models", bound="LinearModel | LinearModels")


def selected(
    models: Models,
    states: Sequence[str] | None,
    inputs: Sequence[str] | None,
    outputs: Sequence[str] | None,
) -> Models:
    """One model or many with these states, inputs and outputs; see `LinearModel.select`."""
    ix = indices(models.states if states is None else states, models.states, "state")
    iu = indices(models.inputs if inputs is None else inputs, models.inputs, "input")
    if outputs is None:
        outputs = [
            y for y in models.outputs if y not in models.states or models.states.index(y) in ix
        ]
    iy = indices(outputs, models.outputs, "output")
    return replace(
        models,
        A=models.A[..., ix, :][..., ix],
        B=models.B[..., ix, :][..., iu],
        C=models.C[..., iy, :][..., ix],
        D=models.D[..., iy, :][..., iu],
        states=tuple(models.states[i] for i in ix),
        inputs=tuple(models.inputs[i] for i in iu),
        outputs=tuple(models.outputs[i] for i in iy),
    )


def is_control_system(system: object) -> bool:
    """Whether this is a system of python-control, which need not be installed or loaded for the
    answer.
    """
    return type(system).__module__.partition(".")[0] == "control" and hasattr(
        system, "input_labels"
    )


def as_model(system: object) -> LinearModel:
    """Return a LinearModel itself, a system of python-control as one; `InputError` for anything
    else.
    """
    if isinstance(system, LinearModel):
        return system
    if is_control_system(system):
        return LinearModel.from_control(system)
    raise InputError(
        "expected a LinearModel or a system of python-control, got"
        f" {type(system).__name__}; an LPV model has .at(p), a Plant .nominal.at(p)"
    )


def feedback_matrix(
    gains: Mapping[tuple[str, str], float], inputs: Sequence[str], outputs: Sequence[str]
) -> np.ndarray:
    """K (nu, ny) of u = K y from {(input, output): gain}; raises `UnknownNameError`."""
    K = np.zeros((len(inputs), len(outputs)))
    pairs = "{(input, output): gain}"
    for pair, gain in by_name(gains, "feedback", pairs).items():
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise InputError(f"feedback: expected {pairs}, got the key {pair!r:.80}")
        u, y = pair
        K[indices([u], inputs, "input")[0], indices([y], outputs, "output")[0]] = finite(
            gain, f"gain from {y} to {u}"
        )
    return K
