"""Terminal sets and costs of predictive controllers, proven and handed over."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv.riccati import lyapunov, regulator
from symheli.progress import tracked
from symheli.threads import with_one_thread
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import by_name, positive
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate_file import decoded, encoded
from synthesis.certify.statement.proven_statement import ProvenStatement
from synthesis.numerics.polynomial.multivariate import SparsePolynomial, linear_substitution
from synthesis.numerics.polynomial.symmetric import symmetrized
from synthesis.numerics.program.cone_program import Solver, general_solver
from synthesis.regions.equations import Equations, equations
from synthesis.regions.files import read_proof, read_terms, written_proof, written_terms
from synthesis.regions.growth import linearization
from synthesis.regions.levels import NOTHING, LevelSearch
from synthesis.regions.proof import RegionProof, costs, why_not, within

if TYPE_CHECKING:
    import casadi

BELOW = 1 - 1e-9
"""Share of the level at which a limit is touched: room for its exact check."""
SHARES = (0.05, 0.3, 0.6, 0.9, 0.97)
"""Shares of the loop's slowest rate at which V falls beside the cost, tried for the largest set."""
INFINITE = 1e10
"""Bound that acados takes for none."""
MATRICES = ("Q", "R", "K", "P")
COSTLESS = (
    "Q + K'R K is not positive semidefinite to the last digit, so that a set may be left while the"
    " cost falls: add a small multiple of the identity to Q"
)


@dataclass(frozen=True, eq=False)
class TerminalSet(ProvenStatement):
    """The states x'P x <= alpha: with u = K x no motion leaves them or a limit, and x'P x falls by
    the cost x'Q x + u'R u at least.

    Made by `terminal`; `verify` proves it again from these fields alone.

    Attributes
    ----------
    states : tuple of str
        Names of x.
    controls : tuple of str
        Names of u.
    f : tuple of SparsePolynomial
        dx/dt, or the next x, in x and u.
    dt : float or None
        Sample period, s; None: continuous time, in which the cost is an integral.
    bounds : tuple of (str, float)
        States and controls, and their largest sizes.
    Q, R, K, P : array
        Weights (n, n) and (m, m), feedback (m, n), terminal cost (n, n).
    alpha : float
        Level of the set; 0 where nothing is proven.
    proof : RegionProof or None
        Sums of squares of the decrease; see `synthesis.regions.proof`.
    verified : bool
        Decrease and limits hold in rational arithmetic.
    why : str
        Why there is no proof; empty where there is one.

    Raises
    ------
    InputError
        `save` of a set without a proof, `load` of a file that is damaged or another.

    Examples
    --------
    A motor with saturated torque.

    >>> import sympy
    >>> w, u = sympy.symbols("w u")
    >>> found = synthesis.regions.terminal(
    ...     {w: u - w}, [[1.0]], [[1.0]], controls=[u], input_bounds={"u": 0.5}
    ... )
    >>> given = found.acados()
    >>> found.contains([1.2]), found.contains([1.3]), given["uh_e"].tolist() == [found.alpha]
    (True, False, True)
    """

    states: tuple[str, ...]
    controls: tuple[str, ...]
    f: tuple[SparsePolynomial, ...]
    dt: float | None
    bounds: tuple[tuple[str, float], ...]
    Q: Array
    R: Array
    K: Array
    P: Array
    alpha: float
    proof: RegionProof | None
    verified: bool
    why: str = ""
    reader: ClassVar[str] = "terminal-set"

    __repr__ = summarized

    def verify(self, rigorous: bool = True) -> bool:
        """Check decrease and limits again, in rational arithmetic always."""
        return not self._refused()

    def _refused(self) -> str:
        if self.proof is None:
            return self.why or NOTHING
        if any((0,) * p.size in p.terms for p in self.f):
            return "f is not 0 at 0"
        V = quadratic_form(self.P)
        if not costs(self.Q, self.R, self.K):
            return COSTLESS
        change = decrease(self.f, V, self.K, self.Q, self.R, self.dt)
        if not (math.isfinite(self.alpha) and self.alpha > 0):
            return "the level is no number above 0"
        for name, bound in self.bounds:
            if not within(self.P, self.row(name), bound, self.alpha):
                return f"the limit of {name} is not kept"
        return why_not(V, change, self.alpha, self.proof)

    def row(self, name: str) -> Array:
        """The signal of a limit over the states, (n,)."""
        if name in self.states:
            return np.eye(len(self.states))[self.states.index(name)]
        return self.K[self.controls.index(name)]

    @property
    def log_volume(self) -> float:
        """Logarithm of the set's volume, up to a constant."""
        if not self.alpha > 0:
            return -math.inf
        n = len(self.states)
        return 0.5 * (n * math.log(self.alpha) - float(np.linalg.slogdet(self.P)[1]))

    def contains(self, x: Any) -> bool:
        """Whether a state (n,) lies in the set."""
        x = frozen(x, "x", (len(self.states),))
        return self.verified and bool(x @ self.P @ x <= self.alpha)

    def acados(self, x: casadi.SX | None = None) -> dict[str, Any]:
        """Fields of an acados OCP: `con_h_expr_e` and `cost_y_expr_e` of its model, `lh_e`, `uh_e`
        of its constraints, the others of its cost.

        Stage and terminal cost are both halved there, as least squares are. acados multiplies the
        stage cost by the time step by default: `W_e` has that factor in discrete time.

        Parameters
        ----------
        x : casadi.SX (n, 1), optional
            The model's state; by default a new symbol.
        """
        x = self._symbol(x)
        step = 1.0 if self.dt is None else self.dt
        return {
            "con_h_expr_e": self._level(x),
            "lh_e": np.array([-INFINITE]),
            "uh_e": np.array([self.alpha]),
            "cost_type": "NONLINEAR_LS",
            "cost_type_e": "NONLINEAR_LS",
            "cost_y_expr_e": x,
            "W": np.block(
                [
                    [self.Q, np.zeros((len(self.Q), len(self.R)))],
                    [np.zeros((len(self.R), len(self.Q))), self.R],
                ]
            ),
            "W_e": step * self.P,
            "yref_e": np.zeros(len(self.states)),
        }

    def do_mpc(
        self, x: casadi.SX | None = None, u: casadi.SX | None = None, step: float | None = None
    ) -> dict[str, Any]:
        """Expressions for do-mpc: `mterm` and `lterm` of its objective, and `terminal`, an
        expression that is at most 0 in the last state, for `nlp_cons` after `prepare_nlp`.

        Parameters
        ----------
        x, u : casadi.SX, optional
            State and control of the model; by default new symbols.
        step : float, optional
            Time step of the controller, s. do-mpc adds the stage cost once a step: needed in
            continuous time, where the cost is an integral.
        """
        import casadi

        if self.dt is None and step is None:
            raise InputError(
                "step: expected the controller's time step, s: the cost is an integral"
            )
        factor = 1.0 if self.dt is not None or step is None else positive(step, "step")
        own, moved = self._symbol(x), casadi.SX.sym("u", len(self.controls)) if u is None else u
        stage = casadi.bilin(casadi.DM(self.Q), own, own)
        stage += casadi.bilin(casadi.DM(self.R), moved, moved)
        level = self._level(own)
        return {"mterm": level, "lterm": factor * stage, "terminal": level - self.alpha}

    def _symbol(self, x: Any) -> Any:
        import casadi

        if not self.verified:
            raise InputError(f"only a proven set is handed over; here {self.why}")
        n = len(self.states)
        x = casadi.SX.sym("x", n) if x is None else x
        if x.shape != (n, 1):
            raise InputError(f"x: expected a column of {n} states, got shape {x.shape}")
        return x

    def _level(self, x: Any) -> Any:
        import casadi

        return casadi.bilin(casadi.DM(self.P), x, x)

    @property
    def bound(self) -> float:
        """The level alpha."""
        return self.alpha

    @property
    def claim(self) -> str:
        """The claim in one sentence, with numbers."""
        falls = (
            "d(x'P x)/dt <= -(x'Q x + u'R u)"
            if self.dt is None
            else "x'P x falls by x'Q x + u'R u a sample at least"
        )
        return (
            f"no motion with u = K x leaves x'P x <= {self.alpha!r} or a limit, and there {falls}"
        )

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions of the claim, each a sentence made from the numbers of the proof."""
        names = (*self.states, *self.controls)
        own = zip(self.states, self.f, strict=True)
        left = ("d{}/dt" if self.dt is None else "next {}").format
        time = "continuous time" if self.dt is None else f"samples of {self.dt!r} s"
        limits = ", ".join(f"|{name}| <= {bound!r}" for name, bound in self.bounds)
        return (
            *(f"{left(name)} = {p.text(names)}" for name, p in own),
            f"in {time}, within {limits or 'no limits'}",
        )

    @property
    def facts(self) -> Mapping[str, Any]:
        """Kind, bounds and conditions as data that JSON holds."""
        return {"kind": "terminal set", "alpha": self.alpha, "limits": dict(self.bounds)}

    @property
    def stored(self) -> dict[str, Any]:
        """Values of a file: equations, weights, feedback and the sums of squares."""
        if not self.verified or self.proof is None:
            raise InputError(f"only a proven set is saved; here {self.why}")
        return {
            "kind": "terminal set",
            "states": list(self.states),
            "controls": list(self.controls),
            "f": [written_terms(p) for p in self.f],
            "dt": self.dt,
            "bounds": [list(each) for each in self.bounds],
            **{name: encoded(getattr(self, name)) for name in MATRICES},
            "alpha": self.alpha,
            **written_proof(self.proof),
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any]) -> TerminalSet:
        """Return the set of a file, proven anew."""
        states, controls = (tuple(map(str, content[k])) for k in ("states", "controls"))
        n, m, dt = len(states), len(controls), content["dt"]
        names = {*states, *controls}
        bounds = tuple((str(k), positive(b, f"the limit of {k}")) for k, b in content["bounds"])
        fits = len(names) == n + m and len(content["f"]) == n and names >= {k for k, _ in bounds}
        if not fits:
            raise InputError("expected different names, and an equation for each state")
        shapes = {"Q": (n, n), "R": (m, m), "K": (m, n), "P": (n, n)}
        matrices = {k: frozen(decoded(content[k]), k, shape) for k, shape in shapes.items()}
        for name in "QRP":
            _even(matrices[name], name)
        made = cls(
            states=states, controls=controls, bounds=bounds, **matrices,
            f=tuple(read_terms(p, n + m) for p in content["f"]),
            dt=None if dt is None else positive(dt, "dt"),
            alpha=positive(content["alpha"], "alpha"), proof=read_proof(content, n),
            verified=False, why=NOTHING,
        )  # fmt: skip
        why = made._refused()
        return replace(made, verified=not why, why=why)

    def __str__(self) -> str:
        return f"proven: {self.claim}" if self.verified else f"no terminal set: {self.why}"


def quadratic_form(P: Array) -> SparsePolynomial:
    """Return x'P x, with the rationals that the doubles are."""
    n = len(P)
    x = SparsePolynomial.variables(n)
    every = [x[i] * x[j] * Fraction(float(P[i, j])) for i in range(n) for j in range(n)]
    return sum(every, SparsePolynomial(n, {}))


def decrease(
    f: Sequence[SparsePolynomial],
    V: SparsePolynomial,
    K: Array,
    Q: Array,
    R: Array,
    dt: float | None,
) -> SparsePolynomial:
    """Return the change of V with u = K x, by time or a sample, plus the cost x'Q x + u'R u."""
    x = SparsePolynomial.variables(len(f))
    u = linear_substitution(K)
    closed = [p.composed((*x, *u)) for p in f]
    change = V.along(closed) if dt is None else V.composed(closed) - V
    return change + quadratic_form(Q) + quadratic_form(R).composed(u)


@with_one_thread
def terminal(
    f: Any,
    Q: Any,
    R: Any,
    *,
    states: Any = None,
    controls: Any = None,
    dt: float | None = None,
    state_bounds: Mapping[str, float] | None = None,
    input_bounds: Mapping[str, float] | None = None,
    gain: Any = None,
    share: float | None = None,
    solver: Solver | str = "CLARABEL",
) -> TerminalSet:
    """A proven terminal set and cost of a predictive controller, for linear or polynomial systems.

    With u = K x the set is invariant within the limits, and the cost x'P x falls by the stage cost
    at least. So a predictive controller with this terminal cost and constraint stays feasible, and
    its least cost is a Lyapunov function.

    Parameters
    ----------
    f : LinearModel, mapping, sequence or casadi.Function
        {state: dx/dt} in SymPy; a list of SymPy or CasADi expressions, with their states; a
        casadi.Function (x, u); polynomials with f(0, 0) = 0. With `dt` the next x.
    Q, R : array (n, n) and (m, m)
        Weights of the stage cost x'Q x + u'R u, positive semidefinite and definite.
    states, controls : sequence, optional
        Symbols of SymPy, or the CasADi columns in which f is written; of a casadi.Function names.
    dt : float, optional
        Sample period, s; of a LinearModel its own. Default: continuous time, an integral of cost.
    state_bounds, input_bounds : dict, optional
        {state: largest size}, {control: largest size}; at least one in all.
    gain : array (m, n), optional
        K of u = K x; default: the linear-quadratic regulator.
    share : float, optional
        V falls faster than the cost near 0, by twice this share of the loop's slowest rate: room
        for what is not linear. Between 0 and 1; small: a small cost P. Default: what makes the
        largest set.
    solver : Solver or str
        For the search; nothing of its answer is believed.

    Returns
    -------
    TerminalSet
        `verified` says whether there is one, `why` why not; `.acados()` and `.do_mpc()` hand it on.

    Raises
    ------
    InputError
        Equations that are no polynomials, weights, bounds or a gain that do not fit, a loop that is
        not stable at 0.

    References
    ----------
    Chen and Allgoewer, Automatica 34 (1998); Mayne, Rawlings, Rao and Scokaert, Automatica 36
    (2000).

    Examples
    --------
    >>> import sympy
    >>> x, u = sympy.symbols("x u")
    >>> found = synthesis.regions.terminal(
    ...     {x: x + x**3 + u}, [[1.0]], [[1.0]], controls=[u], input_bounds={"u": 1.0}
    ... )
    >>> found.verified, bool(abs(found.K[0, 0] + 1 + 2**0.5) < 1e-6)
    (True, True)
    >>> sorted(found.do_mpc(step=0.1))
    ['lterm', 'mterm', 'terminal']
    """
    solver = general_solver(solver)
    if share is not None and not 0 < positive(share, "share") < 1:
        raise InputError(f"share: expected a number between 0 and 1, got {share!r:.60}")
    own, dt = _posed(f, states, controls, dt)
    n, m = len(own.states), len(own.controls)
    Q, R = _weight(Q, "Q", n), _weight(R, "R", m)
    bounds = _bounds(own, state_bounds, input_bounds)
    K = _gain(own, Q, R, dt, gain)
    tried = [
        _largest(
            TerminalSet(
                own.states, own.controls, own.f, dt, bounds, Q, R, K,
                _cost(own, Q, R, K, dt, each), 0.0, None, False, NOTHING,
            ),
            solver,
        )
        for each in tracked("terminal set", SHARES if share is None else (share,))
    ]  # fmt: skip
    return max(tried, key=lambda found: (found.verified, found.log_volume))


def _largest(made: TerminalSet, solver: Solver) -> TerminalSet:
    """Return the set of the largest level."""
    V, back = quadratic_form(made.P), np.linalg.inv(made.P)
    rows = [(made.row(name), bound) for name, bound in made.bounds]
    levels = [bound**2 / (row @ back @ row) for row, bound in rows if row.any()]
    if not levels:
        raise InputError("expected a limit of a state, or of a control that K moves")
    change = decrease(made.f, V, made.K, made.Q, made.R, made.dt)
    found = LevelSearch(V, change, None, solver, BELOW * float(min(levels))).found()
    own = replace(made, alpha=found.level, proof=found.proof, why=found.why)
    why = own._refused()
    return replace(own, verified=not why, why=why)


def _posed(f: Any, states: Any, controls: Any, dt: Any) -> tuple[Equations, float | None]:
    if not isinstance(f, LinearModel):
        own = equations(f, states, controls)
        if not own.controls:
            raise InputError("controls: expected at least one")
        return own, None if dt is None else positive(dt, "dt")
    if states is not None or controls is not None or dt is not None:
        raise InputError("states, controls and dt are those of the LinearModel; leave them out")
    rows = np.hstack([f.A, f.B])
    names = tuple(map(str, f.states)), tuple(map(str, f.inputs))
    return Equations(*names, linear_substitution(rows), None), f.dt


def _weight(given: Any, name: str, n: int) -> Array:
    M = frozen(given, name, (n, n))
    _even(M, name)
    least = np.linalg.eigvalsh(M)[0]
    if name == "R" and not least > 0:
        raise InputError("R: expected a positive definite matrix: every control has a weight > 0")
    if least < -1e-12 * np.abs(M).max():
        raise InputError(f"{name}: expected a positive semidefinite matrix")
    return M


def _even(M: Array, name: str) -> None:
    if not np.array_equal(M, M.T):
        raise InputError(f"{name}: expected a symmetric matrix; take 0.5 * (M + M.T)")


def _bounds(own: Equations, states: Any, inputs: Any) -> tuple[tuple[str, float], ...]:
    found: list[tuple[str, float]] = []
    for given, names, kind in ((states, own.states, "state"), (inputs, own.controls, "input")):
        argument = f"{kind}_bounds"
        for name, bound in by_name(given or {}, argument, f"{{{kind}: largest size}}").items():
            if str(name) not in names:
                raise InputError(f"{argument}: no {name!r}; known: {', '.join(names)}")
            found.append((str(name), positive(bound, f"the limit of {name}")))
    return tuple(found)


def _gain(own: Equations, Q: Array, R: Array, dt: float | None, gain: Any) -> Array:
    n, m = len(own.states), len(own.controls)
    if gain is not None:
        return frozen(gain, "gain", (m, n))
    AB = linearization(own.f)
    return frozen(-regulator(AB[:, :n], AB[:, n:], Q, R, dt=dt).K, "K", (m, n))


def _cost(own: Equations, Q: Array, R: Array, K: Array, dt: float | None, share: float) -> Array:
    """Return P of the cost that falls by the stage cost and faster, by a share of the rate."""
    n = len(own.states)
    AB = linearization(own.f)
    A = AB[:, :n] + AB[:, n:] @ K
    poles = np.linalg.eigvals(A)
    slowest = poles.real.max() if dt is None else np.abs(poles).max() - 1.0
    if not slowest < 0:
        raise InputError(
            "the loop with u = K x is not stable at 0; give another gain=, or leave it out for the"
            " linear-quadratic regulator"
        )
    faster = A - share * slowest * np.eye(n)
    if dt is not None:
        faster = A / (1.0 + share * slowest)
    P = symmetrized(lyapunov(faster.T, symmetrized(Q + K.T @ R @ K), dt))
    if not np.linalg.eigvalsh(P)[0] > 0:
        raise InputError("Q: some motions cost nothing; give every state a weight > 0")
    return frozen(P, "P", (n, n))
