"""Helicopter models from hover to forward flight: symbolic equations in, exact linear families and
LPV models out.

Everything is loaded when first used: `import symheli` brings in neither CasADi nor a plotting
library. The examples of this package start from

>>> import numpy as np
>>> import symheli
>>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
"""

from symheli.lazy import lazily

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
