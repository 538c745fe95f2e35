"""Why the two bounds of a gain are apart: numbers, a search that did not end, or the class of P."""

from __future__ import annotations

import math

from synthesis.program.cone_program import Answer

FAR = 1.05
"""Bounds within this ratio need no cause."""

ROUNDED = 1e-2
"""A frozen gain missed by more than this fraction says that numbers limit the bound."""


def apart(gamma: float, lower: float, rounding: float, answer: Answer) -> tuple[str, ...]:
    """A sentence where a proven gain is far above what no proof undercuts; else nothing.

    `rounding` is the fraction by which the gain of a frozen model was missed in the same
    coordinates (NaN: not asked), `answer` the solver's for the program of the proof.
    """
    if not (math.isfinite(gamma) and gamma > FAR * lower) or math.isnan(rounding):
        return ()
    if lower == 0.0:
        return ()  # the lower bound tells nothing to compare with
    head = f"the bounds are {100 * (gamma / lower - 1):.3g} % apart"
    if not rounding <= ROUNDED:
        return (
            f"{head}, and of the model frozen at mid-range the same program does not find the gain"
            " either: rounding limits the bound; drop states that are far faster or slower than"
            " what matters",
        )
    told = f"{head}; of the model frozen at mid-range the same program finds the gain"
    if answer is not Answer.SOLVED:
        return (
            f"{told}, but this one was not solved to its tolerance: the search did not converge;"
            " take another solver, or fewer segments",
        )
    return (
        f"{told}, and it was solved: P of a higher degree or with more segments may prove less, a"
        " longer search may find a worse trajectory",
    )
