"""Records: one time axis, gaps and missing samples respected, messages that say where."""

import io
import os
import subprocess
import sys

import numpy as np
import pytest

from symheli.errors import InputError, UnknownNameError
from symheli.records import FlightRecord, decimate, low_pass, split
from symheli.records.shifted import shifted


def record(time=None, **columns):
    time = 0.1 * np.arange(10) if time is None else np.asarray(time, float)
    columns = columns or {"q": np.sin(time)}
    return FlightRecord.from_arrays(time, dict.fromkeys(columns, "rad/s"), **columns)


def test_units_are_converted_at_the_door_and_kept_in_the_signal(pd):
    frame = pd.DataFrame(
        {
            "t": [0.0, 10.0, 20.0],
            "speed": [10.0, 20.0, 30.0],
            "theta": [0.0, 90.0, 180.0],
            "junk": ["a", "b", "c"],
        }
    )
    got = FlightRecord.from_frame(
        frame, time="t", units={"speed": "kt", "theta": "deg"}, time_unit="ms"
    )
    np.testing.assert_allclose(got["theta"], [0, np.pi / 2, np.pi])
    np.testing.assert_allclose(got["speed"][0], 10 * 1852 / 3600)
    assert got.dt == pytest.approx(0.01)
    assert [(s, s.unit) for s in got.signals] == [("speed", "m/s"), ("theta", "rad")]
    assert list(got.to_frame().columns) == ["t", "speed", "theta"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: record([0.0, 0.1, 0.1, 0.2]), "sample 2 is at 0.1 s after 0.1 s"),
        (lambda: record([0.0, 0.2, 0.1]), "time must increase"),
        (lambda: record([0.0]), "at least two samples"),
        (lambda: record([0.0, np.nan]), r"time: entry \(1,\) is nan"),
        (
            lambda: record(q=[0.0] * 9 + [np.inf]),
            "q is infinite at 0.9 s; mark missing samples as NaN",
        ),
        (lambda: record(q=np.zeros(4)), r"q: expected shape \(10\), got \(4,\)"),
        (lambda: FlightRecord.from_arrays([0, 1], {}, q=[0, 1]), "declare the unit of 'q'"),
        (
            lambda: FlightRecord.from_arrays([0, 1], {"q": "rad/sec"}, q=[0, 1]),
            "did you mean 'rad/s'",
        ),
        (lambda: record([0, 0.1, 0.23, 0.31]).dt, "sampling is irregular"),
        (lambda: record().resample(0), "positive number"),
        (lambda: record()["p"], "unknown signal 'p'"),
    ],
)
def test_a_record_that_cannot_be_used_says_why(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_misspelt_column_gets_the_nearest(pd):
    with pytest.raises(UnknownNameError, match="did you mean 'theta'"):
        FlightRecord.from_frame(
            pd.DataFrame({"t": [0, 1], "theta": [0, 1]}), time="t", units={"tetha": "rad"}
        )


def test_gaps_split_the_record_and_nothing_is_invented_across_them():
    time = np.r_[np.arange(5) * 0.1, 2 + np.arange(6) * 0.1]
    got = record(time, q=time**2)
    assert got.segments() == (slice(0, 5), slice(5, 11))
    assert got.dt == pytest.approx(0.1)
    finer = got.resample(0.05)
    assert not np.any((finer.time > 0.41) & (finer.time < 1.99))
    assert len(finer.segments()) == 2
    slope = got.derivative("q")
    np.testing.assert_allclose(slope[1:4], 2 * time[1:4], atol=1e-12)
    assert slope[4] < 1.0  # one-sided at the end of the segment, not a chord over the gap


def test_missing_samples_stay_missing():
    got = record(q=[0.0, 1.0, np.nan, *range(7)])
    assert np.isnan(got["q"][2])
    assert np.isnan(got.resample(0.05)["q"]).any()


def test_resampling_to_the_same_step_changes_nothing():
    got = record()
    np.testing.assert_allclose(got.resample(0.1).values, got.values, atol=1e-12)


def test_cutting_selecting_and_adding_make_new_records():
    got = record(q=np.arange(10.0), p=np.zeros(10))
    np.testing.assert_allclose(got.between(0.2, 0.5).time, [0.2, 0.3, 0.4])
    assert got.select(["p"]).signals == ("p",)
    more = got.with_signals({"q": "deg/s", "n": "1"}, q=np.full(10, 180.0), n=np.ones(10))
    assert set(more.signals) == {"q", "p", "n"}
    np.testing.assert_allclose(more["q"], np.pi)
    np.testing.assert_array_equal(got["q"], np.arange(10.0))
    np.testing.assert_array_equal(got.columns(["q", "p"])[:, 1], np.zeros(10))


def test_arrays_are_copies_that_cannot_be_changed():
    mine = np.zeros(10)
    got = record(q=mine)
    mine[:] = 1.0
    assert not got["q"].any()
    with pytest.raises(ValueError, match="read-only"):
        got.values[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        got.time[0] = 1.0


def holed():
    """A gap after the fifth sample, q missing twice with one sample between."""
    time = np.r_[np.arange(5) * 0.1, 2 + np.arange(6) * 0.1]
    q = np.sin(time)
    q[[6, 8]] = np.nan
    return FlightRecord.from_arrays(time, {"q": "rad/s", "n": "1"}, q=q, n=np.ones(11))


@pytest.mark.slow
def test_a_plot_has_units_and_no_line_across_gaps_and_missing_samples():
    got = holed()
    q, n = got.plot()
    assert (q.get_title(loc="left"), n.get_title(loc="left"), n.get_xlabel()) == (
        "q (rad/s)",
        "n",
        "time (s)",
    )
    time, values = q.lines[0].get_data()
    drawn = (
        np.isfinite(time[:-1])
        & np.isfinite(time[1:])
        & np.isfinite(values[:-1])
        & np.isfinite(values[1:])
    )
    steps = [
        (round(a, 6), round(b, 6)) for a, b in zip(time[:-1][drawn], time[1:][drawn], strict=True)
    ]
    assert steps == [(0.0, 0.1), (0.1, 0.2), (0.2, 0.3), (0.3, 0.4), (2.4, 2.5)]
    np.testing.assert_allclose(
        q.lines[1].get_xdata(), [2.0, 2.2]
    )  # alone between what is missing: dots
    assert len(q.patches) == 3  # shaded: the gap, and two missing samples
    assert len(n.patches) == 1
    q.figure.savefig(io.BytesIO(), format="svg")


def test_a_plot_of_many_signals_stands_in_two_columns_and_of_named_ones_shows_those():
    many = FlightRecord.from_arrays(
        np.arange(4.0),
        {f"s{i}": "m" for i in range(9)},
        note="log",
        **{f"s{i}": np.zeros(4) for i in range(9)},
    )
    axes = many.plot()
    assert [ax.get_title(loc="left") for ax in axes] == [f"s{i} (m)" for i in range(9)]
    figure = axes[0].figure
    assert {ax for ax in figure.axes if ax.get_visible()} == set(axes)
    assert figure.get_suptitle() == "log"
    assert [ax.get_title(loc="left") for ax in many.plot(["s3", "s1"])] == ["s3 (m)", "s1 (m)"]
    with pytest.raises(UnknownNameError, match="unknown signal 'q'"):
        many.plot(["q"])


SCRIPT = """
import sys
import warnings
import numpy as np
warnings.simplefilter("error")
import symheli
time = 0.1 * np.arange(9)
record = symheli.FlightRecord.from_arrays(time, {"q": "rad/s", "n": "1"}, q=np.sin(time), n=time)
axes = record.plot()
import matplotlib
import matplotlib.pyplot as plt
axes[0].figure.savefig(sys.argv[1])
print(matplotlib.get_backend().lower(), len(axes), len(plt.get_fignums()))
"""


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["agg", "", "tkagg"])
def test_a_script_without_a_display_draws(tmp_path, backend):
    """Told nothing, or to use windows, matplotlib falls back on a backend for files."""
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "record.png")]
    done = subprocess.run(
        command, capture_output=True, text=True, env=kept | {"MPLBACKEND": backend}
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["agg", "2", "1"]
    assert (tmp_path / "record.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_waits_to_be_shown(monkeypatch):
    """It is one of pyplot's, so that a notebook and `pyplot.show()` find it, and nothing is shown
    before.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    monkeypatch.setattr(plt, "show", lambda *_, **__: pytest.fail("shown"))
    monkeypatch.setattr(plt, "pause", lambda *_: pytest.fail("shown"))
    axes = holed().plot()
    assert [plt.figure(n) for n in plt.get_fignums()] == [axes[0].figure]


def test_without_pandas_a_data_frame_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        InputError, match=r"a data frame needs pandas: pip install 'symheli\[labelled\]'"
    ):
        record().to_frame()


@pytest.mark.usefixtures("pd")
def test_no_method_changes_the_record_it_is_called_on():
    got = holed().rows(slice(5, None)).select(["n"]).with_signals({"a": "1"}, a=np.arange(6.0))
    before = got.time.copy(), got.values.copy(), got.signals
    (
        got.plot(),
        got.resample(0.05),
        got.low_pass(2.0),
        got.decimate(2),
        got.split(0.5),
        got.between(2.0, 2.3),
        got.rows([0, 2]),
    )
    (
        got.select(["a"]),
        got.with_signals({"a": "m"}, a=np.zeros(6)),
        got.derivative("a"),
        got.columns(["a"]),
        got.to_frame(),
    )
    for new, old in zip((got.time, got.values), before[:2], strict=True):
        np.testing.assert_array_equal(new, old)
    assert got.signals == before[2]


def test_the_methods_are_the_functions_of_that_name():
    got = record(np.arange(200) * 0.1)
    for method, function in (
        (
            got.low_pass(2.0, 2, zero_phase=True, leave=["q"]),
            low_pass(got, 2.0, 2, zero_phase=True, leave=["q"]),
        ),
        (got.decimate(4), decimate(got, 4)),
        *zip(got.split(0.7), split(got, 0.7), strict=True),
    ):
        np.testing.assert_array_equal(method.time, function.time)
        np.testing.assert_array_equal(method.values, function.values)
    assert [len(part) for part in got.split(0.7)] == [140, 60]


@pytest.mark.parametrize("step", [0.02, 0.01])
def test_irregular_samples_are_brought_to_one_step_with_an_error_of_second_order(step):
    """Linear interpolation between samples at most h apart: h^2 / 8 times the second derivative."""
    rng = np.random.default_rng(0)
    time = np.cumsum(step * rng.uniform(0.6, 1.4, int(10 / step)))
    irregular = record(time, q=np.sin(3 * time))
    with pytest.raises(InputError, match="resample first"):
        irregular.dt  # noqa: B018
    regular = irregular.resample(step)
    assert regular.dt == pytest.approx(step)
    error = np.abs(regular["q"] - np.sin(3 * regular.time)).max()
    bound = 9 * (1.4 * step) ** 2 / 8
    assert 0.3 * bound < error <= bound  # it is that large: the longest steps meet the crests


def test_a_late_signal_is_put_where_it_belongs():
    t = 0.02 * np.arange(200)
    late = FlightRecord.from_arrays(t, {"q": "rad/s"}, q=np.sin(t - 0.07))
    mended = shifted(late, {"q": 0.07})["q"]
    # what comes after the record is not known; a cubic spline of steps of .02 s: 1e-9
    assert np.isnan(mended[-4:]).any()
    np.testing.assert_allclose(mended[:-4], np.sin(t)[:-4], atol=1e-6)
