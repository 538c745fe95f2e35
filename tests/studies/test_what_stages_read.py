"""A stage is computed from what it declares: the entries its stored result is keyed by are all that
it reads, whatever the effort asks for.
"""

from __future__ import annotations

import pytest

from studies.transition.effort import Effort
from studies.transition.stages import stages

ASKING = [stage for stage in stages(Effort()) if stage.asks]


@pytest.mark.slow
@pytest.mark.parametrize(
    "effort",
    [Effort(), Effort.look()],
    ids=["whole", "look"],
)
@pytest.mark.parametrize("stage", ASKING, ids=lambda stage: stage.name)
def test_the_questions_of_a_stage_are_made_of_what_it_declares(full, stage, effort):
    """Entries that only a branch reads are read with every option on, or off; the other stages read
    theirs in any case, which the outcome of the tests shows.
    """
    questions = stage.call(full, effort)()
    count = len(questions.proofs)
    assert count > 0 or (stage.name, effort) in (
        ("longitudinal", Effort.look()),
        ("certified_controllers", Effort.look()),
    )
    assert all(any(proof is long for proof in questions.proofs) for long in questions.long)
