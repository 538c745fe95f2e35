"""Small trials that campaigns of the tests repeat; workers import them."""

import os
import time

import numpy as np

from studies.campaigns.trial import Trial


def pendulum(*, length: float = 1.0, kind: str = "rod", seed: int = 0) -> dict[str, float]:
    """Fails for a length that is not positive."""
    if length <= 0:
        raise ValueError(f"no pendulum is {length:g} m long")
    g = np.random.default_rng(seed).normal(9.81, 0.1)
    return {"period": 2 * np.pi * np.sqrt(length / g)} | ({"bob": 1.0} if kind == "bob" else {})


PENDULUM = Trial(pendulum, {"period": "s", "bob": "kg"})


def deadly(*, number: int = 0, folder: str = "", deaths: int = 0, pause: float = 0.0):
    """Number 3 ends its process, `deaths` times; every call leaves a file in `folder`."""
    time.sleep(pause)
    calls = len([name for name in os.listdir(folder) if name.startswith(f"{number}-")])
    with open(os.path.join(folder, f"{number}-{calls}"), "w") as file:
        file.write(str(os.getpid()))
    if number == 3 and calls < deaths:
        os.kill(os.getpid(), 9)
    return {"square": float(number**2)}


DEADLY = Trial(deadly, {"square": "1"})
