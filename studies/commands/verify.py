"""symheli verify: prove a saved certificate again, in exact arithmetic and from its file alone."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from studies.output import Output, progress

if TYPE_CHECKING:
    from synthesis import Certificate

HELP = "prove a saved certificate again, exactly, from its file alone"


def configure(parser: argparse.ArgumentParser) -> None:
    """The file."""
    parser.add_argument("file", help="written by Certificate.save or symheli certify --save")


def run(arguments: argparse.Namespace) -> Output:
    """Load, verify in rational arithmetic; exit status 1 where the proof fails."""
    from synthesis import Certificate

    cert = Certificate.load(arguments.file)
    if cert.proof is None:
        verdict = f"not proven: {arguments.file} holds no proof ({cert.status.value})"
        exact = False
    else:
        progress("verifying in rational arithmetic")
        exact = cert.verify(rigorous=True)
        verdict = (
            f"proven in exact arithmetic: {_bound(cert)}"
            if exact
            else f"not proven: {cert.fault or 'the inequalities do not hold in exact arithmetic'}"
        )
    data = {
        "file": arguments.file,
        "kind": cert.kind,
        "rates": cert.rates,
        "gamma": cert.gamma,
        "alpha": cert.alpha,
        "status": cert.status.name,
        "exact": exact,
        "hypotheses": cert.hypotheses,
    }
    text = f"{cert}\n{verdict}"
    return Output(text, data, status=0 if exact else 1)


def _bound(cert: Certificate) -> str:
    if cert.kind == "stability":
        return "stability"
    if cert.kind == "decay rate":
        return f"{cert.kind} {cert.alpha:.9g} 1/s"
    return f"{cert.kind} {cert.gamma:.9g}"
