"""Fits of predictions: one step, some seconds ahead, and in free run, always together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identification.design.leakage import warn_of_own_past
from identification.model.kinematic_model import KinematicModel
from identification.model.lpvarx_model import LPVARXModel
from identification.model.prediction import fit_percent
from identification.model.state_space_model import StateSpaceModel
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.numbers import positive

Identified = LPVARXModel | KinematicModel | StateSpaceModel

HORIZON = 1.0
"""Seconds ahead at which models are judged unless said otherwise."""


@dataclass(frozen=True, kw_only=True)
class Scores:
    """Fit in percent of each output one step ahead, `horizon` seconds ahead and in free run.

    100 is perfect, 0 no better than the mean; -inf where a prediction diverges, NaN where there is
    nothing to compare.

    Examples
    --------
    >>> import numpy as np, identification as idn
    >>> y = np.sin(np.arange(20.0))[:, None]
    >>> idn.judge.Scores.of(y, ["y"], one_step=y, ahead=y, free_run=0.9 * y).one_step
    {'y': 100.0}
    """

    horizon: float
    one_step: Mapping[str, float]
    ahead: Mapping[str, float]
    free_run: Mapping[str, float]

    def __post_init__(self) -> None:
        positive(self.horizon, "horizon")

    @property
    def by_horizon(self) -> dict[str, Mapping[str, float]]:
        """{name of the horizon: {output: percent}}, shortest first."""
        names = horizons(self.horizon)
        return dict(zip(names, (self.one_step, self.ahead, self.free_run), strict=True))

    @classmethod
    def of(
        cls,
        measured: Array,
        outputs: Sequence[str],
        *,
        one_step: Array,
        ahead: Array,
        free_run: Array,
        horizon: float = HORIZON,
    ) -> Scores:
        """Scores of predictions (n, ny) beside what was `measured`, a column an output.

        NaN for an output of which no row has both a measurement and a prediction. Raises
        `InputError` unless every output has one column, for a horizon that is not greater than 0
        and as `fit_percent`.
        """
        columns = 1 if measured.ndim < 2 else measured.shape[1]
        if len(set(outputs)) != len(outputs) or len(outputs) != columns:
            raise InputError(
                f"outputs: expected {columns} different names, one a column, got {list(outputs)}"
            )

        def fits(guess: Array) -> dict[str, float]:
            values = fit_percent(measured, guess)
            return {str(y): float(v) for y, v in zip(outputs, values, strict=True)}

        return cls(
            horizon=horizon,
            one_step=fits(one_step),
            ahead=fits(ahead),
            free_run=fits(free_run),
        )


def scores(
    model: Identified, record: FlightRecord, *, horizon: float = HORIZON, hold_p: bool = False
) -> Scores:
    """Judge a model on a record: one step ahead, some seconds ahead and in free run.

    One-step prediction flatters: a model that predicts the next sample at 98 % may not run free at
    all. The three are therefore given together.

    Parameters
    ----------
    model : LPVARXModel, KinematicModel or StateSpaceModel
        The identified model.
    record : FlightRecord
        With the outputs, inputs and scheduling of the model, at its sample period; best one that
        the model has not been fitted to.
    horizon : float
        Of the second prediction, s; one sample where it is shorter.
    hold_p : bool
        Hold the scheduling from the start of each prediction, as where it is measured; a free run
        follows it in any case. Of an LPVARXModel only.

    Returns
    -------
    Scores
        Fits in percent by output.

    Raises
    ------
    InputError
        For a horizon that is not greater than 0 and a record the model does not fit.

    Warns
    -----
    DataWarning
        The scheduling is a function of the outputs or their past.

    See Also
    --------
    identification.judge.validate : the verdict on flights not identified
    identification.judge.compare_constant : against a model without scheduling

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli
    >>> u, p = np.random.default_rng(0).standard_normal((2, 300))
    >>> y = np.zeros(300)
    >>> for k in range(1, 300):
    ...     y[k] = 0.8 * y[k - 1] + (1 + 0.1 * p[k - 1]) * u[k - 1]
    >>> units = dict.fromkeys("yup", "1")
    >>> record = symheli.FlightRecord.from_arrays(0.1 * np.arange(300), units, y=y, u=u, p=p)
    >>> arx = idn.LPVARX(
    ...     "y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, p.min(), p.max()))
    >>> found = idn.scores(idn.fit(arx, record), record, horizon=0.5)
    >>> round(found.ahead["y"], 6), list(found.by_horizon)
    (100.0, ['one step', '0.5 s', 'free run'])
    """
    own = model.structure.regression if isinstance(model, StateSpaceModel) else model.structure
    warn_of_own_past(own, record)
    one, ahead, free = (
        predicted(model, record, n, hold_p) for n in steps(model.dt, horizon).values()
    )
    return Scores.of(
        record.columns(model.outputs),
        model.outputs,
        one_step=one,
        ahead=ahead,
        free_run=free,
        horizon=horizon,
    )


def horizons(horizon: float = HORIZON) -> tuple[str, str, str]:
    """The names of the three horizons."""
    return ("one step", f"{horizon:g} s", "free run")


def steps(dt: float, horizon: float = HORIZON) -> dict[str, int | None]:
    """Each of `horizons` in samples of `dt` (s), at least one; None is a free run."""
    if not 0 < horizon < np.inf:
        raise InputError(f"horizon: expected seconds greater than 0, got {horizon:g}")
    if not horizon / dt < np.inf:
        raise InputError(
            f"horizon: {horizon:g} s at dt = {dt:g} s is not a whole number of samples"
        )
    return dict(zip(horizons(horizon), (1, max(round(horizon / dt), 1), None), strict=True))


def predicted(
    model: Identified, record: FlightRecord, horizon: int | None, hold_p: bool = False
) -> Array:
    """The prediction (n, ny) `horizon` samples ahead, or with None the free run."""
    if horizon is None:
        return model.simulate(record)
    if isinstance(model, LPVARXModel):
        return model.predict(record, horizon, hold_p=hold_p)
    if hold_p:
        raise InputError(f"hold_p: a {type(model).__name__} takes its scheduling as known ahead")
    return model.predict(record, horizon)


LOST = "diverges"
"""The word for a fit that is beyond all numbers."""

DIVERGES = -1e4
"""Percent: a prediction off by a hundred times what the signal varies has left it for good."""


def percent(value: float) -> str:
    """A fit in words where it is no number, or one that says no more than the word."""
    if np.isnan(value):
        return "no data"
    return LOST if value <= DIVERGES else f"{value:.1f}"
