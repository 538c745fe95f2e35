"""On a bare Cortex-M4 and M7, emulated: the bits of Python; no allocation, no recursion, no loop
without an end, a stack that is known.
"""

import subprocess

import pytest
from export.test_exported_controller import TABLES
from export.test_exported_estimator import CASES, Everything
from export.test_exported_kinematic_estimator import DT, KIN, UNITS
from export.test_exported_kinematic_model import STRUCTURES, model_of

import identification as idn
import symheli
from evidence import on_board
from evidence.on_board import checked
from identification.export import (
    write_estimator,
    write_kinematic_estimator,
    write_kinematic_model,
    write_kinematic_observer,
)
from studies.cli import main
from symheli.errors import UnknownNameError
from symheli.export import write_board, write_controller, write_monitor
from symheli.export.board import TARGETS
from symheli.flight import HypothesisMonitor

needs_emulator = pytest.mark.skipif(bool(on_board.missing()), reason=on_board.missing())

M4, M7 = TARGETS
SPEED = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0)
LIMITS = {"d_lon": (-0.2, 0.2), "d_ped": (-0.3, 0.1)}


def monitor(**options):
    return HypothesisMonitor(SPEED, 0.02, LIMITS, ("d_lon", "d_lat", "d_ped"), **options)


def estimator(case):
    return lambda folder: write_estimator(CASES[case], Everything(), folder)


def kinematic(precision):
    rls = idn.RecursiveLeastSquares(KIN, 0.99, precision=precision)
    return lambda folder: write_kinematic_estimator(rls, UNITS, DT, folder)


def kinematic_model(precision):
    model = model_of(STRUCTURES["airspeed"])
    return lambda folder: write_kinematic_model(model, folder, precision=precision)


def kinematic_observer(precision):
    kin = STRUCTURES["airspeed"]
    observer = model_of(kin).observer(dict.fromkeys(kin.outputs, 0.05), process=0.02)
    return lambda folder: write_kinematic_observer(observer, folder, precision=precision)


WRITTEN = {
    "estimator, single": estimator("longitudinal, single"),
    "estimator, double": estimator("longitudinal"),
    "groups, variable": estimator("groups, variable"),
    "groups, directional, single": estimator("groups, directional, single"),
    "kinematic estimator, single": kinematic("single"),
    "kinematic estimator, double": kinematic("double"),
    "kinematic model, single": kinematic_model("single"),
    "kinematic model, double": kinematic_model("double"),
    "kinematic observer, single": kinematic_observer("single"),
    "kinematic observer, double": kinematic_observer("double"),
    "controller": lambda folder: write_controller(TABLES["position"](), folder),
    "controller of rates": lambda folder: write_controller(TABLES["rates"](), folder),
    "monitor": lambda folder: write_monitor(monitor(noise=0.05), folder),
}
NUMBERS = ("controller", "monitor")
"""Of these the quick tests are: the others repeat them."""


def folder_of(name, folder):
    WRITTEN[name](folder)
    write_board(folder, M4)
    return folder


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A folder of each artefact, written once."""
    found = {}

    def written(name):
        if name not in found:
            found[name] = folder_of(name, tmp_path_factory.mktemp("board"))
        return found[name]

    return written


# --- bits ----------------------------------------------------------------------------------------

SAME = {
    "estimator, single": "25 of 25 updates, largest difference 0.00e+00, the same to the last bit",
    "estimator, double": "25 of 25 updates, largest difference 0.00e+00, the same to the last bit",
    "groups, variable": "largest difference 0.00e+00, the same to the last bit",
    "groups, directional, single": "largest difference 0.00e+00, the same to the last bit",
    "controller": "960 of 960 commands equal to the last bit",
    "controller of rates": "960 of 960 commands equal to the last bit",
    "monitor": "400 of 400 statuses equal",
}


@pytest.mark.slow(but=("cortex-m4-controller", "cortex-m4-monitor"))
@needs_emulator
@pytest.mark.parametrize("name", SAME)
@pytest.mark.parametrize("target", TARGETS)
def test_the_bits_are_those_of_python(folders, target, name):
    """Double precision by software on the M4, whose unit has single only, too."""
    (run,) = checked(folders(name), target).values()
    assert run.passed, run.text
    assert SAME[name] in run.text
    assert 0 < run.instructions[0] <= run.instructions[1]
    assert run.stack > 0


ROUNDED = {
    "kinematic estimator, single": 1e-3,
    "kinematic estimator, double": 1e-12,
    "kinematic model, single": 1e-6,
    "kinematic model, double": 1e-14,
    "kinematic observer, single": 1e-6,
    "kinematic observer, double": 1e-12,
}
"""sin, cos and tan are those of newlib, and the model's sums run in another order than NumPy's."""


@pytest.mark.slow
@needs_emulator
@pytest.mark.parametrize("name", ROUNDED)
@pytest.mark.parametrize("target", TARGETS)
def test_known_kinematics_are_those_of_python_but_for_rounding(folders, target, name):
    runs = checked(folders(name), target)
    for run in runs.values():
        assert run.passed, run.text
    inner = [runs[key].text for key in runs if "aero" in key and "estimator" in name]
    assert all("the same to the last bit" in text for text in inner)
    (outer,) = (runs[key].text for key in runs if "aero" not in key)
    error = float(outer.split("largest difference ")[1].split()[0].rstrip(","))
    assert error <= ROUNDED[name]


@pytest.mark.slow
@needs_emulator
def test_another_number_fails_on_board_too(tmp_path):
    folder = folder_of("controller", tmp_path)
    source, number = folder / "controller.c", TABLES["position"]().matrices[16, 2, 3]
    text = source.read_text()
    assert float(number).hex() in text
    source.write_text(text.replace(float(number).hex(), float(number + 0.01).hex()))
    assert not checked(folder, M4)["controller_check"].passed


@pytest.mark.slow
@needs_emulator
def test_a_fault_ends_the_emulator_with_an_error(tmp_path):
    folder = folder_of("monitor", tmp_path)
    check = folder / "monitor_check.c"
    text = check.read_text()
    check.write_text(text.replace("monitor_init(&s);", "*(volatile int *)0xFFFFFFF0u = 1;"))
    assert not checked(folder, M4)["monitor_check"].passed


# --- what a step takes ---------------------------------------------------------------------------

COUNTING = """
#include <stdio.h>
#include "count.h"
int main(void) { for (int n = 0; n < 3; n++) printf("%d\\n", count_update(n)); return 0; }
"""


@pytest.mark.slow
@needs_emulator
def test_instructions_and_stack_are_those_of_code_whose_are_known(tmp_path):
    """1000 instructions and 512 bytes more are counted as such."""
    more = {}
    for nops, bytes_ in ((0, 8), (1000, 8), (0, 520)):
        folder = tmp_path / f"{nops}_{bytes_}"
        folder.mkdir()
        (folder / "count.h").write_text("#pragma once\nint count_update(int n);\n")
        (folder / "count.c").write_text(f"""#include "count.h"
int count_update(int n)
{{
    volatile char room[{bytes_}];
    room[0] = (char)n;
    __asm volatile(".rept {nops}\\n nop\\n .endr");
    return room[0];
}}
""")
        (folder / "count_check.c").write_text(COUNTING)
        write_board(folder, M4)
        run = checked(folder, M4)["count_check"]
        assert run.passed, run.text
        more[nops, bytes_] = run
    least = more[0, 8]
    assert more[1000, 8].instructions[1] - least.instructions[1] == 1000
    assert more[0, 520].stack - least.stack == pytest.approx(512, abs=32)


# --- how it is written ---------------------------------------------------------------------------

LOOPS = {
    "learn": "over the rows, from one to the next turn by n, a number of regressors: 1 or more",
    "new_peaks": "over the regressors by the number of functions of the basis: 1 or more",
    "power": "halves an int: 31 times at most",
    "evaluate": "counts up to the pieces of a basis, and may end before",
    "is_outside": "counts up to the factors of a basis, and may end before",
    "defect": "counts up to the signals, and may end before",
    "rls_absorb": "counts up to the groups of the constant configuration, which gcc reads again",
}
"""Loops whose iterations gcc does not know when they are entered, and why they end."""


@pytest.mark.slow(but=NUMBERS)
@needs_emulator
@pytest.mark.parametrize("name", WRITTEN)
def test_nothing_calls_itself_and_every_stack_is_known(folders, tmp_path, name):
    found = on_board.calls(folders(name), M4, tmp_path)
    assert found.stack
    assert not found.recursive
    assert not found.dynamic
    assert not {f for f in found.outside if "indirect" in f}
    assert max(map(found.deepest, found.stack)) <= 4096


@pytest.mark.slow(but=NUMBERS)
@needs_emulator
@pytest.mark.parametrize("name", WRITTEN)
def test_every_loop_is_counted(folders, tmp_path, name):
    total = 0
    for source in on_board.flying(folders(name)):
        loops, left = on_board.uncounted(source, M4, tmp_path)
        total += loops
        assert set(left) <= (set(LOOPS) if source.name == "rls.c" else set()), source.name
        assert len(left) == len(set(left))
    assert total > 0


@pytest.mark.slow(but=NUMBERS)
@needs_emulator
@pytest.mark.parametrize("name", WRITTEN)
def test_nothing_is_allocated_and_the_library_is_sin_cos_and_tan(folders, tmp_path, name):
    allowed = on_board.MEMORY | (on_board.MATHEMATICS if "kinematic" in name else set())
    taken = on_board.undefined(folders(name), M7, tmp_path)
    assert taken <= allowed, taken - allowed
    # on the M4 a double is an integer of the compiler's own library
    taken = on_board.undefined(folders(name), M4, tmp_path)
    assert {s for s in taken if not s.startswith("__aeabi_")} <= allowed


@pytest.mark.slow
@needs_emulator
@pytest.mark.parametrize("name", WRITTEN)
def test_the_static_analyzer_finds_nothing(folders, tmp_path, name):
    for source in on_board.flying(folders(name)):
        # that an array is filled by a loop over all of its lanes, it does not see in rls.c
        blind = ["-Wno-analyzer-use-of-uninitialized-value"] if source.name == "rls.c" else []
        assert on_board.analyzed(source, M7, tmp_path, *blind) == ""


BAD = """
struct node { struct node *next; };
int length(const struct node *p) { int k = 0; while (p) { k++; p = p->next; } return k; }
int wait(volatile int *flag) { while (!*flag) { } return 1; }
int counted(int n, int k) { int s = k; for (int i = 0; i < n; i++) s += i * s; return s; }
int even(unsigned n, int k) { int s = k; for (unsigned i = 0; i != n; i += 2) s *= k; return s; }
int twice(int k) { return k < 2 ? 1 : twice(k - 1) + twice(k - 2); }
extern void *malloc(unsigned);
void *taken(void) { return malloc(8); }
"""


@needs_emulator
def test_the_tools_see_what_they_look_for(tmp_path):
    (tmp_path / "bad.c").write_text(BAD)
    work = tmp_path / "work"
    work.mkdir()
    loops, left = on_board.uncounted(tmp_path / "bad.c", M4, work)
    assert loops >= 4
    assert {"length", "wait", "even"} <= set(left)
    assert "counted" not in left
    found = on_board.calls(tmp_path, M4, work)
    assert found.recursive == {"twice"}
    assert on_board.undefined(tmp_path, M4, work) == {"malloc"}
    (tmp_path / "bad.c").write_text("int f(int n) { volatile char a[n]; a[0] = 1; return a[0]; }")
    with pytest.raises(subprocess.CalledProcessError):
        on_board.calls(tmp_path, M4, work)
    (tmp_path / "bad.c").write_text("int f(int n) { int *p = 0; if (n) return *p; return 0; }")
    assert "NULL" in on_board.analyzed(tmp_path / "bad.c", M4, work)


# --- files and command ---------------------------------------------------------------------------


def test_the_makefile_is_rewritten_unless_somebody_elses(tmp_path):
    names = [f.name for f in write_board(tmp_path, M7)]
    assert names == ["startup.c", "measure.h", "mps2.ld", "Makefile"]
    assert "TARGET ?= cortex-m7" in (tmp_path / "Makefile").read_text()
    write_board(tmp_path, M4)
    assert "TARGET ?= cortex-m4" in (tmp_path / "Makefile").read_text()
    (tmp_path / "Makefile").write_text("all:\n")
    assert len(write_board(tmp_path, M4)) == 3
    assert (tmp_path / "Makefile").read_text() == "all:\n"
    with pytest.raises(UnknownNameError, match="cortex-m4"):
        write_board(tmp_path, "cortex-m3")


def test_the_command_writes_a_folder_for_the_board(tmp_path, capsys):
    TABLES["gains"]().save(tmp_path / "c.json")
    model, out = ["--model", str(tmp_path / "c.json")], ["--out", str(tmp_path / "onboard")]
    assert main(["export", "controller", *model, *out, "--target", "cortex-m7"]) == 0
    assert main(["export", "monitor", *model, *out, "--target", "cortex-m7"]) == 0
    assert {f.name for f in (tmp_path / "onboard").iterdir()} >= {
        "controller.c",
        "monitor.c",
        "Makefile",
        "board",
    }
    assert main(["export", "c", "--target", "cortex-m7"]) == 1
    assert "--target" in capsys.readouterr().err


@pytest.mark.slow
@needs_emulator
def test_controller_and_monitor_in_one_folder_are_one_library(tmp_path):
    write_controller(TABLES["position"](), tmp_path)
    write_monitor(HypothesisMonitor.of(TABLES["position"]()), tmp_path)
    write_board(tmp_path, M4)
    assert all(run.passed for run in checked(tmp_path, M4).values())
    text, data = on_board.size(tmp_path, M4)
    assert text > 4 * TABLES["position"]().matrices.size
    assert data == 0
