from synthesis.robust.mu_synthesis import mu_synthesis as mu_synthesis
from synthesis.robust.rational import RationalGain as RationalGain
from synthesis.robust.rational import rational_gain as rational_gain
from synthesis.robust.robust_margin import robust_margin as robust_margin
from synthesis.robust.slope import slope_margin as slope_margin
from synthesis.robust.structure import DynamicBlock as DynamicBlock
from synthesis.robust.uncertain import uncertain as uncertain
from synthesis.robust.worst_case_gain import worst_case_gain as worst_case_gain
