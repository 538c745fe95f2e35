from synthesis.design.lpv.objectives import H2 as H2
from synthesis.design.lpv.objectives import L2 as L2
from synthesis.design.lpv.objectives import EnergyToPeak as EnergyToPeak
from synthesis.design.lpv.objectives import PoleRegion as PoleRegion
