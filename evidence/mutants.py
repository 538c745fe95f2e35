"""Errors put into the code one at a time, and whether the default tests find them.

Each is put into a copy of the clone, in which the named tests run that are not slow: files, or
tests of them (file::test).

    python -m evidence.mutants                 all errors
    python -m evidence.mutants tube -n 2       those whose sentence or file holds a word
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import Any, NamedTuple

from studies.output import progress

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("symheli", "identification", "synthesis", "studies", "evidence", "tests", "docs")


LONGEST = 300.0
"""Seconds after which tests that still run have failed: an error may make a loop endless."""


class Mutant(NamedTuple):
    """An error: `right` in the file becomes `wrong`; one of `tests`, words between spaces, is to
    find it.
    """

    error: str
    file: str
    right: str
    wrong: str
    tests: str


SERVOS = "tests/flight/test_servos_sensors_and_gusts.py"
COVERS = (
    "tests/synthesis/certify/test_cover.py"
    " tests/synthesis/robust/test_delays_and_servos_as_blocks.py"
)
CLAIMS = (
    "tests/synthesis/claims/test_vertices_and_grids.py"
    " tests/synthesis/claims/test_regions_of_attraction.py"
    " tests/synthesis/claims/test_terminal_sets.py"
    " tests/checker/test_claims_of_others.py"
)
POLYNOMIALS = (
    "tests/synthesis/numerics/test_bernstein_and_cells.py"
    " tests/synthesis/numerics/test_polynomial_matrices.py"
)

MUTANTS = (
    Mutant(
        "pieces narrower than 1e-9 of the range are left out",
        "synthesis/numerics/polynomial/pieces.py",
        "        if not a < b:\n",
        "        if not b - a > 1e-9 * (high - low):\n",
        "tests/synthesis/certify/test_no_false_proof.py",
    ),
    Mutant(
        "slopes below 1e-12 of the whole controller are left out",
        "synthesis/design/loops/wrong_parameter.py",
        "moves = spread > 0\n",
        "moves = spread > 1e-12 * np.abs(hull).max()\n",
        "tests/synthesis/design/test_wrong_parameter.py",
    ),
    Mutant(
        "a jump is judged beside the largest entry",
        "synthesis/design/loops/wrong_parameter.py",
        "> ROUNDING * (first[1] + end[1])",
        "> 1e-9 * np.max(first[1] + end[1])",
        "tests/synthesis/design/test_wrong_parameter.py",
    ),
    Mutant(
        "a misfit of the performance below 1e-10 is left out, whatever its unit",
        "synthesis/design/loops/sampled_loop.py",
        "> ROUNDING * np.tensordot(functions, np.abs(of), axes=1)",
        "> 1e-10",
        "tests/synthesis/design/test_sampled_loop.py",
    ),
    Mutant(
        "the states of a controller act with the other sign",
        "symheli/lpv/lower_feedback.py",
        "E, V = N @ K.D, N @ K.C\n",
        "E, V = N @ K.D, N @ K.C @ -np.eye(K.C.shape[-1])\n",
        "tests/lpv/test_lower_feedback.py",
    ),
    Mutant(
        "a delay is a sample short",
        "symheli/lpv/delay.py",
        "        np.eye(1, n),\n        np.zeros((1, 1)),\n",
        "        np.eye(1, n, k=min(1, n - 1)),\n        np.zeros((1, 1)),\n",
        "tests/lpv/test_in_series.py",
    ),
    Mutant(
        "cross spectra lack a conjugate",
        "identification/judge/frequency_response.py",
        "np.swapaxes(np.conj(Sur), 1, 2)",
        "np.swapaxes(Sur, 1, 2)",
        "tests/identification/test_frequency_responses_and_experiments.py",
    ),
    Mutant(
        "windows that overlap count as independent",
        "identification/judge/frequency_response.py",
        "np.conj(Z), found.overlap, Z",
        "np.conj(Z), np.eye(len(Z)), Z",
        "tests/identification/test_frequency_responses_and_experiments.py",
    ),
    Mutant(
        "residuals that are correlated count as white",
        "identification/judge/coefficient_covariance.py",
        "full[..., : lags + 1]], axis=-1)",
        "full[..., : lags + 1]], axis=-1) * (np.arange(-lags, lags + 1) == 0)",
        "tests/identification/test_uncertainty_carried_along.py",
    ),
    Mutant(
        "sensitivities leave out the parameters",
        "symheli/integrate/equations.py",
        "[*point, p], [*change, dp]",
        "[*point, p], [*change, 0 * dp]",
        "tests/integrate/test_sensitivities.py",
    ),
    Mutant(
        "the integrator of the autopilot leaks away from its limit",
        "symheli/flight/ardupilot.py",
        "integrator - LEAK * beyond",
        "integrator + LEAK * beyond",
        "tests/flight/test_ardupilot_loops.py",
    ),
    # --- symheli -----------------------------------------------------------------------------
    Mutant(
        "the velocity turns the other way about the pitch axis",
        "symheli/physics/rigid_body.py",
        "v * r - w * q + gravity[0]",
        "v * r + w * q + gravity[0]",
        "tests/model/test_conservation.py",
    ),
    Mutant(
        "the gyroscopic moment of roll has the other sign",
        "symheli/physics/rigid_body.py",
        "q * r * (Iyy - Izz)",
        "q * r * (Izz - Iyy)",
        "tests/model/test_conservation.py",
    ),
    Mutant(
        "yaw pitches a banked helicopter up",
        "symheli/values/kinematics.py",
        "        q * cosine - r * sine,\n",
        "        q * cosine + r * sine,\n",
        "tests/values/test_kinematics.py",
    ),
    Mutant(
        "the attitude quaternion turns the wrong way about one axis",
        "symheli/physics/rigid_body.py",
        "0.5 * (q0 * q + q3 * p - q1 * r)",
        "0.5 * (q0 * q - q3 * p + q1 * r)",
        "tests/model/test_conservation.py",
    ),
    Mutant(
        "momentum theory carries half the thrust",
        "symheli/physics/inflow.py",
        "residual = (2 * efficiency * lam * root - (line0 - line1 * lam)) * root",
        "residual = (efficiency * lam * root - (line0 - line1 * lam)) * root",
        "tests/model/test_inflow.py",
    ),
    Mutant(
        "above the tropopause the pressure falls from sea level",
        "symheli/environment/atmosphere.py",
        "math.exp(-GRAVITY * (height - low)",
        "math.exp(-GRAVITY * height",
        "tests/environment/test_air.py",
    ),
    Mutant(
        "turbulence across is as long as along",
        "symheli/environment/turbulence.py",
        "[longitudinal, longitudinal / 2, self.altitude / 2]",
        "[longitudinal, longitudinal, self.altitude / 2]",
        "tests/environment/test_air.py",
    ),
    Mutant(
        "the states of a gust are correlated a little less than they are",
        "symheli/environment/turbulence.py",
        "0.5 - left * (steps + 0.5)",
        "0.5 - left * (steps + 0.4)",
        "tests/environment/test_air.py",
    ),
    Mutant(
        "a servo at rest holds another deflection than it is told",
        "symheli/flight/servo.py",
        "ServoState(self.settled * deflection[:, None]",
        "ServoState(0.9 * self.settled * deflection[:, None]",
        SERVOS + "::test_a_bank_starts_at_rest",
    ),
    Mutant(
        "the lead of a servo has the other sign",
        "symheli/flight/servo.py",
        "[A, (1 - r) * B]",
        "[A, (r - 1) * B]",
        SERVOS + "::test_a_servo_has_the_printed_transfer_function",
    ),
    Mutant(
        "the exponential of a large matrix is squared once less",
        "symheli/lpv/exponential.py",
        "for _ in range(squarings):",
        "for _ in range(squarings - 1):",
        "tests/lpv/test_exponential.py",
    ),
    Mutant(
        "a lagged parameter jerks half as much as it may",
        "symheli/lpv/lagged.py",
        "-s.rate, s.rate, 2 * s.rate / seconds)",
        "-s.rate, s.rate, s.rate / seconds)",
        "tests/lpv/test_lagged.py",
    ),
    Mutant(
        "gravity does not turn with roll and pitch together",
        "symheli/values/kinematics.py",
        "[q, -p, -v, u, -GRAVITY * sp * ct, -GRAVITY * cp * st]",
        "[q, -p, -v, u, -GRAVITY * sp * ct, GRAVITY * cp * st]",
        "tests/values/test_kinematics.py",
    ),
    Mutant(
        "a late signal is made later",
        "symheli/records/shifted.py",
        "extrapolate=False)(time + by)",
        "extrapolate=False)(time - by)",
        "tests/records/test_flight_record.py",
    ),
    Mutant(
        "a moving trim drives the model the wrong way",
        "symheli/lpv/trim_drift.py",
        "columns.append(-slopes[:, i])",
        "columns.append(slopes[:, i])",
        "tests/lpv/test_lpv_state_space.py tests/lpv/test_several_parameters.py",
    ),
    Mutant(
        "new outputs leave out what goes straight through",
        "symheli/lpv/mixing.py",
        "D = D + np.multiply.outer(lpv.basis.constant(), G)",
        "D = D + 0 * np.multiply.outer(lpv.basis.constant(), G)",
        "tests/lpv/test_interconnection.py",
    ),
    # --- identification ----------------------------------------------------------------------
    Mutant(
        "a long-run covariance counts a lag less",
        "identification/estimators/newey_west.py",
        "np.maximum(ends - lags - 1, 0)",
        "np.maximum(ends - lags, 0)",
        "tests/identification/test_newey_west.py",
    ),
    Mutant(
        "cross-validation forgets what no coefficient explains",
        "identification/estimators/ridge.py",
        "self.R @ b) ** 2) + self.rest[y]",
        "self.R @ b) ** 2)",
        "tests/identification/test_penalties.py",
    ),
    Mutant(
        "the power of residuals grows with the window",
        "identification/estimators/residual_power.py",
        "axis=1)) ** 2 / size",
        "axis=1)) ** 2",
        "tests/identification/test_unseen_flight.py",
    ),
    Mutant(
        "the dependence on p that is tried is that of the model",
        "identification/judge/dependence.py",
        'scheduling_at="now" if arx.scheduling_at == "lag" else "lag"',
        'scheduling_at="lag" if arx.scheduling_at == "lag" else "now"',
        "tests/identification/test_dependence_on_scheduling.py",
    ),
    Mutant(
        "bands of growth rates are a hundredth as wide",
        "identification/judge/frozen_stability.py",
        "* spread + BAND * off",
        "* 0.01 * spread + BAND * off",
        "tests/identification/test_frozen_stability.py",
    ),
    Mutant(
        "a horizon is rounded to a sample more",
        "identification/judge/scores.py",
        "max(round(horizon / dt), 1)",
        "max(round(horizon / dt) + 1, 1)",
        "tests/identification/test_judged_models.py",
    ),
    # --- synthesis ---------------------------------------------------------------------------
    Mutant(
        "a polynomial restricted to an interval is turned round",
        "synthesis/numerics/polynomial/bernstein.py",
        "blossom([a] * (degree - k) + [b] * k)",
        "blossom([b] * (degree - k) + [a] * k)",
        POLYNOMIALS,
    ),
    Mutant(
        "products of Bernstein polynomials have the weights of another place",
        "synthesis/numerics/polynomial/bernstein.py",
        "/ comb(a + b, i + k)",
        "/ comb(a + b, i)",
        POLYNOMIALS,
    ),
    Mutant(
        "what is added to a form at will is not nothing",
        "synthesis/numerics/polynomial/symmetric_power.py",
        "for sign, (a, b) in zip((1, -1), entries, strict=True):",
        "for sign, (a, b) in zip((1, 1), entries, strict=True):",
        "tests/synthesis/certify/test_sharper_lyapunov_functions.py",
    ),
    Mutant(
        "a power of a state moves as the state does",
        "synthesis/numerics/polynomial/symmetric_power.py",
        "+= times * A[..., i, j]",
        "+= A[..., i, j]",
        "tests/synthesis/certify/test_sharper_lyapunov_functions.py",
    ),
    Mutant(
        "the exact check believes the one in floating point",
        "synthesis/numerics/polynomial/definite.py",
        "if promising and positive_definite(G):",
        "if promising:",
        "tests/synthesis/numerics/test_polynomial_matrices.py",
    ),
    Mutant(
        "a speed counts as out of reach from which p can stop",
        "synthesis/numerics/polynomial/motion.py",
        "room = 2 * jerk * (1 + 1e-9)",
        "room = jerk * (1 + 1e-9)",
        "tests/synthesis/certify/test_tied_rates.py",
    ),
    Mutant(
        "the shaped loop is designed for a level of the other sign",
        "synthesis/design/lti/loop_shaping.py",
        "L = (1 - gamma**2)",
        "L = (1 + gamma**2)",
        "tests/synthesis/design/test_loop_shaping.py",
    ),
    Mutant(
        "a sampled controller leaves the newest noise out",
        "synthesis/design/lti/linear_quadratic.py",
        "@ P.C2.T + control.F0 @ P.D21.T",
        "@ P.C2.T",
        "tests/synthesis/design/test_h2_properties.py",
    ),
    Mutant(
        "the direct way of the plant is fed back with the other sign",
        "synthesis/design/lti/linear_quadratic.py",
        "return A - B @ D22 @ NC, B - B @ D22 @ ND",
        "return A + B @ D22 @ NC, B + B @ D22 @ ND",
        "tests/synthesis/design/test_hinf_properties.py",
    ),
    Mutant(
        "the governor steps out of the set",
        "synthesis/sets/governor.py",
        "(wanted - now)) <= 1",
        "(wanted - now)) <= 1.1",
        "tests/synthesis/sets/test_invariant_set.py",
    ),
    Mutant(
        "a disturbed set need not shrink",
        "synthesis/sets/inequality.py",
        "top = slope - Q * alpha - motion * 2",
        "top = slope - motion * 2",
        "tests/synthesis/sets/test_invariant_set.py",
    ),
    Mutant(
        "a sampled set takes the disturbance for nothing",
        "synthesis/sets/inequality.py",
        "top = Q * (1 - alpha)",
        "top = Q",
        "tests/synthesis/sets/test_invariant_set.py",
    ),
    Mutant(
        "a switch is compared with what it grows to",
        "synthesis/switching/inequality.py",
        "jump.T @ own[j][0] @ jump",
        "jump.T @ own[j][-1] @ jump",
        "tests/synthesis/switching/test_switching.py",
    ),
    Mutant(
        "a rate of p counts on one side only, in a claim about a grid",
        "synthesis/claims/inequality.py",
        "return [own * as_fraction(rate), own * -as_fraction(rate)]",
        "return [own * as_fraction(rate)]",
        CLAIMS,
    ),
    Mutant(
        "a step of p is as long as its rate, whatever the period, in a claim about a grid",
        "synthesis/claims/inequality.py",
        "step = min(step, as_fraction(plant.rate) * as_fraction(plant.dt))",
        "step = min(step, as_fraction(plant.rate))",
        CLAIMS,
    ),
    Mutant(
        "inputs pass twice to the outputs, in a claim of a gain",
        "synthesis/claims/inequality.py",
        "corner = D.T @ D if dt is None else D.T @ D + B.T @ (after @ B)",
        "corner = D.T @ D",
        CLAIMS,
    ),
    Mutant(
        "a region of attraction is looked at on one side of each axis",
        "synthesis/claims/polar.py",
        "for axis, sign in product(range(n), (-1, 1)):",
        "for axis, sign in product(range(n), (1, 1)):",
        CLAIMS,
    ),
    Mutant(
        "a terminal set keeps its limits to their square",
        "synthesis/claims/terminal.py",
        "if c * reach > row.b**2:",
        "if c * reach > 1.1 * row.b**2:",
        CLAIMS,
    ),
    Mutant(
        "multipliers of a set may be below zero, in the checker",
        "synthesis/checker/claims.py",
        "if any(v < 0 for v in y) or not same or total > b:",
        "if not same or total > b:",
        CLAIMS,
    ),
    Mutant(
        "a motion of p that jumps leaves a moving P believed, in the checker",
        "synthesis/checker/claims.py",
        'refused = "P depends on p, and p may jump"',
        'refused = ""',
        CLAIMS,
    ),
    Mutant(
        "the energy of an output is counted at one of two points",
        "synthesis/certify/lower_bounds/paths.py",
        "*(math.sqrt(0.5) * root * y for y in outputs)",
        "*(root * y for y in outputs)",
        "tests/synthesis/certify/test_order_of_bounds.py",
    ),
    Mutant(
        "the multiplier of dynamics may depend on p",
        "synthesis/certify/statement/norm_bounded.py",
        "if dynamic and np.any(own != own[0]):",
        "if False and np.any(own != own[0]):",
        "tests/synthesis/robust/test_several_blocks_while_p_moves.py",
    ),
    Mutant(
        "what is unknown of a matrix counts a tenth",
        "synthesis/tubes/inequality.py",
        "diagonal = sizes * total / units",
        "diagonal = 0.1 * sizes * total / units",
        "tests/synthesis/tubes/test_tube.py::test_terms_of_the_remainder_bound_their_matrices",
    ),
    Mutant(
        "of what a matrix of rank one leaves, a tenth is counted",
        "synthesis/tubes/inequality.py",
        "rest += (np.abs(matrix - product)",
        "rest += 0.1 * (np.abs(matrix - product)",
        "tests/synthesis/tubes/test_tube.py::test_terms_of_the_remainder_bound_their_matrices",
    ),
    Mutant(
        "cells with a gap between them cover the commands",
        "synthesis/tubes/tube.py",
        "np.any(np.all((boxes[..., 0] <= own[:, 0]) & (own[:, 1] <= boxes[..., 1]), axis=1))",
        "np.any(np.all((boxes[..., 0] <= own[:, 1]) & (own[:, 0] <= boxes[..., 1]), axis=1))",
        "tests/synthesis/tubes/test_tube.py",
    ),
    Mutant(
        "a tube need not cover every command",
        "synthesis/tubes/tube.py",
        " and _covers(self.cells, loop.reference)):",
        "):",
        "tests/synthesis/tubes/test_tube.py",
    ),
    Mutant(
        "the angle of a loop is measured from plus one",
        "synthesis/design/loops/margins.py",
        "lag = np.angle(-response(unit))",
        "lag = np.angle(response(unit))",
        "tests/synthesis/design/test_margins.py",
    ),
    Mutant(
        "the disk margin is that of another disk",
        "synthesis/design/loops/margins.py",
        "S.D - 0.5 * np.eye",
        "S.D - 0.25 * np.eye",
        "tests/synthesis/design/test_margins.py",
    ),
    Mutant(
        "the bandwidth leaves 90 deg of phase",
        "synthesis/design/loops/handling_qualities.py",
        "-0.75 * math.pi",
        "-0.5 * math.pi",
        "tests/synthesis/design/test_margins.py tests/synthesis/sheet/test_specifications.py",
    ),
    Mutant(
        "the weight of a delay is below its error",
        "synthesis/robust/covers.py",
        "np.polymul([0.5, 1.0]",
        "np.polymul([0.7, 1.0]",
        COVERS,
    ),
    Mutant(
        "the weight of a lag covers the nearer end of the bandwidths",
        "synthesis/robust/covers.py",
        "h, k = sizes.max(), (sizes / ends).max()",
        "h, k = sizes.min(), (sizes / ends).min()",
        COVERS,
    ),
    # --- studies -----------------------------------------------------------------------------
    Mutant(
        "values of any package are written into files of stages",
        "studies/setup/stage_file.py",
        "        if not _ours(kind):\n            raise TypeError",
        "        if False:\n            raise TypeError",
        "tests/studies/test_stage_file.py",
    ),
    Mutant(
        "what was one object is two when read again",
        "studies/setup/stage_file.py",
        "if place not in self._made:",
        "if True:",
        "tests/studies/test_stage_file.py",
    ),
    Mutant(
        "an array that could not be changed can be when read again",
        "studies/setup/stage_file.py",
        'array.flags.writeable = not node["fixed"]',
        "array.flags.writeable = True",
        "tests/studies/test_stage_file.py",
    ),
    Mutant(
        "failed cases count in the medians of a campaign",
        "studies/campaigns/summary.py",
        "good = [i for i in at if rows[i] not in reasons]",
        "good = list(at)",
        "tests/studies/test_campaigns.py",
    ),
    Mutant(
        "numbers that are not finite are no text in JSON",
        "studies/output.py",
        "return value if math.isfinite(value) else str(value)",
        "return value if math.isfinite(value) else None",
        "tests/studies/test_command_line.py tests/studies/test_results_schema.py",
    ),
    Mutant(
        "a process that has ended is asked again",
        "studies/processes.py",
        "except ProcessEndedError:\n            self._own.worker = None\n            raise",
        "except ProcessEndedError:\n            raise",
        "tests/studies/test_processes.py",
    ),
    Mutant(
        "a misspelt choice is not told its name",
        "studies/choices.py",
        "cutoff=0.5)",
        "cutoff=0.99)",
        "tests/studies/test_configuration.py",
    ),
    Mutant(
        "wind turns the other way about the heading",
        "studies/controllers/measures.py",
        "[ct * cp, ct * sp, -st],",
        "[ct * cp, -ct * sp, -st],",
        "tests/studies/test_study_controllers.py",
    ),
    Mutant(
        "an energy ratio is that of the energies, not its root",
        "studies/controllers/measures.py",
        "return float(np.sqrt((z**2).sum() / (w**2).sum()))",
        "return float((z**2).sum() / (w**2).sum())",
        "tests/studies/test_study_controllers.py",
    ),
    Mutant(
        "a sum of squares may leave a direction out",
        "synthesis/numerics/polynomial/gram.py",
        "own == set(range(size))",
        "True",
        "tests/checker/test_forged_regions.py",
    ),
    Mutant(
        "what a sum of squares misses of its polynomial is left out",
        "synthesis/numerics/polynomial/gram.py",
        "            out[i, j] += c / len(places[k])\n",
        "            out[i, j] += 0\n",
        "tests/checker/test_forged_regions.py tests/synthesis/regions/test_regions.py",
    ),
    Mutant(
        "the multiplier of a region may have either sign",
        "synthesis/regions/proof.py",
        "if not (proof.sigma.is_sum_of_squares and proof.s.is_sum_of_squares):",
        "if not proof.sigma.is_sum_of_squares:",
        "tests/checker/test_forged_regions.py",
    ),
    Mutant(
        "the cost of a terminal set leaves the controls out",
        "synthesis/regions/terminal.py",
        " + quadratic_form(R).composed(u)",
        "",
        "tests/checker/test_forged_regions.py",
    ),
    Mutant(
        "limits of a terminal set are not checked",
        "synthesis/regions/terminal.py",
        "if not within(self.P, self.row(name), bound, self.alpha):",
        "if False:",
        "tests/checker/test_forged_regions.py",
    ),
)


def found(mutant: Mutant, folder: Path) -> bool:
    """Whether a test fails once the error is in the copy in `folder`; the copy is right again
    afterwards. Raises `ValueError` where the code to be changed is not there once.
    """
    path = folder / mutant.file
    text = path.read_text(encoding="utf-8")
    if text.count(mutant.right) != 1:
        raise ValueError(f"{mutant.file} has {text.count(mutant.right)} times {mutant.right!r}")
    path.write_text(text.replace(mutant.right, mutant.wrong), encoding="utf-8")
    try:
        return not passes(mutant.tests, folder)
    finally:
        path.write_text(text, encoding="utf-8")


def passes(tests: str, folder: Path) -> bool:
    """Whether these default tests in the copy pass, within `LONGEST`."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    # no bytecode: a second that has not passed since would hide the change
    environment = {
        **os.environ,
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
        "SYMHELI_CACHE": str(folder / "cache"),
    }
    try:
        run = subprocess.run(
            [*command, *tests.split()],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=LONGEST,
        )
    except subprocess.TimeoutExpired:
        return False
    if run.returncode not in (0, 1):
        raise RuntimeError(f"{tests}: {run.stdout[-2000:]}{run.stderr[-2000:]}")
    return run.returncode == 0


def copy(folder: Path) -> Path:
    """`folder` with a copy of what the tests need."""
    for each in FOLDERS:
        shutil.copytree(ROOT / each, folder / each, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def main() -> None:
    """Print which errors the default tests find; exit with 1 where one is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("word", nargs="?", default="", help="of the sentence, or of the file")
    parser.add_argument("-n", type=int, default=1, help="processes")
    options = parser.parse_args()
    chosen = [m for m in MUTANTS if options.word in m.error or options.word in m.file]
    if not chosen:
        raise SystemExit(f"no error holds {options.word!r}")
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(options.n) as pool:
        free: Queue[Path] = Queue()
        for i in range(options.n):
            free.put(copy(Path(name) / str(i)))

        def in_a_copy(question: Callable[..., bool], asked: Any) -> bool:
            folder = free.get()
            try:
                return question(asked, folder)
            finally:
                free.put(folder)

        tests = list(dict.fromkeys(mutant.tests for mutant in chosen))
        for each, right in zip(tests, pool.map(lambda t: in_a_copy(passes, t), tests), strict=True):
            progress(f"{each} without an error")
            if not right:
                raise SystemExit(f"{each} fails as it is")
        missed = 0
        verdicts = pool.map(lambda m: in_a_copy(found, m), chosen)
        for mutant, caught in zip(chosen, verdicts, strict=True):
            missed += not caught
            print(
                f"{'found ' if caught else 'MISSED'}  {mutant.error} ({mutant.tests})", flush=True
            )
    if missed:
        raise SystemExit(f"{missed} of {len(chosen)} errors are missed by the default tests")


if __name__ == "__main__":
    main()
