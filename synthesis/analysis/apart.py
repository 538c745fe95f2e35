"""Why the two bounds of a gain are apart: numbers, a fine sample period, a search that did not end,
or the class of P.
"""

from __future__ import annotations

import math

import numpy as np

from synthesis.program.cone_program import Answer

Array = np.ndarray

FAR = 1.05
"""Bounds within this ratio need no cause."""

ROUNDED = 1e-2
"""A frozen gain missed by more than this fraction says that numbers limit the bound."""

FINE = 1e-3
"""A least decay per sample, 1 - |pole|, below which margins of 1e-6 in a discrete LMI are felt in
the third digit of a gain.
"""

WORTH_SAYING = 1.01
"""Bounds that are this far apart may be so because of the sample period."""


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


def fine_sampling(A: Array, dt: float | None, gamma: float, lower: float) -> tuple[str, ...]:
    """A hypothesis where `gamma`, proven of a model sampled every `dt` seconds, may be loose
    because of that period; else nothing.

    A (k, n, n): frozen models of the range. `lower` is the lower bound on the gain.
    """
    if dt is None or not np.isfinite(gamma) or not gamma > WORTH_SAYING * lower:
        return ()
    decay = 1 - float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
    if not decay < FINE:
        return ()
    return (
        (
            f"sampled every {dt:g} s its slowest mode decays by {decay:.1g} a sample, which is"
            " little beside the margin of the LMIs: the bound may be loose for that alone; analyse"
            " the continuous model, or sample more coarsely"
        ),
    )
