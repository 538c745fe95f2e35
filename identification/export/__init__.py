"""Estimators and identified models as C99 for an autopilot or a simulator."""

from identification.export.estimator import write_estimator
from identification.export.fmu import write_identifier_fmu
from identification.export.kinematic_estimator import write_kinematic_estimator
from identification.export.kinematic_model import write_kinematic_model
from identification.export.kinematic_observer import write_kinematic_observer
from identification.export.model import write_model

__all__ = [
    "write_estimator",
    "write_identifier_fmu",
    "write_kinematic_estimator",
    "write_kinematic_model",
    "write_kinematic_observer",
    "write_model",
]
