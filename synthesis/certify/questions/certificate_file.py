"""Certificates as JSON files that are sufficient to verify them again.

A file has a schema and its version, the statement, and the proof: model, units and Lyapunov
function. Every value is a number, a text or a list, an array with its shape, or a value of one of
the `TYPES` by its name and fields. Doubles are written with all their digits. The polynomial pieces
are derived from the model. Reading trusts no value: each is checked where it is made, and the proof
again in floating point.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from symheli.errors import CertificateError, InputError
from symheli.lpv.bases import BSpline, CubicSpline, Patches, PiecewiseLinear, Polynomial, Product
from symheli.lpv.lft_matrices import Block, LFTMatrices
from symheli.lpv.lpv_matrices import LPVMatrices
from symheli.lpv.scheduling import Scheduling
from symheli.values import Signal
from synthesis.certify.lft import proof as lft_proof
from synthesis.certify.lft.multipliers import Multiplier
from synthesis.certify.proof import box, one_parameter
from synthesis.certify.questions.certificate import Certificate, Proof
from synthesis.certify.statement.box import BoxLyapunov
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.kind import Kind
from synthesis.certify.statement.lag import LagRegion
from synthesis.certify.statement.norm_bounded import NormBounded
from synthesis.certify.statement.outcome import Attempt, Seconds, Status
from synthesis.certify.statement.sentences import motion
from synthesis.certify.statement.spline import MemoryLyapunov, SplineLyapunov
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.certify.statement.units import Scaling
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import model_pieces, pieces


def _former_units(
    left: Any, right: Any, inputs: Any, outputs: Any, time: Any, storage: Any, weight: Any
) -> Scaling:
    """Return the scaling of an older file, which holds units of inputs, outputs and V: that of V is
    the square of the channel's, or 1 where V is compared with the energy of inputs.
    """
    return Scaling(left, right, outputs if storage == 1.0 else math.sqrt(storage), time, weight)


def _demand(kind: Any, **own: Any) -> Demand:
    """Return the demand of a file, its kind by name."""
    return Demand(Kind.named(kind), **own)


TYPES: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        *(Attempt, Seconds, Scheduling, Block),
        *(PolynomialMatrix, Motion, Scaling, lft_proof.Coordinates, NormBounded),
        *(SplineLyapunov, MemoryLyapunov, LagRegion, BoxLyapunov),
        Multiplier,
        *(Polynomial, BSpline, PiecewiseLinear, Product, Patches),
    )
} | {
    "Demand": _demand,
    "LFT": LFTMatrices,
    "LPVStateSpace": LPVMatrices,
    "Quadratic": lft_proof.QuadraticStorage,
    "Spline": CubicSpline,
    "Trajectory": SchedulingTrajectory,
    "Units": _former_units,
}
"""Types that a file may contain, by their name in the file, which does not change with the name of
the class.
"""
WORDS = {kind: word for word, kind in TYPES.items()} | {Demand: "Demand"}

HEAD = {"schema", "version", "statement"}
NONE = {"float": "nan"}
LATER = {"perturbation": None, "index": NONE, "index_limit": NONE}
"""Fields that files of this version may lack: they were written before the field existed."""

ROUTES = {
    "one parameter": one_parameter.IntervalEvidence,
    "box": box.BoxEvidence,
    "lft": lft_proof.LFTEvidence,
}
DERIVED = {"pieces", "model"}


def written(cert: Certificate) -> dict[str, Any]:
    """Return what a file holds of the certificate; see `Certificate.stored`."""
    statement = {f.name: getattr(cert, f.name) for f in fields(cert) if f.name != "proof"}
    return {
        **encoded({**statement, "status": cert.status.name}),
        "proof": None if cert.proof is None else _encoded_proof(cert.proof),
    }


def read(content: Mapping[str, Any]) -> Certificate:
    """Return the certificate that a file holds; see `Certificate.restored`."""
    cert = _certificate(content)
    if cert.verified and not cert.verify():
        why = cert.fault or "the inequalities do not hold with this bound"
        raise CertificateError(f"the proof does not establish the certified bound: {why}")
    return cert


def _certificate(content: Mapping[str, Any]) -> Certificate:
    names = {f.name for f in fields(Certificate)}
    content = {**LATER, **content}
    missing, foreign = names - content.keys(), content.keys() - names - HEAD
    if missing or foreign:
        raise InputError(
            f"expected the fields of a certificate; missing: {', '.join(sorted(missing)) or 'none'}"
            f"; unknown: {', '.join(sorted(foreign)) or 'none'}"
        )
    statement = {name: decoded(content[name]) for name in names if name != "proof"}
    if statement["status"] not in Status.__members__:
        raise InputError(f"expected the name of a status, got {statement['status']!r:.60}")
    statement["status"] = Status[statement["status"]]
    if not isinstance(statement["verified"], bool):
        raise InputError(f"verified must be true or false, got {statement['verified']!r:.60}")
    for name, kind in (
        ("seconds", Seconds),
        ("worst", SchedulingTrajectory | None),
        ("perturbation", np.ndarray | None),
    ):
        if not isinstance(statement[name], kind):
            raise InputError(f"{name} is invalid: {statement[name]!r:.60}")
    for name, kind in (("hypotheses", str), ("attempts", Attempt)):
        values = statement[name]
        if not isinstance(values, tuple) or not all(isinstance(v, kind) for v in values):
            raise InputError(f"{name} are invalid: {values!r:.60}")
    if not isinstance(statement["method"], str) or not isinstance(statement["solver"], str):
        raise InputError("method and solver must be texts")
    proof = content["proof"]
    cert = Certificate(**statement, proof=None if proof is None else _decoded_proof(proof))
    if cert.proof is not None:
        for s, rate in zip(cert.proof.evidence.parameters, cert.rates, strict=True):
            if motion(s, rate) not in cert.hypotheses:
                raise CertificateError(
                    "the hypotheses do not say for which range and rate of"
                    f" {s.name} the proof holds: {motion(s, rate)}"
                )
        for sentence in getattr(cert.proof.evidence, "sentences", ()):
            if sentence not in cert.hypotheses:
                raise CertificateError(
                    f"the hypotheses do not say for which perturbations the proof holds: {sentence}"
                )
    return cert


def _encoded_proof(proof: Proof) -> dict[str, Any]:
    evidence = proof.evidence
    route = next(name for name, kind in ROUTES.items() if isinstance(evidence, kind))
    own = {
        name: value
        for name, value in evidence._asdict().items()  # type: ignore[attr-defined]
        if name not in DERIVED
    }
    if isinstance(evidence, box.BoxEvidence):
        own["source"] = evidence.model.source
    return {"route": route, **encoded(own), "lyapunov": encoded(proof.lyapunov)}


def _decoded_proof(content: Any) -> Proof:
    if not isinstance(content, dict) or content.get("route") not in ROUTES:
        raise InputError(f"expected a proof by one of the routes {', '.join(ROUTES)}")
    route = content["route"]
    own = {name: decoded(v) for name, v in content.items() if name not in ("route", "lyapunov")}
    if route == "one parameter":
        own["pieces"] = model_pieces(_a(LPVMatrices, own["lpv"]))
    elif route == "box":
        own["model"] = pieces(_a(LPVMatrices, own.pop("source")))
    else:
        _a(LFTMatrices, own["lft"])
    for name, kind in (
        ("units", Scaling),
        ("demand", Demand),
        ("coordinates", lft_proof.Coordinates),
    ):
        if name in own:
            _a(kind, own[name])
    if own.get("block") is not None:
        _a(NormBounded, own["block"])
    return Proof(ROUTES[route](**own), decoded(content["lyapunov"]))


def _a(kind: Any, value: Any) -> Any:
    if not isinstance(value, kind):
        raise InputError(f"expected {getattr(kind, '__name__', kind)}, got {value!r:.60}")
    return value


def encoded(value: Any) -> Any:
    """Return a value as JSON holds it; raise `InputError` for a type that is not in `TYPES`."""
    if isinstance(value, Signal):
        return {"signal": str(value), "unit": value.unit}
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else {"float": repr(float(value))}
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.ndarray):
        numbers = [encoded(v) for v in value.ravel().tolist()]
        return {"shape": list(value.shape), "array": numbers}
    if isinstance(value, dict):
        return {name: encoded(v) for name, v in value.items()}
    kind = next((kind for kind in type(value).__mro__ if kind in WORDS), None)
    if kind is not None:
        names = [f.name for f in fields(kind) if f.init] if is_dataclass(kind) else kind._fields
        return {"type": WORDS[kind], **{name: encoded(getattr(value, name)) for name in names}}
    if isinstance(value, tuple | list):
        return [encoded(v) for v in value]
    raise InputError(
        f"a {type(value).__name__} cannot be written to a file; fit the model to a polynomial or"
        " spline basis first, or keep the certificate in memory"
    )


def decoded(value: Any) -> Any:
    """Return the value that `encoded` wrote; raise `InputError` for anything else."""
    if isinstance(value, list):
        return tuple(map(decoded, value))
    if not isinstance(value, dict):
        return value
    if value.keys() == {"float"}:
        number = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}.get(value["float"])
        if number is None:
            raise InputError(f"expected nan, inf or -inf, got {value['float']!r:.60}")
        return number
    if value.keys() == {"signal", "unit"}:
        return Signal(_a(str, value["signal"]), _a(str, value["unit"]))
    if value.keys() == {"shape", "array"}:
        numbers = [decoded(v) for v in _a(list, value["array"])]
        if not all(isinstance(v, float | int) and not isinstance(v, bool) for v in numbers):
            raise InputError("expected an array of numbers")
        return np.array(numbers, dtype=float).reshape(_a(list, value["shape"]))
    kind = TYPES.get(value.get("type", ""))
    if kind is None:
        raise InputError(f"unknown kind of value {value.get('type')!r:.60}")
    return kind(**{name: decoded(v) for name, v in value.items() if name != "type"})


def same_model(own: Any, other: Any) -> bool:
    """Whether a model is exactly the one of a proof: its numbers, functions of p, ranges and sample
    period; names of signals and rates may differ. Raises `InputError` for what is no such model.
    """
    kind = LFTMatrices if isinstance(own, LFTMatrices) else LPVMatrices
    if not isinstance(other, kind):
        wanted = "an LFT" if kind is LFTMatrices else "an LPVStateSpace"
        raise InputError(f"the proof is about {wanted}, got {type(other).__name__}")
    return _numbers(own) == _numbers(other)


def _numbers(model: Any) -> Any:
    content = encoded(model)
    sizes = [len(content.pop(group)) for group in ("states", "inputs", "outputs")]
    for s in content.get("parameters") or [block["scheduling"] for block in content["blocks"]]:
        s.pop("rate")
    return sizes, content
