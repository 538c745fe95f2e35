"""Plots and tables of a model over its scheduling parameter: Bode, singular values, Nyquist, poles,
damping, step responses.

Each takes an LPVStateSpace, an LFT, a LinearFamily or a LinearModel. `p` are the values at which
the parameter is frozen, with several parameters rows of them; by default seven over the range of
the first parameter with the others in the middle, and every node of a family. Curves are pale at
the first value and strong at the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.lft.model import LFT
from symheli.lpv.linear_family import LinearFamily
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.simulate import simulate
from symheli.values.arrays import Array, frozen
from symheli.values.drawing import BLUE, GREY, RED, axes_of, label, legend_beside, new_figure, plain
from symheli.values.labelled import frame
from symheli.values.signal import Signal, indices

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

Model = Any
"""An LPVStateSpace, an LFT, a LinearFamily or a LinearModel."""

VALUES = 7
"""Default number of values of the parameter."""
FREQUENCIES = 400
"""Default number of frequencies, from a tenth of the slowest pole to ten times the fastest, or to
the Nyquist frequency.
"""
MIN_ALPHA = 0.25
"""Opacity of the first curve."""


@dataclass(frozen=True)
class NamedModel:
    """A model at one value of its parameters, and how a legend writes that."""

    p: tuple[float, ...]
    words: str
    model: LinearModel


def frozen_at(model: Model, p: object = None) -> list[NamedModel]:
    """The model frozen at each of the values; raises `InputError` for another type and for a linear
    model with values.
    """
    match model:
        case LinearModel():
            if p is not None:
                raise InputError("a LinearModel has no scheduling parameter: leave p out")
            return [NamedModel((), "", model)]
        case LinearFamily():
            grid = np.stack([m.ravel() for m in np.meshgrid(*model.values, indexing="ij")], -1)
            names = model.axes
        case LPVStateSpace() | LFT():
            names = tuple(Signal(s.name, s.unit) for s in model.parameters)
            grid = np.tile([s.middle for s in model.parameters], (VALUES, 1))
            first = model.parameters[0] if model.parameters else None
            if first is None:
                return [NamedModel((), "", model.at())]
            grid[:, 0] = np.linspace(first.low, first.high, VALUES)
        case _:
            raise InputError(
                "expected an LPVStateSpace, an LFT, a LinearFamily or a LinearModel, got"
                f" {type(model).__name__}"
            )
    if p is not None:
        grid = frozen(np.atleast_1d(np.asarray(p, float)), "p")
        grid = grid[:, None] if grid.ndim == 1 and len(names) == 1 else np.atleast_2d(grid)
        grid = frozen(grid, "p", (None, len(names)))
    return [NamedModel(tuple(row), _words(names, row), model.at(*row)) for row in grid.tolist()]


def _words(names: Sequence[Signal], values: Sequence[float]) -> str:
    pairs = zip(names, values, strict=True)
    return ", ".join(f"{s} {v:.4g}{'' if s.unit == '1' else f' {s.unit}'}" for s, v in pairs)


def bode(
    model: Model,
    input: str,
    output: str,
    p: object = None,
    *,
    omega: object = None,
    axes: Sequence[Axes] | None = None,
) -> tuple[Axes, Axes]:
    """Plot magnitude (dB) and phase (deg) of one channel over frequency (rad/s), a curve a value of
    the parameter.

    Parameters
    ----------
    model : LPVStateSpace, LFT, LinearFamily or LinearModel
        The model.
    input, output : str
        The channel.
    p : array_like, optional
        Values of the parameter.
    omega : array_like, optional
        rad/s.
    axes : (Axes, Axes), optional
        For magnitude and phase.

    Returns
    -------
    (Axes, Axes)
        Of magnitude and phase.

    Raises
    ------
    InputError, UnknownNameError
        Another type of model, a channel it does not have.

    See Also
    --------
    symheli.lpv.sigma : singular values
    symheli.lpv.step : step responses
    symheli.lpv.tools.nyquist : the loop in the complex plane

    Examples
    --------
    >>> upper, lower = lpv.bode(spring, "u1", "y1", [0.0, 0.5, 1.0])
    >>> upper.get_ylabel(), len(upper.lines)
    ('y1 per u1 (dB)', 3)
    """
    models = frozen_at(model, p)
    upper, lower = axes or new_figure(7.0, 5.5).subplots(2, 1, sharex=True)
    w = _frequencies(models, omega)
    for one, strength in _paler(models):
        G = _channel(one.model, input, output, w)
        look = {"color": BLUE, "alpha": strength}
        with np.errstate(divide="ignore"):
            upper.semilogx(w, 20 * np.log10(np.abs(G)), label=one.words or None, **look)
        lower.semilogx(w, np.degrees(np.unwrap(np.angle(G))), **look)
    y, u = _signals(models, input, output)
    upper.set_ylabel(f"{y} per {u} (dB)")
    lower.set_ylabel("phase (deg)")
    lower.set_xlabel("frequency (rad/s)")
    legend_beside(upper)
    return plain(upper), plain(lower)


def sigma(model: Model, p: object = None, *, omega: object = None, ax: Axes | None = None) -> Axes:
    """Plot the singular values (dB) of all channels over frequency (rad/s), a curve a value of the
    parameter.

    Parameters
    ----------
    model : LPVStateSpace, LFT, LinearFamily or LinearModel
        The model.
    p : array_like, optional
        Values of the parameter.
    omega : array_like, optional
        rad/s.
    ax : Axes, optional
        To draw into.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        Another type of model.

    See Also
    --------
    symheli.lpv.bode : magnitude and phase
    synthesis.frozen_gain : the worst frozen model

    Examples
    --------
    >>> len(lpv.sigma(spring, [0.0, 1.0]).lines)
    2
    """
    models = frozen_at(model, p)
    ax, w = axes_of(ax), _frequencies(models, omega)
    for one, strength in _paler(models):
        values = np.linalg.svd(one.model.frequency_response(w), compute_uv=False)
        with np.errstate(divide="ignore"):
            lines = ax.semilogx(w, 20 * np.log10(values), color=BLUE, alpha=strength)
        lines[0].set_label(one.words or None)
    ax.set_xlabel("frequency (rad/s)")
    ax.set_ylabel("singular values (dB)")
    legend_beside(ax)
    return plain(ax)


def nyquist(
    model: Model,
    input: str,
    output: str,
    p: object = None,
    *,
    omega: object = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot one channel in the complex plane for positive frequencies, with the point -1, a curve a
    value of the parameter.

    Parameters
    ----------
    model : LPVStateSpace, LFT, LinearFamily or LinearModel
        The loop; with the positive feedback of this package its sign is turned.
    input, output : str
        The channel.
    p : array_like, optional
        Values of the parameter.
    omega : array_like, optional
        rad/s.
    ax : Axes, optional
        To draw into.

    Returns
    -------
    Axes

    Raises
    ------
    InputError, UnknownNameError
        Another type of model, a channel it does not have.

    Examples
    --------
    >>> ax = lpv.tools.nyquist(spring, "u1", "y1", [0.0, 1.0])
    >>> ax.get_xlabel()
    'real part of y1 per u1'
    """
    models = frozen_at(model, p)
    ax, w = axes_of(ax, 5.5, 4.5), _frequencies(models, omega)
    for one, strength in _paler(models):
        G = _channel(one.model, input, output, w)
        ax.plot(np.real(G), np.imag(G), color=BLUE, alpha=strength, label=one.words or None)
    ax.plot(-1.0, 0.0, "+", color=RED)
    y, u = _signals(models, input, output)
    ax.set_xlabel(f"real part of {y} per {u}")
    ax.set_ylabel("imaginary part")
    legend_beside(ax)
    return plain(ax)


def pole_map(model: Model, p: object = None, *, ax: Axes | None = None) -> Axes:
    """Plot the poles in the complex plane, paler the earlier the value of the parameter comes, and
    in red where they are not stable.

    Parameters
    ----------
    model : LPVStateSpace, LFT, LinearFamily or LinearModel
        The model.
    p : array_like, optional
        Values of the parameter.
    ax : Axes, optional
        To draw into.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        Another type of model.

    Examples
    --------
    >>> lpv.tools.pole_map(spring).get_xlabel()
    'real part (1/s)'
    """
    from symheli.lpv.pole_plot import frame_of_poles

    models = frozen_at(model, p)
    ax = axes_of(ax, 5.5, 4.5)
    for one, strength in _paler(models):
        poles = one.model.poles()
        stable = _stable(one.model, poles)
        for mask, colour in ((stable, BLUE), (~stable, RED)):
            ax.plot(np.real(poles[mask]), np.imag(poles[mask]), "x", color=colour, alpha=strength)
    words = [models[0].words, models[-1].words]
    if words[0] != words[1]:
        ax.set_title(f"{words[0]} (pale) to {words[1]}", fontsize=9, loc="left")
    return frame_of_poles(ax, models[0].model.dt)


@dataclass(frozen=True)
class Damping:
    """The poles of a model at each value of its parameter, as `damping` finds them.

    `rows`: (p, pole, natural frequency rad/s, damping ratio), of a discrete model those of the
    continuous poles log(z)/dt.
    """

    names: tuple[Signal, ...]
    rows: tuple[tuple[tuple[float, ...], complex, float, float], ...]

    def __str__(self) -> str:
        head = " ".join(f"{label(s):>16}" for s in self.names)
        lines = [f"{head} {'pole':>22} {'frequency (rad/s)':>18} {'damping ratio':>14}"]
        for p, pole, frequency, ratio in self.rows:
            values = " ".join(f"{v:16.5g}" for v in p)
            lines.append(f"{values} {pole:22.4f} {frequency:18.4g} {ratio:14.4f}")
        return "\n".join(lines)

    __repr__ = __str__

    def to_frame(self) -> pandas.DataFrame:
        """A row a pole. Raises `InputError` without pandas."""
        columns = np.array([[*p, s.real, s.imag, w, z] for p, s, w, z in self.rows]).T
        signals = [Signal("real part", "1/s"), Signal("imaginary part", "rad/s")]
        signals += [Signal("frequency", "rad/s"), Signal("damping ratio", "1")]
        count = len(self.names)
        index = list(zip(self.names, columns[:count], strict=True)) or [
            (Signal("pole"), np.arange(len(self.rows)))
        ]
        return frame(index, list(zip(signals, columns[count:], strict=True)))


def damping(model: Model, p: object = None) -> Damping:
    """Return the poles, natural frequencies (rad/s) and damping ratios at each value of the
    parameter, as a table; of complex pairs the pole with positive imaginary part.

    Parameters
    ----------
    model : LPVStateSpace, LFT, LinearFamily or LinearModel
        The model.
    p : array_like, optional
        Values of the parameter.

    Returns
    -------
    Damping
        Prints as a table; `.rows`, `.to_frame()`.

    Raises
    ------
    InputError
        Another type of model.

    Examples
    --------
    >>> print(lpv.tools.damping(spring, [0.0]))
                   p                   pole  frequency (rad/s)  damping ratio
                   0        -0.5000+1.3229j              1.414         0.3536
    """
    models = frozen_at(model, p)
    rows = []
    for one in models:
        poles = one.model.poles().astype(complex)
        if one.model.dt is not None:
            with np.errstate(divide="ignore"):
                poles = np.log(poles) / one.model.dt
        for pole in sorted(poles[np.imag(poles) >= 0], key=lambda s: (abs(s), s.imag)):
            size = abs(pole)
            rows.append(
                (one.p, complex(pole), float(size), float(-pole.real / size if size else 1))
            )
    return Damping(parameters_of(model), tuple(rows))


def parameters_of(model: Model) -> tuple[Signal, ...]:
    """Names and units of the parameters at which a model is frozen."""
    names = model.axes if isinstance(model, LinearFamily) else getattr(model, "parameters", ())
    return tuple(Signal(getattr(s, "name", s), s.unit) for s in names)


def step(
    model: Model,
    input: str,
    output: str,
    p: object = None,
    *,
    duration: float | None = None,
    along: object = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot the response of an output to a unit step of an input, a curve a value at which the
    parameter is frozen, and in red the response while it moves `along` a history.

    Parameters
    ----------
    model : LPVStateSpace, LFT, LinearFamily or LinearModel
        The model.
    input, output : str
        The channel.
    p : array_like, optional
        Values of the parameter.
    duration : float, optional
        s; by default five times the slowest decaying pole's time constant.
    along : array_like (n,) or (n, d), optional
        Values of the parameters at even times over the duration, of an LPVStateSpace or LFT.
    ax : Axes, optional
        To draw into.

    Returns
    -------
    Axes

    Raises
    ------
    InputError, UnknownNameError
        Another type of model, a channel it does not have, a duration that is not positive.

    See Also
    --------
    symheli.lpv.bode : magnitude and phase
    symheli.lpv.tools.pole_map : poles over the parameter

    Examples
    --------
    >>> ax = lpv.step(spring, "u1", "y1", [0.0, 1.0], duration=10.0, along=np.linspace(0, 1, 500))
    >>> len(ax.lines), ax.get_ylabel()
    (4, 'y1 per u1')
    """
    models = frozen_at(model, p)
    ax = axes_of(ax)
    seconds = _settled(models) if duration is None else duration
    y, u = _signals(models, input, output)
    for one, strength in _paler(models):
        i, j = _places(one.model, input, output)
        found = one.model.step_response(seconds)
        ax.plot(
            found.time, found.values[:, i, j], color=BLUE, alpha=strength, label=one.words or None
        )
    if along is not None:
        if not isinstance(model, LPVStateSpace | LFT):
            raise InputError("along: expected an LPVStateSpace or an LFT, whose parameter can move")
        path = np.asarray(along, float)
        dt = model.dt or seconds / (len(path) - 1)
        i, j = _places(models[0].model, input, output)
        force = np.zeros((len(path), len(model.inputs)))
        force[:, j] = 1.0
        _, response = simulate(model, path, force, dt=None if model.dt else dt)
        ax.plot(dt * np.arange(len(path)), response[:, i], color=RED, label="along the history")
    ax.axhline(0.0, color=GREY, linewidth=0.8)
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"{y} per {u}")
    legend_beside(ax)
    return plain(ax)


def _settled(models: Sequence[NamedModel]) -> float:
    """Five time constants of the slowest decaying pole, s; 10 where none decays."""
    poles, dt = np.concatenate([one.model.poles() for one in models]), models[0].model.dt
    decay = -(np.real(poles) if dt is None else np.log(np.abs(poles[poles != 0])) / dt)
    slowest = float(decay[decay > 0].min(initial=np.inf))
    return 5.0 / slowest if np.isfinite(slowest) else 10.0


def _paler(models: Sequence[NamedModel]) -> list[tuple[NamedModel, float]]:
    strengths = np.linspace(MIN_ALPHA, 1.0, len(models)) if len(models) > 1 else [1.0]
    return [(one, float(s)) for one, s in zip(models, strengths, strict=True)]


def _frequencies(models: Sequence[NamedModel], omega: object) -> Array:
    if omega is not None:
        return frozen(omega, "omega", (None,))
    dt = models[0].model.dt
    poles = np.concatenate([one.model.poles() for one in models]).astype(complex)
    if dt is not None:
        poles = np.log(poles[poles != 0]) / dt
    speeds = np.abs(poles)[np.abs(poles) > 1e-6]
    low, high = (speeds.min() / 10, speeds.max() * 10) if len(speeds) else (1e-2, 1e2)
    high = high if dt is None else np.pi / dt
    return np.geomspace(min(low, high / 100), high, FREQUENCIES)


def _places(model: LinearModel, input: str, output: str) -> tuple[int, int]:
    return indices([output], model.outputs, "output")[0], indices([input], model.inputs, "input")[0]


def _channel(model: LinearModel, input: str, output: str, w: Array) -> Array:
    i, j = _places(model, input, output)
    return model.frequency_response(w)[:, i, j]


def _signals(models: Sequence[NamedModel], input: str, output: str) -> tuple[Signal, Signal]:
    i, j = _places(models[0].model, input, output)
    return models[0].model.outputs[i], models[0].model.inputs[j]


def _stable(model: LinearModel, poles: Array) -> Array:
    return np.real(poles) < 0 if model.dt is None else np.abs(poles) < 1
