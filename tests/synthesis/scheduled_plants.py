"""Scheduled plants whose least gain is known, and small ones."""

from functools import cache

import numpy as np
from design_plants import first_order

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.lpv.bases.polynomials import interpolation_points, polynomials
from synthesis import Plant, output_feedback

RATE = 0.5
"""Of p of the spring, per second."""
WORST_FROZEN = 0.766273
"""Optimum of `two_parameters` at (1, 1), and nowhere larger."""


def of(model, controls, measured):
    """The plant of a frozen model with these controls and measurements."""
    return Plant(
        model,
        disturbances=[u for u in model.inputs if u not in controls],
        performance=[y for y in model.outputs if y not in measured],
        controls=controls,
        measurements=measured,
    )


def lag(a, b, c):
    """`first_order` as a plant."""
    return of(*first_order(a, b, c))


def turning(rate, degree=10):
    """x' = -3 cos(t) x + 3 sin(t) u + w, z = (x, u), t in [0, pi/2]; x is measured.

    Scalar and homogeneous: the value of the game is the optimum over all causal controllers. The
    polynomials of t are within 1e-9 of sine and cosine.
    """
    t = Scheduling("t", "rad", 0.0, np.pi / 2, rate=rate)
    nodes = interpolation_points([degree], [(t.low, t.high)])
    basis = polynomials([degree], [(t.low, t.high)])

    def fit(*rows):
        each = [[np.broadcast_to(entry, len(nodes)) for entry in row] for row in rows]
        return basis.fit(nodes, np.moveaxis(np.array(each, dtype=float), -1, 0))

    at = nodes.ravel()
    model = LPVStateSpace(
        basis,
        fit([-3 * np.cos(at)]),
        fit([1.0, 3 * np.sin(at)]),
        fit([1.0], [0.0], [1.0]),
        fit([0.0, 0.0], [0.0, 1.0], [0.0, 0.0]),
        (t,),
        ("x",),
        ("w", "u"),
        ("z_x", "z_u", "y"),
    )
    return of(model, ["u"], ["y"])


def spring(rate=RATE, noise=0.1, states=False, price=0.3):
    """x'' = -(1 + 2p) x - (.4 - .6p) x' + w + u, stiffer and undamped as p grows; x measured with
    noise, or with `states` x and v without.
    """
    C = [[1, 0], [0, 0], *([[1, 0], [0, 1]] if states else [[1, 0]])]
    D = [[0, 0, 0], [0, 0, price], *([[0, 0, 0]] * 2 if states else [[0, noise, 0]])]
    model = LPVStateSpace.polynomial(
        [[[0, 1], [-1, -0.4]], [[0, 0], [-2, 0.6]]],
        [[[0, 0, 0], [1, 0, 1]]],
        [C],
        [D],
        Scheduling("p", "1", 0.0, 1.0, rate=rate),
        states=["x", "v"],
        inputs=["w", "n", "u"],
        outputs=["z", "z_u", *(["x", "v"] if states else ["y"])],
    )
    return of(model, ["u"], ["x", "v"] if states else ["y"])


@cache
def spring_controller():
    """Output feedback of `spring`, made once a process."""
    return output_feedback(spring())


def frozen(plant, *p):
    """The arguments of `synthesis.hinf` for the plant at p."""
    return plant.model.at(*p), list(plant.controls), list(plant.measurements)


def two_parameters(rate):
    """An example of two parameters: mixed sensitivity of a plant of two states.

    A reference enters, its error counts by 10/(s + .01), the control by (.04s + .1)/(.004s + 1).
    """
    model = LPVStateSpace.polynomial(
        {
            (0, 0): [[-2, 1], [-1, -2]],
            (1, 0): [[-1.3, 0.1], [-0.1, -1.3]],
            (0, 1): [[-0.5, 0], [0, -0.5]],
        },
        {(0, 0): [[1], [1]]},
        {(0, 0): [[10, 10]]},
        {(0, 0): [[0]]},
        [Scheduling(name, "1", 0.0, 1.0, rate=rate) for name in ("p1", "p2")],
        states=["x1", "x2"],
        inputs=["u"],
        outputs=["y"],
    )

    def weight(a, b, c, d):
        return LinearModel([[a]], [[b]], [[c]], [[d]], ("x",), ("in",), ("out",))

    plant = Plant(model, performance=["y", "u"], controls=["u"], measurements=["y"])
    return plant.with_reference(["y"]).weighted(
        # (.04s + .1)/(.004s + 1) = 10 + (25 - 2500)/(s + 250)
        {"y_error": weight(-0.01, 1.0, 10.0, 0.0), "u": weight(-250.0, 1.0, 25.0 - 2500.0, 10.0)}
    )


def missile_at(mach, alpha):
    """A, B, C, D of a missile's pitch axis with actuator, filter, reference model and weights.

    Inputs: commanded normal acceleration, disturbance of the fin, two noises, fin command.
    Outputs: weighted error and fin command; error and pitch rate as measured. Source: Lim and How,
    IEEE Trans. Control Systems Technology 11 (2003), with the disturbance at the actuator.
    """
    a, size = np.deg2rad(alpha), abs(alpha)
    f1 = (1e-4 * alpha**2 - 0.0112 * size - 0.2010 * (2 - mach / 3)) * mach * np.cos(a)
    f2 = (0.0152 * alpha**2 - 1.3765 * size + 3.6001 * (-7 + 8 * mach / 3)) * mach**2
    f3, f4 = -0.0403 * mach * np.cos(a), -14.542 * mach**2
    f5 = (1e-4 * alpha**2 - 0.0063 * size - 0.1130 * (2 - mach / 3)) * mach**2
    f6 = -0.0226 * mach**2
    # rows over alpha, q, fin, filter, two of the reference, error, weight of the command; inputs
    one = np.eye(13)
    attack, q, fin, filtered, r1, r2, error, command = one[:8]
    nc, disturbance, n1, n2, dc = one[8:]
    moved = fin + 0.01 * disturbance
    normal = f5 * attack + f6 * moved
    follow = 144 * r1 - 7.2 * r2
    A = [
        f1 * attack + q + f3 * moved,
        f2 * attack + f4 * moved,
        100 * (dc - fin),
        100 * (normal - filtered),
        r2,
        nc - 144 * r1 - 19.2 * r2,
        follow - normal - 0.0577 * error,
        dc - 200 * command,
    ]
    # (s + .25)/(25(.005s + 1)) = 8 + 8(.25 - 200)/(s + 200)
    C = [
        17.321 * error,
        8 * dc + 8 * (0.25 - 200) * command,
        nc - filtered - 0.001 * n1,
        q + 0.001 * n2,
    ]
    X, Z = np.array(A), np.array(C)
    return X[:, :8], X[:, 8:], Z[:, :8], Z[:, 8:]


MISSILE = (["nc", "d", "n1", "n2", "dc"], ["z_error", "z_dc", "error", "q"])
MISSILE_STATES = tuple(f"x{i}" for i in range(8))


def missile(rate, degrees=(6, 4), box=((2.0, 4.0), (0.0, 20.0))):
    """Over Mach number and angle of attack (deg), polynomials of these degrees."""
    nodes, basis = interpolation_points(degrees, box), polynomials(degrees, box)
    each = (np.stack(M) for M in zip(*(missile_at(*q) for q in nodes), strict=True))
    scheduling = [
        Scheduling(name, unit, *ends, rate=rate)
        for name, unit, ends in zip(("mach", "alpha"), ("1", "deg"), box, strict=True)
    ]
    model = LPVStateSpace(
        basis, *(basis.fit(nodes, M) for M in each), scheduling, MISSILE_STATES, *MISSILE
    )
    return of(model, ["dc"], ["error", "q"])
