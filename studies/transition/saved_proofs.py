"""The certificates of a study as files, from which alone `symheli verify` proves them again."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from studies.transition.guarantees import Bound
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
    found = [*study.bounds]
    if study.certified_controllers is not None:
        found += study.certified_controllers.bounds
    named = ((proof_file(b), b.certificate) for b in found)
    return [_saved(certificate, out / name) for name, certificate in named if name is not None]


def _saved(certificate: Certificate, path: Path) -> Path:
    paths = _written.setdefault(certificate, set())
    if path not in paths or not path.is_file():
        paths.add(certificate.save(path))
    return path
