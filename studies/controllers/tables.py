"""What was designed, proven and flown, as tables and sentences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from studies.controllers.designs import LQR
from studies.controllers.flown import WINDS
from studies.controllers.plant import RATE, TOP
from studies.transition.guarantees import CONSTANT, PLAIN, proven
from studies.transition.tables import Table, gain

if TYPE_CHECKING:
    from studies.controllers.certified import CertifiedControllers
    from studies.controllers.designs import Designs
    from studies.controllers.flown import Flown, FlownControllers
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
    """Those that the study has reached."""
    out = []
    if study.controllers is not None:
        out.append(designed(study.controllers, study.certified_controllers))
    if study.flown_controllers is not None:
        out.append(flown(study.flown_controllers, study.certified_controllers))
    return out


def designed(found: Designs, proofs: CertifiedControllers | None) -> Table:
    """A row a controller: its order, and gains from synthesis to proof."""
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
            said = f"{design.name}: is that model fit for this loop? {design.remark}."
            table.remarks.append(said)
    return table


def flown(found: FlownControllers, proofs: CertifiedControllers | None) -> Table:
    """A row a controller and size of turbulence: median and worst over the seeds."""
    table = Table(
        f"Flown: a transition of {found.duration:.0f} s at up to {RATE:g} m/s^2, {found.seeds}"
        " seeds; median and worst",
        ["controller", "gusts (m/s)", "lost", "proven", *MEASURES],
    )
    for wind in WINDS:
        best = next(iter(found.ranked(wind)), None)
        for one in found.at(wind):
            bound = "" if proofs is None or not proofs.bounds else gain(proofs.gain(one.name))
            cells = ["{:.2f}, {:.2f}".format(*one.of(measure)) for measure in MEASURES.values()]
            if one is best:
                table.bold.add((len(table.rows), 4))
            table.rows.append([one.name, f"{one.gust:.1f}", str(one.lost), bound, *cells])
    table.remarks.append(
        "Gusts: standard deviation of the level components; beside them a steady wind and noise on"
        " every sensor. The nonlinear helicopter, its engine governed, with servos of limited"
        " rate and the delay. The energy ratio compares performance with gusts and noise as the"
        " proven gain does; what the transition itself asks for (the trim that moves, the governor)"
        " is in the performance and not among the disturbances."
    )
    return table


def conclusions(study: Outcome) -> list[str]:
    """Who won and by how much, and where hypotheses of the certificates broke."""
    found, proofs = study.flown_controllers, study.certified_controllers
    if found is None or not found.flown:
        return []
    out = [_won(found, wind) for wind in WINDS]
    out += list(_bounds(found, proofs)) if proofs is not None and proofs.bounds else []
    return [*out, _hypotheses(found)]


def _won(found: FlownControllers, wind: float) -> str:
    ranked, everyone = found.ranked(wind), found.at(wind)
    where = f"In gusts of {everyone[0].gust:.1f} m/s"
    lost = [f"{f.name} ({f.lost} of {found.seeds})" for f in everyone if f.lost]
    fell = f" Flights were lost by {', '.join(lost)}." if lost else ""
    if not ranked:
        return f"{where} every controller lost flights: none won.{fell}"
    first, *rest = ranked
    behind = ", ".join(f"{100 * (f.ratio / first.ratio - 1):.0f} % ({f.name})" for f in rest)
    others = f"; larger by {behind}" if rest else ""
    simple = " No synthesis was worth it there." if first.name == LQR else ""
    won = f"{first.name} won: a median energy ratio of {first.ratio:.2f}{others}."
    if rest:
        pairs = zip(first.flights, rest[0].flights, strict=True)
        better = sum(one.ratio < other.ratio for one, other in pairs)
        won += f" It was better than the next with {better} of {found.seeds} seeds."
    return f"{where} {won}{simple}{fell}"


def _bounds(found: FlownControllers, proofs: CertifiedControllers) -> Iterator[str]:
    for name in dict.fromkeys(one.name for one in found.flown):
        limit, own = proofs.gain(name), found.of(name)
        if math.isinf(limit):
            yield f"{name}: no gain is proven, there is nothing to exceed."
            continue
        largest = max(own, key=_worst)
        above = found.exceeded(name, limit)
        said = (
            f"not exceeded in any flight from still air to gusts of {own[-1].gust:.1f} m/s"
            if above is None
            else f"first exceeded in gusts of {above.gust:.1f} m/s ({_worst(above):.2f})"
        )
        yield (
            f"{name}: the proven {gain(limit)} is {said}; the largest energy ratio is"
            f" {_worst(largest):.2f}, in gusts of {largest.gust:.1f} m/s."
        )


def _worst(one: Flown) -> float:
    return one.of(lambda flight: flight.ratio)[1]


def _hypotheses(found: FlownControllers) -> str:
    outside, faster = "outside the range (%)", "faster than the rate (%)"
    parts = []
    for wind in WINDS:
        some = found.at(wind)
        shares = [
            ", ".join(f"{one.of(MEASURES[column])[0]:.0f} % ({one.name})" for one in some)
            for column in (outside, faster)
        ]
        parts.append(
            f"in gusts of {some[0].gust:.1f} m/s airspeed was outside 0 to {TOP:g} m/s for"
            f" {shares[0]} of the time and changed faster than {RATE:g} m/s^2 for {shares[1]}"
        )
    every = all(_broke(one) for wind in WINDS for one in found.at(wind))
    which = "every certificate" if every else "certificates"
    return (
        f"The command keeps to range and rate, the helicopter does not: hypotheses of {which} broke"
        f" (medians); {'; '.join(parts)}."
    )


def _broke(one: Flown) -> bool:
    return any(flight.outside > 0 or flight.faster > 0 for flight in one.flights)
