"""Flight records in, LPV models out: recursive, batch and instrumental-variable estimates of
input-output models with moving coefficients.

Units are those of the record: SI and radians. The examples of this package start from

>>> import numpy as np
>>> import identification as idn
>>> from symheli import FlightRecord
>>> rng, n = np.random.default_rng(0), 800
>>> p, u, noise = np.sin(0.05 * np.arange(n)), rng.uniform(-1, 1, n), 0.01 * rng.normal(size=n)
>>> y = np.zeros(n)
>>> for k in range(1, n):
...     y[k] = (0.5 + 0.3 * p[k - 1]) * y[k - 1] + u[k - 1] + noise[k]
>>> record = FlightRecord.from_arrays(
...     0.1 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=p
... )
>>> arx = idn.LPVARX(
...     "y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, low=-1.0, high=1.0)
... )
>>> model = idn.fit(arx, record)

One step flatters: report one step, a horizon and the free run.

>>> for horizon in (1, 10, None):
...     print(round(float(model.score(record, horizon)["y"])))
99
98
98
"""

from symheli.lazy import lazily

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
