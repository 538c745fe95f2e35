"""What the report says first of a helicopter of one's own."""

import pytest

import symheli
from studies.transition.first_look import first_look
from studies.transition.tables import first_look as table


@pytest.mark.parametrize(
    ("changes", "answer"),
    [
        ({}, "It hovers and trims to 6 m/s within the travel of its controls; by itself it is sta"),
        ({"main_rotor.bar_lock_number": 5.0}, "unstable at every airspeed looked at (doubling"),
        ({"controls.d_ped": 0.2}, "It cannot hover within its controls"),
    ],
)
def test_hover_trims_and_stability_are_answered_in_a_sentence(ideal, changes, answer):
    heli = ideal.with_parameters(changes)
    family = symheli.sweep(heli, [0.0, 3.0, 6.0])
    travel = dict(zip(map(str, heli.inputs), map(float, heli.travel), strict=True))
    look = first_look(family, travel)
    assert answer in look.answer
    assert len(list(look.sentences())) == 3
    assert any("(stop)" in cell for row in table(look).rows for cell in row) == (not look.hovers)
