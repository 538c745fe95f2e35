"""Models with the scheduling held: poles, responses, distances to a reference, point by point."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from symheli import LinearModel
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import nu_gap
from symheli.lpv.tools import chordal_distance
from symheli.values.arrays import Array
from symheli.values.numbers import whole
from symheli.values.summary import summarized


class Freezable(Protocol):
    """A model whose scheduling can be held: LPV state space, LFT, identified model."""

    def at(self, *p: float) -> LinearModel:
        """The linear model with the scheduling held at p."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class FrozenModel:
    """One model with the scheduling held at K points, and its distance from a reference.

    Parameters
    ----------
    poles : tuple of array
        rad/s, at each point; those of a sampled model as the continuous ones it samples.
    stable : bool array (K,)
        Whether it is stable.
    gap : array (K,)
        nu-gap to the reference.
    miss : array (K,)
        Distance of the nearest pole to the reference's `mode`, percent of its magnitude.
    distance : array (K,)
        Largest chordal distance from the reference above the frequency `fast`.
    response : array (n,)
        |G| of the channel over `omega` at one of the points.

    What was not asked for is empty.
    """

    poles: tuple[Array, ...]
    stable: Array
    gap: Array
    miss: Array
    distance: Array
    response: Array

    __repr__ = summarized


@dataclass(frozen=True, kw_only=True, eq=False)
class FrozenModels:
    """A reference and other models with the scheduling held at the same points.

    Parameters
    ----------
    points : array (K,) or (K, parameters)
        Values of the scheduling.
    reference : FrozenModel
        The reference; its distances are 0.
    models : mapping of str to FrozenModel
        The others, by name.
    mode : tuple of complex
        The pole (rad/s) of the reference that a model must have, at each point; () without one.
    fast : float, optional
        Frequency from which chordal distances count, rad/s.
    omega : array (n,)
        Frequencies of the responses, rad/s.
    channel : tuple of str
        Input and output of the responses; () without one.
    responses_at : float or tuple
        The point of the responses.

    Examples
    --------
    >>> import identification as idn, symheli
    >>> names = dict(states=["p"], inputs=["aileron"], outputs=["p"])
    >>> exact, coarse = (symheli.LPVStateSpace.polynomial(
    ...     A=[[[-4.0]], [[slope]]], B=[[[30.0]]], C=[[[1.0]]], D=[[[0.0]]],
    ...     scheduling=symheli.Scheduling("speed", "m/s", 0.0, 10.0), **names)
    ...     for slope in (-0.2, -0.1))
    >>> reference = {v: exact.at(v).discretize(0.02) for v in (0.0, 8.0)}
    >>> found = idn.compare_frozen(
    ...     {"coarse": coarse}, reference, scales={"p": 1.0, "aileron": 0.1},
    ...     mode={v: -4.0 - 0.2 * v for v in reference})
    >>> found["coarse"].gap.round(3).tolist(), found["coarse"].miss.round(1).tolist()
    ([0.0, 0.067], [0.0, 14.3])
    """

    points: Array
    reference: FrozenModel
    models: Mapping[str, FrozenModel]
    mode: tuple[complex, ...]
    fast: float | None
    omega: Array
    channel: tuple[str, ...]
    responses_at: Any

    __repr__ = summarized

    def __getitem__(self, name: str) -> FrozenModel:
        """The model of this name."""
        if name not in self.models:
            raise UnknownNameError("model", name, self.models)
        return self.models[name]

    def otherwise_stable(self, name: str) -> int:
        """Number of points at which this model is stable and the reference is not, or the
        reverse.
        """
        return int(np.sum(self[name].stable != self.reference.stable))


def pole_distance(model: LinearModel, pole: complex) -> float:
    """Return the distance of the nearest pole of a linear model to `pole` (rad/s), in percent of
    its magnitude.

    The poles of a sampled model count as those of the continuous one it samples.

    Parameters
    ----------
    model : LinearModel
        Continuous or sampled.
    pole : complex
        What it is to have, rad/s; not 0.

    Returns
    -------
    float
        Percent.

    Raises
    ------
    InputError
        A pole that is 0 or not finite, a model without poles other than delays.

    Examples
    --------
    >>> import identification as idn, symheli
    >>> lag = symheli.LPVStateSpace.polynomial(
    ...     A=[[[-2.0]]], B=[[[1.0]]], C=[[[1.0]]], D=[[[0.0]]],
    ...     scheduling=symheli.Scheduling("speed", "m/s", 0.0, 1.0))
    >>> round(idn.judge.pole_distance(lag.at(0.0).discretize(0.1), -2.1), 2)
    4.76
    """
    if pole == 0 or not np.isfinite(pole):
        raise InputError(
            f"pole: expected a finite pole other than 0, got {pole}; the distance is given in"
            " percent of its magnitude"
        )
    poles = continuous_poles(model)
    if not len(poles):
        raise InputError(
            "the model has no poles other than those of delays; there is none to compare"
        )
    return float(100 * np.abs(poles - pole).min() / abs(pole))


def continuous_poles(model: LinearModel) -> Array:
    """The poles in rad/s; a pole at 0 of a sampled model is a delay and left out."""
    poles = model.poles().astype(complex)
    return poles if model.dt is None else np.log(poles[np.abs(poles) > 1e-12]) / model.dt


def compare_frozen(
    models: Mapping[str, Freezable | Mapping[Any, LinearModel]],
    reference: Mapping[Any, LinearModel],
    *,
    scales: Mapping[str, float],
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    mode: Mapping[Any, complex] | None = None,
    channel: tuple[str, str] | None = None,
    responses_at: Any = None,
    fast: float | None = None,
    frequencies: int = 2000,
) -> FrozenModels:
    """Compare models with exact linear models at frozen scheduling: poles, nu-gaps, responses.

    All are compared at one sample period: continuous models are sampled with inputs held, as the
    first sampled one is.

    Parameters
    ----------
    models : mapping of str to model
        By name: an LPV or identified model of one scheduling parameter, or linear models by point.
    reference : mapping of float (or tuple) to LinearModel
        The exact model at each point of the scheduling.
    scales : mapping of str to float
        A change of this size of an input or output counts as 1 in the distances; all of them.
    inputs, outputs : sequence of str, optional
        The signals that are compared; default those of the reference.
    mode : mapping of float (or tuple) to complex, optional
        The pole (rad/s) of the reference at each point that a model must have.
    channel : (str, str), optional
        Input and output whose response is kept.
    responses_at : float (or tuple), optional
        The point at which it is kept; default the middle one.
    fast : float, optional
        Frequency, rad/s, from which chordal distances are compared.
    frequencies : int
        Frequencies a nu-gap begins with; see `symheli.lpv.nu_gap`.

    Returns
    -------
    FrozenModels
        Poles, stability, distances by model and point.

    Raises
    ------
    UnknownNameError
        For a size that is missing and a signal that a model does not have.
    InputError
        Without a point or a sampled model, where `models`, `mode` or `responses_at` have other
        points, and as `symheli.lpv.nu_gap`.

    See Also
    --------
    symheli.lpv.nu_gap : distance of two models in feedback
    identification.judge.frozen_stability : whether frozen models are stable

    References
    ----------
    Vinnicombe (2001), Uncertainty and Feedback, ch. 3.

    Examples
    --------
    >>> import identification as idn, symheli
    >>> names = dict(states=["p"], inputs=["aileron"], outputs=["p"])
    >>> exact, coarse = (symheli.LPVStateSpace.polynomial(
    ...     A=[[[-4.0]], [[slope]]], B=[[[30.0]]], C=[[[1.0]]], D=[[[0.0]]],
    ...     scheduling=symheli.Scheduling("speed", "m/s", 0.0, 10.0), **names)
    ...     for slope in (-0.2, -0.1))
    >>> reference = {v: exact.at(v).discretize(0.02) for v in (0.0, 8.0)}
    >>> found = idn.compare_frozen(
    ...     {"coarse": coarse}, reference, scales={"p": 1.0, "aileron": 0.1},
    ...     mode={v: -4.0 - 0.2 * v for v in reference})
    >>> found["coarse"].stable.tolist(), found.otherwise_stable("coarse")
    ([True, True], 0)
    """
    points, frequencies = list(reference), whole(frequencies, "frequencies", 2)
    if not points or not models:
        raise InputError("compare_frozen: give models={name: ...} and reference={point: ...}")
    at = points[len(points) // 2] if responses_at is None and points else responses_at
    if at not in points or (mode is not None and set(mode) != set(points)):
        raise InputError(
            f"mode and responses_at: expected the points {points}, got"
            f" {None if mode is None else list(mode)} and {at}"
        )
    exact = [reference[point] for point in points]
    held = {name: _held(name, model, points) for name, model in models.items()}
    inputs = list(map(str, exact[0].inputs if inputs is None else inputs))
    outputs = list(map(str, exact[0].outputs if outputs is None else outputs))
    _require_signals(inputs, outputs, scales, channel)
    periods = (m.dt for group in (exact, *held.values()) for m in group if m.dt is not None)
    dt = next(periods, None)
    if dt is None:
        raise InputError("all models are continuous: discretize one of them, the others follow")
    omega = np.geomspace(0.3, 0.8 * np.pi / dt, 200)
    if fast is not None and not fast <= omega[-1]:
        raise InputError(f"fast: expected at most {omega[-1]:.4g} rad/s, got {fast}")
    sizes: dict[str, Any] = {
        "input_scale": [scales[i] for i in inputs],
        "output_scale": [scales[y] for y in outputs],
    }

    def compared(linear: Sequence[LinearModel], to: Sequence[LinearModel] | None) -> FrozenModel:
        def each(distance: Callable[[LinearModel, LinearModel], float]) -> Array:
            if to is None:
                return np.zeros(len(linear))
            return np.array([distance(a, b) for a, b in zip(to, linear, strict=True)])

        empty = np.zeros(0)
        far = omega[omega >= (np.inf if fast is None else fast)]
        return FrozenModel(
            poles=tuple(map(continuous_poles, linear)),
            stable=np.array([m.is_stable() for m in linear]),
            gap=each(lambda a, b: nu_gap(a, b, **sizes, points=frequencies)),
            miss=empty
            if mode is None
            else np.array([pole_distance(m, mode[p]) for m, p in zip(linear, points, strict=True)]),
            distance=empty
            if fast is None
            else each(lambda a, b: chordal_distance(a, b, far, **sizes).max()),
            response=empty
            if channel is None
            else _magnitude(linear[points.index(at)], channel, omega),
        )

    def sampled(linear: Sequence[LinearModel]) -> list[LinearModel]:
        discrete = (m if m.dt is not None else m.discretize(dt) for m in linear)
        return [m.select(inputs=inputs, outputs=outputs) for m in discrete]

    exact = sampled(exact)
    return FrozenModels(
        points=np.array(points, float),
        reference=compared(exact, None),
        models={name: compared(sampled(linear), exact) for name, linear in held.items()},
        mode=() if mode is None else tuple(complex(mode[point]) for point in points),
        fast=fast,
        omega=omega,
        channel=channel or (),
        responses_at=at,
    )


def _held(
    name: str, model: Freezable | Mapping[Any, LinearModel], points: Sequence[Any]
) -> list[LinearModel]:
    """The linear models at the points."""
    if not isinstance(model, Mapping):
        return [model.at(*np.atleast_1d(point)) for point in points]
    if set(points) - set(model):
        raise InputError(f"{name}: expected a model at the points {points}, got {list(model)}")
    return [model[point] for point in points]


def _require_signals(
    inputs: Sequence[str],
    outputs: Sequence[str],
    scales: Mapping[str, float],
    channel: tuple[str, str] | None,
) -> None:
    """Raise `UnknownNameError` for a signal without a size, or a channel of other signals."""
    for signal in (*inputs, *outputs):
        if signal not in scales:
            raise UnknownNameError("size in scales", signal, scales)
    if channel is None:
        return
    if len(channel) != 2:
        raise InputError(f"channel: expected (input, output), got {channel!r:.80}")
    for signal, there in zip(channel, (inputs, outputs), strict=True):
        if signal not in there:
            raise UnknownNameError("signal of channel", signal, there)


def _magnitude(model: LinearModel, channel: tuple[str, str], omega: Array) -> Array:
    """|G| (n,) of a channel."""
    one = model.select(inputs=[channel[0]], outputs=[channel[1]])
    return np.abs(one.frequency_response(omega)[:, 0, 0])
