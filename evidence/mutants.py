"""Errors put into the code one at a time, and whether the default tests find them.

Each is put into a copy of the clone, in which the tests of the named files run that are not slow.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from studies.output import progress

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("symheli", "identification", "synthesis", "studies", "evidence", "tests", "docs")


class Mutant(NamedTuple):
    """An error: `right` in the file becomes `wrong`; `tests` are to find it."""

    error: str
    file: str
    right: str
    wrong: str
    tests: str


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
    """Whether the default tests of a file in the copy pass."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", tests]
    environment = {**os.environ, "PYTHONPATH": str(folder), "SYMHELI_CACHE": str(folder / "cache")}
    run = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if run.returncode not in (0, 1):
        raise RuntimeError(f"{tests}: {run.stdout[-2000:]}{run.stderr[-2000:]}")
    return run.returncode == 0


def main() -> None:
    """Print which errors the default tests find; exit with 1 where one is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.parse_args()
    missed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for each in FOLDERS:
            shutil.copytree(ROOT / each, folder / each)
        shutil.copy(ROOT / "pyproject.toml", folder)
        for tests in dict.fromkeys(mutant.tests for mutant in MUTANTS):
            progress(f"{tests} without an error")
            if not passes(tests, folder):
                raise SystemExit(f"{tests} fails as it is")
        for mutant in MUTANTS:
            caught = found(mutant, folder)
            missed += not caught
            print(
                f"{'found ' if caught else 'MISSED'}  {mutant.error} ({mutant.tests})", flush=True
            )
    if missed:
        raise SystemExit(f"{missed} of {len(MUTANTS)} errors are missed by the default tests")


if __name__ == "__main__":
    main()
