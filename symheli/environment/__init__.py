"""The air a helicopter flies in: its density with altitude, its steady motion, gusts and
turbulence.
"""

from symheli.environment.atmosphere import Air, standard_atmosphere
from symheli.environment.gust import Gust
from symheli.environment.turbulence import Dryden
from symheli.environment.wind import Wind

__all__ = ["Air", "Dryden", "Gust", "Wind", "standard_atmosphere"]
