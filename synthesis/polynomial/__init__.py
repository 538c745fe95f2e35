"""Several scheduling parameters, and other relaxations than Bernstein coefficients: polynomial
matrices over a box.
"""

from synthesis.polynomial.certificate import BoxCertificate
from synthesis.polynomial.lyapunov import BoxLyapunov
from synthesis.polynomial.matrix import PolynomialMatrix

__all__ = ["BoxCertificate", "BoxLyapunov", "PolynomialMatrix"]
