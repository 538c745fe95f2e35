"""From equations to an identified model in a few lines; runs in a few seconds."""

import identification
import symheli

heli = symheli.Helicopter.load("xcell60", governor="ideal")
point = symheli.trim(heli, airspeed=5.0)
print(f"{point.outcome}: theta {point.x['theta']:.4f} rad, collective {point.u['d_col']:.4f} rad")
print("poles, rad/s:", symheli.linearize(heli, point).poles().round(2))

family = symheli.sweep(heli, [0.0, 2.0, 4.0, 6.0, 8.0])
lateral = family.select(states=["v", "p", "r", "phi", "b1"], inputs=["d_lat", "d_ped"]).interpolate(
    "polynomial", degree=3
)
print("order of the LFT:", lateral.to_lft().order, "reduced:", lateral.to_lft().reduce(1e-12).order)

excitation = symheli.Excitation(
    {"d_lon": 0.012, "d_lat": 0.012, "d_col": 0.01, "d_ped": 0.02}, seed=1
)
training = symheli.fly(
    heli,
    symheli.AirspeedSchedule.transition(0.0, 8.0, acceleration=2.0, laps=2),
    excitation=excitation,
)
unseen = symheli.fly(heli, symheli.AirspeedSchedule.transition(0.0, 7.5, acceleration=1.5))
basis = identification.Polynomial(degree=2, low=0.0, high=8.0)
structure = identification.LPVARX(
    ("q", "theta"),
    ("d_lon", "d_col"),
    "airspeed_command",
    na=3,
    nb=3,
    delay=1,
    basis=basis,
    offset=True,
)
model = identification.fit(structure, training)
for name, horizon in (("one step", 1), ("1 s", 50), ("free run", None)):
    print(f"fit of an unseen flight, {name}: {model.score(unseen, horizon)}")
