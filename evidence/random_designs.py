"""Controllers for identified models with random settings: each ends in a design or in a sentence.

python -m evidence.random_designs [N]
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from dataclasses import replace

import numpy as np

import identification
import symheli
from studies.controllers import starting
from studies.controllers.design_choices import DesignChoices
from studies.controllers.synthesized import synthesized
from studies.setup.axes import LONGITUDINAL
from symheli.errors import SymheliError

SETTINGS = 80
OUTPUTS, INPUTS = LONGITUDINAL.outputs, LONGITUDINAL.inputs


def flown() -> symheli.FlightRecord:
    """Return the flight that all models are identified from."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    return symheli.fly(
        heli,
        symheli.AirspeedSchedule.transition(0.0, 10.0, acceleration=1.5),
        excitation=symheli.Excitation({"d_lon": 0.012, "d_col": 0.010}, seed=3),
        noise_db=30.0,
        seed=3,
    )


def drawn(seed: int, record: symheli.FlightRecord) -> tuple[DesignChoices, object]:
    """Return choices and a model of random lags, signals, sizes, noise, servos and delay."""
    rng = np.random.default_rng(seed)
    several = int(rng.integers(1, len(OUTPUTS) + 1))
    outputs = tuple(str(y) for y in rng.permutation(OUTPUTS)[:several])
    inputs = INPUTS if rng.random() < 0.6 else (str(rng.choice(INPUTS)),)
    basis = identification.Polynomial(int(rng.integers(0, 4)), 0.0, 10.0)
    structure = identification.LPVARX(
        outputs=outputs,
        inputs=inputs,
        scheduling="airspeed_command",
        na=int(rng.integers(1, 4)),
        nb=int(rng.integers(1, 4)),
        delay=1,
        basis=basis,
        offset=True,
    )
    model = identification.fit(structure, record)
    choices = starting.for_model(
        DesignChoices(vehicle="", model="drawn"), model.to_state_space(), model, ""
    )
    sizes = {n: s * 10 ** rng.uniform(-1, 1) for n, s in choices.sizes.items()}
    noise = {y: s * 10 ** rng.uniform(-1, 1) for y, s in choices.noise.items()}
    servos = choices.servos if rng.random() < 0.5 else {}
    return replace(
        choices,
        sizes=sizes,
        noise=noise,
        servos=servos,
        delay=choices.period * int(rng.integers(0, 3)),
        acceleration=float(rng.choice([0.0, 1.0, 3.0])),
        references=outputs[:1] if rng.random() < 0.3 else (),
        gain=float(10 ** rng.uniform(0.5, 3)),
    ), model


def outcome(seed: int, record: symheli.FlightRecord) -> str:
    """Return how a design ended: "proven", "not proven", or what it was refused with."""
    choices, model = drawn(seed, record)
    try:
        found = synthesized(choices, model)  # type: ignore[arg-type]
    except SymheliError as error:
        return f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
    return "proven" if found.sampled.certificate.verified else "not proven"


def main() -> None:
    """Print how each setting ended, then the counts; any other error ends the program."""
    record, ends = flown(), Counter[str]()
    count = int(sys.argv[1]) if len(sys.argv) > 1 else SETTINGS
    for seed in range(count):
        begin = time.process_time()
        end = outcome(seed, record)
        ends[end.split(":")[0]] += 1
        print(f"{seed:3d} {time.process_time() - begin:5.1f} s  {end}", flush=True)
    print(f"{count} settings: " + ", ".join(f"{n} {end}" for end, n in ends.most_common()))


if __name__ == "__main__":
    main()
