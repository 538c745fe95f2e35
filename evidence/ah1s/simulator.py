"""Minimal wrapper of JSBSim's AH-1S: set a state, hold it until the rotor settles, release it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symheli.extras import extra
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS, RIGID_BODY

STATES = RIGID_BODY
STICKS = tuple(Signal(name, "1") for name in INPUTS)
"""Longitudinal and lateral stick, collective, pedals, as parts of their travel."""

DEFLECTIONS = tuple(Signal(f"{name}_reached", "rad") for name in STICKS)
"""What rotors and tail rotor are set to: sticks through gains, mixing and lags."""

LAGS = (20.0, 20.0, 10.0, 20.0)
"""From sticks to deflections, 1/s, in the file of the aircraft; behind them they are mixed."""

DT = 0.02
"""Sample period, s."""

STEPS = 3
"""Steps of integration a sample: 150 Hz, a little finer than the 133 Hz of the aircraft's own
script.
"""

ALTITUDE = 1000.0
"""ft; where each flight starts."""

FOOT = 0.3048

READ = (
    *("velocities/u-fps", "velocities/v-fps", "velocities/w-fps"),
    *("velocities/p-rad_sec", "velocities/q-rad_sec", "velocities/r-rad_sec"),
    *("attitude/phi-rad", "attitude/theta-rad"),
)
SET = (
    *("ic/u-fps", "ic/v-fps", "ic/w-fps"),
    *("ic/p-rad_sec", "ic/q-rad_sec", "ic/r-rad_sec"),
    *("ic/phi-rad", "ic/theta-rad"),
)
RATES = (
    *("accelerations/udot-ft_sec2", "accelerations/vdot-ft_sec2", "accelerations/wdot-ft_sec2"),
    *("accelerations/pdot-rad_sec2", "accelerations/qdot-rad_sec2", "accelerations/rdot-rad_sec2"),
)
COMMANDS = (
    *("fcs/elevator-cmd-norm", "fcs/aileron-cmd-norm"),
    *("fcs/collective-cmd-norm", "fcs/rudder-cmd-norm"),
)
REACHED = (
    *("propulsion/engine/longitudinal-ctrl-rad", "propulsion/engine/lateral-ctrl-rad"),
    *("propulsion/engine/collective-ctrl-rad", "propulsion/engine[1]/antitorque-ctrl-rad"),
)
INTEGRATORS = tuple(
    f"simulation/integrator/{part}/{kind}"
    for part in ("rate", "position")
    for kind in ("rotational", "translational")
)
TO_SI = np.array([FOOT, FOOT, FOOT, 1.0, 1.0, 1.0, 1.0, 1.0])

SPIN_UP, HOLD = 300.0, 4.0
"""Seconds that the governor needs to bring the rotor to its speed, and in which lags settle."""


class AH1S:
    """The simulator, rotor turning, body held still. Without jsbsim an `InputError` says how to
    install it.

    Its stick commands are linear here (the curves for joysticks are switched off), its stability
    augmentation is off, its rotor governor on.
    """

    def __init__(self) -> None:
        with extra("jsbsim", "the AH-1S"):
            import jsbsim  # pyright: ignore[reportMissingImports]

        jsbsim.FGJSBBase().debug_lvl = 0
        self._fdm = fdm = jsbsim.FGFDMExec(None)
        fdm.set_dt(DT / STEPS)  # before the model: its lags are discretized when it is read
        fdm.load_model("ah1s")
        fdm["ic/terrain-elevation-ft"] = 0.0
        fdm["ic/h-sl-ft"] = ALTITUDE
        fdm.run_ic()
        self._integrate = [fdm[name] for name in INTEGRATORS]
        fdm["fcs/adj/collective-profile"] = 0.0
        fdm["fcs/adj/center-sensitivity"] = 1.0
        fdm["fcs/rpm-governor-active-norm"] = 1.0
        self.hold(np.zeros(8), [0.0, 0.0, 0.4, 0.3], SPIN_UP)

    def hold(self, state: object, sticks: Sequence[float] | Array, seconds: float = HOLD) -> Array:
        """Put the body into `state` (8,), keep it there for so long, and return the accelerations
        (6,) of u v w p q r it would then have (m/s^2, rad/s^2).
        """
        fdm = self._fdm
        for name, value in zip(SET, np.asarray(state) / TO_SI, strict=True):
            fdm[name] = float(value)
        fdm["ic/h-sl-ft"] = ALTITUDE
        self._command(sticks)
        fdm.run_ic()
        for name in INTEGRATORS:
            fdm[name] = 0
        for _ in range(round(seconds / DT) * STEPS):
            fdm.run()
        return np.array([fdm[name] for name in RATES]) * TO_SI[:6]

    def release(self) -> None:
        """Let the body move from now on."""
        for name, value in zip(INTEGRATORS, self._integrate, strict=True):
            self._fdm[name] = value

    def read(self) -> Array:
        """u v w p q r phi theta (8,)."""
        return np.array([self._fdm[name] for name in READ]) * TO_SI

    def deflections(self) -> Array:
        """`DEFLECTIONS` (4,)."""
        return np.array([self._fdm[name] for name in REACHED])

    def step(self, sticks: Sequence[float] | Array) -> Array:
        """Hold sticks (4,) for one sample; the state (8,) after it."""
        self._command(sticks)
        for _ in range(STEPS):
            self._fdm.run()
        return self.read()

    def _command(self, sticks: Sequence[float] | Array) -> None:
        for name, value in zip(COMMANDS, sticks, strict=True):
            self._fdm[name] = float(value)
