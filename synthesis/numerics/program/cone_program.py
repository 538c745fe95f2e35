"""Semidefinite programs in conic form, and their solvers.

    minimise c' x  subject to  b - A x in a product of positive semidefinite cones

(vectors as in `symmetric`), after optional rows that are zero.

Clarabel and SCS are called directly; CVXOPT, MOSEK, SDPA and COPT, where installed, through cvxpy.
Whatever a solver answers is a candidate: nothing is believed before it is verified.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from symheli.errors import InputError, SolverError
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.symmetric import basis, length
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.interruptible import in_process, in_thread, no_panic

if TYPE_CHECKING:
    import cvxpy


LYAPUNOV = "LYAPUNOV"
"""Name in `Solver` of the method of `interior_point`, for programs of Lyapunov inequalities only.
"""


@dataclass(frozen=True)
class Solver:
    """A solver of semidefinite programs is a name with stopping criteria.

    Parameters
    ----------
    name : str
        As cvxpy spells it; or "LYAPUNOV", this package's own interior-point method for Lyapunov
        inequalities with a P of many states.
    tolerance : float, optional
        On residuals and gap, relative: 1e-8; SCS, a first-order method, and "LYAPUNOV" 1e-5, since
        the gain is recomputed from P afterwards and more digits cost minutes.
    iterations : int, optional
        At most: 200; SCS 20000.
    time_limit : float, optional
        s of wall time at most: no limit. A solve that it ends says so, and its result depends on
        the machine. CVXOPT and SDPA have no option for it.

    Raises
    ------
    InputError
        For a setting out of range, or one that the solver has no option for.
    SolverError
        For a solver that is not installed.

    See Also
    --------
    synthesis.analysis.installed_solvers : solvers that can be named
    synthesis.l2_gain : worst-case gain while p moves

    Examples
    --------
    >>> Solver("clarabel", iterations=50).options["max_iter"]
    50
    """

    name: str = "CLARABEL"
    tolerance: float | None = None
    iterations: int | None = None
    time_limit: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", str(self.name).upper())
        if self.name not in (*installed_solvers(), LYAPUNOV):
            raise SolverError(
                f"solver {self.name!r} is not available; installed here:"
                f" {', '.join(installed_solvers())}, and solver={LYAPUNOV!r}, {_OWN}"
            )
        for setting in ("tolerance", "iterations", "time_limit"):
            given = getattr(self, setting)
            if given is None:
                usual = _OTHER.get(self.name, {}).get(setting, _USUAL.get(setting))
                object.__setattr__(self, setting, usual)
            elif setting not in _OPTIONS[self.name]:
                raise InputError(
                    f"{self.name} has no option for {setting}, got {given}; leave it None or take"
                    " another solver"
                )
            elif not 0 < given < (1 if setting == "tolerance" else math.inf):
                raise InputError(
                    "expected 0 < tolerance < 1, iterations >= 1 and time_limit > 0 s, got"
                    f" {setting} = {given}"
                )

    @property
    def options(self) -> dict[str, Any]:
        """The settings in the solver's own names, as they are passed to it: no time without a
        limit.
        """
        return {
            option: getattr(self, setting)
            for setting, options in _OPTIONS[self.name].items()
            if getattr(self, setting) is not None
            for option in options
        }

    @property
    def version(self) -> str:
        """Version of the installed package."""
        return importlib.metadata.version(_PACKAGES.get(self.name, "symheli"))

    def __str__(self) -> str:
        limit = "no time limit" if self.time_limit is None else f"{self.time_limit:g} s"
        called = f"{_OWN}, symheli" if self.name == LYAPUNOV else self.name
        return (
            f"{called} {self.version}, tolerance {self.tolerance:g}, at most {self.iterations}"
            f" iterations, {limit}"
        )


_OWN = "interior-point method for Lyapunov inequalities"
"""Name of "LYAPUNOV" in certificates and messages."""

_PACKAGES = {
    "CLARABEL": "clarabel",
    "SCS": "scs",
    "CVXOPT": "cvxopt",
    "MOSEK": "mosek",
    "SDPA": "sdpa-python",
    "COPT": "coptpy",
}


_USUAL: dict[str, Any] = {"tolerance": 1e-8, "iterations": 200}
_OTHER: dict[str, dict[str, Any]] = {
    "SCS": {"tolerance": 1e-5, "iterations": 20000},
    LYAPUNOV: {"tolerance": 1e-5},
}

_OPTIONS: dict[str, dict[str, tuple[str, ...]]] = {
    LYAPUNOV: {
        "tolerance": ("tolerance",),
        "iterations": ("iterations",),
        "time_limit": ("seconds",),
    },
    "CLARABEL": {
        "tolerance": ("tol_gap_abs", "tol_gap_rel", "tol_feas"),
        "iterations": ("max_iter",),
        "time_limit": ("time_limit",),
    },
    "SCS": {
        "tolerance": ("eps_abs", "eps_rel"),
        "iterations": ("max_iters",),
        "time_limit": ("time_limit_secs",),
    },
    "CVXOPT": {"tolerance": ("abstol", "reltol", "feastol"), "iterations": ("max_iters",)},
    "MOSEK": {
        "tolerance": (
            "MSK_DPAR_INTPNT_CO_TOL_REL_GAP",
            "MSK_DPAR_INTPNT_CO_TOL_PFEAS",
            "MSK_DPAR_INTPNT_CO_TOL_DFEAS",
        ),
        "iterations": ("MSK_IPAR_INTPNT_MAX_ITERATIONS",),
        "time_limit": ("MSK_DPAR_OPTIMIZER_MAX_TIME",),
    },
    "SDPA": {"tolerance": ("epsilonStar", "epsilonDash"), "iterations": ("maxIteration",)},
    "COPT": {
        "tolerance": ("RelGap", "FeasTol", "DualTol"),
        "iterations": ("BarIterLimit",),
        "time_limit": ("TimeLimit",),
    },
}
"""Names of tolerance, iterations and time limit in each solver; a missing setting has no such
option.
"""


_CLARABEL = {
    "Solved": Answer.SOLVED,
    "AlmostSolved": Answer.SOLVED,
    "PrimalInfeasible": Answer.INFEASIBLE,
    **dict.fromkeys(
        (
            "AlmostPrimalInfeasible",
            "DualInfeasible",
            "AlmostDualInfeasible",
            "MaxIterations",
            "MaxTime",
            "NumericalError",
            "InsufficientProgress",
            "CallbackTerminated",
            "Unsolved",
        ),
        Answer.FAILED,
    ),
}
"""Answers by the status of Clarabel, FAILED for others: that something almost has no solution says
nothing.
"""
_SCS = {
    **dict.fromkeys((-7, -6, -5, -4, -3, -1, 0), Answer.FAILED),
    **{-2: Answer.INFEASIBLE, 1: Answer.SOLVED, 2: Answer.SOLVED},
}
"""The same of SCS, by the numbers of glbopts.h: -7 is inaccurately infeasible."""
_CVXPY = {
    "optimal": Answer.SOLVED,
    "infeasible": Answer.INFEASIBLE,
    **dict.fromkeys(
        (
            "optimal_inaccurate",
            "infeasible_inaccurate",
            "infeasible_or_unbounded",
            "unbounded",
            "unbounded_inaccurate",
            "user_limit",
            "solver_error",
        ),
        Answer.FAILED,
    ),
}
"""The same of cvxpy."""


def general_solver(solver: Solver | str) -> Solver:
    """Return a solver for any cone program; raise `InputError` for the one that is not."""
    solver = solver if isinstance(solver, Solver) else Solver(solver)
    if solver.name == LYAPUNOV:
        raise InputError(
            f"the {_OWN} (solver={LYAPUNOV!r}) serves l2_gain and stability of an LPVStateSpace in"
            " one parameter, with form=Spline(...) by plain Bernstein coefficients; take"
            " solver='CLARABEL' here"
        )
    return solver


def installed_solvers() -> tuple[str, ...]:
    """Return the installed semidefinite solvers for any program.

    Returns
    -------
    tuple of str
        Their names, in the order of preference.

    Examples
    --------
    >>> "CLARABEL" in installed_solvers()
    True
    """

    def there(package: str) -> bool:
        try:
            importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            return False
        return True

    return tuple(name for name, package in _PACKAGES.items() if there(package))


@dataclass(frozen=True, eq=False)
class ConeProgram:
    """The problem: minimise c' x subject to b - A x in the product of semidefinite cones of
    `sizes`; the first `equalities` rows are zero.

    `own_units`: its variables are of order one; where Clarabel fails numerically, it is tried once
    more without its own scaling of rows and columns, which can leave a system that is not definite.
    """

    c: Array
    A: sparse.csc_matrix
    b: Array
    sizes: tuple[int, ...]
    equalities: int = 0
    own_units: bool = False

    def to_cvxpy(self) -> tuple[cvxpy.Problem, cvxpy.Variable]:
        """Return it as a problem of cvxpy, for its other solvers and for constraints of one's own,
        and the variable x (count,).
        """
        import cvxpy as cp

        x = cp.Variable(len(self.c))
        s = self.b - self.A @ x
        start = self.equalities
        constraints: list[Any] = [s[:start] == 0] if start else []
        for n, group in groupby(self.sizes):
            expand = basis(n).reshape(length(n), n * n).T
            for _ in group:
                constraints.append(
                    cp.reshape(expand @ s[start : start + length(n)], (n, n), order="C") >> 0
                )
                start += length(n)
        return cp.Problem(cp.Minimize(self.c @ x), constraints), x


@dataclass(frozen=True, eq=False)
class SolverPoint:
    """A solver's answer and point `x`, None without one; `seconds` of solving, `message` of the
    solver, multipliers `dual` of the rows, None from solvers that are asked through cvxpy.
    """

    answer: Answer
    x: Array | None
    seconds: float
    message: str
    dual: Array | None = field(default=None, kw_only=True)


def solve(program: ConeProgram, solver: Solver) -> SolverPoint:
    """Return the solver's candidate. Never raises for a failed solve: that is an answer."""
    method: Callable[[ConeProgram, Solver], Found] = {
        "CLARABEL": _clarabel,
        "SCS": _scs,
    }.get(solver.name, _cvxpy)
    start = time.perf_counter()
    answer, x, message, dual = _interruptible(method, program, solver)
    x = None if x is None else np.asarray(x, dtype=float)
    if x is not None and (x.size != len(program.c) or not np.all(np.isfinite(x))):
        x = None
    dual = None if dual is None else np.asarray(dual, dtype=float)
    return SolverPoint(answer, x, time.perf_counter() - start, message, dual=dual)


Found = tuple[Answer, Any, str, Any]
"""Answer, point, message and multipliers."""

SHORT_ITERATION = 3e8
"""Operations of an iteration that takes some tenths of a second: below it Clarabel and SCS can be
interrupted between two iterations.
"""


def _interruptible(
    method: Callable[[ConeProgram, Solver], Any], program: ConeProgram, solver: Solver
) -> Found:
    """Solve here if the solver can be interrupted often enough, else in a process that an interrupt
    can end: starting it takes half a second.
    """
    operations = (sum(length(n) ** 3 for n in program.sizes) + len(program.c) ** 3) / 3
    if method is not _cvxpy and operations < SHORT_ITERATION:
        return method(program, solver)
    try:
        return in_process(method, program, solver)
    except SolverError as error:
        return Answer.FAILED, None, str(error), None


MAX_BYTES = 4e9
"""Bytes above which an interior-point method refuses a program: the operating system would end the
process.
"""


def _bytes(program: ConeProgram) -> float:
    """Return the memory of the scaling matrices of the cones in an interior-point method, bytes;
    their factors take a few times as much.
    """
    return 8.0 * sum(length(n) ** 2 for n in program.sizes)


def _clarabel(program: ConeProgram, solver: Solver) -> Found:
    if _bytes(program) > MAX_BYTES / 4:
        words = (
            f"not tried: cones of size {max(program.sizes)} would need several times"
            f" {_bytes(program) / 1e9:.2g} GB"
        )
        return (
            Answer.UNTRIED,
            None,
            f"{words}; a lower degree, fewer segments, Bernstein coefficients or SCS need less",
            None,
        )
    clarabel: Any = importlib.import_module("clarabel")  # its stubs hide the classes
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for option, value in solver.options.items():
        setattr(settings, option, value)
    cones = [clarabel.ZeroConeT(program.equalities)] * (program.equalities > 0)
    cones += [clarabel.PSDTriangleConeT(n) for n in program.sizes]
    n = len(program.c)

    def work(stop: Event) -> Any:
        engine = clarabel.DefaultSolver(
            sparse.csc_matrix((n, n)), program.c, program.A, program.b, cones, settings
        )
        engine.set_termination_callback(lambda _: stop.is_set())
        return engine.solve()

    try:
        with no_panic():
            solution = in_thread(work)
            if program.own_units and str(solution.status) == "NumericalError":
                settings.equilibrate_enable = False
                solution = in_thread(work)
    except SolverError as error:
        return Answer.FAILED, None, str(error), None
    word = str(solution.status)
    answer = _CLARABEL.get(word, Answer.FAILED)
    # a point that ran out of iterations or progress may still pass the verification
    return answer, None if "PrimalInfeasible" in word else solution.x, word, solution.z


def _scs(program: ConeProgram, solver: Solver) -> Found:
    import scs

    # the same vectors: SCS stacks the lower triangle by columns, which is the upper one by rows;
    # reorder
    starts = program.equalities + np.cumsum([0, *(length(n) for n in program.sizes)])
    blocks = [_scs_order(n) + start for n, start in zip(program.sizes, starts[:-1], strict=True)]
    order = np.concatenate([np.arange(program.equalities), *blocks])
    data = {"A": program.A.tocsr()[order].tocsc(), "b": program.b[order], "c": program.c}
    engine = scs.SCS(
        data, {"z": program.equalities, "s": list(program.sizes)}, verbose=False, **solver.options
    )
    solution = engine.solve()
    word = str(solution["info"]["status"])
    if word == "interrupted":  # SCS handles the interrupt itself
        raise KeyboardInterrupt
    answer = _SCS.get(solution["info"]["status_val"], Answer.FAILED)
    dual = np.empty(len(program.b))
    dual[order] = solution["y"]
    return answer, None if answer is Answer.INFEASIBLE else solution["x"], word, dual


@lru_cache(maxsize=32)
def _scs_order(n: int) -> Array:
    place = np.zeros((n, n), dtype=int)
    columns, rows = np.tril_indices(n)
    place[rows, columns] = place[columns, rows] = np.arange(length(n))
    return np.concatenate([place[j:, j] for j in range(n)])


def _cvxpy(program: ConeProgram, solver: Solver) -> Found:
    from cvxpy.error import SolverError as CvxpyError

    problem, x = program.to_cvxpy()
    try:
        # cvxpy hands MOSEK's parameters on under a name of their own
        problem.solve(
            solver=solver.name,
            **({"mosek_params": solver.options} if solver.name == "MOSEK" else solver.options),
        )
    except CvxpyError as error:
        return Answer.FAILED, None, str(error), None
    answer = _CVXPY.get(problem.status, Answer.FAILED)
    return answer, None if answer is Answer.INFEASIBLE else x.value, str(problem.status), None
