"""`python -m evidence.field --folder DIR`: data sets of the field with published test errors,
identified by the methods of this package.

The files are taken from `--folder` where they are there, else fetched from a public repository;
each is held against its checksum. Orders and degrees are chosen on the last part of the training
data alone. Errors are those of the free run, from the 50th sample on.

Sources: Verhoek, Beintema, Haesaert, Schoukens and Toth (2022), Deep-learning-based identification
of LPV models for nonlinear systems, arXiv 2204.04060 (the gyroscope); Schoukens, Suykens and Ljung
(2009), Wiener-Hammerstein benchmark. The errors of LPV-SUBNET are those of the notebooks in the
repository; the one of SUBNET is quoted by Champneys et al. (2024), arXiv 2405.10779.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from evidence.learnt_map import filtered_input, splines
from evidence.public_files import PublicFile, fetched
from evidence.tables import DOCS, four_digits, keep, markdown, parsed
from identification import LPVARX, Polynomial, StateSpace, fit
from identification.judge.scores import Identified
from symheli import FlightRecord
from symheli.errors import ConvergenceWarning, DataWarning, ExcitationError, InputError
from symheli.lpv import Product
from symheli.lpv.bases import FunctionSpace
from symheli.progress import tracked
from symheli.values.arrays import Array

COMMIT = "gsmfnc/LPV_SysId", "a843d61efb1401308c932bd77b6653446bbdd351"
LPVCORE = "noise_simulations/lpvcore"
FILES = {
    name: PublicFile(name, *COMMIT, f"{LPVCORE}/{path}", sha256)
    for name, path, sha256 in (
        (
            "gyroscope-training.mat",
            "gyroscope/gyroscope_data/ML_estim.mat",
            "159f207e51b5be19fdcab42e30e27a5a69ceeafe4ae6309719ee28ce1b7dacc6",
        ),
        (
            "gyroscope-test.mat",
            "gyroscope/gyroscope_data/ML_valid.mat",
            "a2d484961cbdeabcef0da5f5a979416a4387b9ea9b0df0ba28a430e0b9928fc0",
        ),
        (
            "wiener-hammerstein.mat",
            "wiener_hammerstein/dataset/WienerHammerBenchMark.mat",
            "096e6128687efb664d146d28fc17db4c5a94f247c4b3a2e451319be1efb25ae2",
        ),
    )
}
"""The data, which belong to others and are not kept here (BSD 3-Clause)."""

KNOWN_SAMPLES = 50
"""Outputs at the start of a test that a model may see."""

FITTED = 0.7
"""Part of the training data that the candidates are fitted to; the rest chooses among them."""

NEAR = 1.05
"""Error over the least at which the smaller structure is taken."""

Structure = LPVARX | StateSpace


@dataclass(frozen=True)
class Way:
    """Structures among which the training data choose, and the method that fits them; what adds a
    learnt scheduling parameter to a record, and how many samples are used at most.
    """

    name: str
    candidates: tuple[Structure, ...]
    method: str = "oe"
    learnt: Callable[[FlightRecord], Callable[[FlightRecord], FlightRecord]] | None = None
    samples: int = 10**9


@dataclass(frozen=True)
class DataSet:
    """Training and test data, the ways to identify them, and (name, error, fit in percent) of what
    was published; errors in `unit`, which is 1/`per_unit` of the output's own.
    """

    title: str
    unit: str
    per_unit: float
    load: Callable[[Path], tuple[FlightRecord, FlightRecord]]
    ways: tuple[Way, ...]
    published: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class Found:
    """What a way comes to: root mean square errors in the output's own unit, fit of the test in
    percent, seconds of the choice and the fit.
    """

    structure: Structure
    training: float
    test: float
    percent: float
    seconds: float


def gyroscope(folder: Path) -> tuple[FlightRecord, FlightRecord]:
    """A control moment gyroscope, simulated by others with noise: motor current `u` of the inner
    gimbal to speed `y` of the outer one; `w` wheel speed, `sine` of the inner gimbal's angle.
    """

    def of(file: str) -> FlightRecord:
        names = ("exp_u", "exp_p", "exp_y")
        found = scipy.io.loadmat(fetched(FILES[file], folder), variable_names=names)
        _, w, sine = found["exp_p"].T
        return recorded(0.01, u=found["exp_u"][:, 0], y=found["exp_y"][:, 0], w=w, sine=sine)

    return of("gyroscope-training.mat"), of("gyroscope-test.mat")


def wiener_hammerstein(folder: Path) -> tuple[FlightRecord, FlightRecord]:
    """An electronic circuit, measured: a filter, a diode with resistors, a filter; V, time in
    samples of 1/51200 s.
    """
    found = scipy.io.loadmat(fetched(FILES["wiener-hammerstein.mat"], folder))
    u, y = (found[name][5200:184000, 0] for name in ("uBenchMark", "yBenchMark"))
    training, test = slice(100000), slice(100000, None)
    return recorded(1.0, u=u[training], y=y[training]), recorded(1.0, u=u[test], y=y[test])


def recorded(dt: float, **columns: Any) -> FlightRecord:
    """Signals as they are, without units."""
    instants = dt * np.arange(len(columns["y"]))
    return FlightRecord.from_arrays(instants, dict.fromkeys(columns, "1"), **columns)


def free_run(model: Identified, record: FlightRecord) -> Array:
    """Free run (n,) of a model that sees the first outputs of a record alone: all of them where its
    state is found from them, the last ones where it starts from lags.
    """
    k, memory = np.arange(len(record)), model.structure.memory
    y = np.where(k < KNOWN_SAMPLES, record["y"], np.nan)
    begin = KNOWN_SAMPLES - memory if 0 < memory < KNOWN_SAMPLES else 0
    seen = record.with_signals({"y": "1"}, y=y).rows(k >= begin)
    return np.concatenate([np.full(begin, np.nan), model.simulate(seen)[:, 0]])


def error_of(model: Identified, record: FlightRecord) -> float:
    """Root mean square of the free run's error behind what it sees; infinite where it diverges."""
    left = (free_run(model, record) - record["y"])[KNOWN_SAMPLES:]
    value = float(np.sqrt(np.mean(left**2)))
    return value if np.isfinite(value) else np.inf


def identified(way: Way, training: FlightRecord, test: FlightRecord) -> Found:
    """The smallest of the candidates that run free closest to the last part of the training data,
    fitted to all of them; raises `InputError` where none can be fitted.
    """
    begin = time.perf_counter()
    training = training.rows(np.arange(len(training)) < way.samples)
    early = np.arange(len(training)) < FITTED * len(training)
    if way.learnt is not None:
        along = way.learnt(training.rows(early))
        training, test = along(training), along(test)
    first, last = training.rows(early), training.rows(~early)
    tried = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        warnings.simplefilter("ignore", DataWarning)
        for structure in way.candidates:
            try:
                tried.append((error_of(fit(structure, first, way.method), last), structure))
            except (ExcitationError, InputError):  # no candidate, the others are
                continue
        if not tried:
            raise InputError(f"{way.name}: the training data determine none of its structures")
        least = min(error for error, _ in tried)
        near = [structure for error, structure in tried if error <= NEAR * least]
        structure = min(near, key=unknowns)
        model = fit(structure, training, way.method)
    error = error_of(model, test)
    spread = float(np.std(test["y"][KNOWN_SAMPLES:]))
    return Found(
        structure=structure,
        training=error_of(model, training),
        test=error,
        percent=100.0 * max(1.0 - error / spread, 0.0),
        seconds=time.perf_counter() - begin,
    )


def unknowns(structure: Structure) -> int:
    """Number of coefficients."""
    if isinstance(structure, StateSpace):
        order = structure.order
        return order + structure.basis.size * order * (order + len(structure.inputs))
    return structure.n_regressors


Range = tuple[str, float, float]


def polynomials(degree: int, *scheduling: Range) -> FunctionSpace:
    """Those of this total degree in parameters of these ranges."""
    factors = tuple(Polynomial(degree, low, high) for _, low, high in scheduling)
    return factors[0] if len(factors) == 1 else Product(factors, total_degree=degree)


def states(
    orders: Sequence[int],
    *scheduling: Range,
    inputs: tuple[str, ...] = ("u",),
    degrees: Sequence[int] = (1,),
) -> tuple[Structure, ...]:
    """State-space structures of these orders, constant or of these degrees over parameters."""
    if not scheduling:
        return tuple(StateSpace("y", inputs, order=n, offset=len(inputs) > 1) for n in orders)
    names = tuple(name for name, _, _ in scheduling)
    bases = [polynomials(degree, *scheduling) for degree in degrees]
    return tuple(StateSpace("y", inputs, names, order=n, basis=b) for b in bases for n in orders)


WHEEL, ANGLE = ("w", 30.0, 50.0), ("sine", -0.45, 0.45)
INPUT = ("u", -3.5, 3.5)
"""Ranges that hold training and test data."""

DATA = {
    "gyroscope": DataSet(
        "Control moment gyroscope (simulated by others, with noise)",
        "rad/s",
        1.0,
        gyroscope,
        (
            Way("constant", states((2, 3, 4, 5), inputs=("u", "w"))),
            Way(
                "difference equation over wheel speed and gimbal angle, least squares",
                tuple(
                    LPVARX("y", "u", ("w", "sine"), na=n, nb=n, basis=polynomials(1, WHEEL, ANGLE))
                    for n in (2, 4, 6, 10)
                ),
                "ls",
            ),
            Way(
                "states over wheel speed",
                states((2, 3, 4), WHEEL, inputs=("u", "w"), degrees=(1, 2)),
            ),
            Way(
                "states over wheel speed and gimbal angle",
                states((2, 3, 4), WHEEL, ANGLE, inputs=("u", "w"), degrees=(1, 2)),
            ),
        ),
        (("LPV-SUBNET, 5 states, 3 learnt parameters", 0.02457, 90.87),),
    ),
    "wiener-hammerstein": DataSet(
        "Wiener-Hammerstein circuit (measured)",
        "mV",
        1000.0,
        wiener_hammerstein,
        (
            Way("constant", states((4, 6)), samples=20000),
            Way("states over the input", states((6,), INPUT, degrees=(1, 2)), samples=10000),
            Way(
                "difference equation over a learnt filter of the input",
                tuple(
                    LPVARX("y", "v", "v", na=n, nb=n + 1, delay=0, basis=splines(count))
                    for n, count in ((3, 7), (3, 15), (4, 15))
                ),
                samples=40000,
                learnt=partial(filtered_input, basis=splines(15)),
            ),
        ),
        (
            ("LPV-SUBNET, 6 states, 1 learnt parameter", 1.158, 99.53),
            ("LPV-SUBNET, 6 states, 3 learnt parameters", 0.693, 99.72),
            ("SUBNET, nonlinear", 0.241, 99.90),
        ),
    ),
}


def rows(name: str, folder: Path) -> Iterator[tuple[str, ...]]:
    """A row a way, then one for each published error."""
    data = DATA[name]
    training, test = data.load(folder)
    for way in tracked(name, data.ways):
        found = identified(way, training, test)
        yield (
            way.name,
            described(found.structure),
            str(min(way.samples, len(training))),
            four_digits(found.training * data.per_unit),
            four_digits(found.test * data.per_unit),
            f"{found.percent:.2f}",
            f"{found.seconds:.0f}",
        )
    for published, error, percent in data.published:
        yield f"published: {published}", "", "", "", four_digits(error), f"{percent:.2f}", ""


def described(structure: Structure) -> str:
    """Order and number of functions of the parameters."""
    order = structure.order if isinstance(structure, StateSpace) else structure.na
    return f"order {order}, {structure.basis.size} function{'s' * (structure.basis.size > 1)}"


def table(name: str, found: Sequence[tuple[str, ...]]) -> str:
    """Rows under a title with the unit."""
    data = DATA[name]
    head = ("model", "chosen", "samples", "training", "test", "fit of the test, %", "seconds")
    return f"{data.title}, free-run error in {data.unit}.\n\n{markdown(head, found)}"


def main() -> None:
    """Print the tables, and keep them in docs/identified.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where files are, or go to")
    parser.add_argument("--only", choices=DATA, nargs="+", default=list(DATA), help="data sets")
    options = parsed(parser, "identified.md", timed=False)
    for name in options.only:
        found = []
        try:
            for row in rows(name, options.folder):
                print(*row, sep=", ", flush=True)
                found.append(row)
        except InputError as error:
            parser.exit(1, f"{error}\n")
        text = table(name, found)
        print(text, end="\n\n", flush=True)
        if options.write:
            command = f"python -m evidence.field --folder DIR --only {name} --write"
            keep(DOCS / "identified.md", f"field: {name}", text, command=command)


if __name__ == "__main__":
    main()
