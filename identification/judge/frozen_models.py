"""Models with the scheduling held: poles, responses, distances to a reference, point by point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.model.lpvarx_model import LPVARXModel
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import LinearModel, LPVStateSpace, chordal_distance, nu_gap
from symheli.values.arrays import Array
from symheli.values.summary import summarized

FAST = 3.0
"""Frequency (rad/s) above which models are compared on their own: what is slower hardly shows in
records of a minute.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrozenModels:
    """Reference, baseline and identified model with the scheduling held at `points`.

    Poles (rad/s) are those of the sampled models as continuous ones. `miss_*` (K,): percent of its
    magnitude by which the nearest pole misses the reference's `mode`; `gap_*` (K,): nu-gaps to the
    reference; `fast_*` (K,): the largest chordal distance from `fast` rad/s on. `responses`: |G|
    (n,) over `omega` (rad/s) of the `channel` (input, output) at the point `responses_at`.

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli
    >>> names = dict(states=["p"], inputs=["aileron"], outputs=["p"])
    >>> roll = symheli.LPVStateSpace.polynomial(
    ...     A=[[[-4.0]], [[-0.2]]], B=[[[30.0]]], C=[[[1.0]]], D=[[[0.0]]],
    ...     scheduling=symheli.Scheduling("speed", "m/s", 0.0, 10.0), **names)
    >>> arx = idn.LPVARX(
    ...     "p", "aileron", "speed", na=1, nb=1, delay=1, basis=idn.Polynomial(0, 0.0, 10.0))
    >>> rng = np.random.default_rng(0)
    >>> u, p = rng.standard_normal(300), np.zeros(300)
    >>> for k in range(1, 300):
    ...     p[k] = 0.9 * p[k - 1] + 0.5 * u[k - 1]
    >>> record = symheli.FlightRecord.from_arrays(
    ...     0.02 * np.arange(300), {"p": "rad/s", "aileron": "rad", "speed": "m/s"},
    ...     p=p, aileron=u, speed=5 + 5 * np.sin(np.arange(300)))
    >>> found = idn.frozen_models(
    ...     {v: roll.at(v) for v in (2.0, 8.0)}, roll, idn.fit(arx, record),
    ...     mode={v: -4.0 - 0.2 * v for v in (2.0, 8.0)},
    ...     scales={"p": 1.0, "aileron": 0.1}, channel=("aileron", "p"))
    >>> bool(found.gap_baseline.max() < 1e-9 < found.gap_identified.min())
    True
    """

    points: Array
    mode: tuple[complex, ...]
    reference_poles: tuple[Array, ...]
    baseline_poles: tuple[Array, ...]
    identified_poles: tuple[Array, ...]
    miss_baseline: Array
    miss_identified: Array
    gap_baseline: Array
    gap_identified: Array
    fast: float
    fast_baseline: Array
    fast_identified: Array
    omega: Array
    channel: tuple[str, str]
    responses_at: float
    responses: Mapping[str, Array]

    __repr__ = summarized


def pole_miss(model: LinearModel, pole: complex) -> float:
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
    >>> round(idn.pole_miss(lag.at(0.0).discretize(0.1), -2.1), 2)
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


def frozen_models(
    reference: Mapping[float, LinearModel],
    baseline: LPVStateSpace,
    identified: LPVARXModel,
    *,
    mode: Mapping[float, complex],
    scales: Mapping[str, float],
    channel: tuple[str, str],
    responses_at: float | None = None,
    fast: float = FAST,
) -> FrozenModels:
    """Compare a baseline and an identified model with exact linear models at frozen scheduling.

    Everything is compared at the sample period of the identified model, inputs held from sample to
    sample, on its inputs and outputs.

    Parameters
    ----------
    reference : mapping of float to LinearModel
        The continuous model at each point of the scheduling.
    baseline : LPVStateSpace
        Continuous, with the inputs and outputs of the identified model.
    identified : LPVARXModel
        One scheduling parameter.
    mode : mapping of float to complex
        The pole (rad/s) of the reference at each point that a model must have.
    scales : mapping of str to float
        A change of this size of an input or output counts as 1 in the distances; all of them.
    channel : (str, str)
        Input and output whose response is kept.
    responses_at : float, optional
        The point at which it is kept; default the middle one.
    fast : float
        Frequency, rad/s, from which the chordal distances count.

    Returns
    -------
    FrozenModels
        Poles, misses, distances by point.

    Raises
    ------
    UnknownNameError
        For a size that is missing and a channel the model does not have.
    InputError
        Without a point, or where `mode` or `responses_at` has other points.

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli
    >>> names = dict(states=["p"], inputs=["aileron"], outputs=["p"])
    >>> roll = symheli.LPVStateSpace.polynomial(
    ...     A=[[[-4.0]], [[-0.2]]], B=[[[30.0]]], C=[[[1.0]]], D=[[[0.0]]],
    ...     scheduling=symheli.Scheduling("speed", "m/s", 0.0, 10.0), **names)
    >>> arx = idn.LPVARX(
    ...     "p", "aileron", "speed", na=1, nb=1, delay=1, basis=idn.Polynomial(0, 0.0, 10.0))
    >>> rng = np.random.default_rng(0)
    >>> u, p = rng.standard_normal(300), np.zeros(300)
    >>> for k in range(1, 300):
    ...     p[k] = 0.9 * p[k - 1] + 0.5 * u[k - 1]
    >>> record = symheli.FlightRecord.from_arrays(
    ...     0.02 * np.arange(300), {"p": "rad/s", "aileron": "rad", "speed": "m/s"},
    ...     p=p, aileron=u, speed=5 + 5 * np.sin(np.arange(300)))
    >>> found = idn.frozen_models(
    ...     {v: roll.at(v) for v in (2.0, 8.0)}, roll, idn.fit(arx, record),
    ...     mode={v: -4.0 - 0.2 * v for v in (2.0, 8.0)},
    ...     scales={"p": 1.0, "aileron": 0.1}, channel=("aileron", "p"))
    >>> bool(found.gap_baseline.max() < 1e-9 < found.gap_identified.min())
    True
    """
    points, dt = list(reference), identified.dt
    inputs, outputs = list(map(str, identified.inputs)), list(map(str, identified.outputs))
    at = points[len(points) // 2] if responses_at is None and points else responses_at
    if at not in points or set(mode) != set(points):
        raise InputError(
            f"mode and responses_at: expected the points {points}, got {list(mode)} and {at}"
        )
    for signal in (*inputs, *outputs):
        if signal not in scales:
            raise UnknownNameError("size in scales", signal, scales)
    if len(channel) != 2:
        raise InputError(f"channel: expected (input, output), got {channel!r:.80}")
    for signal, there in zip(channel, (inputs, outputs), strict=True):
        if signal not in there:
            raise UnknownNameError("signal of channel", signal, there)
    sizes: dict[str, Any] = {
        "input_scale": [scales[i] for i in inputs],
        "output_scale": [scales[y] for y in outputs],
    }
    omega = np.geomspace(0.3, 0.8 * np.pi / dt, 200)
    if not fast <= omega[-1]:
        raise InputError(f"fast: expected at most {omega[-1]:.4g} rad/s, got {fast}")
    names = ("reference", "baseline", "identified")
    poles: dict[str, list[Array]] = {name: [] for name in names}
    misses, gaps, distances = ({name: [] for name in names[1:]} for _ in range(3))
    responses = {}
    for point in points:
        models = {
            "reference": reference[point].discretize(dt),
            "baseline": baseline.at(point).discretize(dt),
            "identified": identified.at(point),
        }
        exact = models["reference"].select(inputs=inputs, outputs=outputs)
        for name, whole in models.items():
            frozen = whole.select(inputs=inputs, outputs=outputs)
            poles[name].append(continuous_poles(frozen))
            if name != "reference":
                misses[name].append(pole_miss(frozen, mode[point]))
                gaps[name].append(nu_gap(exact, frozen, **sizes))
                far = chordal_distance(exact, frozen, omega[omega >= fast], **sizes)
                distances[name].append(far.max())
            if point == at:
                one = frozen.select(inputs=[channel[0]], outputs=[channel[1]])
                responses[name] = np.abs(one.frequency_response(omega)[:, 0, 0])
    return FrozenModels(
        points=np.array(points, float),
        mode=tuple(complex(mode[point]) for point in points),
        reference_poles=tuple(poles["reference"]),
        baseline_poles=tuple(poles["baseline"]),
        identified_poles=tuple(poles["identified"]),
        miss_baseline=np.array(misses["baseline"]),
        miss_identified=np.array(misses["identified"]),
        gap_baseline=np.array(gaps["baseline"]),
        gap_identified=np.array(gaps["identified"]),
        fast=fast,
        fast_baseline=np.array(distances["baseline"]),
        fast_identified=np.array(distances["identified"]),
        omega=omega,
        channel=channel,
        responses_at=at,
        responses=responses,
    )
