"""Files with marked places: every place is filled, every name found, nothing is forgotten."""

import pytest

from symheli.export.c_program import filled
from symheli.export.c_text import rows, table


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "roll.c"
    path.write_text('/* of @what@ */\n/* @tables@ */\n#include "roll.h"\nint roll_init(void);\n')
    return path


def test_places_are_filled_and_names_renamed_where_they_begin(file):
    text = filled(file, {"what": "a scroll_bar", "tables": "int t;"}, {"roll_": "yaw_"})
    assert text == '/* of a scroll_bar */\nint t;\n#include "roll.h"\nint yaw_init(void);\n'


@pytest.mark.parametrize("places", [{"what": "x"}, {"what": "x", "tables": "", "more": ""}])
def test_a_place_forgotten_or_unknown_is_refused(file, places):
    with pytest.raises(ValueError, match="its marked places are"):
        filled(file, places)


def test_a_name_that_is_not_there_is_refused(file):
    with pytest.raises(ValueError, match="pitch_ is not in it"):
        filled(file, {"what": "", "tables": ""}, {"pitch_": "yaw_"})


def test_tables_keep_to_a_hundred_columns():
    import numpy as np

    values = np.random.default_rng(0).standard_normal((3, 40))
    for text in (table("int", "t", range(200)), rows("double", "r", "40", values)):
        assert max(map(len, text.splitlines())) <= 100
    assert "-0x1" in rows("double", "r", "40", values)
