"""Mathematics that knows no control question: linear models, polynomials, programs."""
