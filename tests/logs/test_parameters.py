"""Parameters of an autopilot, from files as they are written and as they are damaged."""

import math

import pytest
from autopilot_logs import FORMATS, dataflash

from symheli.errors import InputError
from symheli.logs.parameters import LARGEST_COUNT, LARGEST_FILE, read_parameters

WITH_PARAMETERS = {
    "FMT": FORMATS["FMT"],
    "PARM": (64, "QNf", "TimeUS,Name,Value"),
    "ATT": FORMATS["ATT"],
}


def read(tmp_path, content):
    file = tmp_path / "heli.param"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_parameters(file)


@pytest.mark.parametrize(
    "line", ["A_B1,0.15", "A_B1 0.15", "A_B1\t0.15", "A_B1, 1.5e-1", "  A_B1 ,0.15 ", "A_B1=0.15"]
)
def test_a_name_and_a_value_a_line(tmp_path, line):
    if "=" in line:
        with pytest.raises(InputError, match=r"line 1: expected NAME,VALUE, got 'A_B1=0\.15'"):
            read(tmp_path, line)
    else:
        assert read(tmp_path, line) == {"A_B1": 0.15}


def test_comments_empty_lines_and_what_other_programs_add(tmp_path):
    """A mark of the encoding, Windows' ends of lines, a third word; the last value counts."""
    text = "\ufeff# heli\r\n\r\nA,1 # first\r\nB,-2,@READONLY\r\n#C,3\r\nA,4\r\n"
    assert read(tmp_path, text) == {"A": 4.0, "B": -2.0}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("A,1\nATC_RAT_RLL_P\n", "line 2: expected NAME,VALUE, got 'ATC_RAT_RLL_P'"),
        ("A,1\n\nb,1\n", "line 3: expected NAME,VALUE"),
        ("SEVENTEEN_LETTERS,1\n", "line 1: expected NAME,VALUE"),
        ("A,1\nB,nan\n", "line 2, B: expected a finite number, got 'nan'"),
        ("A,1e999\n", "line 1, A: expected a finite number, got '1e999'"),
        ("A,much\n", "line 1, A: expected a finite number, got 'much'"),
        ("# nothing\n", "no parameters in it; expected lines of NAME,VALUE"),
        (b"\x00\xff\xfe\x01", "not a .param file"),
        (b"", "the file is empty"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        read(tmp_path, text)


def test_a_long_line_is_cut_in_the_message(tmp_path):
    with pytest.raises(InputError) as refused:
        read(tmp_path, "x" * 100_000)
    assert len(str(refused.value)) < 300


def test_files_too_large_for_parameters_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"are too many for a \.param file"):
        read(tmp_path, b"#" * (LARGEST_FILE + 1))
    many = "".join(f"P{k},0\n" for k in range(LARGEST_COUNT + 1))
    with pytest.raises(InputError, match="more than 20000 parameters"):
        read(tmp_path, many)


@pytest.mark.parametrize("text", [False, True], ids=["binary", "text"])
def test_the_last_values_of_a_dataflash_log_count(tmp_path, text):
    pytest.importorskip("pymavlink")
    rows = [
        ("PARM", (100, "ATC_RAT_RLL_P", 0.5)),
        ("ATT", (150, 100, 9000)),
        ("PARM", (200, "ATC_RAT_RLL_P", 0.25)),
        ("PARM", (200, "ATC_RAT_RLL_I", math.nan)),
        ("PARM", (200, "INS_GYRO_FILTER", 20.0)),
    ]
    got = read(tmp_path, dataflash(rows, text=text, units=False, formats=WITH_PARAMETERS))
    assert got == {"ATC_RAT_RLL_P": 0.25, "INS_GYRO_FILTER": 20.0}


def test_a_dataflash_log_without_parameters_or_damaged_is_refused(tmp_path):
    pytest.importorskip("pymavlink")
    log = dataflash([("ATT", (150, 100, 9000))], units=False, formats=WITH_PARAMETERS)
    with pytest.raises(InputError, match=r"the log holds no parameters; give a \.param file"):
        read(tmp_path, log)
    with pytest.raises(InputError, match=r"damaged|no parameters"):
        read(tmp_path, log[:40])


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_parameters(tmp_path / "heli.param")
