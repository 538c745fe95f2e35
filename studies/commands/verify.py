"""symheli verify: prove saved certificates again, in exact arithmetic, from their files alone.

With --model, whether they are about that plant, closed as --feedback says. With --plant, whether a
P, K or V that somebody else computed proves what it says of that plant.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.commands import given_model
from studies.commands.arguments import group, option, positional
from studies.output import Output, progress
from symheli.errors import InputError

if TYPE_CHECKING:
    from synthesis.certify.statement.proven_statement import ProvenStatement

HELP = "prove saved certificates again, exactly, from their files alone; or claims of a --plant"

ARGUMENTS = (
    positional(
        "files",
        "written by .save of a certificate, tube, set, dwell time or margin, by symheli certify"
        " --save or a study (DIR/proofs); with --plant, claims with the P, K or V of somebody else",
        nargs="+",
        metavar="file",
    ),
    group(
        "proofs that somebody else computed",
        None,
        option(
            "--plant",
            "FILE",
            "decide whether the claims hold of this plant: a JSON, NPZ or MAT file of vertices, a"
            " grid, polynomials or a plant with limits (synthesis.claims.read_plant)",
            Path,
        ),
        option("--save", "FILE", "write the proof of a claim, which symheli verify reads", Path),
    ),
    *given_model.ARGUMENTS,
)


def run(arguments: argparse.Namespace) -> Output:
    """Load, verify in rational arithmetic; exit status 1 where a proof fails."""
    if arguments.plant is not None:
        return _claims(arguments)
    given_model.only_with_a_model(arguments)
    if arguments.save is not None:
        raise InputError("--save writes the proof of a claim: give --plant FILE too")
    model = None
    if arguments.model is not None:
        model = given_model.closed_loop(arguments, given_model.lpv_model(arguments))
    one = len(arguments.files) == 1
    texts, proofs = [], []
    for file in arguments.files:
        found, verdict, data = _verified(file, model)
        texts.append(f"{verdict}\n\n{_told(found)}" if one else f"{file}: {verdict}")
        proofs.append(data)
    exact = all(proof["exact"] and proof.get("about_the_model", True) for proof in proofs)
    data = proofs[0] if one else {"exact": exact, "proofs": proofs}
    return Output("\n".join(texts), data, status=0 if exact else 1)


def _claims(arguments: argparse.Namespace) -> Output:
    """Decide claims about a plant; exit status 1 where one is not proven."""
    from synthesis.claims import check, read_claim

    if arguments.model is not None:
        raise InputError("give --plant or --model, not both")
    if arguments.save is not None and len(arguments.files) > 1:
        raise InputError("--save writes one proof: give one claim")
    plant = _plant(arguments)
    verdicts = []
    for file in arguments.files:
        claim = read_claim(file)
        progress(f"checking {file} in rational arithmetic")
        verdicts.append(check(plant, claim))
    one = len(verdicts) == 1
    texts = [str(v) if one else f"{f}: {v}" for f, v in zip(arguments.files, verdicts, strict=True)]
    if arguments.save is not None and verdicts[0].proven:
        texts.append(f"written: {verdicts[0].save(arguments.save)}")
    data = [{"file": str(f), **v.facts} for f, v in zip(arguments.files, verdicts, strict=True)]
    proven = all(verdict.proven for verdict in verdicts)
    return Output(
        ("\n" if one else "\n\n").join(texts),
        data[0] if one else {"proven": proven, "claims": data},
        status=0 if proven else 1,
    )


def _plant(arguments: argparse.Namespace) -> Any:
    """The plant of --plant: one of matrices or polynomials, or a model as --model reads it."""
    from synthesis.claims import read_plant
    from synthesis.claims.document import document

    if "schema" not in document(arguments.plant):
        return read_plant(arguments.plant)
    arguments.model = arguments.plant
    return given_model.closed_loop(arguments, given_model.lpv_model(arguments))


def _verified(file: str, model: Any) -> tuple[ProvenStatement, str, dict[str, Any]]:
    """Return the statement in a file, the exact result in words, and the same for a program."""
    from synthesis.certify.statement.statement_file import read

    progress(f"verifying {file} in rational arithmetic")
    found: ProvenStatement = read(file)
    exact = found.verify(rigorous=True)
    why = found.why or "the inequalities do not hold in exact arithmetic"
    verdict = f"proven in exact arithmetic: {found.claim}" if exact else f"not proven: {why}"
    data: dict[str, Any] = {"file": file, **found.facts, "exact": exact}
    if exact:
        data |= {"claim": found.claim, "conditions": found.conditions}
    data["hypotheses"] = getattr(found, "hypotheses", found.conditions)
    if model is not None:
        about = data["about_the_model"] = found.proven_of(model)
        verdict += (
            "\nThe model of the proof is exactly that of --model."
            if about
            else "\nThe model of the proof is NOT that of --model: other numbers, range or period."
        )
    return found, verdict, data


def _told(found: ProvenStatement) -> str:
    """Conditions of a proof, from its numbers; then what the file says, which nothing checks."""
    lines = ["It holds where", *(f"- {line}" for line in found.conditions)]
    details = getattr(found, "details", "")
    if details:
        lines += ["", "How it was found, as the file says; nothing checks these lines:", details]
    return "\n".join(lines)
