from synthesis.certify.statement.forms import HigherOrder as HigherOrder
from synthesis.certify.statement.forms import LaggedParameter as LaggedParameter
from synthesis.certify.statement.forms import Spline as Spline
