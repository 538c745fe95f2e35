"""Step response of a linear model to each input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.drawing import axes_of, label, legend_beside, plain
from symheli.values.html_table import as_table
from symheli.values.labelled import frame
from symheli.values.numbers import positive
from symheli.values.signal import Signal, indices, signals
from symheli.values.summary import summarized

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

    from symheli.lpv.linear_model import LinearModel

TIME = Signal("time", "s")


@dataclass(frozen=True, eq=False)
class StepResponse:
    """Outputs after a unit step of each input from rest, as `LinearModel.step_response` finds them.

    Parameters
    ----------
    time : array (n,)
        s.
    values : array (n, ny, nu)
        Output per unit of the input.
    outputs, inputs : tuple of Signal
        ny and nu of them.

    Examples
    --------
    >>> lag = symheli.LinearModel([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("x",), ("u",), ("y",))
    >>> step = lag.step_response(1.0)
    >>> abs(step.values[-1, 0, 0] - (1 - np.exp(-2.0))) < 1e-12
    np.True_
    """

    time: Array
    values: Array
    outputs: tuple[Signal, ...]
    inputs: tuple[Signal, ...]

    __repr__ = summarized
    _repr_html_ = as_table

    def __post_init__(self) -> None:
        for group in ("outputs", "inputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        object.__setattr__(self, "time", frozen(self.time, "time", (None,)))
        shape = (len(self.time), len(self.outputs), len(self.inputs))
        object.__setattr__(self, "values", frozen(self.values, "values", shape, finite=False))

    def plot(self, ax: Axes | None = None, input: str | None = None) -> Axes:
        """Every output against time (s) after a unit step of `input` (default: the first). Raises
        `UnknownNameError`.
        """
        ax = axes_of(ax)
        (j,) = indices([self.inputs[0] if input is None else input], self.inputs, "input")
        for i, output in enumerate(self.outputs):
            ax.plot(self.time, self.values[:, i, j], label=label(output))
        ax.set_xlabel(label(TIME))
        ax.set_ylabel(f"response to a unit step of {label(self.inputs[j])}")
        ax.margins(x=0.0)
        legend_beside(ax)
        return plain(ax)

    def to_frame(self) -> pandas.DataFrame:
        """Over time (s), a column "output from input" each; the units in attrs. Raises `InputError`
        without pandas.
        """
        columns = [
            (Signal(f"{y} from {u}", y.unit), self.values[:, i, j])
            for j, u in enumerate(self.inputs)
            for i, y in enumerate(self.outputs)
        ]
        return frame([(TIME, self.time)], columns)


def step_response(model: LinearModel, duration: float, samples: int) -> StepResponse:
    """See `LinearModel.step_response`."""
    duration = positive(duration, "duration, s")
    if model.dt is None:
        if samples < 2:
            raise InputError(f"samples: expected at least 2, got {samples}")
        model = model.discretize(duration / (samples - 1))
    else:
        samples = 1 + round(duration / model.dt)
    assert model.dt is not None  # noqa: S101  (sampled by now)
    x = np.zeros((len(model.states), len(model.inputs)))
    values = np.empty((samples, len(model.outputs), len(model.inputs)))
    for k in range(samples):
        values[k] = model.C @ x + model.D
        x = model.A @ x + model.B
    return StepResponse(model.dt * np.arange(samples), values, model.outputs, model.inputs)
