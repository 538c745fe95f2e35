"""Closed loops of all axes as they fly, of 12 to 40 states: helicopter, servos, delay, filtered
sensors, scheduled controller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

import symheli
from symheli import LinearFamily, LinearModel, LPVStateSpace, Scheduling
from symheli.flight import XCELL_SERVOS, gain_scheduled_lqr
from symheli.lpv.tools import pade_delay
from symheli.values import Signal

LOW, HIGH, POINTS = 0.0, 13.0, 27
"""Airspeeds, m/s, and how many of them are linearized and designed for."""
RATE = 1.0
"""Acceleration, m/s^2."""
DEGREE = 3
"""Of every entry in the airspeed."""
CONTROLS = ("d_lon", "d_lat", "d_col", "d_ped")
CYCLIC = ("d_lon", "d_lat")
GUSTS = ("u_w", "v_w", "w_w")
SHOWN = ("r", "phi", "theta")
"""What the gusts are seen by: rad/s, rad, rad."""
DELAY = 0.02
"""From measurement to command, s; one sample of the sampled loop."""
BANDWIDTH = 60.0
"""Of the filter of a sensor, rad/s."""


@dataclass(frozen=True)
class Parts:
    """What stands between controller and helicopter: servos of these inputs, delays by their
    orders, filters on these sensors.
    """

    servos: tuple[str, ...] = ()
    delays: Mapping[str, int] = field(default_factory=dict)
    filters: tuple[str, ...] = ()

    def around(self, model: LinearModel) -> LinearModel:
        """The model with these parts."""
        if self.servos:
            model = model.driven_by({u: XCELL_SERVOS[u].linear(u) for u in self.servos})
        if self.delays:
            model = model.driven_by({u: pade_delay(u, DELAY, k) for u, k in self.delays.items()})
        return filtered(model, self.filters)


LOOPS = {
    12: Parts(servos=("d_ped",)),
    16: Parts(servos=CYCLIC),
    20: Parts(CYCLIC, dict.fromkeys(CYCLIC, 1), ("p", "q")),
    24: Parts((*CYCLIC, "d_ped"), dict.fromkeys((*CYCLIC, "d_ped"), 1), ("p", "q", "r")),
    30: Parts(CONTROLS, dict.fromkeys(CONTROLS, 1), ("p", "q", "r", "phi", "theta")),
    40: Parts(
        CONTROLS,
        {"d_lon": 3, "d_lat": 3, "d_col": 2, "d_ped": 3},
        ("u", "v", "w", "p", "q", "r", "phi", "theta"),
    ),
}
"""Parts by the number of states they lead to, those of the helicopter included."""


def closed_loop(states: int, rate: float = RATE) -> LPVStateSpace:
    """The loop of so many states, one of `LOOPS`: gusts (m/s) -> yaw rate, roll and pitch angle."""
    family, controller = _flown()
    parts = LOOPS[states]
    models = [
        closed(parts.around(family[k]), controller.gains[k], controller.measured(parts.filters))
        for k in range(len(family))
    ]
    return _scheduled(family, models, rate)


def sampled_loop(rate: float = RATE) -> LPVStateSpace:
    """Twenty states at 50 Hz: helicopter and cyclic servos sampled, every command exactly one
    sample late.
    """
    family, controller = _flown()
    parts = Parts(servos=CYCLIC)
    models = []
    for k in range(len(family)):
        plant = parts.around(family[k]).discretize(DELAY)
        late = plant.driven_by({u: _one_sample_late(u) for u in CONTROLS})
        models.append(closed(late, controller.gains[k], controller.measured()))
    return _scheduled(family, models, rate)


def closed(model: LinearModel, K: np.ndarray, measured: Sequence[str]) -> LinearModel:
    """u = -K y, K (4, len(measured)), from the gusts to what they are seen by."""
    gains = {
        (u, y): -float(K[i, j]) for i, u in enumerate(CONTROLS) for j, y in enumerate(measured)
    }
    return model.feedback(gains).select(inputs=GUSTS, outputs=SHOWN)


def filtered(model: LinearModel, sensors: Sequence[str]) -> LinearModel:
    """The model with a first-order filter on each of these outputs, seen as `<name>_measured`."""
    n, nu, k = len(model.states), len(model.inputs), len(sensors)
    rows = [model.outputs.index(y) for y in sensors]  # type: ignore[arg-type]
    names = tuple(Signal(f"{model.outputs[i]}_measured", model.outputs[i].unit) for i in rows)
    return replace(
        model,
        A=np.block(
            [[model.A, np.zeros((n, k))], [BANDWIDTH * model.C[rows], -BANDWIDTH * np.eye(k)]]
        ),
        B=np.vstack([model.B, BANDWIDTH * model.D[rows]]),
        C=np.block([[model.C, np.zeros((len(model.C), k))], [np.zeros((k, n)), np.eye(k)]]),
        D=np.vstack([model.D, np.zeros((k, nu))]),
        states=(*model.states, *names),
        outputs=(*model.outputs, *names),
        point=None,
    )


class Controller(NamedTuple):
    """Gains (K, 4, 8) on these states, one an airspeed."""

    gains: np.ndarray
    states: tuple[Signal, ...]

    def measured(self, filters: Sequence[str] = ()) -> list[str]:
        """The outputs it takes: those of the filters where there are any."""
        return [f"{s}_measured" if s in filters else str(s) for s in self.states]


def _flown() -> tuple[LinearFamily, Controller]:
    """The helicopter, and a controller whose gains are polynomials in the airspeed through those
    of the scheduled LQR.
    """
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    airspeeds = np.linspace(LOW, HIGH, POINTS)
    family = symheli.sweep(heli, airspeeds, inputs=(*CONTROLS, *GUSTS))
    lqr = gain_scheduled_lqr(heli, LOW, HIGH, DELAY, POINTS, XCELL_SERVOS)
    powers = np.vander(airspeeds / HIGH, DEGREE + 1)
    fitted = powers @ np.linalg.lstsq(powers, lqr.gains.reshape(POINTS, -1), rcond=None)[0]
    return family, Controller(fitted.reshape(lqr.gains.shape), lqr.states)


def _one_sample_late(name: str) -> LinearModel:
    state, command = Signal(f"{name}_late", "rad"), Signal(f"{name}_command", "rad")
    zero, one = np.zeros((1, 1)), np.ones((1, 1))
    return LinearModel(zero, one, one, zero, (state,), (command,), (Signal(name, "rad"),), DELAY)


def _scheduled(family: LinearFamily, models: list[LinearModel], rate: float) -> LPVStateSpace:
    fitted = LinearFamily.from_models(family.airspeeds, models).interpolate("polynomial", DEGREE)
    s = fitted.scheduling
    return fitted.with_scheduling(Scheduling(s.name, s.unit, s.low, s.high, rate))
