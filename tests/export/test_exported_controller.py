"""A controller as C compiles without a warning, freestanding, and gives the bits of Python over any
flight.
"""

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight.tables import MACH, InFlight, over, static, table, velocity

from studies.cli import main
from symheli import TableController
from symheli.errors import InputError
from symheli.export import write_controller
from symheli.flight import ParameterMonitor
from symheli.values import Signal

CC = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
EXACT = "-ffp-contract=off"
MONITOR = ParameterMonitor(lag=0.1, frozen=0.5, hold=0.3, fallback=4.0)
RATES = ("d_lon_rate", "d_lat", "d_col_rate", "d_ped_rate")
TABLES = {
    "position": lambda: table(10, 33, monitor=MONITOR, follow="reading"),
    "rates": lambda: table(5, 8, outputs=RATES, monitor=MONITOR, follow="reading"),
    "gains": lambda: static(0.3, monitor=MONITOR, limits={"d_lat": (-0.1, 0.05)}),
    "gains of four": lambda: table(0, (0.0, 0.3, 7.0, 13.0), limit=None),
    "no anti-windup": lambda: table(3, 3, correction=0, follow="reading"),
    "over Mach": lambda: over(MACH, 9),
    "reads its command": lambda: velocity(follow="reading"),
    "one output": lambda: table(2, 2, outputs=("d_ped",), limit=0.02),
}


@pytest.fixture(params=TABLES)
def controller(request):
    return TABLES[request.param]()


def built(folder, name, flags=(EXACT,)):
    for source, out, more in (
        ((f"{name}.c",), "m.o", ("-ffreestanding", "-c")),
        ((f"{name}_check.c", "m.o"), "check", ("-lm",)),
    ):
        subprocess.run([CC, *STRICT, *flags, *source, *more, "-o", out], cwd=folder, check=True)
    return subprocess.run([str(folder / "check")], capture_output=True, text=True)


class InC:
    """The compiled controller with the methods of `InFlight`."""

    ROOM = 1024
    """Numbers of 32 bits that hold a state."""

    def __init__(self, controller, folder, flags):
        write_controller(controller, folder, "own")
        library = folder / "own.so"
        command = [CC, *STRICT, *flags, "-shared", "-fPIC", "own.c", "-o", str(library)]
        subprocess.run(command, cwd=folder, check=True)
        self._code, self._outputs = ctypes.CDLL(str(library)), controller.outputs
        self._state = np.full(self.ROOM, np.nan, np.float32)
        self._code.own_init(self._at(self._state))
        assert np.isnan(self._state[-1])

    def reset(self, command=None):
        if command is None:
            self._code.own_reset(self._at(self._state))
        else:
            self._code.own_enter(self._at(self._state), self._at(command))

    def fly_axes(self, axes):
        bits = sum(1 << i for i, y in enumerate(self._outputs) if y in axes)
        self._code.own_set_axes(self._at(self._state), ctypes.c_uint32(bits))

    def update(self, measured, reference, trim, airspeed, *, valid=True, others=None):
        out = np.zeros(len(self._outputs), np.float32)
        self.status = self._code.own_update(
            self._at(self._state),
            *(self._at(v) for v in (measured, reference, trim)),
            None if others is None else self._at(others),
            ctypes.c_float(airspeed),
            ctypes.c_int(valid),
            self._at(out),
        )
        return out

    @staticmethod
    def _at(array):
        return ctypes.c_void_p(array.ctypes.data)


def flights(controllers, samples, seed=0):
    """The same random flight under each: commands (samples, ny) and statuses."""
    rng = np.random.default_rng(seed)
    first = controllers[0]
    nu, ny = len(first.inputs), len(first.outputs)
    commands, statuses = [[] for _ in controllers], [[] for _ in controllers]
    airspeed, others, size, valid = np.float32(5.0), None, 0.1, True
    for _ in range(samples):
        draw = rng.random()
        what, argument = None, None
        if draw < 0.01:
            what, argument = "reset", None
        elif draw < 0.02:
            what, argument = "reset", (0.1 * rng.standard_normal(ny)).astype(np.float32)
        elif draw < 0.05:
            what = "fly_axes"
            argument = [y for y in first.outputs if rng.random() < 0.6]
        elif draw < 0.08:
            size = rng.choice([1e-3, 0.1, 3.0])
        elif draw < 0.10:
            others = None if others is not None else np.zeros(ny, np.float32)
        elif draw < 0.13:
            airspeed = np.float32(rng.choice([0.0, 13.0, 40.0, -1.0, np.nan, np.inf, 6.5]))
        elif draw < 0.15:
            valid = not valid or rng.random() < 0.5
        if rng.random() < 0.8:
            airspeed = np.float32(airspeed + 0.1 * rng.standard_normal())
            airspeed = airspeed if np.isfinite(airspeed) and rng.random() < 0.99 else np.float32(5)
        given = [
            (s * rng.standard_normal(n)).astype(np.float32)
            for s, n in ((size, nu), (0.1 * size, nu), (0.02, ny))
        ]
        if rng.random() < 0.005:
            given[rng.integers(3)][0] = rng.choice([np.nan, np.inf, 3e38])
        if others is not None:
            others = (0.1 * rng.standard_normal(ny)).astype(np.float32)
            others[0] = np.nan if rng.random() < 0.01 else others[0]
        for controller, said, status in zip(controllers, commands, statuses, strict=True):
            if what:
                getattr(controller, what)(argument)
            said.append(controller.update(*given, airspeed, valid=valid, others=others))
            status.append(int(controller.status))
    return [np.array(said) for said in commands], statuses


@pytest.mark.slow(but="gains")
@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_the_check_beside_it_finds_no_other_bit(tmp_path, controller):
    files = write_controller(controller, tmp_path, "own")
    assert [f.name for f in files] == ["own.h", "own.c", "own_check.c"]
    done = built(tmp_path, "own")
    ny = len(controller.outputs)
    assert done.returncode == 0, done.stdout
    assert f"240 samples, {240 * ny} of {240 * ny} commands equal" in done.stdout
    assert "0 other statuses" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_c_gives_the_bits_of_python_over_any_flight(tmp_path, controller):
    compiled = InC(controller, tmp_path, (EXACT,))
    (python, c), (said, in_c) = flights([InFlight(controller), compiled], 6000)
    np.testing.assert_array_equal(c.view(np.uint32), python.view(np.uint32))
    assert in_c == said
    met = set(said)
    assert {0, 8} <= {status & 9 for status in met}  # none are all saturated, some are held
    assert any(status & 4 for status in met)
    if controller.limits:
        assert any(status & 1 for status in met)
    assert np.isfinite(python).all()


@pytest.mark.slow
@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_a_compiler_that_contracts_products_and_sums_changes_the_last_digits_only(tmp_path):
    controller = TABLES["position"]()
    write_controller(controller, tmp_path, "own")
    fast = ("-ffp-contract=fast", "-march=native")
    done = built(tmp_path, "own", fast)
    assert done.returncode == 0, done.stdout  # to 1e-5, as the check says
    (python, c), (said, in_c) = flights(
        [InFlight(controller), InC(controller, tmp_path, fast)], 2000
    )
    assert in_c == said
    assert np.abs(c - python).max() <= 1e-5 * np.abs(python).max()


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_the_check_notices_another_number(tmp_path):
    controller = TABLES["position"]()
    write_controller(controller, tmp_path)
    source, number = tmp_path / "controller.c", controller.matrices[16, 2, 3]
    text = source.read_text()
    assert float(number).hex() + "f" in text
    source.write_text(text.replace(float(number).hex() + "f", float(number + 0.01).hex() + "f"))
    assert built(tmp_path, "controller").returncode == 1


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_it_is_not_compiled_with_arithmetic_that_knows_no_nan(tmp_path):
    write_controller(TABLES["gains"](), tmp_path)
    done = subprocess.run(
        [CC, "-std=c99", "-ffast-math", "-c", "controller.c"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode != 0
    assert "without -ffast-math" in done.stderr


ARDUPILOT = """
#include <cstdint>
#include "controller.h"
struct Vector3f { float x, y, z; Vector3f(float a, float b, float c) : x(a), y(b), z(c) {} };
struct AP_Motors {
    enum class SpoolState { SHUT_DOWN, GROUND_IDLE, SPOOLING_UP, THROTTLE_UNLIMITED };
    SpoolState get_spool_state() const { return SpoolState::THROTTLE_UNLIMITED; }
    float get_roll() const { return 0; }
    float get_pitch() const { return 0; }
    float get_yaw() const { return 0; }
    float get_throttle() const { return 0; }
};
struct AP_AHRS { bool airspeed_TAS(float &speed) const { speed = 5; return true; } };
namespace AP { AP_AHRS &ahrs() { static AP_AHRS own; return own; } }
namespace AP_HAL { uint32_t micros() { return 0; } }
struct AC_CustomControl_LPV {
    void reset();
    Vector3f update();
    void read_states(float *) {}
    void read_trim(float *, float *) {}
    uint32_t flown() { return 7; }
    float collective(float throttle) { return throttle; }
    float cyclic_travel = 0.1f, tail_travel = 0.3f;
    AP_Motors *_motors;
    controller_state _own;
    float _command[CONTROLLER_NY];
    uint32_t _last;
    bool _enter;
};
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler")
def test_the_backend_of_the_page_compiles_around_it(tmp_path):
    """Against declarations as ArduPilot has them."""
    write_controller(TABLES["position"](), tmp_path)
    page = (Path(__file__).resolve().parents[2] / "docs" / "autopilot.md").read_text()
    (code,) = re.findall(r"```cpp\n(.*?)```", page, re.DOTALL)
    (tmp_path / "backend.cpp").write_text(ARDUPILOT + code)
    command = ["g++", "-std=c++11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "backend.cpp"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_header_says_what_it_is(tmp_path):
    controller = replace(TABLES["rates"](), fade=0.7)
    header = write_controller(controller, tmp_path, "own")[0].read_text()
    for said in (
        "#define OWN_NX 5 /* states */",
        "#define OWN_DT 0.02f /* s between two samples */",
        "#define OWN_U_phi 6 /* rad */",
        "#define OWN_Y_d_lon 0 /* rad, -0.2 to 0.2, integrates */",
        "#define OWN_Y_d_lat 1 /* rad, -0.2 to 0.2 */",
        "straight between 8 values of airspeed from 0 to 13 m/s",
        "moves at 3 m/s^2 at most",
        "fades with 0.7 s",
        "as its sensor reads it",
        "int own_update(own_state *s",
    ):
        assert said in header, said


def test_the_header_names_the_parameter_that_the_table_is_over(tmp_path):
    odd = replace(over(MACH, 9), parameter=Signal("Mach */ number", "1"), rate=0.05)
    header, code, _ = (file.read_text() for file in write_controller(odd, tmp_path, "own"))
    for said in (
        "Controller in a table over Mach * / number, for every 0.02 s",
        "straight between 9 values of Mach * / number from 0.2 to 0.9\n",
        "moves at 0.05 1/s at most",
        "Mach * / number (1) as it is commanded",
        "float parameter, int parameter_valid",
        "OWN_PARAMETER = 2",
    ):
        assert said in header, said
    assert "airspeed" not in (header + code).lower()
    header = write_controller(velocity(), tmp_path, "own")[0].read_text()
    assert (
        "OWN_U_d_lat_command 2 /* rad, in force, its trim before one is; reference: the trim */"
        in header
    )


def test_what_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InputError, match="C identifier"):
        write_controller(TABLES["gains"](), tmp_path, "a b")
    with pytest.raises(InputError, match=r"TableController\.of\(model\)"):
        write_controller(TABLES["gains"]().model, tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_command_writes_it_and_says_what_it_needs(tmp_path, capsys):
    controller = TABLES["gains"]()
    controller.save(tmp_path / "c.json")
    out = tmp_path / "c"
    arguments = ["export", "controller", "--model", str(tmp_path / "c.json"), "--out", str(out)]
    assert main(arguments) == 0
    write_controller(TableController.load(tmp_path / "c.json"), tmp_path / "d")
    for name in ("controller.h", "controller.c", "controller_check.c"):
        assert (out / name).read_text() == (tmp_path / "d" / name).read_text()
    assert main(["export", "controller"]) == 1
    assert "TableController.save" in capsys.readouterr().err
    (tmp_path / "c.json").write_text("{")
    assert main(arguments) == 1
    assert "not a whole file of 'symheli table controller'" in capsys.readouterr().err
