"""Programs over many seeds keep finished ones, and read only what the same call has stored."""

from functools import partial

import numpy as np
import pytest

from evidence.seeds import over_seeds, parser_of, seeds_of

COMPUTED = []


def of_seed(seed, scale=1.0):
    COMPUTED.append(seed)
    if seed == 13:
        raise RuntimeError("no such flight")
    return {"seed": seed, "value": np.array([scale * seed])}


def found(arguments, scale=1.0):
    options = parser_of("about", "0-4").parse_args([*arguments, "--processes", "1"])
    COMPUTED.clear()
    calls = [partial(of_seed, seed, scale) for seed in seeds_of(options)]
    return [one["value"].tolist() for one in over_seeds(options, calls)]


def test_seeds_are_a_range_or_a_list_and_quick_takes_the_first():
    parser = parser_of("about", "0-4")
    assert seeds_of(parser.parse_args([])) == [0, 1, 2, 3, 4]
    assert seeds_of(parser.parse_args(["--quick"])) == [0, 1]
    assert seeds_of(parser.parse_args(["--seeds", "3,5,7"])) == [3, 5, 7]


def test_what_was_finished_before_a_failure_is_not_computed_again(tmp_path):
    out = ["--out", str(tmp_path)]
    with pytest.raises(RuntimeError):
        found(["--seeds", "1,2,13,4", *out])
    assert found(["--seeds", "1,2,4", *out]) == [[1.0], [2.0], [4.0]]
    assert COMPUTED == [4]
    assert found(["--seeds", "4,2,1", *out]) == [[4.0], [2.0], [1.0]]
    assert COMPUTED == []
    assert found(["--seeds", "2,2,1", *out]) == [[2.0], [2.0], [1.0]]
    assert COMPUTED == []


def test_other_arguments_and_damaged_files_are_computed(tmp_path):
    out = ["--seeds", "1,2", "--out", str(tmp_path)]
    found(out)
    assert found(out, scale=2.0) == [[2.0], [4.0]]
    assert COMPUTED == [1, 2]
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[:-3])
    assert found(out) == [[1.0], [2.0]]
    assert COMPUTED == [1, 2]
