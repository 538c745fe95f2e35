from synthesis.switching.dwell_time import dwell_time as dwell_time
from synthesis.switching.switched import SwitchedController as SwitchedController
from synthesis.switching.switched import switched as switched
