"""Plants whose best controllers are known, and random ones."""

import numpy as np

from symheli import LinearModel


def matrix(text):
    return np.array([[float(v) for v in row.split()] for row in text.split(";")])


def named(A, B, C, D, controls, measured, dt=None):
    """A model whose last inputs and outputs are u1.. and y1.., with those names."""
    A, B, C, D = (np.atleast_2d(np.asarray(M, dtype=float)) for M in (A, B, C, D))

    def names(stem, count):
        return [f"{stem}{i + 1}" for i in range(count)]

    u, y = names("u", controls), names("y", measured)
    model = LinearModel(
        A,
        B,
        C,
        D,
        names("x", len(A)),
        names("w", B.shape[1] - controls) + u,
        names("z", len(C) - measured) + y,
        dt,
    )
    return model, u, y


def first_order(a, b, c):
    """x' = ax + bu + w1, y = cx + w2, z = (x, u)."""
    return named(
        [[a]],
        [[1, 0, b]],
        [[1], [0], [c]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
        controls=1,
        measured=1,
    )


def scherer_gahinet_chilali(performance):
    """IEEE Trans. Automatic Control 42 (1997), example 7; `performance` rows of x beside u."""
    rows = np.eye(3)[list(performance)]
    k = len(rows)
    through = np.zeros((k + 2, 2))
    through[k, 1], through[k + 1, 0] = 1.0, 2.0
    return named(
        matrix("0 10 2; -1 1 0; 0 2 -5"),
        matrix("1 0; 0 1; 1 0"),
        np.vstack([rows, np.zeros(3), [0, 1, 0]]),
        through,
        1,
        1,
    )


def slicot_sb10fd():
    """The example of SLICOT's SB10FD: every block of D is there."""
    return named(
        matrix(
            "-1 0 4 5 -3 -2; -2 4 -7 -2 0 3; -6 9 -5 0 2 -1; -8 4 7 -1 -3 0; 2 5 8 -9 1 -4;"
            " 3 -5 8 0 2 -6"
        ),
        matrix("-3 -4 -2 1 0; 2 0 1 -5 2; -5 -7 0 7 -2; 4 -6 1 1 -2; -3 9 -8 0 5; 1 -2 3 -6 -2"),
        matrix("1 -1 2 -4 0 -3; -3 0 5 -1 1 1; -7 5 0 -8 2 -2; 9 -3 4 0 3 7; 0 1 -2 1 -6 -2"),
        matrix("1 -2 -3 0 0; 0 4 0 1 0; 5 -3 -4 0 1; 0 1 0 1 -3; 0 0 1 7 1"),
        2,
        2,
    )


def all_ones():
    """a = -1, every other number 1, without D11 and D22."""
    return named([[-1]], [[1, 1]], [[1], [1]], [[0, 1], [1, 0]], 1, 1)


def random_plant(seed, dt=None, direct=True):
    """Up to five states, two more disturbances than measurements and so on; of a continuous one D11
    only if `direct`.
    """
    rng = np.random.default_rng(seed)
    n, nu, ny = (int(rng.integers(1, top)) for top in (6, 3, 3))
    nw, nz = ny + int(rng.integers(1, 3)), nu + int(rng.integers(1, 3))
    A = rng.standard_normal((n, n)) / (1 if dt is None else np.sqrt(n))
    D = rng.standard_normal((nz + ny, nw + nu))
    if not direct:
        D[:nz, :nw] = 0.0
    return named(
        A, rng.standard_normal((n, nw + nu)), rng.standard_normal((nz + ny, n)), D, nu, ny, dt
    )


def matrices(model):
    return model.A, model.B, model.C, model.D
