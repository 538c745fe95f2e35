"""Files of proofs that symheli 0.1 wrote before its rooms had floors still prove themselves.

One of each kind: every question, an invariant set, a tube. They name no module paths.
"""

import json
from pathlib import Path

import pytest

from symheli.errors import CertificateError, InputError
from synthesis import Certificate
from synthesis.sets import InvariantSet
from synthesis.tubes import Tube

pytestmark = pytest.mark.guard

FILES = sorted((Path(__file__).parents[1] / "data" / "proofs").glob("*.json"))
READERS = {"invariant-set": InvariantSet.load, "tube": Tube.load}
BOUNDS = ("gamma", "alpha")


def test_there_is_one_of_each_kind():
    kinds = {Certificate.load(f).kind for f in FILES if f.stem not in READERS}
    assert kinds == {"l2 gain", "stability", "energy-to-peak gain", "h2 gain", "decay rate"}
    assert {f.stem for f in FILES} >= set(READERS)


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_a_file_of_a_former_version_proves_itself(file, tmp_path):
    proof = READERS.get(file.stem, Certificate.load)(file)
    assert proof.verify(rigorous=True) if file.stem not in READERS else proof.verify()
    proof.save(tmp_path / "again.json")
    again = READERS.get(file.stem, Certificate.load)(tmp_path / "again.json")
    assert str(again) == str(proof)


@pytest.mark.parametrize("file", [f for f in FILES if f.stem not in READERS], ids=lambda f: f.stem)
def test_a_better_bound_in_the_file_is_not_believed(file, tmp_path):
    """Nor, where there is none, another Lyapunov function."""
    content = json.loads(file.read_text())
    name = next((n for n in BOUNDS if isinstance(content[n], float)), None)
    if name is None:
        own = content["proof"]["lyapunov"]
        P = own["P"] if "P" in own else own["coefficients"]
        P["array"] = [-entry for entry in P["array"]]
    else:
        content[name] *= 0.9 if name == "gamma" else 1.1
        content["lower" if name == "gamma" else "upper"] = {"float": "nan"}
        content["frozen"] = {"float": "nan"}
    forged = tmp_path / "forged.json"
    forged.write_text(json.dumps(content))
    with pytest.raises((CertificateError, InputError)):
        Certificate.load(forged)
