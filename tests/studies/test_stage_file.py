"""Files of stages: what is read is what was written, and nothing of a file runs."""

import io
import json
import math
import shutil
import zipfile
from collections import OrderedDict

import numpy as np
import pytest

from studies.setup import stage_file
from studies.setup.stored_stages import NotUsable, Stored, StoredStages
from symheli import LinearModel, Scheduling
from symheli.values import Signal

pytestmark = pytest.mark.guard


def again(value):
    return stage_file.read(stage_file.written(value))


def test_numbers_arrays_and_containers_come_back_to_the_last_bit():
    array = np.array([[0.1, -0.0], [math.nan, math.inf]])
    array.flags.writeable = False
    value = {"a": [1, 2.5, math.inf, None, True, 1 + 2j], ("k", 3): (array, np.float32(0.1))}
    back = again(value)
    assert back["a"] == value["a"]
    found, scalar = back["k", 3]
    assert found.tobytes() == array.tobytes()
    assert not found.flags.writeable
    assert scalar.dtype == np.float32
    assert scalar == np.float32(0.1)


def test_objects_of_the_project_come_back_with_names_units_and_identity():
    signal = Signal("altitude", "m")
    p = Scheduling("p", "rad", 0.0, 1.0, rate=0.5)
    model = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    back = again((signal, signal, p, model))
    assert back[0] == "altitude"
    assert back[0].unit == "m"
    assert back[0] is back[1]
    assert back[2] == p
    np.testing.assert_array_equal(back[3].A, model.A)
    assert back[3].inputs[0].unit == model.inputs[0].unit


def test_what_is_not_of_the_project_is_not_written():
    with pytest.raises(TypeError, match=r"collections\.OrderedDict cannot be stored"):
        stage_file.written(OrderedDict(a=1))
    with pytest.raises(TypeError, match="cannot be stored"):
        stage_file.written([math.sin])


def forged(node):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(stage_file.TREE, json.dumps({"root": {"object": 0}, "objects": [node]}))
    return buffer.getvalue()


@pytest.mark.parametrize(
    "node",
    [
        {"class": "os:system", "state": {}},
        {"class": "subprocess:Popen", "state": {}},
        {"class": "studies.cli:main", "state": {}},
        {"class": "symheli.records.flight_record:np.ndarray", "state": {}},
        {"class": "symheli:nothing", "state": {}},
        {"list": [{"object": 0}]},
        {"array": 7},
        {},
    ],
)
def test_a_forged_file_is_refused(node):
    with pytest.raises(stage_file.UnreadableError):
        stage_file.read(forged(node))


@pytest.mark.parametrize("cut", [0, 10, 200])
def test_a_damaged_file_is_refused(cut):
    content = stage_file.written({"array": np.arange(100.0)})
    with pytest.raises(stage_file.UnreadableError):
        stage_file.read(content[:cut])


@pytest.mark.guard
def test_an_answer_copied_over_another_is_refused(tmp_path):
    """The proof of one loop stood as that of another, and as the whole stage."""
    stages = StoredStages(tmp_path, {"proofs": "k" * 64, "gains": "k" * 64})
    for i in (0, 1):
        stages.save("proofs", Stored(result=("loop", i), seconds=1.0), i)
    assert {i: each.result for i, each in stages.parts("proofs", 2).items()} == {
        0: ("loop", 0),
        1: ("loop", 1),
    }
    first = stages.path("proofs", 0)
    for name, part in (("proofs", 1), ("proofs", None), ("gains", 0), ("gains", None)):
        shutil.copy(first, stages.path(name, part))
        with pytest.raises(NotUsable, match="another stage or question"):
            stages.load(name, part)
        assert stages.usable(name, part) is None
    assert list(stages.parts("proofs", 2)) == [0]
