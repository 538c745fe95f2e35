from synthesis.certify.statement.impose import Bernstein as Bernstein
from synthesis.certify.statement.impose import Grid as Grid
from synthesis.certify.statement.impose import SumOfSquares as SumOfSquares
from synthesis.certify.statement.impose import Vertices as Vertices
