"""One aggressive transition predicted by the LFT baseline and by the stitched model from the same
linearizations; about 10 s.
"""

import numpy as np

import symheli
from identification.judge import BaselinePredictor

OUTPUTS = {
    "u": "m/s",
    "w": "m/s",
    "q": "deg/s",
    "theta": "deg",
    "v": "m/s",
    "r": "deg/s",
    "phi": "deg",
}
EVERY = 10  # samples between the starts of two predictions
heli = symheli.Helicopter.load("xcell60", governor="ideal")
family = symheli.sweep(heli, np.linspace(0.0, 15.0, 16))
excitation = symheli.Excitation({"d_lon": 0.01, "d_lat": 0.01, "d_ped": 0.02})
flight = symheli.fly(
    heli, symheli.AirspeedSchedule.transition(0.0, 13.0, acceleration=5.0), excitation=excitation
)
body = heli.vehicle.values("body")
inertia = (
    body["Ixx"],
    body["Iyy"],
    body["Izz"],
    heli.vehicle.values("drivetrain")["inertia"],
)  # ideal governor: the rotor yaws along

lft = BaselinePredictor(
    family.interpolate("polynomial", degree=3), flight, scheduling="airspeed_command"
)
stitched = {
    f"stitched, {s:g} s": symheli.flight.StitchedModel.from_family(
        family, filter=s, inertia=inertia
    )
    for s in (0.0, 0.5, 5.0)
}
x, u, truth = flight.columns(heli.states), flight.columns(heli.inputs), flight.columns(OUTPUTS)
columns = [heli.states.index(y) for y in OUTPUTS]
scale = np.array([180 / np.pi if unit.startswith("deg") else 1.0 for unit in OUTPUTS.values()])


def show(name: str, errors: np.ndarray) -> None:
    print(
        name.ljust(28) + "".join(f"{e:14.2f}" for e in scale * np.sqrt(np.mean(errors**2, axis=0)))
    )


print(
    "root mean square error".ljust(28)
    + "".join(f"{f'{y}, {unit}':>14}" for y, unit in OUTPUTS.items())
)
show("the flight's own variation", truth - truth.mean(axis=0))
for horizon in (50, 200):  # samples of 20 ms
    starts = np.arange(0, len(x) - horizon, EVERY)
    windows = np.stack([u[starts + h] for h in range(horizon + 1)])
    print(f"{horizon * flight.dt:g} s ahead")
    show("LFT, cubic, trim drift", (lft.predict(tuple(OUTPUTS), horizon) - truth)[starts + horizon])
    for name, model in stitched.items():
        end = model.simulate(windows, x[starts], dt=flight.dt)[-1]
        show(name, end[:, columns] - truth[starts + horizon])
