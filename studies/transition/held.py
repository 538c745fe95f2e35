"""Models at frozen airspeed, at many airspeeds: poles, responses, derivatives, for the slider of
the report.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.judge.frozen_models import continuous_poles
from studies.known_kinematics.truth import frozen, sampled
from studies.setup.axes import LATERAL, LONGITUDINAL
from studies.setup.flights import NOISES, TOP
from studies.setup.quantities import values
from studies.transition.baseline import derivative_name
from studies.transition.comparison import CHANNELS
from symheli import LinearFamily, LinearModel

if TYPE_CHECKING:
    from studies.transition.outcome import Outcome

EXACT, LFT, ARX, KNOWN = "exact", "LFT, cubic", "LPV-ARX", "known kinematics"
SPEEDS = np.linspace(0.0, TOP, 14)
"""m/s, among the nodes of the baseline."""

OMEGA = np.geomspace(0.2, 100.0, 48)
"""Frequencies of the responses, rad/s."""

STEPS = 100
"""Samples of a step response."""

DERIVATIVES = (
    *(("u", "u"), ("w", "w"), ("q", "u"), ("q", "w"), ("q", "q"), ("q", "d_lon"), ("w", "d_col")),
    *(("v", "v"), ("p", "v"), ("p", "p"), ("r", "v"), ("r", "r"), ("p", "d_lat"), ("r", "d_ped")),
)
"""Row and column of those that are shown."""

WITHOUT_ROTOR = ("u", "v", "w", "r")
"""Rows in which the sum over the lags of an identified model is a derivative. In pitch and roll the
rotor answers more slowly than its two lags last.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class AxisModels:
    """The models of one axis at `SPEEDS`, all sampled at the same period."""

    name: str
    channel: tuple[str, str]
    models: Mapping[str, Sequence[LinearModel]]


_kept: list[tuple[tuple[Any, ...], dict[str, Any]]] = []
"""The models of the last call and what they are with the airspeed held: results are written after
every stage, and most stages leave the models as they are.
"""


def held_to_dict(study: Outcome) -> dict[str, Any] | None:
    """Return the data of the exact models and their interpolation, and of the identified ones that
    are there.
    """
    if study.baseline is None:
        return None
    models = (study.baseline, study.identification, study.known_kinematics)
    for known, found in _kept:
        if all(a is b for a, b in zip(known, models, strict=True)):
            return found
    made = {
        "airspeed": values(SPEEDS, "m/s"),
        "frequency": values(OMEGA, "rad/s"),
        "axes": [_axis(axis) for axis in axes(study)],
        "derivatives": derivatives(study),
    }
    _kept[:] = [(models, made)]
    return made


def axes(study: Outcome) -> list[AxisModels]:
    """Longitudinal, then lateral."""
    assert study.baseline is not None  # noqa: S101
    nodes, cubic = study.baseline.nodes, study.baseline.lpv["polynomial 3"]
    out = []
    for name, axis in (("longitudinal", LONGITUDINAL), ("lateral", LATERAL)):
        models = {
            EXACT: [sampled(_at(nodes, v), axis) for v in SPEEDS],
            LFT: [sampled(cubic.at(float(v)), axis) for v in SPEEDS],
        }
        if study.identification is not None:
            arx = study.identification.of(axis, NOISES[0]).model
            models[ARX] = [arx.at(float(v)) for v in SPEEDS]
        if study.known_kinematics is not None:
            known = study.known_kinematics.model
            models[KNOWN] = [frozen(known, axis, float(v)) for v in SPEEDS]
        out.append(AxisModels(name=name, channel=CHANNELS[axis.name], models=models))
    return out


def derivatives(study: Outcome) -> list[dict[str, Any]]:
    """Quasi-steady stability and control derivatives over airspeed: flapping in equilibrium, of the
    identified model the sum over its lags.
    """
    assert study.baseline is not None  # noqa: S101
    nodes, cubic = study.baseline.nodes, study.baseline.lpv["polynomial 3"]
    names = list(map(str, nodes.states))
    fast = [s for s in ("a1", "b1") if s in names]
    steady = {
        EXACT: [_at(nodes, v).residualize(fast) for v in SPEEDS],
        LFT: [cubic.at(float(v)).residualize(fast) for v in SPEEDS],
    }
    known = None if study.known_kinematics is None else study.known_kinematics.model.aerodynamics
    out = []
    for to, of in DERIVATIVES:
        one = steady[EXACT][0]
        row = one.states[list(map(str, one.states)).index(to)]
        signals = {str(s): s for s in (*one.states, *one.inputs)}
        if of not in signals:
            continue
        found = {name: [_entry(m, to, of) for m in models] for name, models in steady.items()}
        if known is not None and to in WITHOUT_ROTOR:
            i, j = known.structure.outputs.index(f"{to}_aero"), known.structure.inputs.index(of)
            rest = (0.0,) * (len(known.parameters) - 1)
            points = [(float(v), *rest) if rest else float(v) for v in SPEEDS]
            found[KNOWN] = [
                float(known.coefficients.at(np.array(p)).B[:, i, j].sum() / known.dt)
                for p in points
            ]
        unit = f"({row.unit}/s)/({signals[of].unit})"
        out.append(
            {
                "name": derivative_name(to, of),
                "models": [{"name": name, **values(each, unit)} for name, each in found.items()],
            }
        )
    return out


def _at(family: LinearFamily, airspeed: float) -> LinearModel:
    k = int(np.argmin(np.abs(family.airspeeds - airspeed)))
    assert abs(family.airspeeds[k] - airspeed) < 1e-9, "no node there"  # noqa: S101
    return family[k]


def _entry(model: LinearModel, to: str, of: str) -> float:
    states, inputs = list(map(str, model.states)), list(map(str, model.inputs))
    M, j = (model.A, states.index(of)) if of in states else (model.B, inputs.index(of))
    return float(M[states.index(to), j])


def _axis(axis: AxisModels) -> dict[str, Any]:
    period = axis.models[EXACT][0].dt
    assert period is not None  # noqa: S101
    source, output = axis.channel
    return {
        "axis": axis.name,
        "input": source,
        "output": output,
        "time": values(period * np.arange(STEPS), "s"),
        "models": [
            {
                "name": name,
                "poles": [_poles(model) for model in models],
                **_responses([m.select(inputs=[source], outputs=[output]) for m in models]),
            }
            for name, models in axis.models.items()
        ],
    }


def _poles(model: LinearModel) -> dict[str, Any]:
    """Return the poles in the upper half plane."""
    poles = np.asarray(continuous_poles(model))
    upper = poles[np.imag(poles) >= -1e-9]
    return {
        "real": values(np.real(upper), "rad/s"),
        "imag": values(np.imag(upper), "rad/s"),
    }


def _responses(models: Sequence[LinearModel]) -> dict[str, Any]:
    """Magnitude over `OMEGA` and answer to a step of 1, of one input to one output."""
    unit = f"({models[0].outputs[0].unit})/({models[0].inputs[0].unit})"
    magnitude = [np.abs(m.frequency_response(OMEGA)[:, 0, 0]) for m in models]
    return {
        "magnitude": [values(each, unit) for each in magnitude],
        "step": [values(_step(m), unit) for m in models],
    }


def _step(model: LinearModel) -> np.ndarray:
    x, out = np.zeros(len(model.A)), np.empty(STEPS)
    for k in range(STEPS):
        out[k] = model.C[0] @ x + model.D[0, 0]
        x = model.A @ x + model.B[:, 0]
    return out
