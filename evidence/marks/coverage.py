"""How often regions of 95 % of identified frequency responses hold the exact ones, by condition:
of the covariance alone, and with the bias that the simulator shows of the structure.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evidence.seeds import by_name, parser_of
from evidence.tables import DOCS, keep, markdown, parsed
from identification.judge import response_regions, structure_bias
from identification.model import KinematicModel
from studies.known_kinematics.conditions import ALL, CONDITIONS, Instruments
from studies.known_kinematics.models import PAIRS
from studies.known_kinematics.truth import AXES, SPEEDS, Truth
from studies.output import as_json
from symheli import FlightRecord, LinearModel
from symheli.errors import DataWarning
from symheli.flight import SimulatedFlight
from symheli.values import Signal

FREQUENCIES = np.geomspace(0.3, 20.0, 8)
"""rad/s."""

LOOKED_AT = range(0, len(SPEEDS), 6)
"""Of the airspeeds of a truth."""

LEAST, MOST, WIDEST = 0.93, 0.97, 2.0
"""Marks of the share and of the median width, in that of the covariance alone."""


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Of one seed: share of regions that hold the exact response by the covariance alone and with
    the bias of the structure, the median ratio of their widths, and the number of regions.
    """

    seed: int
    nominal: float
    covered: float
    width: float
    regions: int


def held(
    model: KinematicModel,
    records: Sequence[FlightRecord],
    source: Instruments | SimulatedFlight,
    truth: Truth,
    simulated: Truth,
    axis: str,
) -> tuple[float, float, float, int]:
    """Share of the responses of an axis (each input to each output, airspeed, frequency) that the
    nominal regions hold, that those with the bias of the structure hold, the median ratio of their
    widths, and their number. `simulated`: the exact models of the simulator's vehicle.
    """
    names = {str(u).removesuffix("_command"): str(u) for u in model.inputs}
    own, others = (at_points(model, of.models[axis]) for of in (truth, simulated))
    signals = AXES[axis].outputs, [names[u] for u in AXES[axis].inputs]
    off = structure_bias(model, records, source, others)
    narrow, wide = (
        response_regions(model, own, FREQUENCIES, *signals, bias=bias) for bias in (None, off)
    )
    exact = np.stack([m.frequency_response(FREQUENCIES) for m in own.values()])
    nominal, covered = (float(regions.contains(exact).mean()) for regions in (narrow, wide))
    return nominal, covered, float(np.median(wide.width / narrow.width)), exact.size


def at_points(
    model: KinematicModel, exact: Sequence[LinearModel], chosen: Iterable[int] = LOOKED_AT
) -> dict[tuple[float, ...], LinearModel]:
    """Some of the exact models by point of the scheduling, with the inputs of the model."""
    out = {}
    names = {str(u).removesuffix("_command"): str(u) for u in model.inputs}
    for k in chosen:
        inputs = tuple(Signal(names[str(u)], u.unit) for u in exact[k].inputs)
        out[(float(SPEEDS[k]), 0.0)[: len(model.parameters)]] = replace(exact[k], inputs=inputs)
    return out


def of_seed(name: str, seed: int, truth: str = "xcell60") -> Coverage:
    """Fly, identify, count."""
    condition = CONDITIONS[name]
    heli, simulator = (condition.helicopter(vehicle) for vehicle in (truth, PAIRS[truth]))
    records = condition.flights(heli, seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        source = Instruments(SimulatedFlight(simulator))
        model = condition.identified(condition.structure(records[0]), records, source)
        nominal, covered, width, regions = held(
            model,
            records,
            source,
            condition.truth(heli),
            condition.truth(simulator),
            ALL,
        )
    return Coverage(seed=seed, nominal=nominal, covered=covered, width=width, regions=regions)


def table(truth: str, found: Mapping[str, Sequence[Coverage]]) -> str:
    """A row a condition, and one of all."""
    rows = []
    pooled = [one for of_name in found.values() for one in of_name]
    groups = [(CONDITIONS[name].about, of_name) for name, of_name in found.items()]
    for about, some in [*groups, ("all", pooled)]:
        shares = np.array([one.covered for one in some])
        width = float(np.median([one.width for one in some]))
        met = LEAST <= shares.mean() <= MOST and width <= WIDEST
        rows.append(
            (
                about,
                f"{100 * np.mean([one.nominal for one in some]):.1f}",
                f"{100 * shares.mean():.1f} ({100 * shares.min():.1f} to {100 * shares.max():.1f})",
                f"{width:.2f}",
                "met" if met else "MISSED",
                f"{sum(one.regions for one in some):,}, {len(some)}",
            )
        )
    head = ("flight", "covariance alone, %", "with the bias, %", "width", "", "regions, seeds")
    return "\n".join(
        [
            f"Truth {truth}, bias of the structure from {PAIRS[truth]}; all axes, 0.3 to 20 rad/s;"
            f" mark: {100 * LEAST:g} to {100 * MOST:g} % on average, at a median width of at most"
            f" {WIDEST:g} times that of the covariance alone.",
            "",
            markdown(head, rows),
        ]
    )


def main() -> None:
    """Count, and keep the table in docs/identified.md."""
    parser = parser_of(__doc__, "0-19")
    parser.add_argument("--truth", default="xcell60", choices=sorted(PAIRS))
    parser.add_argument("--only", nargs="+", choices=CONDITIONS, default=["ideal"])
    options = parsed(parser, "identified.md", timed=False)
    found = by_name(options, of_seed, options.only)
    text = table(options.truth, found)
    plain = {name: [vars(one) for one in some] for name, some in found.items()}
    print(as_json(plain) if options.json else text)
    if options.write:
        keep(DOCS / "identified.md", f"regions {options.truth}", text)


if __name__ == "__main__":
    from evidence.marks import coverage  # under its own name: its results are stored by it

    coverage.main()
