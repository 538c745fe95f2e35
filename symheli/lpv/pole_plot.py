"""Poles of a linear model in the complex plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symheli.values.drawing import BLUE, GREY, RED, axes_of, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symheli.lpv.linear_model import LinearModel


def plot_poles(model: LinearModel, ax: Axes | None = None) -> Axes:
    """See `LinearModel.plot`."""
    ax = axes_of(ax, 5.5, 4.5)
    poles = model.poles()
    stable = np.real(poles) < 0 if model.dt is None else np.abs(poles) < 1
    for mask, colour, name in ((stable, BLUE, "stable"), (~stable, RED, "not stable")):
        if mask.any():
            ax.plot(np.real(poles[mask]), np.imag(poles[mask]), "x", color=colour, label=name)
    ax = frame_of_poles(ax, model.dt)
    if not stable.all():
        ax.legend(frameon=False, fontsize=8)
    return ax


def frame_of_poles(ax: Axes, dt: float | None) -> Axes:
    """The axes with the border of stability and their labels; `dt` in s."""
    if dt is None:
        ax.axvline(0.0, color=GREY, linewidth=0.8)
        ax.set_xlabel("real part (1/s)")
        ax.set_ylabel("imaginary part (rad/s)")
    else:
        angle = np.linspace(0.0, 2 * np.pi, 181)
        ax.plot(np.cos(angle), np.sin(angle), color=GREY, linewidth=0.8)
        ax.set_aspect("equal")
        ax.set_xlabel(f"real part of z ({dt:g} s)")
        ax.set_ylabel("imaginary part of z")
    ax.axhline(0.0, color=GREY, linewidth=0.8)
    return plain(ax)
