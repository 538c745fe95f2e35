"""Causes of a gap between the two bounds of a gain: rounding, a small sample period, a search that
did not converge, or the class of P.
"""

from __future__ import annotations

import math

import numpy as np

from synthesis.program.cone_program import Answer

Array = np.ndarray

MAX_UNEXPLAINED_RATIO = 1.05
"""Largest ratio of upper to lower bound for which no cause of the gap is reported."""

FROZEN_GAIN_ERROR = 1e-2
"""Relative error of a frozen gain above which rounding is reported to limit the bound."""

MIN_DECAY_PER_SAMPLE = 1e-3
"""Least decay per sample, 1 - |pole|, below which margins of 1e-6 in a discrete-time LMI change
the third digit of a gain.
"""

MIN_SAMPLING_RATIO = 1.01
"""Ratio of upper to lower bound above which a small sample period is reported as a possible cause.
"""


def apart(gamma: float, lower: float, rounding: float, answer: Answer) -> tuple[str, ...]:
    """Return a sentence on the cause where a proven gain is far above its lower bound; else
    nothing.

    `rounding` is the fraction by which the gain of a frozen model was missed in the same
    coordinates (NaN: not computed), `answer` the solver's for the program of the proof.
    """
    if not (math.isfinite(gamma) and gamma > MAX_UNEXPLAINED_RATIO * lower) or math.isnan(rounding):
        return ()
    if lower == 0.0:
        return ()  # there is no lower bound to compare with
    head = f"the bounds are {100 * (gamma / lower - 1):.3g} % apart"
    if not rounding <= FROZEN_GAIN_ERROR:
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
    """Return a hypothesis where `gamma`, proven of a model sampled every `dt` seconds, may be
    conservative because of that period; else nothing.

    A (k, n, n): frozen models of the range. `lower` is the lower bound on the gain.
    """
    if dt is None or not np.isfinite(gamma) or not gamma > MIN_SAMPLING_RATIO * lower:
        return ()
    decay = 1 - float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
    if not decay < MIN_DECAY_PER_SAMPLE:
        return ()
    return (
        (
            f"sampled every {dt:g} s its slowest mode decays by {decay:.1g} a sample, which is"
            " little beside the margin of the LMIs: the bound may be loose for that alone; analyse"
            " the continuous model, or sample more coarsely"
        ),
    )
