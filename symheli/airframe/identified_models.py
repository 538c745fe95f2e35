"""Linear models identified from flight by others: equations and parameters from a file, in SI with
names and units.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import numpy as np

from symheli.airframe.linear_model_file import LinearModelFile
from symheli.airframe.quantity import Quantity
from symheli.airframe.vehicle_file import LINEAR
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import LinearModel
from symheli.values.html_table import as_table
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from symheli.values.text_file import text_of


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedModel(LinearModel):
    """A `LinearModel` from the literature, with C = I.

    Parameters
    ----------
    A, B, C, D, states, inputs, outputs, dt, point
        As in `LinearModel`.
    title, source : str
        What it is of, and where from.
    parameters : mapping of str to Quantity
        In SI by the source's names. Those that are disputed or were not at hand have `assumed` set,
        and their source says why they are what they are.

    Examples
    --------
    >>> model = symheli.airframe.identified_model("r50_hover")
    >>> [str(s) for s in model.inputs], len(model.parameters) > 20
    (['lat', 'lon', 'ped', 'col'], True)
    """

    title: str = ""
    source: str = ""
    parameters: Mapping[str, Quantity] = field(default_factory=dict)

    __repr__ = summarized
    _repr_html_ = as_table

    @property
    def assumed(self) -> list[str]:
        """Names of the parameters that are not the source's."""
        return [name for name, quantity in self.parameters.items() if quantity.assumed]


def identified_models() -> list[str]:
    """Return the names of the identified linear models that come with the package.

    Returns
    -------
    list of str
        What `identified_model` takes, beside a path.

    Examples
    --------
    >>> symheli.airframe.identified_models()
    ['r50_hover']
    """
    names = (p.name for p in resources.files("symheli.airframe.vehicles").iterdir())
    return sorted(name.removesuffix(LINEAR) for name in names if name.endswith(LINEAR))


def identified_model(name_or_path: str | os.PathLike[str]) -> IdentifiedModel:
    """Return a linear model from the literature.

    The file gives for each state its unit and the equation of its derivative, for each parameter
    value, unit and source. That the units fit is checked: the equations must say the same in the
    file's units and in SI.

    Parameters
    ----------
    name_or_path : str or path
        A packaged model ("r50_hover": Yamaha R-50 in hover), or any file of that form.

    Returns
    -------
    IdentifiedModel
        A `LinearModel` with its title, source and parameters.

    Raises
    ------
    InputError
        No such model; or all that is wrong with the file: what cannot be read, names that nothing
        has, equations that are not linear, units that do not fit.

    References
    ----------
    Each file names its own.

    Examples
    --------
    >>> model = symheli.airframe.identified_model("r50_hover")
    >>> model.A.shape, model.is_stable()
    ((13, 13), False)
    """
    given = os.fspath(name_or_path)
    if given.endswith(".toml"):
        if not Path(given).is_file():
            raise InputError(
                f"no model file at {given}; packaged models: {', '.join(identified_models())}"
            )
        text = text_of(Path(given))
    elif given in identified_models():
        text = (resources.files("symheli.airframe.vehicles") / f"{given}{LINEAR}").read_text(
            encoding="utf-8"
        )
    else:
        raise UnknownNameError("identified model", given, identified_models())
    file = LinearModelFile(given, text)
    found = file.read()
    states, inputs = (
        tuple(Signal(name, unit) for name, unit in units.items())
        for units in (found.states, found.inputs)
    )
    n = len(states)
    return IdentifiedModel(
        A=found.coefficients[:, :n],
        B=found.coefficients[:, n:],
        C=np.eye(n),
        D=np.zeros((n, len(inputs))),
        states=states,
        inputs=inputs,
        outputs=states,
        title=str(file.tables.get("title", given)),
        source=str(file.tables.get("source", "")),
        parameters=found.parameters,
    )
