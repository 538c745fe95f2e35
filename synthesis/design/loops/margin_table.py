"""The margins of a loop at values of its scheduling parameters, as a table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli import LPVStateSpace
from symheli.errors import InputError
from symheli.lpv.frozen_plots import Model, frozen_at, parameters_of
from symheli.values.drawing import BLUE, GREY, ORANGE, axes_of, label
from symheli.values.html_table import as_table
from symheli.values.labelled import frame
from symheli.values.signal import Signal
from synthesis.design.loops.margins import Margins, decibels, margins, open_loop
from synthesis.design.plant.as_controller import as_controller
from synthesis.design.plant.plant import Plant

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

COLUMNS = (
    Signal("gain down", "dB"),
    Signal("gain up", "dB"),
    Signal("phase", "deg"),
    Signal("delay", "s"),
    Signal("disk gain", "dB"),
    Signal("disk phase", "deg"),
    Signal("crossover", "rad/s"),
)


@dataclass(frozen=True)
class MarginTable:
    """Margins at each value of the parameters, as `margin_table` finds them.

    `rows`: (p, Margins); printed in dB and degrees, the crossover the highest one.
    """

    names: tuple[Signal, ...]
    rows: tuple[tuple[tuple[float, ...], Margins], ...]

    def values(self) -> np.ndarray:
        """(K, columns): p, then the margins in the units of the columns; NaN of a loop that is not
        stable.
        """
        return np.array([[*p, *_numbers(m)] for p, m in self.rows])

    def __str__(self) -> str:
        heads = [f"{label(s):>18}" for s in (*self.names, *COLUMNS)]
        lines = ["".join(f"{v:18.5g}" for v in row) for row in self.values()]
        return "\n".join(["".join(heads), *lines])

    __repr__ = __str__
    _repr_html_ = as_table

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw gain margins (dB) and the phase margin (deg, on the right) over the parameter.

        Raises `InputError` for a table over several parameters or none.
        """
        if len(self.names) != 1:
            raise InputError(
                f"a picture is over one parameter, this table over {len(self.names)}: print it"
            )
        values = self.values()
        ax = axes_of(ax)
        ax.plot(values[:, 0], values[:, 2], "o-", color=BLUE, markersize=4, label="gain up (dB)")
        if np.any(np.isfinite(values[:, 1])):
            down = np.where(np.isfinite(values[:, 1]), -values[:, 1], np.nan)
            ax.plot(values[:, 0], down, "v-", color=GREY, markersize=4, label="gain down (dB)")
        ax.set_xlabel(label(self.names[0]))
        ax.set_ylabel("gain margin (dB)")
        ax.set_ylim(bottom=0.0)
        right = ax.twinx()
        right.plot(
            values[:, 0], values[:, 3], "s--", color=ORANGE, markersize=4, label="phase (deg)"
        )
        right.set_ylabel("phase margin (deg)")
        right.set_ylim(bottom=0.0)
        ax.legend(
            handles=[*ax.get_lines(), *right.get_lines()], loc="best", fontsize=8, frameon=False
        )
        return ax

    def to_frame(self) -> pandas.DataFrame:
        """A row a value of the parameters. Raises `InputError` without pandas."""
        columns = self.values().T
        count = len(self.names)
        index = list(zip(self.names, columns[:count], strict=True)) or [
            (Signal("loop"), np.arange(len(self.rows)))
        ]
        return frame(index, list(zip(COLUMNS, columns[count:], strict=True)))


def margin_table(
    model: Model | Plant,
    feedback: Any,
    at: str,
    p: object = None,
) -> MarginTable:
    """Compute the margins of the loop u = feedback y broken at one input, at values of the
    parameters.

    Parameters
    ----------
    model : LPVStateSpace, LFT, LinearFamily, LinearModel or Plant
        What is controlled; of a `Plant` from its controls to its measurements.
    feedback : mapping, LinearModel, LPVStateSpace, Controller or TableController
        As of `open_loop`; a controller over the parameters of the plant is frozen where it is. Of a
        `Plant` what its `close` takes.
    at : str
        The input at which the loop is broken.
    p : array_like, optional
        Values of the parameters; by default seven over the range, of a family its nodes.

    Returns
    -------
    MarginTable
        Prints as a table; `.rows`, `.to_frame()`.

    Raises
    ------
    InputError, UnknownNameError
        As `open_loop`; another type of model.

    See Also
    --------
    synthesis.margins : margins of a scalar loop
    synthesis.specifications : a whole sheet of requirements

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[0.0]]], [[[1.0]], [[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> found = margin_table(lag, {("u1", "y1"): -2.0}, "u1", [0.0, 1.0])  # 2(1 + p)/s
    >>> [round(float(m.crossover[0]), 6) for _, m in found.rows]
    [2.0, 4.0]
    """
    if isinstance(model, Plant):
        feedback = as_controller(feedback, model.controls, model.measurements)
        model = model.nominal.select(inputs=model.controls, outputs=model.measurements)
    feedback = getattr(feedback, "model", feedback)
    rows = []
    for one in frozen_at(model, p):
        there: Any = feedback.at(*one.p) if isinstance(feedback, LPVStateSpace) else feedback
        rows.append((one.p, margins(open_loop(one.model, there, at))))
    return MarginTable(parameters_of(model), tuple(rows))


def _numbers(found: Margins) -> list[float]:
    if not found.stable:
        return [math.nan] * len(COLUMNS)
    crossover = max(found.crossover, default=math.nan)
    disk = decibels(found.disk_gain[1]), math.degrees(found.disk_phase)
    return [*found.decibels, found.phase_margin, found.delay, *disk, crossover]
