"""The certificates of a study as files, from which alone `symheli verify` proves them again."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

from studies.setup.bounds import Bound, rate_text
from studies.transition.tables import gain
from synthesis import Certificate

if TYPE_CHECKING:
    from studies.transition.outcome import Outcome

FOLDER = "proofs"
_written: WeakKeyDictionary[Certificate, set[Path]] = WeakKeyDictionary()
"""Where this process has written a certificate: results are written after every stage, proofs
once.
"""


def proof_file(b: Bound) -> str | None:
    """The name of its file beside results.json; None where nothing is proven."""
    c = b.certificate
    if not c.verified:
        return None
    words = (b.channel, b.model, b.form, f"{b.rate:g}", c.kind)
    plain = (re.sub(r"[^a-z0-9.]+", "-", word.lower()).strip("-") for word in words)
    return f"{FOLDER}/{'-'.join(plain)}.json"


def save_proofs(study: Outcome, out: Path) -> list[Path]:
    """Write every proof that the study has reached below `out`; the files."""
    return [_saved(b.certificate, out / name) for name, b in _proven(study)]


class LinkedProof(NamedTuple):
    """A file of a proof, from where results.json lies, and what it proves."""

    file: str
    claim: str


def linked_proofs(study: Outcome) -> dict[str, list[LinkedProof]]:
    """Every file of `save_proofs` by the loop that it is about."""
    out: dict[str, list[LinkedProof]] = {}
    for name, b in _proven(study):
        what = (
            "stable"
            if b.certificate.kind == "stability"
            else f"gain of at most {gain(b.certificate.gamma)}"
        )
        claim = f"{b.model}, {b.form}, {rate_text(b.rate)}: {what}"
        out.setdefault(b.channel, []).append(LinkedProof(name, claim))
    return out


def _proven(study: Outcome) -> Iterator[tuple[str, Bound]]:
    """Every bound that is proven, with its file."""
    certified = study.certified_controllers
    for b in (*study.bounds, *(certified.bounds if certified is not None else ())):
        if (name := proof_file(b)) is not None:
            yield name, b


def _saved(certificate: Certificate, path: Path) -> Path:
    paths = _written.setdefault(certificate, set())
    if path not in paths or not path.is_file():
        paths.add(certificate.save(path))
    return path
