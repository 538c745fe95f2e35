"""Designs and proofs of the pages print the same digits for every BLAS kernel and any number of
threads.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from executed import DOCS, blocks
from threadpoolctl import threadpool_info

from symheli.threads import BLAS

PROVEN = """
import math, sys
from models import lateral
from synthesis.analysis import LowerBoundSearch
from threadpoolctl import threadpool_info

search = LowerBoundSearch(starts=1, evaluations=5, seconds=math.inf)
found = synthesis.l2_gain(lateral(), 0.1, search=search)
for gain in (promised, tuned.promised, proof.gamma, found.frozen, found.lower, found.gamma):
    print(f"{gain:#.4g}")
print({found["architecture"] for found in threadpool_info()}, file=sys.stderr)
"""
"""After the blocks of the pages; a search that no clock ends."""


def code(page, *words):
    """The blocks of Python of a page in which one of the words stands."""
    found = blocks((DOCS / page).read_text(encoding="utf-8"))
    return [b.code for b in found if b.kind == "python" and any(w in b.code for w in words)]


def printed(kernel, threads):
    """What a process prints whose BLAS has this kernel and number of threads; and its kernels."""
    tutorial = code("tutorial.md", "Helicopter.load", "symheli.sweep", "output_feedback(")
    classical = code("classical.md", "Helicopter.load", "structured(")
    assert (len(tutorial), len(classical)) == (3, 2)
    program = [*tutorial, "promised = controller.promised", *classical, PROVEN]
    paths = (str(Path(__file__).parent), os.environ.get("PYTHONPATH", ""))
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(program)],
        env={
            **os.environ,
            **dict.fromkeys(BLAS, str(threads)),
            "OPENBLAS_CORETYPE": kernel,
            "PYTHONPATH": os.pathsep.join(paths),
        },
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_another_kernel_or_another_number_of_threads_prints_the_same_digits():
    if all(found["internal_api"] != "openblas" for found in threadpool_info()):
        pytest.skip("the kernel of this BLAS is not chosen by a variable")
    found, kernel = printed("Haswell", 1)
    others = [printed("SkylakeX", 1), printed("Nehalem", 1), printed("Haswell", 2)]
    # a kernel for which the processor lacks instructions is replaced by another
    assert {other for _, other in others} > {kernel}
    assert [other for other, _ in others] == [found] * len(others)
