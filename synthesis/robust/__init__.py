"""Several uncertain things at once: real parameters, and dynamics of bounded gain."""
