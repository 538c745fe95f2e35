"""An identified model as one that a controller may be designed on, or the reasons why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from identification.judge.fit_for_control import FitForControl
from identification.model.kinematic_model import KinematicModel
from symheli.errors import InputError, NotFitError
from symheli.lpv import LPVStateSpace, UncertainStateSpace


def design_model(
    model: KinematicModel,
    judged: FitForControl,
    *,
    probability: float | None = None,
    force: bool = False,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    held: Mapping[str, float] | None = None,
    degree: int | None = None,
) -> LPVStateSpace | UncertainStateSpace:
    """Return the state space of a model that was judged fit for control.

    Parameters
    ----------
    model : KinematicModel
        The estimate.
    judged : FitForControl
        What `fit_for_control` found of it.
    probability : float, optional
        Of the set of models; None: the estimate alone.
    force : bool
        Hand it out whatever was found: to see a design fail.
    outputs, inputs, held, degree
        As of `KinematicModel.to_state_space`.

    Returns
    -------
    LPVStateSpace or UncertainStateSpace
        For `synthesis.Plant`; sampled, as the model is.

    Raises
    ------
    NotFitError
        The verdict is not "fit"; `reasons` are the criteria that decide it.
    InputError
        Something else was judged.

    Examples
    --------
    >>> from symheli.errors import NotFitError
    >>> poor = idn.FitForControl(
    ...     criteria=(idn.Criterion(name="nu-gap over margin", value=1.4, threshold=1.0,
    ...                             verdict="not fit", source="here", where="hover"),),
    ...     points=(0.0,), margin=np.array([0.1]), gap=np.array([0.14]),
    ...     second_gap=np.array([np.nan]))
    >>> try:
    ...     idn.design_model(None, poor)
    ... except NotFitError as error:
    ...     print(error.reasons[0])
    nu-gap over margin is 1.4, at most 1 (hover): not fit
    """
    if not isinstance(judged, FitForControl):
        raise InputError(
            f"judged: expected what fit_for_control found, got {type(judged).__name__}"
        )
    if judged.verdict != "fit" and not force:
        reasons = tuple(
            f"{row.name} is {row.value:.3g}, at most {row.threshold:.3g}"
            + (f" ({row.where})" if row.where else "")
            + f": {row.verdict}"
            for row in judged.criteria
            if row.decides and row.verdict != "fit"
        )
        known = "not known to be" if judged.verdict == "not known" else "not"
        raise NotFitError(f"the model is {known} fit for control", reasons)
    if probability is None:
        return model.to_state_space(outputs, inputs, held=held, degree=degree)
    return model.uncertain(probability, outputs, inputs, held=held, degree=degree)
