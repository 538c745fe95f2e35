"""Certified energy-to-peak gain (generalised H2 norm) of an LPV model."""

from __future__ import annotations

from synthesis.analysis.box import Model, box_certificate
from synthesis.forms import Relaxation
from synthesis.polynomial.certificate import BoxCertificate
from synthesis.program.cone_program import Solver
from synthesis.worst.lower_bound import THOROUGH, Search
from synthesis.worst.rates import Rate


def generalized_h2(
    model: Model,
    rate: Rate = None,
    *,
    relaxation: Relaxation | None = None,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
) -> BoxCertificate:
    """Certified upper bound of max_t |y(t)| / |u|_2 over every p(t) in its box within its rates,
    from rest.

    In units of y per unit of u and root second (root sample). `rate` in units of p per second: one
    for all parameters, one each, by name, or None for the model's own; math.inf: it may jump, 0:
    every frozen model. A gust of known energy then moves the outputs by at most gamma times its
    root. Continuous models need D = 0. `search` looks for a worse trajectory than any frozen p.
    Raises `InputError`, `SolverError`; a failed solve is a certificate with gamma = inf and its
    reason.
    """
    solver = solver if isinstance(solver, Solver) else Solver(solver)
    return box_certificate(
        model, rate, "energy-to-peak gain", relaxation or Relaxation(), solver, search
    )
