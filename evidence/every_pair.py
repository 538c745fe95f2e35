"""Every design with every certificate over three plants: a helicopter's lateral axis, a missile and
a crane. A cell is a number, or why there is none.

    python -m evidence.every_pair                          the tables
    python -m evidence.every_pair missile --seconds 20     of one plant, each cell given up sooner
"""

from __future__ import annotations

import argparse
import math
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any

import control
import numpy as np

import symheli
import synthesis
from evidence.tables import markdown
from symheli import LPVStateSpace, Scheduling
from symheli.errors import SymheliError, SynthesisError
from synthesis import Certificate, Plant, analysis, designs, objectives, robust, structures

MOST = 60.0
"""Seconds of processor after which a cell is given up."""
CRASHED = "TRACEBACK"
"""Cell of what ended in another error than a refusal."""
PERIOD = 0.02
"""Of the sampled loops, s."""


def helicopter() -> Plant:
    """The lateral axis of an X-Cell in a gust, attitude and rates measured."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    family = symheli.sweep(heli, np.linspace(0, 13, 14), inputs=("d_lat", "d_ped", "v_w"))
    lateral = family.select(("v", "p", "r", "phi", "b1")).interpolate("polynomial", 2, rate=3.0)
    plant = Plant(
        lateral,
        disturbances=["v_w"],
        performance=["r", "phi", "d_lat", "d_ped"],
        controls=["d_lat", "d_ped"],
        measurements=["p", "r", "phi"],
    )
    sizes = {"v_w": 2.0, "r": 3.0, "phi": 5.0, "d_lat": 100.0, "d_ped": 30.0}
    return plant.weighted(sizes).with_noise({"p": 0.01, "r": 0.01, "phi": 0.01})


def missile() -> Plant:
    """Normal acceleration over the Mach number: Lim and How, IEEE Trans. Control Systems Technology
    11 (2003), at small angles of attack.
    """
    mach = Scheduling("Mach", "1", low=2.0, high=4.0, rate=0.5)
    M = mach.symbol
    model = LPVStateSpace.from_expressions(
        A=[
            [-0.2010 * (2 - M / 3) * M, 1, -0.0403 * M],
            [3.6001 * (-7 + 8 * M / 3) * M**2, 0, -14.542 * M**2],
            [0, 0, -100],
        ],
        B=[[0], [0], [100]],
        C=[[-0.1130 * (2 - M / 3) * M**2, 0, -0.0226 * M**2], [0, 1, 0]],
        D=[[0], [0]],
        scheduling=mach,
        states=["attack", "q", "fin_position"],
        inputs=["fin"],
        outputs=["normal", "q"],
    )
    slow = control.tf([0.1, 0.5], [1.0, 0.05])
    plant = Plant(model, [], ["normal", "fin"], ["fin"], ["normal", "q"])
    plant = plant.with_input_disturbance().with_reference(["normal"])
    plant = plant.weighted({"normal_error": slow, "fin": 1 / 20.0})
    plant = plant.weighted({"fin_disturbance": 1.0, "normal_reference": 10.0})
    return plant.with_noise({"normal_error": 0.1, "q": 0.5})


def crane() -> Plant:
    """A load on a rope of 2 to 8 m below a trolley, over 1/length."""
    inverse = Scheduling("inverse_length", "1/m", low=1 / 8, high=1 / 2, rate=0.25)
    A0, A1 = np.zeros((4, 4)), np.zeros((4, 4))
    A0[0, 1] = A0[2, 3] = 1.0
    A1[3, 2], A0[3, 3] = -9.81, -0.05
    B0, B1 = np.zeros((4, 1)), np.zeros((4, 1))
    B0[1, 0], B1[3, 0] = 1.0, -1.0
    model = LPVStateSpace.polynomial(
        [A0, A1],
        [B0, B1],
        [np.eye(4)[[0, 2]]],
        [np.zeros((2, 1))],
        inverse,
        states=["position", "speed", "swing", "swing_rate"],
        inputs=["acceleration"],
        outputs=["position", "swing"],
    )
    signals = ["position", "swing", "acceleration"]
    plant = Plant(model, [], signals, ["acceleration"], ["position", "swing"])
    plant = plant.with_input_disturbance().with_reference(["position"])
    plant = plant.weighted({"position_error": 1 / 1.0, "swing": 1 / 0.2, "acceleration": 1 / 1.0})
    plant = plant.weighted({"acceleration_disturbance": 0.1, "position_reference": 0.5})
    return plant.with_noise({"position_error": 0.01, "swing": 0.01})


PLANTS = {"helicopter": helicopter, "missile": missile, "crane": crane}


def middle(plant: Plant) -> Any:
    """The model of the plant at the middle of its range."""
    return plant.nominal.at(plant.parameters[0].middle)


def at_the_middle(plant: Plant) -> Plant:
    """The plant of the model at the middle of the range."""
    return replace(plant, model=middle(plant))


def over_the_range(plant: Plant, of_one: Any) -> Any:
    """The controller of one model as that of all of a plant."""
    return synthesis.Controller.of(plant, of_one.at(0.5))


def of_the_loop(plant: Plant) -> Any:
    """The bare plant at the middle of the range, from its controls to its measurements."""
    return middle(plant).select(inputs=plant.controls, outputs=plant.measurements)


def for_the_loop(plant: Plant, design: Callable[..., Any], *options: float) -> Any:
    """The controller of a design for the bare plant."""
    return synthesis.Controller.of(plant, design(of_the_loop(plant), *options))


def shaped(plant: Plant) -> Any:
    """Loop shaping over the range."""
    bare = plant.nominal.select(inputs=plant.controls, outputs=plant.measurements)
    return synthesis.Controller.of(plant, designs.loop_shaping(bare))


def cascade(plant: Plant) -> Any:
    """Gains on every measurement and its filtered derivative, of every control."""
    paths = {(str(u), str(y)): "PD" for u in plant.controls for y in plant.measurements}
    tunable = structures.TunableController.pid(plant, paths, corner=20.0)
    return synthesis.structured(plant, tunable, starts=2)


DESIGNS: Mapping[str, Callable[[Plant], Any]] = {  # each of `synthesis` and `synthesis.designs`
    "output_feedback": lambda plant: synthesis.output_feedback(plant, X=0, Y=1),
    "lft_feedback": designs.lft_feedback,
    "state_feedback": lambda plant: synthesis.state_feedback(plant, Y=1),
    "multiobjective": lambda plant: synthesis.multiobjective(
        plant, [objectives.L2(), objectives.H2(bound=1e3)]
    ),
    "lqr": synthesis.lqr,
    "lqg": synthesis.lqg,
    "hinf": lambda plant: over_the_range(plant, synthesis.hinf(at_the_middle(plant))),
    "h2": lambda plant: over_the_range(plant, synthesis.h2(at_the_middle(plant))),
    "loop_shaping": shaped,
    "ncfsyn": lambda plant: for_the_loop(plant, designs.ncfsyn),
    "mixed_sensitivity": lambda plant: for_the_loop(plant, designs.mixed_sensitivity, 0.5, 0.1),
    "coefficient_diagram": lambda plant: for_the_loop(plant, designs.coefficient_diagram, 0.5),
    "structured": cascade,
}

Reading = Callable[[Any, Plant], object]

CERTIFICATES: Mapping[str, Reading] = {
    "stability": lambda made, plant: analysis_of(made, plant, synthesis.stability),
    "l2_gain": lambda made, plant: analysis_of(made, plant, synthesis.l2_gain),
    "h2_gain": lambda made, plant: analysis_of(made, plant, synthesis.h2_gain),
    "energy_to_peak": lambda made, plant: analysis_of(made, plant, analysis.energy_to_peak),
    "decay_rate": lambda made, plant: analysis_of(made, plant, synthesis.decay_rate),
    "passivity_index": lambda made, plant: analysis.passivity_index(pair(made, plant), search=None),
    "sector_radius": lambda made, plant: analysis.sector_radius(
        pair(made, plant), 0.0, search=None
    ),
    "lft_gain": lambda made, plant: synthesis.lft_gain(closed(made, plant).to_lft(), search=None),
    "lft_stability": lambda made, plant: analysis.lft_stability(
        closed(made, plant).to_lft(), search=None
    ),
    "certify": lambda made, plant: made.certify(search=None),
    "certify_sampled": lambda made, plant: (
        synthesis.certify_sampled(
            made.discretize(PERIOD), plant.sampled(PERIOD), search=None
        ).certificate
    ),
    "saved": lambda made, plant: kept(analysis_of(made, plant, synthesis.l2_gain)),
    "robust_margin": lambda made, plant: robust.robust_margin(
        analysis.with_scheduling_error(plant, made, 0.1), rate=0.0
    ),
    "worst_case_gain": lambda made, plant: robust.worst_case_gain(closed(made, plant)),
    "proven_around": lambda made, plant: analysis.proven_around(
        plant, made, plant.parameters[0].middle, tolerance=0.2, search=None
    ),
    "margins": lambda made, plant: synthesis.margin_table(plant, made, str(plant.controls[0])),
}


def closed(made: Any, plant: Plant) -> Any:
    """The loop of a design with its plant."""
    return plant.close(made)


def pair(made: Any, plant: Plant) -> Any:
    """The loop from its first disturbance to its first performance signal."""
    loop = closed(made, plant)
    return loop.select(inputs=loop.inputs[:1], outputs=loop.outputs[:1])


def analysis_of(made: Any, plant: Plant, question: Callable[..., Any]) -> Any:
    """The answer to a question about the loop."""
    return question(closed(made, plant), search=None)


def kept(found: Any) -> bool:
    """Whether a certificate proves itself after it was written and read."""
    if not found.verified:
        raise SynthesisError(found.why, ())
    with TemporaryDirectory() as folder:
        return bool(Certificate.load(found.save(Path(folder) / "proof.json")).verify(rigorous=True))


@contextmanager
def limited(seconds: float) -> Iterator[Event]:
    """Interrupt the work as Ctrl-C does after so many seconds of processor; the event says that it
    was this.
    """
    over = Event()

    def ended(*_: object) -> None:
        over.set()
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGPROF, ended)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield over
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def cell(
    work: Callable[[], object], reasons: dict[str, str], seconds: float = MOST
) -> tuple[str, Any]:
    """Return what a cell says, and the result; a reason is entered under its letter."""
    over = Event()
    try:
        with limited(seconds) as over:
            found = work()
    except KeyboardInterrupt:
        if not over.is_set():
            raise
        return f"over {seconds:g} s", None
    except SymheliError as error:
        return f"[{entered(str(error), reasons)}]", None
    except Exception:
        traceback.print_exc()
        return CRASHED, None
    return said(found, reasons), found


def said(found: Any, reasons: dict[str, str]) -> str:
    """A number, or why there is none."""
    if isinstance(found, bool):
        return "yes" if found else "NO"
    if isinstance(found, tuple):
        return " to ".join(f"{number:.3g}" for number in found)
    if hasattr(found, "verified"):
        if not found.verified:
            return f"[{entered(found.why, reasons)}]"
        bound = getattr(found, "bound", math.nan)
        return "proven" if bound is None or math.isnan(bound) else f"{bound:.4g}"
    promised = getattr(found, "promised", None)
    return "made" if promised is None or math.isnan(promised) else f"{promised:.4g}"


def entered(reason: str, reasons: dict[str, str]) -> str:
    """The letter of a reason."""
    first = " ".join(reason.split())[:160]
    return reasons.setdefault(first, chr(ord("a") + len(reasons)))


def table(name: str, seconds: float = MOST) -> str:
    """The table of a plant, with the reasons below it."""
    plant, reasons = PLANTS[name](), dict[str, str]()
    rows = []
    for design, make in DESIGNS.items():
        begin, made = cell(partial(make, plant), reasons, seconds)
        row = [design, begin]
        for question, ask in CERTIFICATES.items():
            text = "" if made is None else cell(partial(ask, made, plant), reasons, seconds)[0]
            row.append(text)
            print(name, design, question, text, file=sys.stderr, flush=True)
        rows.append(row)
    below = "\n".join(f"- [{letter}] {reason}" for reason, letter in reasons.items())
    return f"{markdown(['design', 'made', *CERTIFICATES], rows)}\n\n{below}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", default=[*PLANTS], choices=PLANTS, metavar="plant")
    parser.add_argument("--seconds", type=float, default=MOST, help="of processor, for each cell")
    options = parser.parse_args()
    for name in options.plants:
        print(f"**{name}**\n\n{table(name, options.seconds)}\n")


if __name__ == "__main__":
    main()
