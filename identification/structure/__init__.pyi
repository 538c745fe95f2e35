from identification.estimators.instruments import LaggedSignals as LaggedSignals
from identification.structure.late_sensors import LateSensors as LateSensors
from identification.structure.steady_wind import SteadyWind as SteadyWind
