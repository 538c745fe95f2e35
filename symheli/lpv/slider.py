"""A picture in a notebook with a slider for every parameter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from symheli.errors import InputError
from symheli.extras import extra
from symheli.lpv.frozen_plots import Model
from symheli.lpv.lft.model import LFT
from symheli.lpv.linear_family import LinearFamily
from symheli.lpv.lpv_state_space import LPVStateSpace

STEPS = 100
"""Steps of a slider over its range."""


def slider(picture: Callable[..., Any], model: Model, *args: Any, **options: Any) -> Any:
    """Show a picture or table of a model frozen at the values of sliders, in a notebook.

    Parameters
    ----------
    picture : callable
        `bode`, `sigma`, `nyquist`, `pole_map`, `step`, `damping`, or a function with their
        arguments (model, *args, p=...), which returns axes, or what is displayed.
    model : LPVStateSpace, LFT or LinearFamily
        Of a family the sliders have its nodes.
    *args, **options
        Of the picture, such as the channel.

    Returns
    -------
    ipywidgets.interactive
        The last line of a cell shows it.

    Raises
    ------
    InputError
        Another type of model; without ipywidgets.

    Examples
    --------
    >>> lpv.tools.slider(lpv.bode, spring, "u1", "y1")  # doctest: +SKIP
    >>> lpv.tools.slider("bode", None)
    Traceback (most recent call last):
        ...
    symheli.errors.InputError: expected an LPVStateSpace, an LFT or a LinearFamily, got NoneType
    """
    if not isinstance(model, LPVStateSpace | LFT | LinearFamily):
        raise InputError(
            f"expected an LPVStateSpace, an LFT or a LinearFamily, got {type(model).__name__}"
        )
    with extra("notebook", "a slider"):
        import ipywidgets  # type: ignore[import-not-found]
        from IPython.display import display  # type: ignore[import-not-found]

    def shown(**p: float) -> None:
        found = picture(model, *args, p=[list(p.values())], **options)
        first = found[0] if isinstance(found, tuple) else found
        if (figure := getattr(first, "figure", None)) is None:
            display(found)
            return
        display(figure)
        import matplotlib.pyplot as plt

        plt.close(figure)  # which the notebook would show a second time

    look = {"continuous_update": False, "style": {"description_width": "initial"}}
    if isinstance(model, LinearFamily):
        sliders = {
            str(s): ipywidgets.SelectionSlider(
                options=values.tolist(), description=f"{s} ({s.unit})", **look
            )
            for s, values in zip(model.axes, model.values, strict=True)
        }
    else:
        sliders = {
            s.name: ipywidgets.FloatSlider(
                value=s.middle,
                min=s.low,
                max=s.high,
                step=(s.high - s.low) / STEPS,
                description=f"{s.name} ({s.unit})",
                readout_format=".4g",
                **look,
            )
            for s in model.parameters
        }
    return ipywidgets.interactive(shown, **sliders)
