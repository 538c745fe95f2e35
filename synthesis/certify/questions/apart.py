"""Causes of a gap between the bounds of a gain: rounding, a search that did not converge, or the
class of P.
"""

from __future__ import annotations

import math

from synthesis.numerics.program.answer import Answer

MAX_UNEXPLAINED_RATIO = 1.05
"""Largest ratio of upper to lower bound for which no cause of the gap is reported."""

FROZEN_GAIN_ERROR = 1e-2
"""Relative error of a frozen gain above which rounding is reported to limit the bound."""


def apart(gamma: float, lower: float, rounding: float, answer: Answer) -> tuple[str, ...]:
    """Return a sentence on the cause where a proven gain is far above its lower bound; else
    nothing.

    `rounding` is the fraction by which the gain of a frozen model was missed in the same
    coordinates (NaN: not computed), `answer` the solver's for the program of the proof.
    """
    if not (math.isfinite(gamma) and gamma > MAX_UNEXPLAINED_RATIO * lower) or lower == 0.0:
        return ()  # near, or there is no lower bound to compare with
    head = f"the bounds are {100 * (gamma / lower - 1):.3g} % apart"
    if rounding > FROZEN_GAIN_ERROR:
        return (
            f"{head}, and of the model frozen at mid-range the same program does not find the gain"
            " either: rounding limits the bound; drop states that are far faster or slower than"
            " what matters",
        )
    cause = (
        "" if math.isnan(rounding) else "of the model frozen at mid-range the same program finds"
    )
    cause = f"{head}; {cause} the gain, but" if cause else f"{head}:"
    if answer is not Answer.SOLVED:
        return (
            f"{cause} this one was not solved to its tolerance: the search did not converge;"
            " take another solver, or fewer segments",
        )
    return (
        f"{cause} this one was solved: P of a higher degree or with more segments may prove less, a"
        " longer search may find a worse trajectory",
    )
