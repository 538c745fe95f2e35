"""Gain scheduling for parameters that may jump, as linear fractional transformations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from symheli.threads import with_one_thread
from synthesis.loops.controller import Controller
from synthesis.lpv.output_feedback import output_feedback
from synthesis.lpv.search import BACK_OFF

if TYPE_CHECKING:
    from synthesis.plant.plant import Plant


@with_one_thread
def lft_feedback(
    plant: Plant,
    *,
    back_off: float | Sequence[float] = BACK_OFF,
    fastest: float = math.inf,
    divisions: int = 1,
) -> Controller:
    """Design an output-feedback controller for parameters that change arbitrarily fast, from an LFT
    in them.

    With constant X and Y the conditions of `output_feedback` need hold at every p alone. The full
    block S-procedure turns them into conditions on multipliers without losing anything (Scherer
    2001, theorem 8); here they are imposed on p itself, by Bernstein coefficients. The controller
    is polynomial in p: `controller.model.to_lft().reduce()`.

    Parameters
    ----------
    plant : Plant
        As for `output_feedback`.
    back_off, fastest, divisions
        As for `output_feedback`.

    Returns
    -------
    Controller
        `certify(math.inf)` or `lft_gain(controller.closed().to_lft().reduce())` prove its gain.

    Raises
    ------
    InputError, SynthesisError
        As `output_feedback`; where p may jump there often is no controller.

    References
    ----------
    Scherer, "LPV control and full block multipliers", Automatica 37 (2001).

    Examples
    --------
    >>> made = synthesis.lft_feedback(plant)
    >>> proof = made.certify(math.inf, search=None)
    >>> proof.verified, bool(proof.gamma <= made.promised)
    (True, True)
    """
    return output_feedback(plant, math.inf, back_off=back_off, fastest=fastest, divisions=divisions)
