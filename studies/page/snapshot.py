"""Snapshots of a watch for a page: made once in the thread that receives, for all browsers."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from studies.live.identifier import BIN, ENOUGH_SAMPLES, ControlPower
from studies.live.watch import Watch
from studies.output import progress
from studies.page import charts
from studies.page.motion import Motion, Track
from studies.page.powers import Baseline

MOTION_EVERY, NUMBERS_EVERY = 0.1, 1.0
"""Seconds between two snapshots of the motion, and of the numbers."""
AXES = {"p": "roll", "q": "pitch", "w": "heave", "r": "yaw"}
"""Name of the acceleration of each velocity."""
BANDS = 2.0
"""Standard errors of half a band."""
AT_MOST = 9
"""Airspeeds at which control powers are shown, at most."""

EVENTS = 4
"""Events of a pilot that are shown, the last ones."""

Parts = Mapping[str, str]


class Published:
    """The latest snapshots of a watch, which it calls after each receive.

    A snapshot that fails is said once, and does not end the watch.

    Parameters
    ----------
    baseline : Baseline, optional
        Control powers to compare with.
    clock : callable
        Seconds.
    """

    def __init__(
        self, baseline: Baseline | None = None, clock: Callable[[], float] = time.monotonic
    ):
        self.motion: Motion | None = None
        self.parts: Parts = {}
        self.count = 0
        self._baseline, self._clock, self._track = baseline, clock, Track()
        self._next_motion = self._next_numbers = -np.inf
        self._failed = False

    def __call__(self, watch: Watch) -> None:
        """Take in the latest samples; publish where it is time."""
        try:
            self._look(watch)
        except Exception as error:  # a page is no reason to lose a flight
            if not self._failed:
                progress(f"the page shows no more of this: {error!r}")
            self._failed = True

    def _look(self, watch: Watch) -> None:
        for sample in watch.latest:
            if sample.sender == watch.stream.sender:
                self._track.add(sample.time, sample.values)
        now = self._clock()
        if now >= self._next_motion:
            self._next_motion = now + MOTION_EVERY
            self.motion = self._track.shown()
        if now >= self._next_numbers:
            self._next_numbers = now + NUMBERS_EVERY
            self.parts = parts(watch, self._baseline)
            self.count += 1


def parts(watch: Watch, baseline: Baseline | None = None) -> Parts:
    """Return the pieces of HTML of a page, by name, as they are now."""
    data = watch.data()
    return {
        "lamp": lamp(data),
        "next": next_to_fly(watch, data),
        "state": state(watch, data),
        "coverage": coverage(watch, data),
        "powers": powers(watch, baseline),
        "prediction": prediction(data["prediction"]),
    }


def lamp(data: Mapping[str, Any]) -> str:
    """Return the lamp and its reasons, with the alarm where there is one."""
    found, alarm = data.get("lamp"), data.get("alarm")
    words = Markup("")
    if alarm:
        words += Markup('<p class="alarm" role="alert"><b>Alarm:</b> {}</p>').format(alarm)
    if found is None:
        return words + Markup('<p class="lamp none"><i></i><b>no lamp yet</b></p>')
    style, said = ("green", "green") if found["green"] else ("red", "not green")
    words += Markup('<p class="lamp {}"><i></i><b>{}</b></p>').format(style, said)
    return words + _list(found["reasons"])


def next_to_fly(watch: Watch, data: Mapping[str, Any]) -> str:
    """Return what to do next: what keeps the stream from teaching, or what to fly; where a pilot
    flies, what it is doing and what has happened.
    """
    if not watch.received:
        return Markup("<p>waiting: nothing has come from {} yet</p>").format(data["source"])
    problems = watch.problems()
    if (pilot := data.get("pilot")) is not None:
        last = [f"{event['time']:.0f} s: {event['what']}" for event in pilot["events"][-EVENTS:]]
        return Markup("<p>{}</p>").format(pilot["doing"]) + _list([*problems, *last])
    return _list(problems) if problems else Markup("<p>{}</p>").format(data["next"])


def state(watch: Watch, data: Mapping[str, Any]) -> str:
    """Return the state of stream and record."""
    now = watch.stream.state
    counts = ", ".join(f"{name} {n}" for name, n in data["states"].items()) or "none"
    rows = [
        ("source", data["source"]),
        ("stream", f"{now.name}: {now.value}"),
        ("samples", f"{watch.received}: {counts}"),
        ("rows learnt", f"{data['learnt']}"),
        ("outside the airspeeds", f"{data['outside_the_range']}"),
    ]
    if watch.recorder is not None:
        rows.append(("record", watch.recorder.problem or str(watch.recorder.path)))
    items = (Markup("<dt>{}</dt><dd>{}</dd>").format(name, value) for name, value in rows)
    return f'<dl class="{"good" if now.name == "GOOD" else "other"}">{"".join(items)}</dl>'


def coverage(watch: Watch, data: Mapping[str, Any]) -> str:
    """Return bars of the samples at each airspeed, and which inputs have moved enough there."""
    cells = data["coverage"]
    whole = sum(not cell["missing"] for cell in cells)
    few = [cell["samples"] < ENOUGH_SAMPLES for cell in cells]
    moved = {
        name: [bool(cell["motion"][name]) and (name not in cell["missing"]) for cell in cells]
        for name in watch.identifier.inputs
    }
    said = f"{whole} of {len(cells)} airspeeds are covered"
    picture = charts.coverage(
        [cell["airspeed"] for cell in cells],
        [cell["samples"] for cell in cells],
        ENOUGH_SAMPLES,
        moved,
        BIN,
        watch.airspeed,
        said,
    )
    more = f"; fewer than {ENOUGH_SAMPLES} samples at {sum(few)}" if any(few) else ""
    return f"{picture}<p>{said}{more}.</p>"


def powers(watch: Watch, baseline: Baseline | None) -> str:
    """Return a chart of each control power over airspeed with its band, and the baseline's."""
    found = watch.identifier.control_powers(airspeeds(watch.identifier.low, watch.identifier.high))
    if not found:
        return "<p>no model yet: not every coefficient is determined</p>"
    seen = _seen(watch)
    pictures = []
    for output in dict.fromkeys(power.output for power in found):
        own = [power for power in found if power.output == output and seen(power.airspeed)]
        pictures.append(_power(output, own, baseline, watch.airspeed) if own else "")
    names = [("identified, with 2 standard errors", "c0")]
    names += [(f"linearization of {baseline.name}", "c1")] if baseline is not None else []
    return (
        f'{charts.legend(names)}<div class="charts">{"".join(pictures)}</div>'
        '<p class="quiet">Only where samples came. The band is of the scatter alone; noise of the'
        " sensors shifts the values besides.</p>"
    )


def airspeeds(low: float, high: float) -> list[float]:
    """Return the airspeeds (m/s) at which control powers are shown: middles of cells."""
    count = max(int(np.ceil((high - low) / BIN)), 1)
    middles = low + BIN * (np.arange(count) + 0.5)
    kept = middles[np.unique(np.linspace(0, count - 1, min(count, AT_MOST)).round().astype(int))]
    return np.minimum(kept, high).tolist()


def prediction(fit: Mapping[str, float] | None) -> str:
    """Return how well each state is predicted 1 s ahead."""
    if fit is None:
        return "<p>none yet: a model and some seconds without a gap are wanted</p>"
    rows = [
        Markup(
            '<tr><th scope="row">{}</th><td>{:.0f} %</td>'
            '<td class="wide"><div class="share"><i style="width:{:.0f}%"></i></div></td></tr>'
        ).format(name, value, min(max(value, 0.0), 100.0))
        for name, value in fit.items()
    ]
    return (
        f"<table><tbody>{''.join(rows)}</tbody></table>"
        '<p class="quiet">100 % less the error as a share of the standard deviation over the'
        " flight.</p>"
    )


def _power(
    output: str, own: Sequence[ControlPower], baseline: Baseline | None, airspeed: float
) -> str:
    V, value, error = (
        np.array([getattr(p, name) for p in own]) for name in ("airspeed", "value", "error")
    )
    control, unit = own[0].control, own[0].unit
    curves = [charts.Curve(f"{output} by {control}", V, value, "c0", BANDS * error, marks=True)]
    if baseline is not None and (output, control) in baseline.powers:
        other = baseline.powers[output, control]
        curves.append(charts.Curve(baseline.name, baseline.airspeeds, other, "c1"))
    about = (
        f"{AXES[output]}: {output} by {control} over airspeed,"
        f" {value.min():.3g} to {value.max():.3g} {unit}"
    )
    picture = charts.chart(
        curves,
        about,
        "airspeed, m/s",
        unit,
        x=(_low(own, baseline), _high(own, baseline)),
        at=airspeed,
    )
    heading = Markup("<figcaption>{}: {} by {}</figcaption>").format(AXES[output], output, control)
    return f"<figure>{heading}{picture}</figure>"


def _low(own: Sequence[ControlPower], baseline: Baseline | None) -> float:
    ends = [p.airspeed for p in own]
    return min(ends if baseline is None else [*ends, *baseline.airspeeds]) - 0.5 * BIN


def _high(own: Sequence[ControlPower], baseline: Baseline | None) -> float:
    ends = [p.airspeed for p in own]
    return max(ends if baseline is None else [*ends, *baseline.airspeeds]) + 0.5 * BIN


def _seen(watch: Watch) -> Callable[[float], bool]:
    """Return whether an airspeed (m/s) lies within the cells that have samples."""
    flown = [cell.low for cell in watch.identifier.coverage() if cell.samples]
    return lambda V: bool(flown) and flown[0] <= V <= flown[-1] + BIN


def _list(items: Sequence[str]) -> Markup:
    rows = (Markup("<li>{}</li>").format(item) for item in items)
    return Markup("<ul>{}</ul>").format(Markup("").join(rows))
