"""symheli verify: prove saved certificates again, in exact arithmetic, from their files alone."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from studies.commands.arguments import positional
from studies.output import Output, progress

if TYPE_CHECKING:
    from synthesis import Certificate

HELP = "prove saved certificates again, exactly, from their files alone"

ARGUMENTS = (
    positional(
        "files",
        "written by Certificate.save, Tube.save, InvariantSet.save, symheli certify --save or a"
        " study (DIR/proofs)",
        nargs="+",
        metavar="file",
    ),
)


def run(arguments: argparse.Namespace) -> Output:
    """Load, verify in rational arithmetic; exit status 1 where a proof fails."""
    if len(arguments.files) == 1 and _reader(arguments.files[0]) is _verified:
        cert, verdict, data = _verified(arguments.files[0])
        found = f"How it was found, and what it supposes:\n{cert.details}"
        return Output(f"{verdict}\n\n{found}", data, status=0 if data["exact"] else 1)
    lines, proofs = [], []
    for file in arguments.files:
        _, verdict, data = _reader(file)(file)
        lines.append(f"{file}: {verdict}")
        proofs.append(data)
    exact = all(proof["exact"] for proof in proofs)
    data = {"exact": exact, "proofs": proofs}
    return Output("\n".join(lines), data, status=0 if exact else 1)


def _verified(file: str) -> tuple[Certificate, str, dict[str, Any]]:
    """Return the certificate in a file, the result of exact arithmetic, and the same for a
    program.
    """
    from synthesis import Certificate

    cert = Certificate.load(file)
    if cert.proof is None:
        verdict = f"not proven: {file} holds no proof ({cert.status.value})"
        exact = False
    else:
        progress(f"verifying {file} in rational arithmetic")
        exact = cert.verify(rigorous=True)
        verdict = (
            f"proven in exact arithmetic: {_bound(cert)}"
            if exact
            else f"not proven: {cert.fault or 'the inequalities do not hold in exact arithmetic'}"
        )
    return (
        cert,
        verdict,
        {
            "file": file,
            "kind": cert.kind,
            "rates": cert.rates,
            "gamma": cert.gamma,
            "alpha": cert.alpha,
            "status": cert.status.name,
            "exact": exact,
            "hypotheses": cert.hypotheses,
        },
    )


def _reader(file: str) -> Callable[[str], tuple[Certificate | None, str, dict[str, Any]]]:
    """What proves this file again: by the schema at its beginning a tube, a set or, of every other,
    a certificate.
    """
    try:
        with open(file, encoding="utf-8") as text:
            start = text.read(200)
    except (OSError, ValueError):
        return _verified
    own = {"symheli tube": _tube, "symheli set": _set}
    return next((by for name, by in own.items() if f'"schema": "{name}"' in start), _verified)


def _tube(file: str) -> tuple[None, str, dict[str, Any]]:
    """The verdict on the tube in a file, in words and for a program."""
    from synthesis.tubes import Tube

    progress(f"enclosing the equations of {file} and verifying in rational arithmetic")
    found = Tube.load(file)
    verdict = (
        f"proven in exact arithmetic: {found}" if found.verified else f"not proven: {found.why}"
    )
    return (
        None,
        verdict,
        {
            "file": file,
            "kind": "invariant tube",
            "airspeeds": found.nodes.tolist(),
            "gust": found.deviations.gust,
            "half_widths": found.half_widths.tolist(),
            "exact": found.verified,
            "hypotheses": found.hypotheses,
        },
    )


def _set(file: str) -> tuple[None, str, dict[str, Any]]:
    """The verdict on the invariant set in a file, in words and for a program."""
    from synthesis.sets.set_file import read

    progress(f"verifying {file} in rational arithmetic")
    found = read(file)
    verdict = (
        f"proven in exact arithmetic: {found}" if found.verified else f"not proven: {found.why}"
    )
    own = found.statement
    return (
        None,
        verdict,
        {
            "file": file,
            "kind": "invariant set",
            "disturbance": own.disturbance,
            "state_bounds": own.state_bounds,
            "input_bounds": own.input_bounds,
            "exact": found.verified,
            "hypotheses": own.hypotheses,
        },
    )


def _bound(cert: Certificate) -> str:
    if cert.kind == "stability":
        return "stability"
    if cert.kind == "decay rate":
        return f"{cert.kind} {cert.alpha:.9g} 1/s"
    return f"{cert.kind} {cert.gamma:.9g}"
