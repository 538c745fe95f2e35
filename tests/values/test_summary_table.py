"""What a notebook shows of a value with words of its own: its lines as a table."""

import re
from dataclasses import replace

import numpy as np

import identification
import symheli
import synthesis
from symheli.values.html_table import as_table

TEXT = """trimmed at 5 m/s
         value   unit
states
  u    4.99888    m/s
  phi  -0.0815    rad  -4.674 deg
"""


class Said:
    _repr_html_ = as_table

    def __str__(self):
        return TEXT


def test_columns_of_characters_become_cells_and_a_head_stands_over_them():
    html = Said()._repr_html_()
    rows = [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in re.findall(r"<tr>.*?</tr>", html)]
    assert rows == [
        ["trimmed at 5 m/s"],
        ["", "value", "unit", "", ""],
        ["states"],
        ["u", "4.99888", "m/s", "", ""],
        ["phi", "-0.0815", "rad", "-4.674", "deg"],
    ]
    assert 'colspan="5"' in html


def test_a_trim_shows_at_the_prompt_what_print_shows():
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    point = symheli.trim(heli, 5.0)
    assert repr(point) == str(point)
    assert "theta" in point._repr_html_()
    model = symheli.linearize(heli, 5.0)
    assert repr(model) == str(model)


def test_every_result_of_a_first_hour_draws_itself():
    import matplotlib.pyplot as plt

    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    schedule = symheli.AirspeedSchedule.transition(0.0, 2.0, acceleration=2.0, hold=0.5)
    record = symheli.fly(heli, schedule)
    family = symheli.sweep(heli, [2.0, 4.0, 6.0])
    lpv = family.interpolate(degree=2, rate=1.0).select(["v", "p", "phi", "b1"], ["d_lat"])
    gains = symheli.LinearModel.gain([[-0.02]], ["phi"], ["d_lat"])
    constant = symheli.LPVStateSpace.constant(replace(gains, dt=0.02), lpv.parameters)
    plant = synthesis.Plant(lpv, [], ["phi"], ["d_lat"], ["phi"])
    plant = plant.with_input_disturbance()
    loop = {("d_lat", "phi"): -0.02}
    arx = identification.LPVARX("phi", "d_lat", na=2, nb=2)
    results = (
        symheli.trim(heli, 5.0),
        family,
        lpv,
        schedule,
        record,
        symheli.derivatives(family),
        symheli.TableController.of(constant, 2),
        synthesis.Controller.of(plant, loop),
        synthesis.margin_table(lpv, loop, "d_lat"),
        synthesis.l2_gain(plant.close(loop), search=None),
        identification.fit(arx, record),
    )
    for result in results:
        axes = np.ravel(result.plot())
        figure = axes[0].figure
        assert any(ax.lines or ax.patches for ax in figure.axes), type(result).__name__
        assert figure.get_size_inches()[1] <= 9.0, type(result).__name__  # one screen
        plt.close(figure)


def test_a_flight_shows_what_was_commanded_and_flown():
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    schedule = symheli.AirspeedSchedule.transition(0.0, 2.0, acceleration=2.0, hold=0.5)
    axes = symheli.fly(heli, schedule).plot()
    assert len(axes) == 4
    named = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert named == ["airspeed", "airspeed_command"]
