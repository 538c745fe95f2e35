from synthesis.structures.structure import TunableController as TunableController
from synthesis.structures.structure import TunableGain as TunableGain
