from symheli.airframe.identified_models import (
    identified_model as identified_model,
)
from symheli.airframe.identified_models import (
    identified_models as identified_models,
)
from symheli.airframe.vehicle import vehicles as vehicles
from symheli.embedding import embed as embed
from symheli.environment import (
    Air as Air,
)
from symheli.environment import (
    Dryden as Dryden,
)
from symheli.environment import (
    Gust as Gust,
)
from symheli.environment import (
    Wind as Wind,
)
from symheli.environment import (
    standard_atmosphere as standard_atmosphere,
)
from symheli.errors import (
    AccuracyError as AccuracyError,
)
from symheli.errors import (
    CertificateError as CertificateError,
)
from symheli.errors import (
    CompilerWarning as CompilerWarning,
)
from symheli.errors import (
    ConvergenceWarning as ConvergenceWarning,
)
from symheli.errors import (
    DataWarning as DataWarning,
)
from symheli.errors import (
    ExcitationError as ExcitationError,
)
from symheli.errors import (
    FlightLostError as FlightLostError,
)
from symheli.errors import (
    InputError as InputError,
)
from symheli.errors import (
    PrecisionWarning as PrecisionWarning,
)
from symheli.errors import (
    SolverError as SolverError,
)
from symheli.errors import (
    SymheliError as SymheliError,
)
from symheli.errors import (
    TrimError as TrimError,
)
from symheli.errors import (
    UnknownNameError as UnknownNameError,
)
from symheli.errors import (
    ValidityWarning as ValidityWarning,
)
from symheli.flight import (
    AirspeedSchedule as AirspeedSchedule,
)
from symheli.flight import (
    Autopilot as Autopilot,
)
from symheli.flight import (
    Excitation as Excitation,
)
from symheli.flight import (
    FlightDataset as FlightDataset,
)
from symheli.flight import (
    FlightPlan as FlightPlan,
)
from symheli.flight import (
    ParameterMonitor as ParameterMonitor,
)
from symheli.flight import (
    PureController as PureController,
)
from symheli.flight import (
    ScheduledController as ScheduledController,
)
from symheli.flight import (
    Sensor as Sensor,
)
from symheli.flight import (
    Servo as Servo,
)
from symheli.flight import (
    SimulatedFlight as SimulatedFlight,
)
from symheli.flight import (
    StatefulController as StatefulController,
)
from symheli.flight import (
    TableController as TableController,
)
from symheli.flight import (
    fly as fly,
)
from symheli.flight import (
    fly_batch as fly_batch,
)
from symheli.flight import (
    fly_campaign as fly_campaign,
)
from symheli.flight import (
    gain_scheduled_lqr as gain_scheduled_lqr,
)
from symheli.flight.stitched_model import StitchedModel as StitchedModel
from symheli.helicopter import Helicopter as Helicopter
from symheli.integrate import (
    CashKarp as CashKarp,
)
from symheli.integrate import (
    DormandPrince as DormandPrince,
)
from symheli.integrate import (
    Feedback as Feedback,
)
from symheli.integrate import (
    Radau as Radau,
)
from symheli.integrate import (
    RungeKutta4 as RungeKutta4,
)
from symheli.integrate import (
    simulate as simulate,
)
from symheli.integrate import (
    simulate_batch as simulate_batch,
)
from symheli.lpv import (
    LFT as LFT,
)
from symheli.lpv import (
    LinearFamily as LinearFamily,
)
from symheli.lpv import (
    LinearModel as LinearModel,
)
from symheli.lpv import (
    LPVStateSpace as LPVStateSpace,
)
from symheli.lpv import (
    Scheduling as Scheduling,
)
from symheli.lpv import (
    UncertainStateSpace as UncertainStateSpace,
)
from symheli.progress import watched as watched
from symheli.records import FlightRecord as FlightRecord
from symheli.steady.airspeed_sweep import sweep as sweep
from symheli.steady.derivative_table import derivatives as derivatives
from symheli.steady.equilibrium import TrimPoint as TrimPoint
from symheli.steady.equilibrium import trim as trim
from symheli.steady.flight_condition import FlightCondition as FlightCondition
from symheli.steady.grid_sweep import sweep_grid as sweep_grid
from symheli.steady.linearization import linearize as linearize
from symheli.steady.trim_batch import trim_batch as trim_batch
from symheli.steady.trim_map import trim_map as trim_map
from symheli.values import NamedVector as NamedVector
from symheli.values import Signal as Signal

__version__: str
