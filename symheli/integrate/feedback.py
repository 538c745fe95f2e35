"""Linear feedback at every sample of a flight."""

from __future__ import annotations

from dataclasses import dataclass

from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized


@dataclass(frozen=True, eq=False)
class Feedback:
    """State feedback u(k) - K(k) (x - reference(k)) about the given inputs, limited to the travel.

    u is what the flight is given: nominal inputs and excitation together. Every flight of a batch
    shares K and the reference.

    Parameters
    ----------
    gains : array (n, 4, nx)
        K, rad per unit of the state.
    reference : array (n, nx)
        Euler form.
    travel : array (4,)
        rad.

    Raises
    ------
    InputError
        Shapes that do not fit.

    Examples
    --------
    >>> point = symheli.trim(heli, airspeed=5.0)
    >>> K = np.zeros((50, 4, len(heli.states)))
    >>> K[:, 1, heli.states.index("phi")] = 0.02  # d_lat on bank
    >>> hold = symheli.integrate.Feedback(K, np.tile(point.x.array, (50, 1)), heli.travel)
    >>> inputs = np.tile(point.u.array, (50, 1))
    >>> len(symheli.simulate(heli, point, inputs, dt=0.02, feedback=hold).times)
    51
    """

    gains: Array
    reference: Array
    travel: Array

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "gains", frozen(self.gains, "gains", (None, 4, None)))
        n, _, nx = self.gains.shape
        object.__setattr__(self, "reference", frozen(self.reference, "reference", (n, nx)))
        object.__setattr__(self, "travel", frozen(self.travel, "travel", (4,)))

    def check(self, heli: Helicopter, samples: int) -> None:
        """Raises `InputError` where it does not fit the helicopter and the length of the flight."""
        expected = (samples, 4, len(heli.states))
        if self.gains.shape != expected:
            raise InputError(
                f"feedback: expected gains {expected} (samples, inputs, states of the Euler form),"
                f" got {self.gains.shape}"
            )
