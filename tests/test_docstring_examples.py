"""Every exported callable shows how it is used, and what it shows is so.

The examples of a package start from the names that its own docstring makes.
"""

import doctest
import importlib
import inspect
import sys
import warnings

import pytest
from public_faces import faces, names, root_of
from public_faces import module as module_of
from reference import results

PACKAGES = faces(("symheli", "identification"))
SYNTHESIS = faces(("synthesis",))
FUNCTIONS_OF = (*faces(("symheli.lpv",)), "symheli.records")
"""Rooms whose classes are values of other rooms, or results: here the functions are shown."""


def shown(package):
    """Names that are documented with an example."""
    return module_of(package).__all__ if package == "symheli.records" else names(package)


PUBLIC = tuple(
    {
        thing
        for package in (*PACKAGES, *FUNCTIONS_OF, *SYNTHESIS)
        for name in shown(package)
        if isinstance(thing := getattr(importlib.import_module(package), name), type)
        and not getattr(thing, "_is_protocol", False)
    }
)
"""The classes that users meet."""

FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def exported():
    for package in (*PACKAGES, *FUNCTIONS_OF):
        module = importlib.import_module(package)
        for name in shown(package):
            thing = getattr(module, name)
            error = isinstance(thing, type) and issubclass(thing, Exception)
            if (
                callable(thing)
                and not error
                and (package in PACKAGES or not isinstance(thing, type))
            ):
                yield package, name


def run(text, where, names):
    """The names after the examples of a docstring; fails with the first that prints otherwise."""
    examples = doctest.DocTestParser().get_doctest(text, names, where, None, None)
    assert examples.examples, f"{where} has no example"
    runner, report = doctest.DocTestRunner(optionflags=FLAGS, verbose=False), []
    runner.run(examples, out=report.append, clear_globs=False)
    assert not runner.failures, "".join(report)
    return examples.globs


FLOOD = 2500
"""Characters that no public value may print at a prompt: a screen of 30 lines."""


def check_short(names):
    """Every value of a public class among the names shows itself in a few lines."""
    for name, value in names.items():
        if isinstance(value, PUBLIC) and not isinstance(value, type):
            assert len(repr(value)) <= FLOOD, f"{name}: {type(value).__name__} prints {value!r}"
            if hasattr(value, "_repr_html_"):
                table = value._repr_html_()
                assert table.startswith("<table>"), name
                assert "://" not in table, f"{name}: a table that loads something"


@pytest.fixture(scope="module")
def start():
    """What the docstring of each package makes."""
    made = {}

    def of(face):
        package = root_of(face)
        if package not in made:
            made[package] = run(importlib.import_module(package).__doc__, package, {})
        return dict(made[package])

    return of


LONG = (
    "identification.model-StateSpaceModel",
    "identification.judge-structure_bias",
    "synthesis-Certificate",
    "synthesis-Controller",
    "synthesis-Estimator",
    "synthesis-GainCurve",
    "synthesis-StructuredController",
    "synthesis.tubes-Tube",
    "synthesis-certify_sampled",
    "synthesis.tubes-coverage",
    "synthesis-decay_rate",
    "synthesis-estimator",
    "synthesis-frozen_gain",
    "synthesis.analysis-gain_against_rate",
    "synthesis-l2_gain",
    "synthesis.designs-lft_feedback",
    "synthesis-lower_bound",
    "synthesis-output_feedback",
    "synthesis.analysis-proven_around",
    "synthesis-stability",
    "synthesis-state_feedback",
    "synthesis-structured",
    "synthesis.tubes-tube",
    "synthesis.analysis-with_scheduling_error",
    "symheli.flight-FlightDataset",
    "symheli-LinearFamily",
    "symheli.integrate-simulate_batch",
    "symheli.steady-sweep_grid",
    "identification.methods-FilterError",
    "identification-FitForControl",
    "identification.model-KinematicModel",
    "identification.methods-OutputError",
    "identification-RigidBodyOnline",
    "identification-calibrate",
    "identification-fit_for_control",
    "identification.judge-validate",
    "symheli.lpv-balanced_truncation",
    "symheli.lpv.tools-simulate",
    "synthesis.robust-robust_margin",
    "synthesis.robust-worst_case_gain",
    "synthesis.robust-mu_synthesis",
    "synthesis.tubes-largest_gust",
    "synthesis.designs-loop_shaping",
    "synthesis-DwellTime",
    "synthesis.switching-SwitchedController",
    "synthesis.designs-bounded_truncation",
    "synthesis.switching-dwell_time",
    "synthesis.analysis-energy_to_peak",
    "synthesis-h2_gain",
    "synthesis-lqg",
    "symheli.records-check_kinematics",
)
"""Examples that take more than a second."""


@pytest.mark.slow(only=LONG)
@pytest.mark.parametrize(("package", "name"), exported())
def test_the_examples_of_an_exported_name_print_what_they_say(package, name, start):
    text = inspect.getdoc(getattr(importlib.import_module(package), name)) or ""
    where = f"{package}.{name}"
    assert "\nExamples\n--------\n" in text, f"{where} has no section Examples"
    check_short(run(text, where, start(package)))


RETURNED = sorted(
    {
        (package, home, found.__name__)
        for package in (*PACKAGES, *SYNTHESIS)
        for name in shown(package)
        for home, found in results(getattr(importlib.import_module(package), name))
        if found not in PUBLIC
    }
)
"""Classes without a public name: what public functions and methods return."""


@pytest.mark.parametrize(("package", "home", "name"), RETURNED)
def test_what_a_public_function_returns_is_documented(package, home, name, start):
    text = inspect.getdoc(getattr(importlib.import_module(home), name)) or ""
    assert text, f"{home}.{name} has no docstring"
    if ">>> " in text:
        check_short(run(text, f"{home}.{name}", start(package)))


WITHOUT = {"LoopShaping", "Status", "DesignStatus", "SCALINGS"}
"""Names without an example of their own: shown in those of what makes them."""

EXPLAINED = [
    (package, name)
    for package in SYNTHESIS
    for name in names(package)
    if name not in WITHOUT and callable(getattr(importlib.import_module(package), name))
]


@pytest.mark.slow(only=LONG)
@pytest.mark.parametrize(("package", "name"), EXPLAINED)
def test_an_example_needs_nothing_but_its_imports(package, name, start, tmp_path, monkeypatch):
    """And what the docstring of its package makes."""
    monkeypatch.chdir(tmp_path)
    thing = getattr(importlib.import_module(package), name)
    text = inspect.getdoc(thing) or ""
    assert ">>> " in text, f"{package}.{name} has no example"
    modules = sys.modules[thing.__module__], importlib.import_module(package)
    names = {**vars(modules[0]), **vars(modules[1]), **start(package)}
    test = doctest.DocTestParser().get_doctest(text, names, f"{package}.{name}", None, 0)
    told: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runner = doctest.DocTestRunner(verbose=False)
        failed = runner.run(test, out=told.append, clear_globs=False).failed
    assert not failed, "".join(told)
    check_short(test.globs)


@pytest.mark.parametrize(("package", "name"), [pair for pair in EXPLAINED if pair[1].islower()])
def test_a_public_function_describes_what_it_takes_and_returns(package, name):
    thing = getattr(importlib.import_module(package), name)
    text = inspect.getdoc(thing) or ""
    assert "Returns\n-------" in text
    for parameter in inspect.signature(thing).parameters:
        assert parameter in text.split("Parameters\n----------", 1)[1], parameter
