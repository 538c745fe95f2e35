"""A closed-loop flight of the nonlinear helicopter along an airspeed schedule, recorded."""

from __future__ import annotations

from typing import Unpack

from symheli.codegen import Layout
from symheli.errors import FlightLostError
from symheli.flight.flight_data import ADVICE
from symheli.flight.flights import Flights
from symheli.flight.plan import FlightPlan, Options, plan_of, shows_options
from symheli.flight.schedule import AirspeedSchedule
from symheli.flight.validity import warn_of_flown
from symheli.helicopter import Helicopter, require
from symheli.records.flight_record import FlightRecord


@shows_options
def fly(
    heli: Helicopter, schedule: AirspeedSchedule | FlightPlan, **options: Unpack[Options]
) -> FlightRecord:
    """Fly a schedule in the nonlinear model under any controller and return its record.

    The reference at each moment is the quasi-steady trim of the commanded airspeed and acceleration
    in the steady wind. The controller receives the recorded u v w p q r phi theta. The whole flight
    is one call into machine code, except for controllers written in Python, which are called at
    every sample: several times slower.

    Parameters
    ----------
    heli : Helicopter
        The model.
    schedule : AirspeedSchedule or FlightPlan
        What is commanded; or a whole plan, as a record keeps it in `meta["plan"]`.
    **options
        dt, controller, excitation, noise_db, seed, wind, servos, sensors, delay, trims, change:
        see `FlightPlan`.

    Returns
    -------
    FlightRecord
        The measured states, the flapping angles a1 b1 and rotor states (true), the four total
        inputs, the excitation as e_d_lon .., `airspeed` (true, of the air), `airspeed_command`,
        `acceleration_command`, and the trim it is held to as u_reference .. d_ped_reference; with
        servos or a delay the inputs are the deflections reached, and d_lon_command .. the
        commands; with a changing wind also wind_n, wind_e, wind_d. `meta["plan"]` flies it again,
        `meta["flown"]` says wind, mass, governor and servos.

    Raises
    ------
    FlightLostError
        Bank or pitch beyond 80 deg, or NaN or infinity in the state; it carries the cause and the
        record up to that time.
    InputError
        Something does not fit.
    TrimError
        There is no trim to be held to.

    Warns
    -----
    ValidityWarning
        It is flown faster than the equations are known to hold for, gusts included.

    See Also
    --------
    symheli.flight.fly_batch : many flights at once
    symheli.simulate : the equations with given inputs
    symheli.FlightPlan : all settings of a flight

    Examples
    --------
    >>> transition = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=1.0)
    >>> record = symheli.fly(heli, transition, excitation=symheli.Excitation({"d_lon": 0.01}))
    >>> round(record.dt, 3), bool(np.abs(record["airspeed"] - record["airspeed_command"]).max() < 1)
    (0.02, True)
    """
    require(heli, "fly(heli, schedule)")
    (data,) = Flights(heli).fly([plan_of(schedule, options)], Layout())
    warn_of_flown(heli, [data])
    record = data.record()
    if data.lost >= 0 or record is None:
        raise FlightLostError(f"{data.cause()}: {ADVICE}", record)
    return record
