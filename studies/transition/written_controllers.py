"""Controllers, proofs and flights for results.json."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from studies.setup.certificates import bound_to_dict
from studies.setup.quantities import named, value, values
from studies.transition.controller_tables import conclusions
from studies.transition.saved_proofs import proof_file

if TYPE_CHECKING:
    from studies.controllers.designs import Design
    from studies.controllers.flown import TurbulentFlights
    from studies.transition.outcome import Outcome


def controllers_to_dict(study: Outcome) -> dict[str, Any]:
    """Return the results of the study on controllers; null where there are none."""
    proofs, flown = study.certified_controllers, study.flown_controllers
    return {
        "designs": study.controllers and [_design(d) for d in study.controllers.designs],
        "bounds": proofs and [bound_to_dict(b, proof_file(b)) for b in proofs.bounds],
        "flights": flown and [_flown(one) for one in flown.flown],
        "conclusions": conclusions(study),
    }


def _design(design: Design) -> dict[str, Any]:
    return {
        "name": design.name,
        "exists": design.controller is not None,
        "states": value(design.order, "1"),
        "gain_by_synthesis": value(design.promised, "1"),
        "frozen_gain": value(design.frozen, "1"),
        "time": value(design.seconds, "s"),
        "reason": design.reason,
        "remark": design.remark,
    }


def _flown(one: TurbulentFlights) -> dict[str, Any]:
    each = one.flights
    return {
        "controller": one.name,
        "mean_wind_at_20ft": value(one.wind, "m/s"),
        "gusts": value(one.gust, "m/s"),
        "lost": value(one.lost, "1"),
        "energy_ratio": values((f.ratio for f in each), "1"),
        "airspeed_error": values((f.speed for f in each), "m/s"),
        "deviation": values((f.deviation for f in each), "1"),
        "deviation_by_signal": named(
            {y: one.of(lambda f, y=y: f.deviations[y])[0] for y in each[0].deviations}, "1"
        ),
        "largest_attitude": values((f.attitude for f in each), "rad"),
        "at_a_stop": values((100 * f.stops for f in each), "%"),
        "outside_the_range": values((100 * f.outside for f in each), "%"),
        "faster_than_the_rate": values((100 * f.faster for f in each), "%"),
        "largest_wind": values((f.wind for f in each), "m/s"),
        "not_covered_by_a_tube": [f.uncovered for f in each],
        "beyond_the_equations": values((100 * f.beyond for f in each), "%"),
    }
