"""How often the bands of measured frequency responses hold the exact ones: simulated flights with
the controller on, which attenuates the off-axis, at constant airspeed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

import symheli
from evidence.seeds import over_seeds, parser_of, seeds_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification import frequency_response
from studies.output import as_json
from studies.setup.axes import ALL
from studies.setup.flights import NOISE_DB, autopilot_for
from symheli import AirspeedSchedule, Excitation, FlightRecord, Helicopter
from symheli.values.arrays import Array

INPUTS = ALL.inputs
OUTPUTS = ("p", "q", "r", "w")
ON_AXIS = (("q", "d_lon"), ("p", "d_lat"), ("w", "d_col"), ("r", "d_ped"))
DIAGONAL = np.array([[(y, u) in ON_AXIS for u in INPUTS] for y in OUTPUTS])
AIRSPEEDS = (0.0, 8.0, 13.0)
"""m/s."""

FLIGHTS, DURATION = 5, 100.0
"""Number of flights at an airspeed, and the length of each, s."""

AMPLITUDE = {"d_lon": 0.008, "d_lat": 0.006, "d_col": 0.008, "d_ped": 0.008}
"""Of the multisines, rad: small, so that the response is that of the linear model."""

LINES = (0.04, 2.2)
"""Of the multisines, Hz."""

WINDOWS = (40.0, 25.0, 15.0, 8.0)
"""s."""

BAND = (0.5, 10.0)
"""rad/s."""

FAINT = 0.01
"""An off-axis response below this share of its output's on-axis response is called absent: in hover
most are zero by symmetry."""

SHARE = (0.90, 0.98)
"""What a band of 95 % is to hold."""


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Of one seed at one airspeed, by output and input: at how many `frequencies` a response is
    usable and the band holds the exact one, with references and without; at how many the exact
    response is not absent, and usable there by references.
    """

    seed: int
    airspeed: float
    inside: dict[str, Array]
    usable: dict[str, Array]
    present: Array
    usable_present: Array
    frequencies: int


def flights_at(
    heli: Helicopter, airspeed: float, seed: int, noise_db: float = NOISE_DB
) -> list[FlightRecord]:
    """Flights at one airspeed under the study's autopilot, all inputs excited at once."""
    schedule = AirspeedSchedule((airspeed,), (1.0,), (DURATION,), start=airspeed)
    autopilot = autopilot_for(heli)
    return [
        symheli.fly(
            heli,
            schedule,
            controller=autopilot,
            excitation=Excitation(AMPLITUDE, "multisine", LINES, 10 * seed + i),
            noise_db=noise_db,
            seed=100 * seed + i,
        )
        for i in range(FLIGHTS)
    ]


def of_seed(airspeed: float, seed: int, noise_db: float = NOISE_DB) -> Coverage:
    """Fly, estimate, compare with the exact linearization at the airspeed flown."""
    heli = Helicopter.load("xcell60", governor="ideal")
    records = flights_at(heli, airspeed, seed, noise_db)
    exact = symheli.linearize(heli, symheli.trim(heli, airspeed=airspeed)).discretize(records[0].dt)
    exact = exact.select(inputs=INPUTS, outputs=OUTPUTS)
    found = {}
    for name, references in (("references", tuple(f"e_{u}" for u in INPUTS)), ("none", ())):
        found[name] = frequency_response(
            records, OUTPUTS, INPUTS, window=WINDOWS, band=BAND, references=references
        )
    omega = found["references"].omega
    G = exact.frequency_response(omega)
    on_axis = np.abs(G).max(axis=2, keepdims=True, where=DIAGONAL, initial=0.0)
    present = np.abs(G) >= FAINT * on_axis
    held = {name: np.abs(f.G - G) <= f.radius() for name, f in found.items()}
    return Coverage(
        seed=seed,
        airspeed=airspeed,
        inside={name: (held[name] & f.usable).sum(axis=0) for name, f in found.items()},
        usable={name: f.usable.sum(axis=0) for name, f in found.items()},
        present=present.sum(axis=0),
        usable_present=(present & found["references"].usable).sum(axis=0),
        frequencies=len(omega),
    )


def table(found: Sequence[Coverage]) -> str:
    """Shares by airspeed, pooled over usable frequencies and entries."""
    rows = []

    def row(name: str, some: Sequence[Coverage]) -> float:
        cells = []
        shares = {}
        for kind in ("references", "none"):
            shares[kind] = sum(c.inside[kind].sum() for c in some) / sum(
                c.usable[kind].sum() for c in some
            )
            cells.append(f"{shares[kind]:.1%}")
        every = np.mean([c.usable["references"] / c.frequencies for c in some], axis=0)
        cells += [f"{every[DIAGONAL].min():.0%}", f"{every[~DIAGONAL].mean():.0%}"]
        seen = sum(c.usable_present[~DIAGONAL].sum() for c in some)
        cells.append(f"{seen / sum(c.present[~DIAGONAL].sum() for c in some):.0%}")
        rows.append((name, *cells))
        return shares["references"]

    for airspeed in sorted({c.airspeed for c in found}):
        row(f"{airspeed:g} m/s", [c for c in found if c.airspeed == airspeed])
    pooled = row("all", found)
    seeds = sorted({c.seed for c in found})
    met = "met" if SHARE[0] <= pooled <= SHARE[1] else "MISSED"
    return "\n".join(
        [
            f"{len(seeds)} seeds from {seeds[0]} to {seeds[-1]}; {FLIGHTS} flights of"
            f" {DURATION:g} s each; {', '.join(OUTPUTS)} from {', '.join(INPUTS)}, {BAND[0]:g} to"
            f" {BAND[1]:g} rad/s.",
            "",
            markdown(
                (
                    "airspeed",
                    "95 % bands that hold the exact response, by references",
                    "without references",
                    "usable on-axis, least",
                    "usable off-axis, mean",
                    f"of those above {FAINT:.0%} of on-axis",
                ),
                rows,
            ),
            "",
            f"Mark: {SHARE[0]:.0%} to {SHARE[1]:.0%} of all usable ones: {pooled:.1%}, {met}.",
        ]
    )


def main() -> None:
    """Print how often bands hold the truth, and keep it in docs/identified.md."""
    parser = parser_of(__doc__, "0-99")
    parser.add_argument("--noise-db", type=float, default=NOISE_DB, help="below each signal")
    options = parsed(parser, "identified.md", timed=False)
    each = [(v, s, options.noise_db) for s in seeds_of(options) for v in AIRSPEEDS]
    found = list(over_seeds(options, [partial(of_seed, *one) for one in each]))
    text = table(found)
    print(as_json([vars(c) for c in found]) if options.json else text)
    if options.write:
        keep(DOCS / "identified.md", "frequency responses", text)


if __name__ == "__main__":
    from evidence import responses  # under its own name: its results are handed on and stored by it

    responses.main()
