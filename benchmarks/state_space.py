"""State-space identification beside other packages, on the same data: largest error of the frozen
frequency responses as a share of the largest response, and seconds of the processor.

jax-sysid and nfoursid (which knows no scheduling) are raced where they are installed.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

# this folder holds scripts named like the packages they measure
sys.path[0] = str(Path(__file__).resolve().parents[1])

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

import identification as idn  # noqa: E402
from benchmarks.race import keep, table  # noqa: E402
from benchmarks.timing import arguments  # noqa: E402
from symheli import FlightRecord  # noqa: E402
from symheli.errors import ConvergenceWarning  # noqa: E402
from symheli.values.arrays import Array  # noqa: E402

OMEGA, POINTS = np.linspace(0.05, 3.0, 60), (-0.8, 0.0, 0.8)
NAMES, INPUTS = ("y", "z"), ("u", "v")


@dataclass(frozen=True)
class Case:
    """x+ = (A0 + p A1) x + B u + K e, y = C x + e, u = r - gain y."""

    name: str
    moving: float
    noise: float
    gain: float = 0.0

    def matrices(self) -> tuple[Array, Array, Array, Array, Array]:
        """A0, A1, B, C and K: two modes that p turns, two inputs and two outputs."""
        rng = np.random.default_rng(3)
        A0 = np.zeros((4, 4))
        for i, (radius, angle) in enumerate([(0.95, 0.3), (0.85, 1.1)]):
            turn = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            A0[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = radius * np.array(turn)
        A1 = rng.normal(size=(4, 4))
        A1 *= self.moving / np.linalg.norm(A1, 2)
        B, C, K = rng.normal(size=(4, 2)), rng.normal(size=(2, 4)), rng.normal(size=(4, 2))
        return A0, A1, B, C, 0.4 * K / np.linalg.norm(K, 2)

    def data(self, n: int) -> tuple[Array, Array, Array]:
        """Outputs, inputs and p."""
        A0, A1, B, C, K = self.matrices()
        rng = np.random.default_rng(7)
        p, r = np.sin(0.03 * np.arange(n)), rng.choice([-1.0, 1.0], (n, 2))
        e, x = self.noise * rng.normal(size=(n, 2)), np.zeros(4)
        y, u = np.zeros((n, 2)), np.zeros((n, 2))
        for k in range(n):
            y[k] = C @ x + e[k]
            u[k] = r[k] - self.gain * y[k]
            x = (A0 + p[k] * A1) @ x + B @ u[k] + K @ e[k]
        return y, u, p

    def error(self, at: Callable[[float], tuple[Array, Array, Array]]) -> float:
        """Of A, B and C at values of p."""
        A0, A1, B, C, _ = self.matrices()
        pairs = [(_response(A0 + p * A1, B, C), _response(*at(p))) for p in POINTS]
        largest = max(np.abs(exact).max() for exact, _ in pairs)
        return float(max(np.abs(found - exact).max() for exact, found in pairs) / largest)


def _response(A: Array, B: Array, C: Array) -> Array:
    z = np.exp(1j * OMEGA)[:, None, None] * np.eye(len(A))
    return C @ np.linalg.solve(z - A, np.tile(B.astype(complex), (len(OMEGA), 1, 1)))


CASES = (
    Case("constant", 0.0, 0.3),
    Case("over p", 0.08, 0.3),
    Case("over p, closed loop", 0.08, 0.6, gain=0.05),
)


def ours(case: Case, y: Array, u: Array, p: Array, method: str) -> Callable[[float], tuple]:
    """A fit of this package; "ls" and "long" are difference equations as state-space models."""
    columns = dict(zip((*NAMES, *INPUTS, "p"), np.column_stack([y, u, p]).T, strict=True))
    time_ = np.arange(len(y), dtype=float)
    record = FlightRecord.from_arrays(time_, dict.fromkeys(columns, "1"), **columns)
    basis = idn.Polynomial(1 if case.moving else 0, -1.0, 1.0)
    structure = idn.StateSpace(NAMES, INPUTS, "p", order=4, basis=basis)
    if method == "ls":
        lpv = idn.fit(structure.regression, record).to_state_space()
    elif method == "long":
        arx = replace(structure.regression, na=8, nb=8)
        lpv = idn.fit(arx, record).truncate(4, balance="response").model
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            lpv = idn.fit(structure, record, method).state_space
    return lambda q: _matrices(lpv.at(q))


def _matrices(model: object) -> tuple[Array, Array, Array]:
    return model.A, model.B, model.C  # type: ignore[attr-defined]


def jax_sysid(case: Case, y: Array, u: Array, p: Array) -> Callable[[float], tuple]:
    """The qLPV model of Bemporad, p a further input; trained from a linear model."""
    import jax
    from jax_sysid.models import qLPVModel

    jax.config.update("jax_enable_x64", True)
    scale = y.std(axis=0)
    model = qLPVModel(4, 2, 3, 1, lambda x, v, _: v[2:3], [], sigma=0.5, seed=0)
    model.loss(rho_x0=1e-6, rho_th=1e-8, train_x0=True)
    model.optimization(adam_epochs=1000, lbfgs_epochs=2000, iprint=-1)
    with contextlib.redirect_stdout(io.StringIO()):
        model.fit(y / scale, np.column_stack([u, p]), LTI_training=True)
    A0, A1, B0, B1, C0, C1 = (np.asarray(part) for part in model.params[:6])
    return lambda q: (
        A0 + q * A1[0],
        (B0 + q * B1[0])[:, :2],
        scale[:, None] * (C0 + q * C1[0]),
    )


def nfoursid(case: Case, y: Array, u: Array, p: Array) -> Callable[[float], tuple]:
    """N4SID, without scheduling."""
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    frame = pd.DataFrame(np.column_stack([y, u]), columns=[*NAMES, *INPUTS])
    method = NFourSID(frame, list(NAMES), list(INPUTS), num_block_rows=10)
    method.subspace_identification()
    found, _ = method.system_identification(rank=4)
    return lambda q: (found.a, found.b, found.c)


def contenders(case: Case) -> dict[str, Callable[..., Callable[[float], tuple]]]:
    """By name, of those that are installed."""
    out: dict[str, Callable[..., Callable[[float], tuple]]] = {
        name: (lambda *data, method=method: ours(*data, method))
        for name, method in {
            "LPV-ARX of 2 lags, realized": "ls",
            "LPV-ARX of 8 lags, truncated": "long",
            "StateSpace, subspace alone": "subspace",
            "StateSpace, output error": "oe",
            "StateSpace, innovations": "innovations",
        }.items()
    }
    others = {"jax_sysid": ("jax-sysid, qLPV", jax_sysid)}
    if not case.moving:
        others["nfoursid"] = ("nfoursid", nfoursid)
    for package, (name, call) in others.items():
        if importlib.util.find_spec(package):
            out[name] = call
        else:
            print(f"{package.replace('_', '-')} is not installed: its row is left out")
    return out


def main() -> None:
    options = arguments(__doc__, write=True, timed=False)
    n, plain, texts = 1000 if options.quick else 4000, {}, []
    for case in CASES:
        data, rows = case.data(n), []
        for name, call in contenders(case).items():
            begin = time.process_time()
            found = call(case, *data)
            seconds = time.process_time() - begin
            error = case.error(found)
            rows.append((name, f"{error:.4f}", f"{seconds:.1f} s"))
            plain[f"{case.name}: {name}"] = {"error": error, "seconds": seconds}
        title = f"### {case.name}, {n} samples, 4 states"
        texts.append(table(title, rows, ("", "largest error of responses", "time")))
        if not options.json:
            print(f"{texts[-1]}\n", flush=True)
    if options.json:
        print(json.dumps(plain))
    if options.write:
        keep("states", "\n\n".join(texts))


if __name__ == "__main__":
    main()
