from synthesis.sets.governor import ReferenceGovernor as ReferenceGovernor
from synthesis.sets.governor import reference_governor as reference_governor
from synthesis.sets.invariant_set import InvariantSet as InvariantSet
from synthesis.sets.invariant_set import invariant_set as invariant_set
from synthesis.sets.low_complexity import LowComplexitySet as LowComplexitySet
from synthesis.sets.low_complexity import low_complexity_set as low_complexity_set
from synthesis.sets.switch import SwitchInside as SwitchInside
