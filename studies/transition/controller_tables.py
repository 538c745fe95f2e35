"""Tables and sentences on designs, proofs and simulated flights."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from studies.controllers.design_choices import RATE, TOP
from studies.controllers.designs import LQR
from studies.controllers.flown import WINDS
from studies.setup.bounds import CONSTANT, PLAIN, proven
from studies.transition.tables import Table, gain

if TYPE_CHECKING:
    from studies.controllers.certified import CertifiedControllers
    from studies.controllers.designs import Designs
    from studies.controllers.flown import FlownControllers, TurbulentFlights
    from studies.controllers.measures import Measures
    from studies.transition.outcome import Outcome

MEASURES: dict[str, Callable[[Measures], float]] = {
    "energy ratio": lambda flight: flight.ratio,
    "airspeed error (m/s)": lambda flight: flight.speed,
    "deviation (sizes)": lambda flight: flight.deviation,
    "bank, pitch (deg)": lambda flight: math.degrees(flight.attitude),
    "at a stop (%)": lambda flight: 100 * flight.stops,
    "outside the range (%)": lambda flight: 100 * flight.outside,
    "faster than the rate (%)": lambda flight: 100 * flight.faster,
}
"""Columns of the table of flights."""


def every(study: Outcome) -> list[Table]:
    """Return the parts that the study has computed."""
    out = []
    if study.controllers is not None:
        out.append(designed(study.controllers, study.certified_controllers))
    if study.flown_controllers is not None:
        out.append(ranking(study.flown_controllers))
        out.append(flown(study.flown_controllers, study.certified_controllers))
        if study.flown_controllers.flown:
            out.append(covered(study.flown_controllers))
        if study.certified_controllers is not None and study.certified_controllers.bounds:
            out.append(exceeded(study.flown_controllers, study.certified_controllers))
    return out


def designed(found: Designs, proofs: CertifiedControllers | None) -> Table:
    """Return a row for each controller: its order, and gains from synthesis to proof."""
    table = Table(
        "Controllers: gain from gusts and noise to deviations and commands, each in its size",
        [
            "controller",
            "states",
            "by synthesis",
            "frozen, as flown",
            f"proven, to {RATE:g} m/s^2",
            "proven, airspeed jumps",
        ],
        name="designed",
        source="controllers",
    )
    for design in found.designs:
        own = {b.form: b for b in proofs.bounds if b.model == design.name} if proofs else {}
        bounds = [gain(proven(own[form])) if form in own else "" for form in (PLAIN, CONSTANT)]
        if design.controller is None:
            table.rows.append([design.name, *["none exists"] * 3, *bounds])
            table.remarks.append(f"{design.name}: {design.reason}")
            continue
        frozen = "unstable" if math.isinf(design.frozen) else gain(design.frozen)
        cells = [str(design.order), gain(design.promised), frozen, *bounds]
        table.rows.append([design.name, *cells])
    table.remarks.append(
        "By synthesis: on the plant of the design, of point designs the largest. As flown: around"
        " the baseline with the servos and a delay of one sample, 50 Hz. None: nothing proven;"
        " blank: not tried, or not needed because more is proven."
    )
    for design in found.designs:
        if design.remark:
            table.remarks.append(f"{design.name}: {design.remark}")
    return table


def flown(found: FlownControllers, proofs: CertifiedControllers | None) -> Table:
    """Return a row for each controller and size of turbulence: median and worst over the seeds."""
    table = Table(
        f"Flown: a transition of {found.duration:.0f} s at up to {RATE:g} m/s^2, {found.seeds}"
        " seeds; median and worst",
        ["controller", "gusts (m/s)", "lost", "proven", *MEASURES],
        name="flown",
        source="controllers",
    )
    for wind in WINDS:
        best = next(iter(found.ranked(wind)), None)
        for one in found.at(wind):
            bound = "" if proofs is None or not proofs.bounds else gain(proofs.gain(one.name))
            cells = ["{:.2f}, {:.2f}".format(*one.of(measure)) for measure in MEASURES.values()]
            if one is best and math.isfinite(one.ratio):
                table.bold.add((len(table.rows), 4))
            table.rows.append([one.name, f"{one.gust:.1f}", str(one.lost), bound, *cells])
    table.remarks.append(
        "Gusts: standard deviation of the level components; beside them a steady wind and noise on"
        " every sensor. The nonlinear helicopter, its engine governed, with servos of limited"
        " rate and the delay. The energy ratio compares performance with gusts and noise as the"
        " proven gain does; what the transition itself asks for (the trim that moves, the governor)"
        " is in the performance and not among the disturbances."
    )
    table.remarks.extend(beyond(found))
    return table


def beyond(found: FlownControllers) -> list[str]:
    """Return a sentence on the flights outside the validity range of the equations of the
    helicopter.
    """
    every = [flight.beyond for one in found.flown for flight in one.flights]
    if not any(every):
        return []
    return [
        f"In {sum(share > 0 for share in every)} of the {len(every)} flights in gusts of all sizes"
        " the airspeed passed what the equations of the helicopter are known to hold for, in one"
        f" for {100 * max(every):.0f} % of the time."
    ]


def ranking(found: FlownControllers) -> Table:
    """A row a size of turbulence: who flew best, and how far the others are behind."""
    names = list(dict.fromkeys(one.name for one in found.flown))
    table = Table(
        "Who flew best: least median energy ratio among those that lost no flight; how much larger"
        " that of each other is, percent",
        ["gusts (m/s)", "best", "its ratio", "seeds better than the next", *names],
        name="ranking",
        source="controllers",
    )
    for wind in WINDS:
        everyone, ranked = {one.name: one for one in found.at(wind)}, found.ranked(wind)
        if not everyone:
            continue
        gust = f"{next(iter(everyone.values())).gust:.1f}"
        lost = {name: f"{one.lost} lost" for name, one in everyone.items() if one.lost}
        if not ranked:
            table.rows.append([gust, "none", "", "", *(lost.get(name, "") for name in names)])
            continue
        first, rest = ranked[0], ranked[1:]
        behind = {one.name: f"+{100 * (one.ratio / first.ratio - 1):.0f}" for one in rest}
        pair = f"{_better(first, rest[0])} of {found.seeds}" if rest else ""
        cells = [(lost | behind).get(name, "") for name in names]
        table.rows.append([gust, first.name, f"{first.ratio:.2f}", pair, *cells])
    return table


def exceeded(found: FlownControllers, proofs: CertifiedControllers) -> Table:
    """A row a controller: its proven gain beside the largest energy ratio of any flight."""
    table = Table(
        "Proven gains beside the largest energy ratio of any flight, from still air to more than"
        " any weather",
        ["controller", "proven", "largest flown", "in gusts of (m/s)", "exceeded from (m/s)"],
        name="exceeded",
        source="controllers",
    )
    for name in dict.fromkeys(one.name for one in found.flown):
        limit = proofs.gain(name)
        largest = max(found.of(name), key=_worst)
        above = found.exceeded(name, limit)
        first = "" if math.isinf(limit) else "never" if above is None else f"{above.gust:.1f}"
        table.rows.append(
            [name, gain(limit), f"{_worst(largest):.2f}", f"{largest.gust:.1f}", first]
        )
    table.remarks.append("None: nothing is proven, there is nothing to exceed.")
    return table


def covered(found: FlownControllers) -> Table:
    """A row a controller: the share of its flights that a tube covers, and what fails first."""
    table = Table(
        "Flights covered by a proven tube of the nonlinear equations",
        ["controller", "flights", "covered (%)", "fails first", "largest wind (m/s)"],
        name="covered",
        source="controllers",
    )
    for name in dict.fromkeys(one.name for one in found.flown):
        flights = [flight for one in found.of(name) for flight in one.flights]
        fails = Counter(flight.uncovered for flight in flights)
        kept = 100 * fails.pop("", 0) / len(flights)
        words = "; ".join(f"{why} ({count})" for why, count in fails.most_common())
        winds = [flight.wind for flight in flights]
        table.rows.append(
            [name, str(len(flights)), f"{kept:.0f}", words, f"{min(winds):.1f} to {max(winds):.1f}"]
        )
    calm = min(found.flown, key=lambda one: one.wind)
    table.remarks.append(
        "A tube speaks of one controller, as its matrices are, of gusts up to its amplitude with"
        " the steady wind among them, without sensor noise, and of servos whose rate limit is not"
        f" reached. In the least turbulence flown ({calm.gust:.1f} m/s) the wind had up to"
        f" {np.median([flight.wind for flight in calm.flights]):.1f} m/s by median. Tubes are made"
        " by synthesis.tubes.tube, and given by their files: tubes = [...] under [effort]."
    )
    return table


def conclusions(study: Outcome) -> list[str]:
    """Return the ranking of the controllers, and whether hypotheses of the certificates were
    violated.
    """
    found = study.flown_controllers
    if found is None or not found.flown:
        return []
    return [*(_won(found, wind) for wind in WINDS), hypotheses(found)]


def _won(found: FlownControllers, wind: float) -> str:
    ranked, everyone = found.ranked(wind), found.at(wind)
    where = f"In gusts of {everyone[0].gust:.1f} m/s"
    lost = [f"{f.name} ({f.lost} of {found.seeds})" for f in everyone if f.lost]
    fell = f" Flights were lost by {', '.join(lost)}." if lost else ""
    if not ranked:
        return f"{where} every controller lost flights: none won.{fell}"
    first, *rest = ranked
    won = f"{where} {first.name} won, with a median energy ratio of {first.ratio:.2f}"
    if rest:
        behind = 100 * (rest[0].ratio / first.ratio - 1)
        won += (
            f"; {rest[0].name} is next with {behind:.0f} % more. It was better than the next with"
            f" {_better(first, rest[0])} of {found.seeds} seeds"
        )
    simple = " No synthesis was worth it there." if first.name == LQR else ""
    return f"{won}.{simple}{fell}"


def _better(one: TurbulentFlights, other: TurbulentFlights) -> int:
    pairs = zip(one.flights, other.flights, strict=True)
    return sum(a.ratio < b.ratio for a, b in pairs)


def _worst(one: TurbulentFlights) -> float:
    return one.of(lambda flight: flight.ratio)[1]


def hypotheses(found: FlownControllers) -> str:
    """Return whether the flights kept to range and rate of the certificates."""
    some = [one for wind in WINDS for one in found.at(wind)]
    if not any(_broke(one) for one in some):
        return "Every flight kept to the range and the rate of the certificates."
    shares = [
        [one.of(MEASURES[column])[0] for one in some]
        for column in ("outside the range (%)", "faster than the rate (%)")
    ]
    outside, faster = (f"{min(each):.0f} to {max(each):.0f} %" for each in shares)
    which = "every controller" if all(_broke(one) for one in some) else "some controllers"
    return (
        f"The flights left the hypotheses of the certificates with {which}: by median, airspeed was"
        f" outside 0 to {TOP:g} m/s for {outside} of the time and changed faster than {RATE:g}"
        f" m/s^2 for {faster}."
    )


def _broke(one: TurbulentFlights) -> bool:
    return any(flight.outside > 0 or flight.faster > 0 for flight in one.flights)
