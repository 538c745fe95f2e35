"""One kernel for every processor of a kind: compiled once a level of vector instructions, the same
bits from each.
"""

import ctypes
import platform
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from test_compiled_kernel_and_twin import STRUCTURES, WAYS, awkward

import identification as idn
from identification.recursive import kernel
from identification.recursive.online import Online
from symheli.codegen.compile import library

compiled_only = pytest.mark.skipif(
    not kernel.compiled_kernels("double"), reason="no compiled kernel is installed"
)


@compiled_only
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("name", STRUCTURES)
def test_every_level_gives_the_same_bits(name, precision):
    """No contraction and sums in a fixed order: there is nothing to differ by, so no tolerance
    either.
    """
    rows = awkward(STRUCTURES[name])
    for way in WAYS:
        rls = idn.RecursiveLeastSquares(STRUCTURES[name], way, precision=precision)
        memories = {}
        for level, module in kernel.compiled_kernels(precision).items():
            online = Online(
                rls.configuration, module.Kernel(*rls.configuration.arguments), rls.init()
            )
            online.run(rows, history=False)
            memories[level] = online.state.memory
        for memory in memories.values():
            np.testing.assert_array_equal(memory, memories["baseline"])


@compiled_only
def test_a_lesser_processor_takes_the_baseline(monkeypatch):
    monkeypatch.setattr(kernel, "processor_levels", lambda: ("baseline",))
    kernel.compiled_kernel.cache_clear()
    try:
        assert list(kernel.compiled_kernels("double")) == ["baseline"]
        assert (
            kernel.compiled_kernel("double").__module__ == "identification.recursive.kernel._double"
        )
    finally:
        kernel.compiled_kernel.cache_clear()


@compiled_only
def test_the_fastest_level_is_taken_and_the_baseline_is_always_there():
    levels = kernel.processor_levels()
    assert levels[-1] == "baseline"
    built = list(kernel.compiled_kernels("double"))
    assert built == [level for level in levels if level in built]
    assert kernel.compiled_kernel("double") is kernel.compiled_kernels("double")[built[0]].Kernel


@compiled_only
@pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64") or not shutil.which("objdump"),
    reason="wants objdump on an x86-64",
)
@pytest.mark.parametrize("ending", ["double", "single"])
def test_what_runs_everywhere_holds_no_instruction_of_a_level_above(ending):
    """Registers ymm and zmm, and mnemonics with a leading v, came with AVX."""
    for module in (
        kernel.compiled_kernels(ending)["baseline"],
        kernel.importlib.import_module("identification.recursive.kernel._processor"),
    ):
        code = subprocess.run(
            ["objdump", "-d", "--no-show-raw-insn", module.__file__],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        assert len(code) > 1000
        assert not re.search(r"\t(v[a-z]+\s|.*%[yz]mm)", code)


IN_USE = """
unsigned in_use(void)
{
    unsigned low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(1));
    return low;
}
"""


def can_tell_what_is_in_use():
    cpu = Path("/proc/cpuinfo")
    return cpu.is_file() and "xgetbv1" in cpu.read_text(encoding="utf-8")


@compiled_only
@pytest.mark.skipif(not can_tell_what_is_in_use(), reason="wants a processor with XGETBV of 1")
@pytest.mark.parametrize("precision", ["double", "single"])
def test_no_level_leaves_anything_in_the_upper_halves_of_the_registers(precision):
    """Once, whatever used short vectors after an update ran at a quarter of its speed: other
    people's code, and the baseline kernel in the same process.
    """
    path = library(IN_USE, "in-use")
    if path is None:
        pytest.skip("wants a C compiler")
    code = ctypes.PyDLL(str(path))
    rls = idn.RecursiveLeastSquares(STRUCTURES["nine outputs"], precision=precision)
    phi, y = np.ones(rls.structure.n_regressors), np.ones(rls.structure.ny)
    rows = awkward(rls.structure)
    for module in kernel.compiled_kernels(precision).values():
        online = Online(rls.configuration, module.Kernel(*rls.configuration.arguments), rls.init())
        for call in (lambda online=online: online.absorb(phi, y), lambda o=online: o.run(rows)):
            call()
            assert not code.in_use() & 4  # bit 2: upper halves of the sixteen ymm
