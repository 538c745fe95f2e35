"""The recursion over two million samples; over a hundred million by benchmarks/long_run.py
(docs/checks.md).
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from identification.recursive import kernel


@pytest.mark.slow
@pytest.mark.skipif(
    kernel.compiled_kernel("single") is None,
    reason="millions of samples want the compiled kernel",
)
def test_millions_of_updates_neither_grow_nor_lose_what_they_know():
    script = Path(__file__).resolve().parents[2] / "benchmarks" / "long_run.py"
    told = json.loads(
        subprocess.run(
            [sys.executable, str(script), "--quick", "--json"],
            capture_output=True,
            text=True,
            check=True,
            timeout=600,
        ).stdout
    )
    for way in ("no forgetting", "factor 0.999", "directional 0.99"):
        for precision in ("double", "single"):
            assert told[f"{precision}, {way}: updates"] > 1.9e6
            # noise of .05 over some 1000 remembered samples leaves 2e-3; a full factor in single
            # precision is allowed as much
            assert told[f"{precision}, {way}: largest error after any chunk"] < 2e-3
