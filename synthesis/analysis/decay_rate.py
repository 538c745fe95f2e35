"""Certified decay rate of an LPV model."""

from __future__ import annotations

from synthesis.analysis.box import Model, box_certificate
from synthesis.forms import Relaxation
from synthesis.polynomial.certificate import BoxCertificate
from synthesis.program.cone_program import Solver
from synthesis.worst.lower_bound import THOROUGH, Search
from synthesis.worst.rates import Rate


def decay_rate(
    model: Model,
    rate: Rate = None,
    *,
    relaxation: Relaxation | None = None,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
) -> BoxCertificate:
    """Largest alpha (1/s) found such that |x(t)| <= c exp(-alpha t) |x(0)| for every p(t) in its
    box within its rates.

    `rate` as in `generalized_h2`. `.alpha` is proven, `.upper` no proof can exceed: the slowest
    frozen mode, or growth along a trajectory `search` found. To 0.2 % of `.upper` where P admits
    that. Raises `InputError`, `SolverError`.
    """
    solver = solver if isinstance(solver, Solver) else Solver(solver)
    return box_certificate(model, rate, "decay rate", relaxation or Relaxation(), solver, search)
