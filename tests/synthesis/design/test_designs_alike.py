"""Every design takes a plant, returns a controller, and says why where there is none."""

import inspect
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scheduled_plants import spring

import synthesis
from evidence.every_pair import DESIGNS, of_the_loop
from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError, SynthesisError
from synthesis import Controller, Plant, designs
from synthesis.design.lpv.estimator import Estimator

EVERY = {**DESIGNS, "estimator": synthesis.estimator}
"""The designs of the benchmark, and the observer, which commands nothing."""
REDUCES = {"bounded_truncation"}
"""Beside the designs: of a model, no controller."""
LOOPS = ("mixed_sensitivity", "ncfsyn", "loop_shaping", "coefficient_diagram")
"""Designs for the loop alone, without its weights."""
ADVICE = (
    r"add |take |name |give |choose |leave |lower |increase |measure |synthesis\.Plant|of a plant"
)


def plant(A=-1.0, B=(1, 0, 1), C=(1, 0, 1), D=((0, 0, 0), (0, 0, 1), (0, 0.1, 0)), dt=None):
    """x' = Ax + B(w, n, u) over a parameter p that may move, z = (C1 x, u), y = C2 x + n / 10."""
    A = np.atleast_2d(A)
    n = len(A)
    B, C = np.reshape(B, (n, 3)), np.reshape(C, (3, n))
    names = [f"x{i}" for i in range(n)], ["w", "n", "u"], ["z", "z_u", "y"]
    model = LPVStateSpace.constant(LinearModel(A, B, C, np.array(D), *names, dt), [MOVING])
    return Plant(model, ["w", "n"], ["z", "z_u"], ["u"], ["y"])


def all_states(given):
    """The plant with its states measured without noise."""
    model = given.nominal
    k, n = len(model.C), len(model.states)
    C = np.concatenate([model.C[:, :2], np.broadcast_to(np.eye(n), (k, n, n))], axis=1)
    D = np.concatenate([model.D[:, :2], np.zeros((k, n, 3))], axis=1)
    whole = replace(model, C=C, D=D, outputs=("z", "z_u", *model.states))
    return Plant(whole, ["w"], ["z", "z_u"], ["u"], model.states)


MOVING = spring().parameters[0]
TWO = {"A": np.diag([-1.0, 1.0]), "B": [[1, 0, 1], [1, 0, 1]], "C": [[1, 1], [0, 0], [1, 1]]}
"""Of two states, the second of them unstable."""
UNREACHED = plant(**TWO | {"B": [[1, 0, 1], [1, 0, 0]]})
UNSEEN = plant(**TWO | {"C": [[1, 1], [0, 0], [1, 0]]})
NO_STATES = plant(np.zeros((0, 0)), [], [])
SIGHT = [[0, 0], [0, 0], [1, 0]]
ILL_POSED = {
    "no control": Plant(plant().model, ["w", "n", "u"], ["z", "z_u"], [], ["y"]),
    "no measurement": Plant(plant().model, ["w", "n"], ["z", "z_u"], ["u"], []),
    "no disturbance": Plant(plant().model, [], ["z", "z_u"], ["u"], ["y"]),
    "no performance": Plant(plant().model, ["w", "n"], [], ["u"], ["y"]),
    "no weight": plant(D=np.zeros((3, 3))),
    "no states": NO_STATES,
    "entries of 1e200": plant(A=1e200),
    "inputs of 1e-200": plant(B=(1e-200, 0, 1e-200)),
    "inputs of 1e308": plant(B=(1e308, 0, 1e308)),
}
SLOWLY_REFUSED = {
    "an integrator that nothing shows": plant(A=0.0, C=(0, 0, 1)),
    "an oscillation that nothing drives": plant(
        [[0, 1], [-1, 0]], [[0] * 3, [0, 0, 1]], np.eye(3, 2)
    ),
    "a mode at half the sample frequency": plant(A=-1.0, dt=0.1),
}


def public():
    """Functions of `synthesis` and `synthesis.designs` that are written in rooms of designs."""
    every = {name: getattr(face, name) for face in (synthesis, designs) for name in face.__all__}
    found = {n: f for n, f in every.items() if inspect.isfunction(f)}
    rooms = ("synthesis.design.lti", "synthesis.design.lpv", "synthesis.structures")
    return {n: f for n, f in found.items() if f.__module__.startswith(rooms)}


def test_every_public_design_is_on_the_list():
    assert public().keys() == EVERY.keys() | REDUCES


@pytest.mark.parametrize("name", EVERY)
def test_a_design_takes_a_plant_and_returns_its_controller(name):
    own = all_states(plant()) if name == "state_feedback" else plant()
    made = EVERY[name](own)
    if name == "estimator":
        assert isinstance(made, Estimator)
        return
    assert isinstance(made, Controller)
    assert (made.model.inputs, made.model.outputs) == (own.measurements, own.controls)
    assert set(own.disturbances) <= set(made.plant.disturbances)
    assert made.closed().at(0.3).is_stable()


@pytest.mark.parametrize("name", LOOPS)
def test_a_design_for_the_loop_says_so_and_how_a_plant_is_given(name):
    first = inspect.getdoc(public()[name]).split("\n\nParameters")[0]
    assert "takes the loop alone" in first
    assert "select(inputs=plant.controls, outputs=plant.measurements)" in " ".join(first.split())
    assert "Controller" in first


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("case", ["unreached", "unseen"])
def test_where_no_controller_exists_the_reasons_are_raised(name, case):
    bad = {"unreached": UNREACHED, "unseen": UNSEEN}[case]
    if name == "estimator" and case == "unreached":
        assert EVERY[name](bad).promised > 0  # what is estimated need not be stabilised
        return
    if name == "state_feedback":
        if case == "unseen":
            return  # all states are measured
        bad = all_states(bad)
    with pytest.raises((SynthesisError, InputError), match=ADVICE) as caught:
        EVERY[name](bad)
    if name not in ("state_feedback", "coefficient_diagram"):  # a common factor: not for this plant
        assert isinstance(caught.value, SynthesisError)
        assert caught.value.reasons


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize(
    "case", [*ILL_POSED, *(pytest.param(case, marks=pytest.mark.slow) for case in SLOWLY_REFUSED)]
)
def test_an_ill_posed_plant_is_refused_in_words_or_has_a_controller(name, case):
    """Never a `LinAlgError`, a warning or None of linear algebra."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            said = EVERY[name]((ILL_POSED | SLOWLY_REFUSED)[case])
        except (InputError, SynthesisError) as error:
            said = str(error)
    assert isinstance(said, Controller | Estimator) or len(said.split()) > 5


@pytest.mark.parametrize("name", sorted(EVERY.keys() - {*LOOPS, "structured", "hinf", "h2"}))
def test_a_model_in_place_of_a_plant_is_refused(name):
    for wrong in (plant().nominal.at(0.5), None):
        with pytest.raises(InputError, match=r"synthesis\.Plant"):
            public()[name](wrong, *([[synthesis.objectives.L2()]] * (name == "multiobjective")))


def test_hinf_and_h2_take_a_plant_of_one_model_or_a_model():
    one, many = replace(plant(), model=plant().nominal.at(0.0)), spring()
    for design in (synthesis.hinf, synthesis.h2):
        made, model = design(one), one.nominal.at(0.0)
        found = design(
            model, ["u"], ["y"], disturbances=one.disturbances, performance=one.performance
        )
        np.testing.assert_array_equal(made.model.at(0.0).A, found.controller.A)
        with pytest.raises(InputError, match=r"depends on p.*output_feedback.*replace\(plant"):
            design(many)
        assert design(replace(many, model=many.nominal.at(0.5))).closed().at(0.0).is_stable()
        with pytest.raises(InputError, match="a plant names its channels"):
            design(one, ["u"], ["y"])
        for wrong in (model, None):
            with pytest.raises(InputError, match=r"synthesis\.Plant|a Plant"):
                design(wrong)
    assert synthesis.hinf(one).promised == pytest.approx(synthesis.hinf(one).optimum, rel=0.02)
    assert "norm of its loop" in str(synthesis.h2(one))


def test_a_point_design_on_a_plant_raises_its_reasons():
    found = designs.ncfsyn(of_the_loop(UNREACHED))
    assert found.controller is None
    with pytest.raises(SynthesisError, match="cannot stabilise it") as caught:
        Controller.of(UNREACHED, found)
    assert caught.value.reasons == found.reasons
