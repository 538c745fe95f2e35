"""Controllers to make tables of, for several test modules."""

from dataclasses import replace

import numpy as np

import symheli
from symheli import TableController
from symheli.flight import ParameterMonitor

OUTPUTS = ("d_lon", "d_lat", "d_col", "d_ped")
INPUTS = ("u", "v", "w", "p", "q", "r", "phi", "theta")
DT = 0.02


def sampled(order, inputs=INPUTS, outputs=OUTPUTS, *, low=0.0, high=13.0, rate=3.0, seed=0):
    """Random matrices, quadratic in airspeed, stable at each: eigenvalues up to 0.9 or so."""
    rng = np.random.default_rng(seed)
    basis = symheli.lpv.Polynomial(2, low, high)
    shares = np.array([1.0, 0.2, 0.05])[:, None, None]
    A = np.concatenate([0.8 * np.linalg.qr(rng.standard_normal((order, order)))[0][None]] * 3)
    A *= shares * np.array([1.0, 0.3, 0.3])[:, None, None]
    B, C, D = (
        shares * size * rng.standard_normal((3, rows, columns))
        for size, rows, columns in (
            (0.3, order, len(inputs)),
            (0.1, len(outputs), order),
            (0.05, len(outputs), len(inputs)),
        )
    )
    return symheli.LPVStateSpace(
        basis,
        A,
        B,
        C,
        D,
        symheli.Scheduling("airspeed", "m/s", low, high, rate),
        tuple(f"x{i}" for i in range(order)),
        inputs,
        outputs,
        DT,
    )


def table(order=6, knots=9, *, outputs=OUTPUTS, limit=0.2, **options):
    """Of `sampled`, with the same limit on all commands."""
    options.setdefault("monitor", ParameterMonitor(lag=0.1, frozen=0.5, hold=0.3, fallback=4.0))
    names = [y.removesuffix("_rate") for y in outputs]
    limits = {} if limit is None else {y: (-limit, limit) for y in names}
    return TableController.of(sampled(order, outputs=outputs), knots, limits=limits, **options)


MACH = symheli.Scheduling("Mach", "1", 0.2, 0.9, 0.1)


def over(scheduling, knots=5, order=2, **options):
    """Of `sampled`, over another parameter."""
    model = sampled(order, low=scheduling.low, high=scheduling.high)
    return TableController.of(replace(model, parameters=scheduling), knots, **options)


class InFlight:
    """A table with the state that it has come to, as its C code keeps it."""

    def __init__(self, controller):
        self.controller, self.axes = controller, None
        self.inputs, self.outputs = controller.inputs, controller.outputs
        self.reset()

    def reset(self, command=None):
        self.state = self.controller.init(command, self.axes)

    def fly_axes(self, axes):
        self.axes = axes
        self.state = self.controller.fly_axes(self.state, axes)

    def update(self, *told, **more):
        u, self.state = self.controller.update(self.state, *told, **more)
        return u

    def run(self, errors, airspeed, trim=0.0):
        """Commands (N, ny) along errors (N, nu) at an airspeed."""
        zeros, at = np.zeros(errors.shape[1]), np.full(len(self.outputs), trim)
        return np.array([self.update(e, zeros, at, airspeed) for e in errors])

    @property
    def status(self):
        return self.state.status


def velocity(**options):
    """Of bank and its command, d_lat_command, by the rate of that."""
    model = sampled(3, ("phi", "p", "d_lat_command"), ("d_lat_rate",))
    return TableController.of(model, 5, limits={"d_lat": (-0.2, 0.2)}, **options)


def static(gain, *, rate=3.0, output="d_lat", **options):
    """One gain from phi, the same at 0 and 10 m/s."""
    model = symheli.LPVStateSpace(
        symheli.lpv.PiecewiseLinear((0.0, 10.0)),
        np.zeros((2, 0, 0)),
        np.zeros((2, 0, 1)),
        np.zeros((2, 1, 0)),
        np.full((2, 1, 1), gain),
        symheli.Scheduling("airspeed", "m/s", 0.0, 10.0, rate),
        (),
        ("phi",),
        (output,),
        DT,
    )
    return TableController.of(model, 2, **options)
