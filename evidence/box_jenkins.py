"""How the methods find the coefficients of the LPV Box-Jenkins system of Laurain, Toth, Gilson and
Garnier (2010), sec. 5: coloured noise at the output, 10 dB.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.signal import lfilter

import identification as idn
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, markdown, parsed
from studies.output import as_json
from symheli import FlightRecord
from symheli.errors import ConvergenceWarning
from symheli.values.arrays import Array

SAMPLES, NOISE_DB = 2000, 10.0

TRUE = np.array(
    [[1.0, -0.5, -0.1], [0.5, -0.7, -0.1], [0.5, -0.4, 0.01], [0.2, -0.3, -0.02]],
)
"""a_1, a_2, b_1, b_2 by powers of p."""

COLOUR = (1.0, -1.0, 0.2)
"""Denominator of the noise."""

STRUCTURE = idn.LPVARX(
    ("y",),
    ("u",),
    "p",
    na=2,
    nb=2,
    delay=1,
    basis=idn.Polynomial(2, 0.0, 1.0),
    scheduling_at="now",
)

METHODS: Mapping[str, idn.methods.Method] = {
    "least squares": idn.methods.LeastSquares(),
    "ARMAX, second order": idn.methods.ARMAX(ma=2),
    "output error": idn.methods.OutputError(),
    "refined instruments, noise of order 2": idn.methods.RefinedInstruments(noise_order=2),
    "Box-Jenkins, noise of order 2": idn.methods.BoxJenkins(ar=2),
}


def record(seed: int) -> FlightRecord:
    """A realization of the system."""
    rng, k = np.random.default_rng(seed), np.arange(SAMPLES)
    u, p = rng.uniform(-1.0, 1.0, SAMPLES), 0.5 * np.sin(0.35 * np.pi * k) + 0.5
    (a1, a2, b1, b2), x = TRUE @ np.stack([np.ones_like(p), p, p**2]), np.zeros(SAMPLES)
    for i in range(2, SAMPLES):
        x[i] = -a1[i] * x[i - 1] - a2[i] * x[i - 2] + b1[i] * u[i - 1] + b2[i] * u[i - 2]
    v = np.asarray(lfilter([1.0], COLOUR, rng.normal(size=SAMPLES)))
    v *= x.std() / v.std() / 10.0 ** (NOISE_DB / 20.0)
    return FlightRecord.from_arrays(k.astype(float), dict.fromkeys("yup", "1"), y=x + v, u=u, p=p)


def of_seed(seed: int) -> dict[str, Array]:
    """The coefficients (4, 3) that each method finds, by powers of p."""
    flown, out = record(seed), {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        for name, method in METHODS.items():
            found = idn.fit(STRUCTURE, flown, method=method).coefficients.monomial()
            out[name] = np.vstack([found.A[:, :, 0, 0], found.B[:, :, 0, 0]])
    return out


def table(found: Sequence[dict[str, Array]]) -> str:
    """A row a method."""
    middle, rows = np.array([1.0, 0.5, 0.25]), []
    for name in METHODS:
        each = np.array([one[name] for one in found])
        scatter = np.sqrt(np.mean(np.sum((each - each.mean(axis=0)) ** 2, axis=(1, 2))))
        rows.append(
            (
                name,
                f"{np.median(each[:, 0] @ middle):.3f}",
                f"{np.linalg.norm(each.mean(axis=0) - TRUE):.3f}",
                f"{scatter:.3f}",
            )
        )
    head = ("method", "a1(.5), median; true .725", "norm of the bias", "scatter")
    return f"{len(found)} seeds, {SAMPLES} samples, {NOISE_DB:g} dB.\n\n{markdown(head, rows)}"


def main() -> None:
    """Print the table, and keep it in docs/identification.md."""
    options = parsed(parser_of(__doc__, "0-20"), "identification.md", timed=False)
    found = list(over_seeds(options, [partial(of_seed, seed) for seed in seeds_of(options)]))
    text = table(found)
    plain = [{name: c.tolist() for name, c in one.items()} for one in found]
    print(as_json(plain) if options.json else text)
    if options.write:
        keep(DOCS / "identification.md", "Box-Jenkins system", text)


if __name__ == "__main__":
    from evidence import box_jenkins  # under its own name: its results are stored by it

    box_jenkins.main()
