"""From a flight to a controller that may fly: identified, designed, certified, judged."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from identification.judge.fit_for_control import FitForControl
from identification.model import KinematicModel
from studies.circle.alarm import deviations
from studies.circle.vehicle import PERIOD, Vehicle
from studies.controllers.design_choices import DesignChoices
from studies.controllers.designs import judged_by_flight
from studies.controllers.starting import for_model, state_space
from studies.controllers.synthesized import synthesized
from studies.known_kinematics.models import PAIRS, SCHEDULING, identified, simulator_of
from studies.live.identifier import STATES
from symheli import FlightRecord, Scheduling, TableController
from symheli.errors import SymheliError
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS
from synthesis import Certificate


@dataclass(frozen=True, kw_only=True, eq=False)
class Designed:
    """A controller from a flight: `model`, what was identified; `table`, what flies; `certificate`
    of its loop, `exact` where that is verified in exact arithmetic; `proven`, range and rate that
    it holds for; `verdict` on the model in this loop; `trim` (functions of the model, 12) of states
    and controls; `deviations` (8,) of its 1 s predictions; `seconds` of each step.
    """

    model: KinematicModel
    table: TableController
    certificate: Certificate
    exact: bool
    proven: Scheduling
    verdict: FitForControl
    trim: Array
    deviations: Array
    seconds: Mapping[str, float]

    @property
    def share(self) -> float:
        """Largest bound of the nu-gap to the truth, as a share of the stability margin there."""
        with np.errstate(divide="ignore"):
            return float(np.max(self.verdict.bound / self.verdict.margin))

    @property
    def objections(self) -> list[str]:
        """Why it may not fly; empty where it may."""
        found = []
        if not self.exact:
            found.append("the certificate of its loop is not verified in exact arithmetic")
        if not self.share < 1.0:
            found.append(f"nu-gap bound {self.share:.2f} times the margin b(P, C)")
        decided = [row for row in self.verdict.criteria if row.decides and row.verdict != "fit"]
        found += [f"{row.name}: {row.verdict}" for row in decided if "nu-gap" not in row.name]
        return found

    def at_rest(self, airspeed: float, acceleration: float) -> tuple[Array, Array]:
        """States (8,) and controls (4,) of the mean flight at a commanded airspeed (m/s) and
        acceleration (m/s^2).
        """
        at = functions(self.model, np.array([[airspeed, acceleration]]))[0] @ self.trim
        return at[: len(STATES)], at[len(STATES) :]


def functions(model: KinematicModel, p: Array) -> Array:
    """Return the basis functions (n, size) of a model at commanded airspeeds and accelerations
    (n, 2).
    """
    return np.asarray(model.structure.basis(p)).reshape(len(p), -1)


def designed(record: FlightRecord, vehicle: str) -> Designed | str:
    """Everything from a record with its plan, as of one `vehicle`; a sentence where there is no
    controller.
    """
    begin = time.perf_counter()
    heli = Vehicle(vehicle).helicopter
    simulator = simulator_of(vehicle, heli)[1]
    seconds: dict[str, float] = {}
    try:
        model = identified(record, simulator)
        seconds["identifying"] = time.perf_counter() - begin
        made = synthesized(choices_for(vehicle, model), model)
        judging = time.perf_counter()
        verdict = judged_by_flight(model, made.table.model, record, simulator)
        seconds |= made.seconds
        seconds["judging"] = time.perf_counter() - judging
    except SymheliError as error:
        return str(error)
    limits = {str(u): (-float(t), float(t)) for u, t in zip(INPUTS, heli.travel, strict=True)}
    certificate = made.sampled.certificate
    if certificate.proof is None:
        return f"nothing is proven of the loop: {certificate.why}"
    proving = time.perf_counter()
    exact = certificate.verify(rigorous=True)
    seconds["verifying exactly"] = time.perf_counter() - proving
    proven = replace(certificate.proof.evidence.parameters[0], rate=certificate.rates[0])
    return Designed(
        model=model,
        table=replace(made.table, limits=limits),
        certificate=certificate,
        exact=exact,
        proven=proven,
        verdict=verdict,
        trim=with_controls(model, record),
        deviations=deviations(model, record),
        seconds=seconds,
    )


def choices_for(vehicle: str, model: KinematicModel) -> DesignChoices:
    """Return the choices of a design: of a packaged X-Cell those of the study, of another vehicle
    with sizes of commands from its identified model; without servos, one sample late.
    """
    usual = DesignChoices(vehicle="", model="flown", servos={}, delay=PERIOD, period=PERIOD)
    return usual if vehicle in PAIRS else for_model(usual, state_space(model), model, "")


def with_controls(model: KinematicModel, record: FlightRecord) -> Array:
    """Return coefficients (functions, 12) of the mean states and controls over the scheduling."""
    F = functions(model, record.columns(SCHEDULING))
    u = record.columns(map(str, INPUTS))
    known = np.isfinite(u).all(axis=1)
    return np.column_stack([model.trim, np.linalg.lstsq(F[known], u[known], rcond=None)[0]])
