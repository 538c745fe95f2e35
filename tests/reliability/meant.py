"""Where NaN is an answer and when, each a rule that the documentation of the place states: what was
found and the arguments of the call (with `self`, of a method) say whether it is meant there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from verdict import NotANumber, not_a_number

from identification.judge.scores import steps
from identification.structure.kinematic_arx import STATES
from identification.structure.regressors import as_records
from synthesis import Certificate
from synthesis.impose import Grid

Arguments = Mapping[str, Any]
Rule = Callable[[NotANumber, Arguments], bool]


def is_meant(entry: str, found: NotANumber, arguments: Arguments) -> bool:
    """Whether the documentation says that NaN stands there."""
    rules = [rule for place, rule in BY_ENTRY.get(entry, ()) if re.fullmatch(place, found.where)]
    if found.field in BY_FIELD:
        rules.append(BY_FIELD[found.field])
    return any(rule(found, arguments) for rule in rules)


# --- certificates and designs --------------------------------------------------------------------


def _kind(found: NotANumber) -> str:
    """Of the certificate that the number is a part of."""
    return next(one.kind for one in reversed(found.owners) if isinstance(one, Certificate))


def _no_gain(found: NotANumber, _: Arguments) -> bool:
    return not _kind(found).endswith("gain")


def _no_decay_rate(found: NotANumber, _: Arguments) -> bool:
    return _kind(found) != "decay rate"


def _stability(found: NotANumber, _: Arguments) -> bool:
    return _kind(found) == "stability"


def _no_grid(_: NotANumber, arguments: Arguments) -> bool:
    return not isinstance({**arguments, **arguments.get("options", {})}.get("impose"), Grid)


def _no_promise(_: NotANumber, arguments: Arguments) -> bool:
    given = arguments["synthesized"]
    return (given is None or math.isnan(given)) and not hasattr(arguments["controller"], "gamma")


def _not_sought(found: NotANumber, arguments: Arguments) -> bool:
    return found.owners[-1].controller is None or arguments.get("gamma") is not None


def _unstable(found: NotANumber, _: Arguments) -> bool:
    return math.isinf(found.owners[-1].gamma)


def _no_phase_delay(found: NotANumber, arguments: Arguments) -> bool:
    omega, dt = found.owners[-1].omega_180, arguments["model"].dt
    return math.isinf(omega) or (dt is not None and 2 * omega > 0.999 * math.pi / dt)


def _where_unstable(found: NotANumber, _: Arguments) -> bool:
    """A value of a specification that is always defined is missing only where the loop is not
    stable, which the table says.
    """
    table = found.owners[0]
    return not any(
        np.isnan(values[:, table.stable[name]]).any() for name, values in table.values.items()
    )


# --- records and predictions ---------------------------------------------------------------------


def _as_given(_: NotANumber, arguments: Arguments) -> bool:
    return any(True for _ in not_a_number(dict(arguments)))


def _not_finite_given(_: NotANumber, arguments: Arguments) -> bool:
    given = (arguments[name] for name in ("x", "u", "wind", "lookup"))
    return any(one is not None and not np.isfinite(one).all() for one in given)


def _no_point(found: NotANumber, _: Arguments) -> bool:
    there = [[point is not None for point in row] for row in found.owners[-1].points]
    return _none_where(np.array(there), found)


def _lost(found: NotANumber, _: Arguments) -> bool:
    """From an instant on, to the end of the flight."""
    bad = ~np.isfinite(found.value).all(axis=2)
    return bool((np.maximum.accumulate(bad, axis=1) == bad).all())


def _unbroken(record: Any, names: Sequence[str], samples: int) -> np.ndarray:
    """(n,) of bool: where so many samples up to this one are there, without a gap."""
    whole = np.isfinite(record.columns(list(map(str, names)))).all(axis=1)
    known = np.zeros(len(record), bool)
    for part in record.segments():
        count = 0
        for k in range(part.start, part.stop):
            count = count + 1 if whole[k] else 0
            known[k] = count >= samples
    return known


def _none_where(known: np.ndarray, found: NotANumber) -> bool:
    return not np.isnan(found.value[known]).any()


def _names(structure: Any) -> tuple[str, ...]:
    return (*getattr(structure, "outputs", STATES), *structure.inputs, *structure.parameters)


def _past_is_incomplete(found: NotANumber, arguments: Arguments) -> bool:
    structure, record = arguments["self"].structure, arguments["record"]
    samples = arguments.get("horizon", 1) + structure.memory
    return _none_where(_unbroken(record, _names(structure), samples), found)


def _first_of_the_horizon(found: NotANumber, arguments: Arguments) -> bool:
    return _none_where(np.arange(len(found.value)) >= arguments["horizon"], found)


def _not_predicted(found: NotANumber, arguments: Arguments) -> bool:
    """Of a `Prediction`, identified or not."""
    record = (arguments.get("self") or found.owners[0]).record
    horizon = steps(record.dt, found.owners[-1].scores.horizon)
    models = (arguments.get("identified") or {}).values()
    lags = max((model.structure.memory for model in models), default=1)
    samples = (list(horizon.values())[1] or 0) + max(lags, 1)
    return _none_where(_unbroken(record, record.signals, samples), found)


def _not_measured(found: NotANumber, arguments: Arguments) -> bool:
    measured = arguments["record"].columns(STATES)
    return not (np.isnan(found.value) & ~np.isnan(measured)).any()


def _nothing_shared(measured: Any, guess: Any) -> bool:
    return not np.any(~np.isnan(measured) & ~np.isnan(guess))


def _place(where: str) -> tuple[str, str]:
    """(one_step, output) of ".one_step['output']"."""
    name, output = re.fullmatch(r"\.?(\w*)\['(.*)'\]", where).groups()  # type: ignore[union-attr]
    return name, output


def _column(values: Any, outputs: Sequence[str], output: str) -> np.ndarray:
    return np.asarray(values, float).reshape(len(values), -1)[
        :, list(map(str, outputs)).index(output)
    ]


def _nothing_to_compare(found: NotANumber, arguments: Arguments) -> bool:
    """Of `Scores.of`, by its own arguments."""
    name, output = _place(found.where)
    pair = (_column(arguments[k], arguments["outputs"], output) for k in ("measured", name))
    return _nothing_shared(*pair)


def _nothing_predicted(found: NotANumber, arguments: Arguments) -> bool:
    """Of `scores` and `.score`, by what the model predicts."""
    name, output = _place(found.where)
    model, record = arguments.get("model") or arguments["self"], arguments["record"]
    horizon = arguments["horizon"]
    if name:
        names = ("one_step", "ahead", "free_run")
        horizon = dict(zip(names, steps(model.dt, horizon).values(), strict=True))[name]
    if horizon is None:
        guess = model.simulate(record)
    else:
        guess = model.predict(record, horizon, **_held(arguments))
    return _nothing_shared(record[output], _column(guess, model.outputs, output))


def _held(arguments: Arguments) -> dict[str, bool]:
    return {"hold_p": arguments["hold_p"]} if "hold_p" in arguments else {}


def _refused_or_too_short(found: NotANumber, arguments: Arguments) -> bool:
    """Of a `Trial`: its mean over the records, of which one that predicts nothing makes NaN."""
    trial = found.owners[-1]
    horizon = arguments["horizon"] if found.where.endswith(".ahead") else 1
    known = (
        _unbroken(one, _names(trial.structure), trial.structure.memory + horizon)
        for one in as_records(arguments["validation"])
    )
    return bool(trial.refused) or any(not one.any() for one in known)


def _no_second(_: NotANumber, arguments: Arguments) -> bool:
    return not arguments["second"]


# --- where ---------------------------------------------------------------------------------------

BY_FIELD: dict[str, Rule] = {
    "Certificate.gamma": _no_gain,
    "Certificate.lower": _no_gain,
    "Certificate.alpha": _no_decay_rate,
    "Certificate.upper": _no_decay_rate,
    "Certificate.frozen": _stability,
    "Certificate.indicative": _no_grid,
    "Attempt.bound": _stability,
    "SampledLoop.promised": _no_promise,
    "PointDesign.optimum": _not_sought,
    "BoxGain.omega": _unstable,
    "FrozenGain.omega": _unstable,
    "Bandwidth.phase_delay": _no_phase_delay,
    "FlightRecord.values": _as_given,
    "Batch.states": _lost,
    "TrimMap.power": _no_point,
    "RLSInfo.innovation": lambda found, _: not found.owners[-1].available,
    "RLSInfo.gain": lambda found, _: not found.owners[-1].available,
    "History.innovations": _past_is_incomplete,
    "FitForControl.second_gap": _no_second,
    "Prediction.ahead": _not_predicted,
    **{f"Trial.{name}": _refused_or_too_short for name in ("one_step", "ahead", "free_run")},
    "Trial.bic": lambda found, _: bool(found.owners[-1].refused),
}
"""By class and field, whatever returns it."""

BY_ENTRY: dict[str, tuple[tuple[str, Rule], ...]] = {
    "symheli.values.NamedVector": ((r"\[.*\]", _as_given),),
    "symheli.flight.StitchedModel.rhs": (("", _not_finite_given),),
    "identification.judge.BaselinePredictor.predict": (("", _first_of_the_horizon),),
    "identification.model.LPVARXModel.predict": (("", _past_is_incomplete),),
    "identification.model.KinematicModel.predict": (("", _past_is_incomplete),),
    "identification.model.LPVARXModel.score": ((r"\['\w+'\]", _nothing_predicted),),
    "identification.model.KinematicModel.score": ((r"\['\w+'\]", _nothing_predicted),),
    "synthesis.specifications": ((r"\.values\['.*'\]", _where_unstable),),
    "identification.judge.Scores.of": (
        (r"\.(one_step|ahead|free_run)\['\w+'\]", _nothing_to_compare),
    ),
    "identification.scores": ((r"\.(one_step|ahead|free_run)\['\w+'\]", _nothing_predicted),),
}
"""By entry and place, where the result is no class of its own."""
