from synthesis.regions.region import RegionOfAttraction as RegionOfAttraction
from synthesis.regions.region import region_of_attraction as region_of_attraction
from synthesis.regions.terminal import TerminalSet as TerminalSet
from synthesis.regions.terminal import terminal as terminal
