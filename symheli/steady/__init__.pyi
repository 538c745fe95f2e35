from symheli.steady.equilibrium import TrimPoint as TrimPoint
from symheli.steady.flight_condition import FlightCondition as FlightCondition
from symheli.steady.grid_sweep import sweep_grid as sweep_grid
from symheli.steady.trim_batch import trim_batch as trim_batch
