"""Mistakes, and the words that answer them: what is wrong, and what to do."""

import shlex
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import identification as idn
import symheli
import synthesis
from studies import cli
from symheli import LPVStateSpace, Scheduling, lpv
from symheli.errors import (
    ExcitationError,
    InputError,
    SolverError,
    SymheliError,
    TrimError,
    UnknownNameError,
)

CLIMB = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=1.0)
T = 0.02 * np.arange(5)
P = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
FIT = "--outputs y --inputs u --scheduling p --units y=deg u=1 p=m/s"
"""Replaces this word in a row of `WORDS`."""

PYTHON = {
    "a vehicle misspelt": (
        lambda s: symheli.Helicopter.load("xcel60"),
        UnknownNameError,
        "unknown vehicle 'xcel60'",
        "did you mean 'xcell60'? (known: xcell60, xcell_kahn_hudson, yamaha_r50)",
    ),
    "a name for a vehicle": (
        lambda s: symheli.Helicopter("xcell60"),
        InputError,
        "vehicle: expected a Vehicle, got 'xcell60'",
        "a packaged airframe or a file is loaded by Helicopter.load('xcell60')",
    ),
    "a vehicle file that is not there": (
        lambda s: symheli.Helicopter.load("no/such.toml"),
        InputError,
        "no vehicle file at no/such.toml",
        "packaged airframes: xcell60, xcell_kahn_hudson, yamaha_r50",
    ),
    "a governor misspelt": (
        lambda s: symheli.Helicopter.load("xcell60", governor="Ideal"),
        UnknownNameError,
        "unknown governor 'Ideal'",
        "did you mean 'ideal'? (known: pi, ideal)",
    ),
    "a printed form misspelt": (
        lambda s: symheli.Helicopter.load("xcell60", printed=["tail"]),
        UnknownNameError,
        "unknown printed option 'tail'",
        "known: lateral_flapping, flapping_sign, fuselage_downwash, rotor_reaction,",
    ),
    "one printed form as a word": (
        lambda s: symheli.Helicopter.load("xcell60", printed="nothing"),
        InputError,
        "printed: expected a list of names, such as ['nothing']",
    ),
    "a number for a vehicle": (
        lambda s: symheli.Helicopter.load(5),
        InputError,
        "vehicle: expected a name, one of xcell60, xcell_kahn_hudson, yamaha_r50, or a",
    ),
    "a parameter as a keyword": (
        lambda s: s.heli.with_parameters(mass=9.0),
        InputError,
        "with_parameters: give one mapping from the names of .parameters to numbers in",
    ),
    "a parameter misspelt": (
        lambda s: s.heli.with_parameters({"body.mas": 9.0}),
        UnknownNameError,
        "unknown parameter 'body.mas'",
        "did you mean 'body.mass' or 'body.Izz' or 'body.Iyy'?",
    ),
    "a mass below zero": (
        lambda s: s.heli.with_parameters({"body.mass": -9.0}),
        InputError,
        "MIT X-Cell .60 SE, body.mass: must be > 0 kg, got -9",
    ),
    "a mass in words": (
        lambda s: s.heli.with_parameters({"body.mass": "9 kg"}),
        InputError,
        "body.mass: expected a finite number in kg, got '9 kg'",
    ),
    "a mass that is no number": (
        lambda s: s.heli.with_parameters({"body.mass": float("nan")}),
        InputError,
        "body.mass: expected a finite number in kg, got nan",
    ),
    "an altitude in words": (
        lambda s: s.heli.at_altitude("high"),
        InputError,
        "altitude: expected a finite number of m, got 'high'",
    ),
    "an altitude in space": (
        lambda s: s.heli.at_altitude(80000.0),
        InputError,
        "altitude: expected -2000 .. 20000 m above sea level, got 80000.0",
        "feet times 0.3048 are metres",
    ),
    "a density below zero": (
        lambda s: s.heli.in_air(-1.0),
        InputError,
        "density must be positive (kg/m^3",
        "1.225 at sea level), got -1.0",
    ),
    "an airspeed below zero": (
        lambda s: symheli.trim(s.heli, -5.0),
        InputError,
        "airspeed must be >= 0 m/s, got -5.0",
        "rearward flight is sideslip = pi",
    ),
    "an airspeed that is no number": (
        lambda s: symheli.trim(s.heli, float("nan")),
        InputError,
        "airspeed: expected a finite number of m/s, got nan",
    ),
    "an airspeed in words": (
        lambda s: symheli.trim(s.heli, "5 m/s"),
        InputError,
        "airspeed: expected a finite number of m/s, got '5 m/s'",
    ),
    "a list of airspeeds to trim": (
        lambda s: symheli.trim(s.heli, [0.0, 5.0]),
        InputError,
        "airspeed: expected a finite number of m/s, got [0.0, 5.0]",
    ),
    "an airspeed that cannot be trimmed": (
        lambda s: symheli.trim(s.heli, 80.0),
        TrimError,
        "no trim at 80 m/s: the best point leaves du/dt = -4.11e+01 m/s^2, dw/dt =",
        "try a nearer condition as `start`, or throw=False for the best point",
    ),
    "a climb faster than the flight": (
        lambda s: symheli.trim(s.heli, 5.0, climb_rate=8.0),
        InputError,
        "|climb_rate| = 8.0 m/s exceeds the airspeed of 5.0 m/s, which includes it:",
    ),
    "a sideslip in degrees": (
        lambda s: symheli.trim(s.heli, 5.0, sideslip=20.0),
        InputError,
        "sideslip: expected rad, within a full circle, got 20",
        "degrees are math.radians(20)",
    ),
    "a wind of two numbers": (
        lambda s: symheli.trim(s.heli, 5.0, wind=(1.0, 2.0)),
        InputError,
        "wind: expected (north, east, down) in m/s, got (1.0, 2.0)",
    ),
    "a wind object for a trim": (
        lambda s: symheli.trim(s.heli, 5.0, wind=symheli.Wind()),
        InputError,
        "wind: expected (north, east, down) in m/s, got Wind(steady=(0.0, 0.0, 0.0),",
    ),
    "a helicopter by name to trim": (
        lambda s: symheli.trim("xcell60", 5.0),
        InputError,
        "expected a Helicopter first, got 'xcell60': trim(heli, airspeed=5.0), with heli",
    ),
    "an input misspelt": (
        lambda s: symheli.linearize(s.heli, 5.0, inputs=["d_long"]),
        UnknownNameError,
        "unknown input 'd_long'",
        "did you mean 'd_lon' or 'd_lat' or 'd_col'? (known: d_lon, d_lat, d_col, d_ped,",
    ),
    "two airspeeds": (
        lambda s: symheli.linearize(s.heli, 5.0, airspeed=6.0),
        InputError,
        "give a trim or an airspeed: linearize(heli, trim(heli, airspeed=5.0)) or",
    ),
    "a sweep of nothing": (
        lambda s: symheli.sweep(s.heli, []),
        InputError,
        "sweep needs increasing airspeeds",
    ),
    "a sweep that turns back": (
        lambda s: symheli.sweep(s.heli, [5.0, 2.0]),
        InputError,
        "sweep needs increasing airspeeds",
    ),
    "a sweep with one airspeed twice": (
        lambda s: symheli.sweep(s.heli, [2.0, 2.0]),
        InputError,
        "sweep needs increasing airspeeds",
    ),
    "derivatives of one model": (
        lambda s: symheli.derivatives(s.linear),
        InputError,
        "derivatives: expected a LinearFamily, got LinearModel",
        "a family of one airspeed is symheli.sweep(heli, [5.0])",
    ),
    "derivatives of a helicopter": (
        lambda s: symheli.derivatives(s.heli),
        InputError,
        "derivatives: expected a LinearFamily, got Helicopter",
        "a family of one airspeed is symheli.sweep(heli, [5.0])",
    ),
    "a derivative misspelt": (
        lambda s: symheli.derivatives(s.family)["M_uu"],
        UnknownNameError,
        "unknown derivative 'M_uu'",
        "did you mean 'M_u' or 'Z_u' or 'Y_u'?",
    ),
    "a trim map without climb": (
        lambda s: symheli.trim_map(s.heli, [5.0], []),
        InputError,
        "climb_rates: expected increasing numbers (m/s), got []",
    ),
    "an index of a state": (
        lambda s: s.point.x["thetta"],
        UnknownNameError,
        "unknown signal 'thetta'",
        "did you mean 'theta'?",
    ),
    "a state misspelt": (
        lambda s: s.linear.select(["qq"]),
        UnknownNameError,
        "unknown state 'qq'",
        "did you mean 'q'?",
    ),
    "an output misspelt": (
        lambda s: s.linear.select(outputs=["thta"]),
        UnknownNameError,
        "unknown output 'thta'",
        "did you mean 'theta'?",
    ),
    "a sample period of zero": (
        lambda s: s.linear.discretize(0.0),
        InputError,
        "dt must be a positive number of seconds or None, got 0.0",
    ),
    "a sample period below zero": (
        lambda s: s.linear.discretize(-0.02),
        InputError,
        "dt must be a positive number of seconds or None, got -0.02",
    ),
    "a discretisation twice": (
        lambda s: s.linear.discretize(0.02).discretize(0.02),
        InputError,
        "the model is already discrete (dt = 0.02 s)",
    ),
    "a feedback of a list": (
        lambda s: s.linear.feedback([1.0]),
        InputError,
        "feedback: expected {(input, output): gain}, got [1.0]",
    ),
    "a feedback of an output misspelt": (
        lambda s: s.linear.feedback({("d_lon", "pitch"): 0.1}),
        UnknownNameError,
        "unknown output 'pitch'",
        "did you mean 'phi' or 'theta'?",
    ),
    "a response at a word": (
        lambda s: s.linear.frequency_response("all"),
        InputError,
        "omega: expected numbers, got 'all'",
    ),
    "a family at a speed it does not hold": (
        lambda s: s.family.at(40.0),
        InputError,
        "airspeed = 40.0 m/s is not on the grid: 2, 5",
    ),
    "a family by a degree too high": (
        lambda s: s.family.interpolate("polynomial", 12),
        InputError,
        "a polynomial of degree 12 needs 13 values of each parameter, got 2: lower the",
    ),
    "a family saved as text": (
        lambda s: s.family.save(s.folder / "f.txt"),
        InputError,
        "f.txt: expected a name that ends in .json or .npz",
    ),
    "a family over climb": (
        lambda s: s.family.fix(climb=1.0),
        UnknownNameError,
        "unknown axis 'climb'",
        "known: airspeed",
    ),
    "a simulation of three states": (
        lambda s: symheli.simulate(s.heli, [0, 0, 0], np.zeros((5, 4)), dt=0.01),
        InputError,
        "x0: expected 15 states in quaternion form or 10 in Euler form, got shape (3,)",
    ),
    "a simulation by a misspelt method": (
        lambda s: symheli.simulate(
            s.heli, s.point.x, np.tile(s.point.u.array, (5, 1)), dt=0.01, method="rk5"
        ),
        UnknownNameError,
        "unknown method 'rk5'",
        "did you mean 'rk4'? (known: rk4, cash_karp, dopri, radau)",
    ),
    "a simulation backwards": (
        lambda s: symheli.simulate(s.heli, s.point.x, np.tile(s.point.u.array, (5, 1)), dt=-0.01),
        InputError,
        "dt must be a positive number of seconds, got -0.01",
    ),
    "a schedule of one number": (
        lambda s: symheli.fly(s.heli, 5.0),
        InputError,
        "schedule: expected an AirspeedSchedule, got 5.0",
    ),
    "a schedule without acceleration": (
        lambda s: symheli.AirspeedSchedule.transition(0.0, 8.0, acceleration=0.0),
        InputError,
        "airspeeds and holds must be >= 0, accelerations > 0",
        "got AirspeedSchedule(targets=(8.0, 0.0), accelerations=(0.0, 0.0), holds=(3.0,",
    ),
    "a schedule with half a lap": (
        lambda s: symheli.AirspeedSchedule.transition(0.0, 8.0, acceleration=2.0, laps=0.5),
        InputError,
        "laps: expected a whole number >= 1, got 0.5",
    ),
    "a schedule of unequal parts": (
        lambda s: symheli.AirspeedSchedule((5.0, 6.0), (1.0,), (1.0, 1.0)),
        InputError,
        "an airspeed schedule needs as many accelerations and holds as targets",
    ),
    "a noise of minus infinity": (
        lambda s: symheli.fly(s.heli, CLIMB, noise_db=float("nan")),
        InputError,
        "noise_db: expected a number of decibels, as 30, got nan",
    ),
    "a delay below zero": (
        lambda s: symheli.fly(s.heli, CLIMB, delay=-0.02),
        InputError,
        "delay: expected a number of seconds >= 0, got -0.02",
    ),
    "a keyword misspelt": (
        lambda s: symheli.fly(s.heli, CLIMB, excitations=None),
        UnknownNameError,
        "unknown option of a flight 'excitations'",
        "did you mean 'excitation'?",
    ),
    "a seed in words": (
        lambda s: symheli.fly(s.heli, CLIMB, seed="first"),
        InputError,
        "seed: expected a whole number >= 0, got 'first'",
    ),
    "an excitation of an input misspelt": (
        lambda s: symheli.fly(s.heli, CLIMB, excitation=symheli.Excitation({"d_long": 0.01})),
        UnknownNameError,
        "unknown input of the excitation 'd_long'",
        "did you mean 'd_lon' or 'd_lat' or 'd_col'? (known: d_lon, d_lat, d_col, d_ped)",
    ),
    "an excitation without amplitudes": (
        lambda s: symheli.Excitation(0.01),
        InputError,
        "amplitude: expected {input: rad}, such as {'d_lon': 0.01}, got 0.01",
    ),
    "an excitation by a kind misspelt": (
        lambda s: symheli.Excitation({"d_lon": 0.01}, kind="multi-sine"),
        UnknownNameError,
        "unknown excitation 'multi-sine'",
        "did you mean 'multisine'? (known: multisine, prbs, chirp, sweep)",
    ),
    "a band upside down": (
        lambda s: symheli.Excitation({"d_lon": 0.01}, band=(5.0, 0.1)),
        InputError,
        "band must be 0 < low < high in Hz, got (5.0, 0.1)",
    ),
    "a wind of a word": (
        lambda s: symheli.Wind("north"),
        InputError,
        "steady: expected three finite numbers (north, east, down), m/s, such as (-5.0,",
    ),
    "a servo without damping": (
        lambda s: symheli.Servo(natural_frequency=30.0, damping=-1.0),
        InputError,
        "a servo needs natural_frequency > 0 rad/s, damping > 0 and rate > 0 rad/s",
    ),
    "a servo as a number": (
        lambda s: symheli.fly(s.heli, CLIMB, servos={"d_lon": 30.0}),
        InputError,
        "servos['d_lon']: expected a Servo, got 30.0",
    ),
    "a servo of an input misspelt": (
        lambda s: symheli.fly(s.heli, CLIMB, servos={"lon": s.servo}),
        UnknownNameError,
        "unknown input 'lon'",
        "did you mean 'd_lon'? (known: d_lon, d_lat, d_col, d_ped)",
    ),
    "a sensor as a number": (
        lambda s: symheli.fly(s.heli, CLIMB, sensors={"q": 0.1}),
        InputError,
        "sensors['q']: expected a Sensor, got 0.1",
    ),
    "a sensor of a signal misspelt": (
        lambda s: symheli.fly(s.heli, CLIMB, sensors={"qq": symheli.Sensor()}),
        UnknownNameError,
        "unknown measured signal 'qq'",
        "did you mean 'q'?",
    ),
    "a sensor with noise below zero": (
        lambda s: symheli.Sensor(noise=-0.1),
        InputError,
        "noise: expected a finite number >= 0, got -0.1",
    ),
    "a controller that is a word": (
        lambda s: symheli.fly(s.heli, CLIMB, controller="pid"),
        InputError,
        "controller: expected gains over airspeed (Autopilot), a LinearModel, an",
        "got str",
    ),
    "a flight in samples of zero": (
        lambda s: symheli.fly(s.heli, CLIMB, dt=0.0),
        InputError,
        "dt must be a positive number of seconds, from 1e-06 on, got 0.0",
    ),
    "a signal misspelt": (
        lambda s: s.record["yy"],
        UnknownNameError,
        "unknown signal 'yy'",
        "did you mean 'y'? (known: y, u, p)",
    ),
    "a selection misspelt": (
        lambda s: s.record.select(["uu"]),
        UnknownNameError,
        "unknown signal 'uu'",
        "did you mean 'u'? (known: y, u, p)",
    ),
    "a record that stands still": (
        lambda s: symheli.FlightRecord.from_arrays(np.zeros(5), {"q": "rad/s"}, q=np.zeros(5)),
        InputError,
        "time must increase: sample 1 is at 0 s after 0 s",
        "sort or drop repeats",
    ),
    "a record with a unit unknown": (
        lambda s: symheli.FlightRecord.from_arrays(T, {"q": "rads"}, q=np.zeros(5)),
        UnknownNameError,
        "unknown unit 'rads'",
        "did you mean 'rad/s' or 'rad' or 'mrad'?",
    ),
    "a record without units": (
        lambda s: symheli.FlightRecord.from_arrays(T, {}, q=np.zeros(5)),
        InputError,
        "declare the unit of 'q': units={'q': ...} ('1' where it has none)",
    ),
    "a record of unequal lengths": (
        lambda s: symheli.FlightRecord.from_arrays(T, {"q": "rad/s"}, q=np.zeros(4)),
        InputError,
        "q: expected shape (5), got (4,)",
    ),
    "a record of words": (
        lambda s: symheli.FlightRecord.from_arrays(T, {"q": "rad/s"}, q=list("abcde")),
        InputError,
        "q: expected numbers, got ['a', 'b', 'c', 'd', 'e']",
    ),
    "a record from a missing file": (
        lambda s: symheli.FlightRecord.from_csv("no.csv"),
        InputError,
        "no.csv: there is no such file",
    ),
    "a record from an empty file": (
        lambda s: symheli.FlightRecord.from_csv(s.empty),
        InputError,
        "empty.csv: the file is empty",
    ),
    "a record from a picture": (
        lambda s: symheli.FlightRecord.load(s.picture),
        InputError,
        "picture.png: not a whole file of FlightRecord.save (This file contains pickled",
        "take an older copy",
    ),
    "a record cut to nothing": (
        lambda s: s.record.between(5.0, 1.0),
        InputError,
        "no samples lie between start and stop",
        "the record goes from 0 to 29.9 s",
    ),
    "a record cut past its end": (
        lambda s: s.record.between(1e4, None),
        InputError,
        "no samples lie between start and stop",
        "the record goes from 0 to 29.9 s",
    ),
    "a record thinned by zero": (
        lambda s: s.record.decimate(0),
        InputError,
        "expected a whole number of samples >= 1 to take together, got 0",
    ),
    "a record split in full": (
        lambda s: s.record.split(1.5),
        InputError,
        "fraction: expected a part of the time in (0, 1], got 1.5",
    ),
    "a record filtered too fast": (
        lambda s: s.record.low_pass(100.0),
        InputError,
        "cutoff: expected a frequency between 0 and 5 Hz (half the sampling frequency),",
    ),
    "a record in steps below zero": (
        lambda s: s.record.resample(-0.1),
        InputError,
        "dt must be a positive number of seconds, got -0.1",
    ),
    "a signal added too short": (
        lambda s: s.record.with_signals({"z": "1"}, z=np.zeros(3)),
        InputError,
        "z: expected shape (300), got (3,)",
    ),
    "the attitude of a record without rates": (
        lambda s: s.record.check_kinematics(),
        InputError,
        "the kinematics tie p q r (rad/s) to phi theta (rad)",
        "the record lacks p, q, r, phi, theta: add them by record.with_signals, with",
    ),
    "lags below zero": (
        lambda s: idn.LPVARX("y", "u", "p", na=-1, nb=1),
        InputError,
        "na: expected an integer from 0 to 10000, a mapping by signal name or one row an",
    ),
    "lags that are no whole number": (
        lambda s: idn.LPVARX("y", "u", "p", na=1.5, nb=1),
        InputError,
        "na: expected an integer from 0 to 10000, a mapping by signal name or one row an",
    ),
    "no lags at all": (
        lambda s: idn.LPVARX("y", "u", "p", na=0, nb=0),
        InputError,
        "nothing to identify for y: give na >= 1, or nb >= 1 with inputs, or offset=True",
    ),
    "an output that is an input": (
        lambda s: idn.LPVARX("y", "y", "p", na=1, nb=1),
        InputError,
        "a signal is either an output or an input",
        "both: y",
    ),
    "a degree for a basis": (
        lambda s: idn.LPVARX("y", "u", "p", na=1, nb=1, basis=2),
        InputError,
        "basis: expected a basis such as Polynomial(degree=2, low=0, high=13), got 2",
    ),
    "a basis upside down": (
        lambda s: idn.Polynomial(1, 1.0, -1.0),
        InputError,
        "a basis needs finite low < high, got [1.0, -1.0]",
    ),
    "a degree below zero": (
        lambda s: idn.Polynomial(-1, 0.0, 1.0),
        InputError,
        "degree: expected a whole number >= 0, got -1",
    ),
    "a fit of a signal that is not there": (
        lambda s: idn.fit(idn.LPVARX("z", "u", "p", na=1, nb=1), s.record),
        UnknownNameError,
        "unknown signal 'z'",
        "known: y, u, p",
    ),
    "a fit by a misspelt method": (
        lambda s: idn.fit(s.arx, s.record, method="lms"),
        UnknownNameError,
        "unknown method 'lms'",
        "did you mean 'ls' or 'rls' or 'lasso'?",
    ),
    "a fit of no record": (
        lambda s: idn.fit(s.arx, []),
        InputError,
        "expected a FlightRecord or a list of them",
        "build one with FlightRecord.from_frame, from_csv, ...",
    ),
    "a fit of a path": (
        lambda s: idn.fit(s.arx, "flight.csv"),
        InputError,
        "expected a FlightRecord or a list of them",
        "build one with FlightRecord.from_frame, from_csv, ...",
    ),
    "a fit the wrong way round": (
        lambda s: idn.fit(s.record, s.arx),
        InputError,
        "structure: expected LPVARX(outputs=..., inputs=..., scheduling=..., ...), got",
    ),
    "a fit outside its basis": (
        lambda s: idn.fit(
            idn.LPVARX("y", "u", "p", na=1, nb=1, basis=idn.Polynomial(1, 5.0, 6.0)), s.record
        ),
        InputError,
        "the scheduling parameter spans [-1, 1] but the basis is declared on [5, 6]",
        "declare the basis over the whole range of the data",
    ),
    "instruments without names": (
        lambda s: idn.fit(s.arx, s.record, method="iv"),
        InputError,
        'method "iv" needs its instruments: InstrumentalVariables(("name", ...)), the',
    ),
    "a horizon of zero": (
        lambda s: s.model.score(s.record, 0),
        InputError,
        "horizon: expected a whole number of steps >= 1, got 0",
        "a free run is simulate()",
    ),
    "a horizon of half a sample": (
        lambda s: s.model.score(s.record, 0.5),
        InputError,
        "horizon: expected a whole number of steps >= 1, got 0.5",
        "a free run is simulate()",
    ),
    "a score of another record": (
        lambda s: s.model.score(s.record.select(["y", "p"])),
        UnknownNameError,
        "unknown signal 'u'",
        "known: y, p",
    ),
    "a model saved on a folder": (
        lambda s: s.model.save("."),
        SymheliError,
        ". is a folder: give the name of a file in it, such as model.json",
    ),
    "a model from a picture": (
        lambda s: idn.model.LPVARXModel.load(s.picture),
        InputError,
        "picture.png: not a whole file of 'symheli LPV-ARX model' ('utf-8' codec can't",
        "take an older copy",
    ),
    "a model from another file": (
        lambda s: idn.model.LPVARXModel.load(s.family_file),
        InputError,
        "family.json: expected a file of 'symheli LPV-ARX model', got 'symheli linear",
    ),
    "a model at a speed of words": (
        lambda s: s.model.at("fast"),
        InputError,
        "scheduling parameter: expected numbers, got 'fast'",
    ),
    "a forgetting above one": (
        lambda s: idn.RecursiveLeastSquares(s.arx, 1.2),
        InputError,
        "forgetting: expected a factor in (0, 1], got 1.2",
        "0.99 forgets within 100 samples",
    ),
    "a forgetting of zero": (
        lambda s: idn.RecursiveLeastSquares(s.arx, 0.0),
        InputError,
        "forgetting: expected a factor in (0, 1], got 0.0",
        "0.99 forgets within 100 samples",
    ),
    "a precision misspelt": (
        lambda s: idn.RecursiveLeastSquares(s.arx, precision="half"),
        InputError,
        'precision: expected "double" or "single", got \'half\'',
    ),
    "an order of zero": (
        lambda s: idn.StateSpace("y", "u", order=0),
        InputError,
        "order: expected a whole number >= 1, got 0",
    ),
    "an order scan of nothing": (
        lambda s: idn.order_scan(s.arx, s.record, s.record, orders=()),
        InputError,
        "orders, degrees: name at least one of each",
    ),
    "a response of an output misspelt": (
        lambda s: idn.frequency_response(s.record, ["z"], ["u"], window=10.0),
        UnknownNameError,
        "unknown signal 'z'",
        "known: y, u, p",
    ),
    "a window longer than the record": (
        lambda s: idn.frequency_response(s.record, ["y"], ["u"], window=1e4),
        ExcitationError,
        "a window of 10000.0 s is longer than every record",
        "shorten the window or record longer",
    ),
    "no frozen models": (
        lambda s: idn.compare_frozen({}, {}, scales={}),
        InputError,
        "compare_frozen: give models={name: ...} and reference={point: ...}",
    ),
    "a calibration of a parameter misspelt": (
        lambda s: idn.calibrate(s.heli, s.record, ["body.mas"]),
        UnknownNameError,
        "unknown parameter 'body.mas'",
        "did you mean 'body.mass' or 'body.Izz' or 'body.Iyy'?",
    ),
    "a calibration without inputs": (
        lambda s: idn.calibrate(s.heli, s.record),
        InputError,
        "the record has no d_lon, d_lat, d_col, d_ped: calibration needs the deflection",
        "it has y, u, p",
    ),
    "experiments to choose from nothing": (
        lambda s: idn.choose_experiments((), 1),
        ExcitationError,
        "no candidate keeps its limits ()",
        "lower the amplitudes or widen the limits",
    ),
    "residuals over no lags": (
        lambda s: idn.residual_analysis(s.model, s.record, lags=0),
        InputError,
        "lags: expected a whole number >= 1, got 0",
    ),
    "a loop fit without scales": (
        lambda s: idn.fit_for_control(s.model, s.record, {("u", "y"): -0.1}, scales={}),
        InputError,
        "scales: name at least one output and one input of the model (y",
        "u), got ",
    ),
    "matrices that are no list": (
        lambda s: LPVStateSpace.polynomial([[0, 1], [-1, 0]], [[[0], [1]]], [[[1, 0]]], [[[0]]], P),
        InputError,
        "A: expected a list of coefficient matrices [A0, A1, ...], A(p) = A0 + p A1 +",
        "write [A0]",
    ),
    "two inputs of one column": (
        lambda s: LPVStateSpace.polynomial(
            [[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], P, inputs=["a", "b"]
        ),
        InputError,
        "inputs: 2 names, a, b, for 1 in the matrices",
    ),
    "matrices of other sizes": (
        lambda s: LPVStateSpace.polynomial([[[-1.0]]], [[[1.0], [2.0]]], [[[1.0]]], [[[0.0]]], P),
        InputError,
        "B: expected matrices of shape (1, 1), got (2, 1)",
    ),
    "a matrix with NaN": (
        lambda s: LPVStateSpace.polynomial([[[np.nan]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], P),
        InputError,
        "A(0,): entry (0, 0) is nan",
        "every entry must be a finite number",
    ),
    "a parameter as a word": (
        lambda s: LPVStateSpace.polynomial([[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], "p"),
        InputError,
        "expected a Scheduling or several, got 'p'",
    ),
    "a range upside down": (
        lambda s: Scheduling("p", "1", 1.0, 0.0),
        InputError,
        "scheduling p: expected finite low < high, got [1.0, 0.0]",
    ),
    "a range of one point": (
        lambda s: Scheduling("p", "1", 1.0, 1.0),
        InputError,
        "scheduling p: expected finite low < high, got [1.0, 1.0]",
    ),
    "a rate below zero": (
        lambda s: Scheduling("p", "1", 0.0, 1.0, rate=-1.0),
        InputError,
        "scheduling p: rate must be >= 0 1/s, got -1.0",
    ),
    "a range without unit": (
        lambda s: Scheduling("p", 0.0, 1.0, 2.0),
        InputError,
        "scheduling: expected a name and a unit before the range, as",
    ),
    "a model outside its range": (
        lambda s: s.lag.at(5.0),
        InputError,
        "p spans [5, 5] 1 but the model holds on [0, 1]",
        "clip the data or identify and sweep over a wider range",
    ),
    "a model at two values": (
        lambda s: s.lag.at(0.1, 0.2),
        InputError,
        "at: expected 1 value(s), one for each of p, got 2",
    ),
    "a model sampled at zero": (
        lambda s: s.lag.discretize(0.0),
        InputError,
        "dt must be a positive number of seconds or None, got 0.0",
    ),
    "a model from a family": (
        lambda s: LPVStateSpace.load(s.family_file),
        InputError,
        "family.json: expected a file of 'symheli LPV state space', got 'symheli linear",
    ),
    "a Bode plot of an input misspelt": (
        lambda s: lpv.bode(s.lag, "v", "y"),
        UnknownNameError,
        "unknown input 'v'",
        "known: u",
    ),
    "a step outside the range": (
        lambda s: lpv.step(s.lag, "u", "y", p=7.0),
        InputError,
        "p spans [7, 7] 1 but the model holds on [0, 1]",
        "clip the data or identify and sweep over a wider range",
    ),
    "a truncation to no order": (
        lambda s: lpv.balanced_truncation(s.lag, -1),
        InputError,
        "order: a model of 1 states cannot be truncated",
    ),
    "a truncation to more states": (
        lambda s: lpv.balanced_truncation(s.lag, 5),
        InputError,
        "order: a model of 1 states cannot be truncated",
    ),
    "a gap of models of other sizes": (
        lambda s: lpv.nu_gap(s.linear, s.linear.select(inputs=["d_lon"])),
        InputError,
        "nu-gap: expected models with the same inputs and outputs in the same order, got",
    ),
    "a gap of an LPV model": (
        lambda s: lpv.nu_gap(s.lag, s.lag),
        InputError,
        "expected a LinearModel, got LPVStateSpace",
        "an LPV model has .at(p)",
    ),
    "a series of strangers": (
        lambda s: lpv.series(s.lag, s.linear),
        InputError,
        "series connection needs as many inputs (4) as outputs of the other (1)",
        "inputs d_lon, d_lat, d_col, d_ped, outputs y: choose some with P[outputs,",
    ),
    "a connection to nothing": (
        lambda s: lpv.connect(s.lag, inputs=["v"], outputs=["y"]),
        InputError,
        "nothing feeds the input u: no output or external input has that name, nor does",
    ),
    "a connection of no system": (
        lambda s: lpv.connect(inputs=["u"], outputs=["y"]),
        InputError,
        "append needs at least one system",
    ),
    "a spline of one node": (
        lambda s: lpv.CubicSpline((0.0,)),
        InputError,
        "CubicSpline needs at least 4 strictly increasing nodes, got (0.0,)",
    ),
    "nodes that turn back": (
        lambda s: lpv.PiecewiseLinear((0.0, 2.0, 1.0)),
        InputError,
        "PiecewiseLinear needs at least 2 strictly increasing nodes, got (0.0, 2.0, 1.0)",
    ),
    "a spline of degree zero below": (
        lambda s: lpv.BSpline(-1, (0.0, 1.0)),
        InputError,
        "degree must be an integer >= 1, got -1",
    ),
    "a plant without controls": (
        lambda s: synthesis.output_feedback(synthesis.Plant(s.lag)),
        InputError,
        "the plant has no disturbances: name them, Plant(model, disturbances=[...])",
    ),
    "a plant with a channel misspelt": (
        lambda s: synthesis.Plant(
            s.generalized, disturbances=["w"], performance=["z"], controls=["v"], measurements=["y"]
        ),
        UnknownNameError,
        "unknown control 'v'",
        "known: w, u",
    ),
    "a channel as control and disturbance": (
        lambda s: synthesis.Plant(
            s.generalized, disturbances=["u"], performance=["z"], controls=["u"], measurements=["y"]
        ),
        InputError,
        "u is a disturbance and a control: keep it as a control, and",
    ),
    "a plant of a word": (
        lambda s: synthesis.Plant("xcell60"),
        InputError,
        "model: expected an LPVStateSpace, an UncertainStateSpace, an LFT, a LinearModel or a",
    ),
    "a design of a model": (
        lambda s: synthesis.output_feedback(s.lag),
        InputError,
        "plant: expected a synthesis.Plant, got LPVStateSpace",
        "declare the signals of a model first: synthesis.Plant(model,",
    ),
    "noise on a measurement misspelt": (
        lambda s: s.plant.with_noise({"x": 0.1}),
        UnknownNameError,
        "unknown measurement 'x'",
        "known: y",
    ),
    "noise as a number": (
        lambda s: s.plant.with_noise(0.1),
        InputError,
        "noise: expected {measurement: size}, got 0.1",
    ),
    "a delay of the plant below zero": (
        lambda s: s.plant.with_delay(-0.1),
        InputError,
        "expected a delay > 0 s and an order from 1 to 10, got -0.1 s and 4",
    ),
    "a plant sampled at zero": (
        lambda s: s.plant.sampled(0.0),
        InputError,
        "dt must be a positive number of seconds or None, got 0.0",
    ),
    "a rate in words": (
        lambda s: synthesis.l2_gain(s.lag, "fast"),
        UnknownNameError,
        "unknown scheduling parameter (the rate of p) 'fast'",
        "known: p",
    ),
    "a rate below zero to certify": (
        lambda s: synthesis.l2_gain(s.lag, -1.0),
        InputError,
        "rate must be >= 0 (math.inf: arbitrarily fast), one for all, one for each of p",
    ),
    "a rate of no number": (
        lambda s: synthesis.stability(s.lag, float("nan")),
        InputError,
        "rate must be >= 0 (math.inf: arbitrarily fast), one for all, one for each of p",
    ),
    "a certificate of a helicopter": (
        lambda s: synthesis.l2_gain(s.heli),
        InputError,
        "expected an LPVStateSpace, an UncertainStateSpace or an LFT, got Helicopter",
        "make one with LPVStateSpace.polynomial(...) or LinearFamily.interpolate()",
    ),
    "a solver misspelt": (
        lambda s: synthesis.l2_gain(s.lag, solver="CLARABELL"),
        SolverError,
        "solver 'CLARABELL' is not available",
        "installed here: CLARABEL, SCS, and solver='LYAPUNOV', interior-point method for",
    ),
    "a form in words": (
        lambda s: synthesis.l2_gain(s.lag, form="spline"),
        InputError,
        "form must be a Spline, LaggedParameter or HigherOrder, got 'spline'",
    ),
    "margins of two loops": (
        lambda s: synthesis.margins(s.linear),
        InputError,
        "margins need a loop of one input and one output, got 4 and 10",
        "break it with open_loop()",
    ),
    "margins of an LPV model": (
        lambda s: synthesis.margins(s.lag),
        InputError,
        "expected a LinearModel or a system of python-control, got LPVStateSpace",
        "an LPV model has .at(p), a Plant .nominal.at(p)",
    ),
    "a margin table at a place misspelt": (
        lambda s: synthesis.margin_table(s.lag, {("u", "y"): -1.0}, "v"),
        UnknownNameError,
        "unknown input 'v'",
        "known: u",
    ),
    "a certificate from a picture": (
        lambda s: synthesis.Certificate.load(s.picture),
        InputError,
        "picture.png: expected a proven statement as JSON, got another or a damaged file",
        "write it again with its .save",
    ),
    "a certificate from a model": (
        lambda s: synthesis.Certificate.load(s.family_file),
        InputError,
        "family.json: expected the schema 'symheli statement'",
        "this file was not written by the .save of a certificate",
    ),
    "no objectives": (
        lambda s: synthesis.multiobjective(s.plant, []),
        InputError,
        "objectives: expected one or more of L2, H2 and EnergyToPeak, got none",
    ),
    "a tolerance below zero": (
        lambda s: synthesis.Solver(tolerance=-1.0),
        InputError,
        "expected 0 < tolerance < 1, iterations >= 1 and time_limit > 0 s, got tolerance",
    ),
    "a test of an LFT misspelt": (
        lambda s: synthesis.lft_gain(s.lag.to_lft(), "DGG"),
        UnknownNameError,
        "unknown scaling 'DGG'",
        "did you mean 'DG' or 'D'? (known: small gain, D, DG, full block)",
    ),
    "an LFT test of an LPV model": (
        lambda s: synthesis.lft_gain(s.lag),
        InputError,
        "expected an LFT, got LPVStateSpace",
        "a polynomial LPVStateSpace becomes one with .to_lft().reduce()",
    ),
    "a controller table from a picture": (
        lambda s: symheli.TableController.load(s.picture),
        InputError,
        "picture.png: not a whole file of 'symheli table controller' ('utf-8' codec",
        "take an older copy",
    ),
    "a controller reduced to more states": (
        lambda s: s.controller.reduce(99),
        InputError,
        "order: the controller has 1 states, fewer than 99",
        "give at most 1",
    ),
    "a controller reduced to no states": (
        lambda s: s.controller.reduce(-1),
        InputError,
        "order: expected an integer >= 0, got -1",
    ),
    "a controller sampled at zero": (
        lambda s: s.controller.discretize(0.0),
        InputError,
        "dt: expected a number > 0, got 0.0",
    ),
    "a controller outside its range": (
        lambda s: s.controller.at(9.0),
        InputError,
        "p spans [9, 9] 1 but the model holds on [0, 1]",
        "clip the data or identify and sweep over a wider range",
    ),
}

WORDS = (
    ("trim --airspeed", 2, "argument --airspeed: expected one argument"),
    (
        "trim --airspeed -5",
        1,
        "--airspeed must be >= 0 m/s, got -5",
        "rearward flight is --airspeed 5 --sideslip-deg 180",
    ),
    ("trim --airspeed nan", 2, "argument --airspeed: expected a finite number, got 'nan'"),
    (
        "trim --airspeed 80",
        1,
        "no trim at 80 m/s: the best point leaves du/dt = -4.11e+01 m/s^2, dw/dt =",
        "and beyond validity, an advance ratio of 0.608 at",
    ),
    (
        "trim --climb-rate 3",
        1,
        "--climb-rate 3 exceeds the --airspeed of 0 m/s of the total velocity",
        "straight up is --airspeed 3 --climb-rate 3",
    ),
    (
        "trim --altitude 1e6",
        1,
        "altitude: expected -2000 .. 20000 m above sea level, got 1000000.0",
        "feet times 0.3048 are metres",
    ),
    (
        "trim --governor PI",
        2,
        "argument --governor: invalid choice: 'PI' (choose from 'ideal', 'pi')",
    ),
    (
        "trim --printed tail",
        1,
        "unknown printed option 'tail'",
        "known: lateral_flapping, flapping_sign, fuselage_downwash, rotor_reaction,",
    ),
    (
        "trim --vehicle xcel60",
        1,
        "unknown vehicle 'xcel60'",
        "did you mean 'xcell60'? (known: xcell60, xcell_kahn_hudson, yamaha_r50)",
    ),
    (
        "trim missing.toml",
        1,
        "no vehicle file at missing.toml",
        "packaged airframes: xcell60, xcell_kahn_hudson, yamaha_r50",
    ),
    (
        "trim text.txt",
        1,
        "unknown vehicle 'text.txt'",
        "known: xcell60, xcell_kahn_hudson, yamaha_r50",
    ),
    (
        "trim --vehicle xcell60 yamaha_r50",
        2,
        "two vehicles are given, xcell60 and yamaha_r50: give one",
    ),
    (
        "trim --vehicle xcell60 --vehicle yamaha_r50",
        2,
        "two vehicles are given, xcell60 and yamaha_r50: give one",
    ),
    (
        "trim --allow-code",
        1,
        "--allow-code runs the Python files that a vehicle file or a campaign names, and",
    ),
    ("linearize --airspeed 5,0", 2, "argument --airspeed: expected a number, got '5,0'"),
    (
        "derivatives --airspeeds 5 2 3",
        2,
        "argument --airspeeds: expected LOW < HIGH and a whole number of points, got 5 2",
    ),
    ("derivatives --airspeeds 0 5", 2, "argument --airspeeds: expected 3 arguments"),
    (
        "derivatives --airspeeds -5 5 3",
        1,
        "airspeed must be >= 0 m/s, got -5.0",
        "rearward flight is sideslip = pi",
    ),
    (
        "derivatives --airspeeds 0 5 2.5",
        2,
        "argument --airspeeds: expected LOW < HIGH and a whole number of points, got 0 5",
    ),
    (
        "derivatives --airspeeds 0 90 3",
        1,
        "no trim at 45 m/s: the best point leaves du/dt = -1.08e+01 m/s^2, dw/dt =",
        "and beyond validity, an advance ratio of 0.337 at 4",
    ),
    (
        "derivatives --airspeeds 0 5 2 --out text.txt",
        1,
        "text.txt/derivatives.csv: cannot be written (File exists)",
        "choose another place",
    ),
    (
        "envelope --climb-rates 1 0 3",
        2,
        "argument --climb-rates: expected LOW < HIGH and a whole number of points, got 1",
    ),
    (
        "vehicles nobody",
        1,
        "unknown vehicle 'nobody'",
        "known: xcell60, xcell_kahn_hudson, yamaha_r50",
    ),
    ("vehicles --toml --reference", 2, "argument --reference: not allowed with argument --toml"),
    (
        "vehicles picture.png",
        1,
        "unknown vehicle 'picture.png'",
        "known: xcell60, xcell_kahn_hudson, yamaha_r50",
    ),
    (
        "export pdf",
        2,
        "argument format: invalid choice: 'pdf' (choose from 'c', 'identifier', 'model',",
    ),
    ("export", 2, "the following arguments are required: format"),
    (
        "export c --model model.json",
        1,
        "--model applies to the formats model, controller, monitor, fmu and mat",
        "c is written for a vehicle",
    ),
    (
        "export model",
        1,
        "name the model: --model FILE.json, as symheli identify LOG --save FILE.json",
    ),
    (
        "export model --model picture.png",
        1,
        "picture.png: expected a model of symheli identify --save, or a family of linear",
    ),
    ("export model --model missing.json", 1, "missing.json: No such file or directory"),
    (
        "export model --model family.json",
        1,
        "family.json: a family of linear models cannot be exported as C",
        "symheli export mat writes it for MATLAB",
    ),
    (
        "export controller",
        1,
        "name the controller: --model FILE.json, as TableController.save writes it",
    ),
    (
        "export controller --model family.json",
        1,
        "family.json: expected a file of 'symheli table controller', got 'symheli linear",
    ),
    ("export identifier --outputs qq", 1, "unknown signal 'qq'", "did you mean 'q'?"),
    (
        "export identifier --forgetting 2",
        1,
        "forgetting: expected a factor in (0, 1], got 2.0",
        "0.99 forgets within 100 samples",
    ),
    ("export identifier --airspeeds 5 5", 1, "a basis needs finite low < high, got [5.0, 5.0]"),
    ("export mat --points 0", 2, "argument --points: expected a whole number >= 1, got '0'"),
    (
        "export mat --airspeeds 5 2",
        1,
        "expected 0 <= LOW < HIGH and at least two points, got 5 to 2 m/s in 14",
    ),
    ("export c --out .", 1, ".: expected a name that ends in .c"),
    (
        "margins --airspeeds 5 2",
        1,
        "expected 0 <= LOW < HIGH and more points than the degree of the interpolation",
    ),
    (
        "margins --airspeeds 0 5 --points 2",
        1,
        "expected 0 <= LOW < HIGH and more points than the degree of the interpolation",
    ),
    (
        "margins --feedback d_lat=phi",
        2,
        "argument --feedback: expected input=output:gain such as d_lat=phi:-0.03, got",
    ),
    (
        "margins --feedback d_lat=phii:-0.1",
        1,
        "unknown output 'phii'",
        "did you mean 'phi' or 'p'?",
    ),
    (
        "margins --feedback d_latt=phi:-0.1",
        1,
        "unknown input 'd_latt'",
        "did you mean 'd_lat' or 'd_lon' or 'd_col'? (known: d_lon, d_lat, d_col, d_ped)",
    ),
    (
        "margins --model family.json",
        1,
        "give the loop to analyse, as --feedback d_lat=phi:-0.02 or as --controller FILE",
    ),
    (
        "margins --model list.json --feedback d_lat=phi:-0.1",
        1,
        "list.json: expected a model of symheli identify --save, or a family of linear",
    ),
    ("margins --states p,r", 1, "--states need a model from a file: give --model FILE"),
    (
        "margins --controller list.json",
        1,
        "--controller goes with --model FILE",
        "of a vehicle, with its servos and delay: symheli specs xcell60 --controller",
    ),
    (
        "margins --model model.json --states y --feedback u=y:-0.1",
        1,
        "--states selects states of a family",
        "an identified model keeps its own",
    ),
    ("margins --model model.json --feedback u=z:-0.1", 1, "unknown output 'z'", "known: y"),
    (
        "certify --channel inputs --model model.json",
        1,
        "--channel selects a channel of a vehicle's lateral loop",
        "for a model give --inputs and --outputs",
    ),
    ("certify --inputs u", 1, "--inputs need a model from a file: give --model FILE"),
    ("certify --rate -1", 2, "argument --rate: expected a number >= 0 or inf, got '-1'"),
    ("certify --rate fast", 2, "argument --rate: expected a number, got 'fast'"),
    (
        "certify --across 2 2 --airspeeds 6 9",
        1,
        "--across sets how P depends on the lag error",
        "give --memory S with it",
    ),
    ("certify --order 0", 2, "argument --order: expected a whole number >= 1, got '0'"),
    ("certify --airspeeds 9 6", 1, "sweep needs increasing airspeeds"),
    ("certify --segments", 2, "argument --segments: expected at least one argument"),
    ("certify --model missing.json", 1, "missing.json: No such file or directory"),
    ("identify", 2, "the following arguments are required: LOG"),
    ("identify missing.csv", 1, "missing.csv: there is no such file"),
    (
        "identify picture.png",
        1,
        "picture.png: expected a text file, this one is binary (it contains zero bytes)",
    ),
    ("identify empty.csv", 1, "empty.csv: the file is empty"),
    ("identify text.txt", 1, "text.txt: a header but no rows"),
    (
        "identify log.csv --outputs y",
        1,
        "give the signals to predict and the inputs that drive them: --outputs q,theta",
    ),
    (
        "identify log.csv --outputs y --inputs u --scheduling q",
        1,
        "the unit of 'y' is not known: --units y=UNIT, such as rad, deg/s, m/s, or 1",
    ),
    (
        "identify log.csv --outputs y --inputs v --scheduling p --units y=deg u=1 p=m/s",
        1,
        "unknown column 'v'",
        "known: t, y, u, p",
    ),
    (
        "identify log.csv --outputs y --inputs y --scheduling p --units y=deg u=1 p=m/s",
        1,
        "a signal is either an output or an input",
        "both: y",
    ),
    (
        "identify log.csv --outputs y --inputs u --scheduling p",
        1,
        "the unit of 'y' is not known: --units y=UNIT, such as rad, deg/s, m/s, or 1",
    ),
    (
        "identify log.csv FIT --instruments u",
        1,
        "--instruments are for --method armax, bj, iv, oe, riv",
        ", not ls",
    ),
    (
        "identify log.csv FIT --method iv",
        1,
        "--method iv needs its instruments: --instruments A,B, the external excitation",
    ),
    (
        "identify log.csv FIT --train 2",
        2,
        "argument --train: expected a fraction in (0, 1], got '2'",
    ),
    (
        "identify log.csv FIT --train 0.5 --test log.csv",
        1,
        "--test holds out another log, --train a part of this one: give one of the two",
    ),
    (
        "identify log.csv FIT --method lms",
        2,
        "argument --method: invalid choice: 'lms' (choose from 'armax', 'bj', 'iv',",
    ),
    (
        "identify log.csv FIT --start 30 --stop 20",
        1,
        "no samples lie between start and stop",
        "the record goes from 0 to 44.95 s",
    ),
    (
        "identify log.csv FIT --save model.txt",
        2,
        "argument --save: expected a file that ends in .json or .mat, got 'model.txt'",
    ),
    (
        "identify log.csv FIT --bands fits.doc",
        2,
        "argument --bands: expected a file that ends in .png, .svg, .pdf, got 'fits.doc'",
    ),
    (
        "identify log.csv FIT --segments 7",
        1,
        "--segments: expected serving, all or numbers from 1 to 1 with commas between",
    ),
    (
        "identify log.csv FIT --format ulog",
        1,
        "log.csv: the columns of an autopilot's log are named in a signal map, --map",
        "symheli identify with the log alone suggests one",
    ),
    ("identify log.csv FIT z=deg", 1, "unknown signal in --units 'z'", "known: y, u, p"),
    (
        "identify log.csv --outputs y, --inputs u",
        2,
        "argument --outputs: expected names with commas between them, got 'y,'",
    ),
    (
        "identify log.csv --map map.toml --outputs theta --inputs stick --degree 0",
        1,
        "unknown signal 'stick'",
        "known: theta, constant",
    ),
    (
        "identify map.toml",
        1,
        "map.toml: expected a flight log, got a TOML file",
        "a signal map goes with --map FILE.toml beside the log, and a vehicle is shown",
    ),
    ("identify log.csv --dt 0", 2, "argument --dt: expected a number > 0, got '0'"),
    (
        "identify log.csv --decimate 0",
        2,
        "argument --decimate: expected a whole number >= 1, got '0'",
    ),
    (
        "calibrate xcell60",
        1,
        "xcell60 is taken as the vehicle, and there is no log: symheli calibrate VEHICLE",
    ),
    (
        "calibrate log.csv",
        1,
        "log.csv is taken as the vehicle, and there is no log: symheli calibrate VEHICLE",
    ),
    ("calibrate xcell60 log.csv", 1, "unknown column 'd_lon'", "known: t, y, u, p"),
    ("calibrate xcell60 missing.csv", 1, "missing.csv: there is no such file"),
    (
        "calibrate xcell60 log.csv --write out.json",
        1,
        "--write: expected a file that ends in .toml, got out.json",
    ),
    (
        "tune xcell60 log.csv",
        1,
        "nothing is changed: give --set NAME=VALUE, such as ATC_RAT_RLL_P=0.15",
    ),
    ("tune xcell60 log.csv --set A", 2, "argument --set: expected NAME=NUMBER, got 'A'"),
    (
        "tune xcell60 log.csv --set ATC_RAT_RLL_P=high",
        2,
        "argument --set: expected a number, got 'high'",
    ),
    (
        "tune xcell60 log.csv --set ATC_RAT_RLL_P=0.1",
        1,
        "log.csv, line 1: expected NAME,VALUE, got 't,y,u,p'",
    ),
    (
        "tune log.csv --set ATC_RAT_RLL_P=0.1",
        1,
        "log.csv, line 1: expected NAME,VALUE, got 't,y,u,p'",
    ),
    ("specs --airspeeds 5 2", 1, "expected 0 <= LOW < HIGH and at least two points"),
    ("specs --points 1", 1, "expected 0 <= LOW < HIGH and at least two points"),
    (
        "specs --only nobody",
        1,
        "unknown controller of the study 'nobody'",
        "known: LQR schedule, H-infinity schedule, LFT, LPV from the baseline, LPV from",
    ),
    (
        "specs --study missing",
        1,
        "missing/study.toml does not exist",
        "symheli study --write-config missing/study.toml writes one with the defaults",
    ),
    ("specs --sheet missing.toml", 1, "missing.toml: No such file or directory"),
    ("specs --controller missing.json", 1, "missing.json: No such file or directory"),
    (
        "specs --controller family.json",
        1,
        "family.json: expected a file of 'symheli table controller', got 'symheli linear",
    ),
    (
        "specs --figure fig.doc",
        2,
        "argument --figure: expected a file that ends in .png, .svg, .pdf, got 'fig.doc'",
    ),
)


@pytest.fixture(scope="module")
def made(ideal, tmp_path_factory):
    """What the mistakes are made with, and files in a folder."""
    folder: Path = tmp_path_factory.mktemp("mistakes")
    rng, n = np.random.default_rng(0), 300
    p, u, y = np.sin(0.05 * np.arange(n)), rng.uniform(-1, 1, n), np.zeros(n)
    for k in range(1, n):
        y[k] = (0.5 + 0.3 * p[k - 1]) * y[k - 1] + u[k - 1] + 0.01 * rng.normal()
    record = symheli.FlightRecord.from_arrays(
        0.1 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=p
    )
    arx = idn.LPVARX("y", "u", "p", na=1, nb=1, basis=idn.Polynomial(1, -1.0, 1.0))
    lag = LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], P, inputs=["u"], outputs=["y"]
    )
    generalized = LPVStateSpace.polynomial(
        [[[-1.0]], [[-1.0]]],
        [[[1.0, 1.0]]],
        [[[1.0], [1.0]]],
        [[[0.0, 0.0], [0.0, 0.0]]],
        P,
        inputs=["w", "u"],
        outputs=["z", "y"],
    )
    plant = synthesis.Plant(
        generalized,
        disturbances=["w"],
        performance=["z", "u"],
        controls=["u"],
        measurements=["y"],
    ).with_noise({"y": 0.1})
    found = SimpleNamespace(
        folder=folder,
        heli=ideal,
        point=symheli.trim(ideal, 5.0),
        linear=symheli.linearize(ideal, 5.0),
        family=symheli.sweep(ideal, [2.0, 5.0]),
        family_file=folder / "family.json",
        record=record,
        arx=arx,
        model=idn.fit(arx, record),
        lag=lag,
        generalized=generalized,
        plant=plant,
        controller=synthesis.lqg(plant, [0.0, 1.0]),
        empty=folder / "empty.csv",
        picture=folder / "picture.png",
        servo=symheli.Servo(natural_frequency=30.0, damping=0.7),
    )
    found.family.save(found.family_file)
    found.model.save(folder / "model.json")
    found.empty.touch()
    found.picture.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    rows = zip(0.05 * np.arange(900), *(np.resize(a, 900) for a in (y, u, p)), strict=True)
    table = [",".join(f"{v:.9g}" for v in row) for row in rows]
    (folder / "log.csv").write_text("\n".join(["t,y,u,p", *table]))
    (folder / "map.toml").write_text(
        'time = "t"\n[signals]\ntheta = { column = "y", unit = "deg" }\n'
    )
    (folder / "text.txt").write_text("hello\n")
    (folder / "list.json").write_text("[1]")
    return found


@pytest.mark.parametrize("mistake", PYTHON)
def test_a_mistake_in_a_call_is_answered(made, mistake):
    call, kind, *words = PYTHON[mistake]
    with pytest.raises(SymheliError) as found:
        call(made)
    assert type(found.value) is kind
    for part in words:
        assert part in str(found.value)


@pytest.mark.parametrize("row", WORDS, ids=lambda row: row[0])
def test_a_mistake_on_the_command_line_is_answered(made, row, capsys, monkeypatch):
    line, status, *words = row
    monkeypatch.chdir(made.folder)
    assert cli.main(shlex.split(line.replace("FIT", FIT))) == status
    told = capsys.readouterr()
    assert told.out == ""
    assert "Traceback" not in told.err
    for part in words:
        assert part in told.err
