"""One criterion of a verdict: a number, its threshold, and what follows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

Verdict = Literal["fit", "not fit", "not known"]

SET = 0.95
"""Share of the distribution of the estimate inside the ellipsoid whose boundary is drawn from."""

TISCHLER = "Tischler and Remple (2012)"
VINNICOMBE = "Vinnicombe (2001)"
GUIDELINE = "usual guideline"
HERE = "here"
NO_COVARIANCE = "no covariance"


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One criterion of `FitForControl`, a row of its table.

    Parameters
    ----------
    name : str
        What is judged.
    value, threshold : float
        In the unit of the name; NaN where the data give no value.
    verdict : {"fit", "not fit", "not known"}
        "not known" where the data say too little for either.
    source : str
        Of the threshold.
    where : str
        At which point or signal the value was found, or why there is none.
    truth : float, optional
        The same against the true models, where they were given.
    decides : bool
        Whether the verdict of the whole asks for it; otherwise it informs.

    Examples
    --------
    >>> row = idn.Criterion(name="TIC", value=0.1, threshold=0.25, verdict="fit", source="book")
    >>> row.verdict
    'fit'
    """

    name: str
    value: float
    threshold: float
    verdict: Verdict
    source: str
    where: str = ""
    truth: float | None = None
    decides: bool = True


def judged(value: float, threshold: float, otherwise: Verdict) -> Verdict:
    """ "fit" up to the threshold, `otherwise` above, "not known" for NaN."""
    return "not known" if np.isnan(value) else "fit" if value <= threshold else otherwise


def together(verdicts: Iterable[Verdict]) -> Verdict:
    """The worst: one "not fit" decides, then one "not known"."""
    found = set(verdicts)
    return "not fit" if "not fit" in found else "not known" if "not known" in found else "fit"
