"""Exported FMUs are valid FMI 3.0 and fly as `fly` does; a master may step them as it likes."""

import shutil
import subprocess
import zipfile
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

import identification as idn
import symheli
from identification.export import write_identifier_fmu
from studies.cli import main
from symheli.codegen.compile import compiler
from symheli.errors import InputError
from symheli.export import write_controller_fmu, write_helicopter_fmu
from symheli.export.fmu import HERE, Fmu, Variable
from symheli.flight.course import Clock, Course
from symheli.values import Signal

fmpy = pytest.importorskip("fmpy")
from fmpy.fmi3 import FMU3Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

CC = compiler()
needs_compiler = pytest.mark.skipif(CC is None, reason="no C compiler")
ERROR = 3
DT = 0.02
ARX = idn.LPVARX("q", "d_lon", "airspeed", na=2, nb=2, delay=1, basis=idn.Polynomial(2, 0.0, 13.0))
UNITS = {"q": "rad/s", "d_lon": "rad", "airspeed": "m/s"}


@pytest.fixture(scope="module")
def table(ideal):
    lqr = symheli.flight.gain_scheduled_lqr(ideal, 0.0, 8.0, dt=DT, points=5)
    limits = {name: (-t, t) for name, t in zip(ideal.inputs, ideal.travel, strict=True)}
    return symheli.TableController.of(lqr.scheduled_controller.model, 17, limits=limits)


@pytest.fixture(scope="module")
def rls():
    return idn.RecursiveLeastSquares(ARX, 0.999, precision="single")


@pytest.fixture(scope="module")
def files(ideal, table, rls, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmu")
    return {
        "helicopter": write_helicopter_fmu(ideal, folder / "helicopter.fmu"),
        "controller": write_controller_fmu(table, folder / "controller.fmu"),
        "identifier": write_identifier_fmu(rls, UNITS, DT, folder / "identifier.fmu"),
    }


class Slave:
    """An instance of an FMU, its variables by name."""

    def __init__(self, file, folder, name="one"):
        self.description = fmpy.read_model_description(str(file))
        self.at = {v.name: v.valueReference for v in self.description.modelVariables}
        if not (folder / "modelDescription.xml").exists():
            fmpy.extract(str(file), str(folder))
        self.said = []
        self.fmu = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.fmu.instantiate(logMessage=lambda *words: self.said.append(words[-1].decode()))

    def started(self, time=0.0, **values):
        self.set(**values)
        self.fmu.enterInitializationMode(startTime=time)
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values):
        self.fmu.setFloat64([self.at[name] for name in values], list(values.values()))

    def get(self, *names):
        return np.array(self.fmu.getFloat64([self.at[name] for name in names]))

    def step(self, time, step):
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=step)

    def end(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture
def opened(files, tmp_path):
    """An instance of one kind; all are freed at the end."""
    made = []

    def of(kind, name="one"):
        made.append(Slave(files[kind], tmp_path / kind, name))
        return made[-1]

    yield of
    for slave in made:
        if slave.fmu.component:
            slave.fmu.freeInstance()


@needs_compiler
@pytest.mark.parametrize("kind", ["helicopter", "controller", "identifier"])
def test_it_is_valid_and_runs_as_it_comes(files, kind):
    assert validate_fmu(str(files[kind])) == []
    end = fmpy.simulate_fmu(str(files[kind]), stop_time=0.2, output_interval=DT)[-1]
    assert np.isfinite(list(end)).all()


@needs_compiler
def test_hover_stays_hover(opened):
    slave = opened("helicopter").started()
    before = slave.get("u", "v", "w", "p", "q", "r", "q0", "q1", "q2", "q3")
    for k in range(50):
        slave.step(k * DT, DT)
    after = slave.get("u", "v", "w", "p", "q", "r", "q0", "q1", "q2", "q3")
    np.testing.assert_allclose(after, before, atol=1e-9)  # a trim ends within 1e-9


# --- flights --------------------------------------------------------------------------------------

SCHEDULE = symheli.AirspeedSchedule.transition(0.0, 6.0, acceleration=1.5, hold=1.0)


def cosimulated(heli, table, opened, name="one", wind=(0.0, 0.0, 0.0)):
    """States of the quaternion form at every sample of `SCHEDULE`: first the controller's step,
    then the helicopter's, with the trims of the schedule.
    """
    plan = symheli.FlightPlan(SCHEDULE, controller=table)
    course = Course.of(heli, plan, Clock.of(plan, DT))
    plant, pilot = opened("helicopter", name), opened("controller", name)
    x0, u0 = course.reference[0][: len(heli.states)], course.reference[0][len(heli.states) :]
    start = symheli.physics.attitude.flight_state(x0)
    plant.started(**dict(zip(heli.flight_states, start, strict=True)))
    pilot.started(**{f"trim_{s}": u for s, u in zip(heli.inputs, u0, strict=True)})
    plant.set(**dict(zip(("w_n", "w_e", "w_d"), wind, strict=True)))
    found = []
    seen = [str(s) for s in table.inputs]
    for k, (row, p) in enumerate(zip(course.reference, course.p, strict=True)):
        found.append(plant.get(*map(str, heli.flight_states), "phi", "theta", "psi", "airspeed"))
        reference = dict(zip(map(str, (*heli.states, *heli.inputs)), row, strict=True))
        pilot.set(
            **{f"measured_{s}": v for s, v in zip(seen, plant.get(*seen), strict=True)},
            **{f"reference_{s}": reference[s] for s in seen},
            **{f"trim_{s}": reference[str(s)] for s in heli.inputs},
            airspeed=p[0],
        )
        pilot.step(k * DT, DT)
        plant.set(
            **dict(zip(map(str, heli.inputs), pilot.get(*map(str, heli.inputs)), strict=True))
        )
        plant.step(k * DT, DT)
    return np.array(found)


@pytest.mark.slow
@needs_compiler
def test_helicopter_and_controller_fly_as_fly_does(ideal, table, opened):
    record = symheli.fly(ideal, SCHEDULE, controller=table)
    found = cosimulated(ideal, table, opened)
    names = [*map(str, ideal.flight_states), "phi", "theta", "psi", "airspeed"]
    shared = ["u", "v", "w", "p", "q", "r", "a1", "b1", "phi", "theta", "airspeed"]
    flown = record.columns(shared)
    assert len(found) == len(flown)
    error = np.abs(found[:, [names.index(s) for s in shared]] - flown).max(axis=0)
    assert error.max() < 1e-9, dict(zip(shared, error, strict=True))
    assert np.ptp(flown[:, 0]) > 5.0


@needs_compiler
def test_two_instances_at_once_share_nothing(opened):
    """Step by step in turn, and each as if it were alone."""
    for kind in ("helicopter", "controller", "identifier"):
        names = [v.name for v in opened(kind).description.modelVariables if v.causality == "input"]

        def flown(slaves, names=names):
            for k in range(30):
                for i, slave in enumerate(slaves):
                    slave.set(**{n: 0.05 * np.sin(k + j + i) for j, n in enumerate(names)})
                    slave.step(k * DT, DT)
            return [s.get(*(n for n in s.at if n not in ("time", "status"))) for s in slaves]

        together = flown([opened(kind, name).started() for name in ("one", "two")])
        alone = flown([opened(kind).started()])
        np.testing.assert_array_equal(together[0], alone[0])
        assert np.abs(together[1] - together[0]).max() > 0


@needs_compiler
def test_the_master_may_step_as_it_likes(opened, ideal):
    """With constant inputs the state after 0.14 s differs by the error of the integration only."""
    inputs = dict(zip(map(str, ideal.inputs), (0.02, -0.01, 0.1, 0.1), strict=True))
    ends = {}
    for milliseconds in (1, 7, 20, 140):
        slave = opened("helicopter").started(**inputs, w_n=2.0)
        steps = np.arange(0, 140, milliseconds) / 1e3
        for start, end in pairwise([*steps, 0.14]):
            slave.step(start, end - start)
        ends[milliseconds] = slave.get(*map(str, ideal.flight_states))
        assert slave.get("time") == pytest.approx([0.14])
    scale = np.maximum(np.abs(ends[1]), 1.0)
    for milliseconds in (7, 20, 140):
        # Runge-Kutta of 5 ms at most, flapping of some 20 ms
        assert (np.abs(ends[milliseconds] - ends[1]) / scale).max() < 1e-5
    assert np.abs(ends[140] - ends[7]).max() > 0


@needs_compiler
@pytest.mark.parametrize("milliseconds", [1, 7, 20, 60])
def test_a_controller_keeps_its_own_clock(table, opened, milliseconds):
    """It is sampled at 0, 20, 40 .. ms with what was set before the step in which they lie."""
    rng, slave = np.random.default_rng(0), opened("controller").started(1.0)
    edges = np.arange(0, 420, milliseconds)
    state, sample, commands = table.init(), 0, []
    nu = len(table.inputs)
    for start in edges:
        given = (0.02 * rng.standard_normal(nu)).astype(np.float32)
        slave.set(**{f"measured_{s}": float(v) for s, v in zip(table.inputs, given, strict=True)})
        slave.step(1.0 + start / 1e3, milliseconds / 1e3)
        while 20 * sample < start + milliseconds:
            u, state = table.update(state, given, np.zeros(nu), np.zeros(4), 4.0)
            sample += 1
        commands.append(u)
        np.testing.assert_array_equal(slave.get(*map(str, table.outputs)), u)
    assert sample == (edges[-1] + milliseconds + 19) // 20
    assert np.ptp(commands) > 0.003


@needs_compiler
def test_an_identifier_learns_what_python_learns(rls, opened):
    rng, slave, online = np.random.default_rng(0), opened("identifier").started(), rls.online()
    signals = [*map(str, (*ARX.outputs, *ARX.inputs, *ARX.parameters))]
    for k in range(60):
        row = [*rng.standard_normal(2), rng.uniform(0, 13)]
        slave.set(**dict(zip(signals, row, strict=True)))
        slave.step(k * DT, DT)
        online.update([row[0]], [row[1]], row[2])
    names = [f"theta_{i}_q" for i in range(ARX.n_regressors)]
    np.testing.assert_array_equal(slave.get(*names), np.ravel(online.coefficients))
    assert np.abs(slave.get(*names)).max() > 0.01


@needs_compiler
def test_outputs_before_the_start_are_those_of_what_is_set_by_then(opened):
    """A master that initializes a loop reads them; they were zero, or of the values before."""
    slave, half = opened("helicopter"), 0.2
    slave.fmu.enterInitializationMode()
    slave.set(q0=np.cos(half), u=5.0, w_n=-1.0)
    slave.get("u")  # in between
    slave.set(q2=np.sin(half))
    before = slave.get("theta", "airspeed", "q2")
    np.testing.assert_allclose(before[0], 2 * half, atol=0.01)  # q1 and q3 are those of hover
    slave.fmu.exitInitializationMode()
    np.testing.assert_array_equal(slave.get("theta", "airspeed", "q2"), before)
    pilot = opened("controller")
    pilot.fmu.enterInitializationMode()
    pilot.set(trim_d_lon=0.1)
    assert pilot.get("d_lon") == 0.1


# --- what is refused ------------------------------------------------------------------------------


@needs_compiler
@pytest.mark.parametrize("kind", ["helicopter", "controller", "identifier"])
def test_what_is_wrong_is_an_error_with_a_message(opened, kind):
    slave = opened(kind).started()
    name = next(v.name for v in slave.description.modelVariables if v.causality == "input")
    for act, message in (
        (lambda: slave.set(**{name: np.nan}), f"{name} is set to a value that is not finite"),
        (lambda: slave.set(**{name: np.inf}), "not finite"),
        (lambda: slave.fmu.getFloat64([10_000]), "no such value reference"),
        (lambda: slave.fmu.setFloat64([10_000], [0.0]), "no such value reference"),
        (lambda: slave.fmu.getInt32([0]), "no such value reference"),
        (lambda: slave.fmu.setFloat64([0], [1.0]), "time cannot be set now"),
        (lambda: slave.fmu.getBoolean([1]), "fmi3GetBoolean is not supported"),
        (lambda: slave.step(5.0, DT), "does not begin where"),
        (lambda: slave.step(0.0, -DT), "no positive number"),
        (lambda: slave.step(0.0, np.nan), "no positive number"),
        (lambda: slave.fmu.exitInitializationMode(), "not allowed now"),
    ):
        with pytest.raises(fmpy.fmi1.FMICallException) as found:
            act()
        assert found.value.status == ERROR
        assert message in slave.said[-1]
        assert slave.said[-1].startswith("one: ")
    slave.step(0.0, DT)  # and goes on
    slave.fmu.terminate()
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.step(DT, DT)


@needs_compiler
@pytest.mark.parametrize("kind", ["helicopter", "controller", "identifier"])
def test_a_step_of_years_and_a_time_beyond_all_digits_are_errors(opened, kind):
    """Instead of a call that never returns, and of a time that stands still."""
    for start, step, message in ((0.0, 1e9, "too long"), (1e17, DT, "too short for a time")):
        slave = opened(kind).started(start)
        with pytest.raises(fmpy.fmi1.FMICallException):
            slave.step(start, step)
        assert message in slave.said[-1]


@needs_compiler
def test_a_state_that_is_none_and_an_attitude_that_is_none_are_errors(opened):
    slave = opened("helicopter")
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.started(q0=0.0, q1=0.0, q2=0.0, q3=0.0)
    assert "not of length 1" in slave.said[-1]
    slave.fmu.reset()
    slave.started(u=1e200)
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.step(0.0, DT)
    assert "a state is not finite" in slave.said[-1]
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.set(u=1.0)
    slave.fmu.reset()
    slave.started().step(0.0, DT)
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.set(u=1.0)
    assert "u cannot be set now" in slave.said[-1]


@needs_compiler
@pytest.mark.parametrize("kind", ["helicopter", "controller", "identifier"])
def test_reset_and_a_kept_state_begin_again_to_the_last_bit(opened, kind):
    slave = opened(kind)
    outputs = [
        v.name
        for v in slave.description.modelVariables
        if v.causality == "output" and v.type == "Float64"
    ]
    inputs = [v.name for v in slave.description.modelVariables if v.causality == "input"]

    def flown(first, rng):
        for k in range(first, first + 20):
            slave.set(**{name: 0.1 * rng.random() for name in inputs})
            slave.step(k * DT, DT)
        return slave.get(*outputs)

    once = flown(0, np.random.default_rng(0)) if slave.started() else None
    kept = slave.fmu.getFMUState()
    later = flown(20, np.random.default_rng(1))
    slave.fmu.setFMUState(kept)
    np.testing.assert_array_equal(flown(20, np.random.default_rng(1)), later)
    slave.fmu.freeFMUState(kept)
    slave.fmu.reset()
    slave.started()
    np.testing.assert_array_equal(flown(0, np.random.default_rng(0)), once)
    assert np.abs(later - once).max() > 0


@needs_compiler
def test_a_foreign_token_makes_no_instance(files, tmp_path):
    text = fmpy.read_model_description(str(files["helicopter"])).guid
    slave = Slave(files["helicopter"], tmp_path / "h")
    slave.fmu.guid = "{of another}"
    with pytest.raises(Exception, match="Failed to instantiate"):
        slave.fmu.instantiate(logMessage=lambda *words: slave.said.append(words[-1].decode()))
    assert "token" in slave.said[-1]
    assert text == Slave(files["helicopter"], tmp_path / "h").description.guid


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize("kind", ["helicopter", "controller", "identifier"])
def test_the_sources_alone_compile_strictly_under_a_prefix(files, tmp_path, kind):
    with zipfile.ZipFile(files[kind]) as archive:
        archive.extractall(tmp_path)
    description = fmpy.read_model_description(str(files[kind]))
    (made,) = fmpy.model_description.read_build_description(str(tmp_path))
    names = [file for fileset in made.sourceFileSets for file in fileset.sourceFiles]
    assert names[0] == "fmu.c"
    assert made.modelIdentifier == description.coSimulation.modelIdentifier
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-DFMI3_FUNCTION_PREFIX=own_"]
    for name in names:
        command = ["gcc", *flags, "-c", name, "-o", f"{name}.o"]
        subprocess.run(command, cwd=tmp_path / "sources", check=True)
    listing = subprocess.run(
        ["nm", "fmu.c.o"], cwd=tmp_path / "sources", check=True, capture_output=True, text=True
    ).stdout
    assert " T own_fmi3DoStep" in listing
    assert " T fmi3" not in listing


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cmake") is None or CC is None, reason="no cmake, or no compiler")
def test_fmpy_builds_and_runs_the_sources(files, tmp_path):
    """By its own CMake project, from the description of the build."""
    from fmpy.build import build_platform_binary

    folder, work = tmp_path / "fmu", tmp_path / "work"
    work.mkdir()
    fmpy.extract(str(files["controller"]), str(folder))
    shutil.rmtree(folder / "binaries")
    build_platform_binary(folder, build_dir=work)
    end = fmpy.simulate_fmu(str(folder), stop_time=0.2, output_interval=DT)[-1]
    assert np.isfinite(list(end)).all()


def test_without_a_compiler_the_sources_stand_alone(ideal, tmp_path, monkeypatch):
    import symheli.codegen.compile

    monkeypatch.setattr(symheli.codegen.compile, "compiler", lambda: None)
    file = write_helicopter_fmu(ideal, tmp_path / "h.fmu")
    names = zipfile.ZipFile(file).namelist()
    assert "sources/buildDescription.xml" in names
    assert not [name for name in names if name.startswith("binaries")]
    assert validate_fmu(str(file)) == []


def test_what_cannot_be_written_is_refused(ideal, tmp_path):
    with pytest.raises(InputError, match=r"ends in \.fmu"):
        write_helicopter_fmu(ideal, tmp_path / "h.zip")
    with pytest.raises(InputError, match="C identifier"):
        write_helicopter_fmu(ideal, tmp_path / "h.fmu", name="a b")
    twice = [Variable(Signal("a"), "input"), Variable(Signal("a"), "output")]
    with pytest.raises(InputError, match=r"\ba\b"):
        Fmu("a", "", twice, tmp_path / "x.c", {}, {}, 0.02)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("odd", ['q"', "q\\", "q\n", "q\x01"])
def test_names_that_c_and_xml_cannot_have_are_refused(odd, tmp_path):
    with pytest.raises(InputError, match="an FMU needs a name without"):
        write_controller_fmu(_of_zeros((odd, "p"), "d_lat"), tmp_path / "c.fmu")
    variables = [Variable(Signal("time"), "output")]
    with pytest.raises(InputError, match="repeated: time"):
        Fmu("odd", "", variables, tmp_path / "none.c", {}, {}, DT)


def test_names_with_spaces_stay_whole():
    """A line that ended within a name did not compile."""
    for width in range(8, 100):
        variables = [Variable(Signal(name), "input") for name in ("m" * width, "d lat")]
        files = Fmu("spaces", "", variables, HERE / "fmu_controller.c", {}, {}, DT).files
        assert '"d lat"' in files["sources/fmu.c"]


def _of_zeros(inputs, output):
    matrices = np.zeros((2, 1, 1 + len(inputs)))
    return symheli.TableController((0.0, 13.0), matrices, (), inputs, (output,), DT)


def test_a_title_with_any_characters_is_valid_xml():
    about = 'A & B <"x"> \x01 \ufffe \ud800 \n'
    variables = [Variable(Signal("p", 'rad/s "&<'), "input")]
    files = Fmu("odd", about, variables, HERE / "fmu_controller.c", {}, {}, DT).files
    found = ElementTree.fromstring(files["modelDescription.xml"])
    assert found.get("description") == 'A & B <"x"> ? ? ? \n'


@pytest.mark.slow
@needs_compiler
def test_the_command_writes_all_three(table, tmp_path, capsys):
    table.save(tmp_path / "c.json")
    out = ["--out", str(tmp_path / "made.fmu")]
    assert main(["export", "fmu", "--of", "helicopter", "--airspeed", "6", *out]) == 0
    start = {
        v.name: v.start
        for v in fmpy.read_model_description(str(tmp_path / "made.fmu")).modelVariables
    }
    assert float(start["u"]) == pytest.approx(6.0, abs=0.1)
    assert (
        main(["export", "fmu", "--of", "controller", "--model", str(tmp_path / "c.json"), *out])
        == 0
    )
    assert validate_fmu(str(tmp_path / "made.fmu")) == []
    assert (
        main(["export", "fmu", "--of", "identifier", "--outputs", "q", "--period", "0.01", *out])
        == 0
    )
    assert validate_fmu(str(tmp_path / "made.fmu")) == []
    assert main(["export", "fmu", *out]) == 1
    assert "--of" in capsys.readouterr().err
    assert main(["export", "fmu", "--of", "controller", *out]) == 1
    assert main(["export", "fmu", "--of", "helicopter", "--outputs", "q", *out]) == 1
    assert "--outputs" in capsys.readouterr().err
