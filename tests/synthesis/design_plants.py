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


def lynx():
    """A and B of HE4 and HE5 of COMPleib: a Lynx, of eight states and four controls."""
    A = matrix(
        "0 0 0 .99857378 .0533842742 0 0 0; 0 0 1 -.00318221934 .0595246553 0 0 0;"
        " 0 0 -11.5704956 -2.54463768 -.0636026263 .106780529 -.0949186683 .00710757449;"
        " 0 0 .439356565 -1.9981823 0 .0166518837 .018462047 -.00118747074;"
        " 0 0 -2.04089546 -.458999157 -.73502779 .0192557573 -.00459562242 .00212036073;"
        " -32.1036072 0 -.503355026 2.29785919 0 -.0212158114 -.021167919 .0158115923;"
        " .102161169 32.0578308 -2.34721756 -.503611565 .834947586 .02122657 -.0378797352"
        " .00035400386; -1.9109726 1.71382904 -.00400543213 -.0574111938 0 .0139896348"
        " -.000906753354 -.290513515"
    )
    B = matrix(
        "0 0 0 0; 0 0 0 0; .124335051 .0827858448 -2.75247765 -.0178887695;"
        " -.0363589227 .475095272 .0142907426 0; .30449152 .0149580166 -.496518373 -.206741929;"
        " .287735462 -.544506073 -.0163793564 0; -.0190734863 .0163674355 -.544536114 .2348423;"
        " -4.82063293 -.000381469727 0 0"
    )
    return A, B


def he5():
    """Roll and pitch rate measured with noise .01; attitudes, heave and yaw count."""
    A, B = lynx()
    show = np.eye(8)
    C1 = np.vstack(
        [[0, 0, 0, 0, 0, 0.0595, 0.05329, -0.9968], show[0], show[1], -0.05348 * show[3] + show[4]]
    )
    D = np.zeros((6, 7))
    D[:4, 3:], D[4, 0], D[5, 1] = np.eye(4), 0.01, 0.01
    return named(A, np.hstack([show[:, 2:5], B]), np.vstack([C1, show[[2, 3]]]), D, 4, 2)


def he1(noise):
    """HE1 of COMPleib, a VTOL helicopter, whose one measurement is given noise here."""
    root = np.sqrt(0.5)
    D = np.zeros((3, 5))
    D[:2, 3:], D[2, 2] = root * np.eye(2), noise
    return named(
        matrix(
            "-.0366 .0271 .0188 -.4555; .0482 -1.01 .0024 -4.0208; .1002 .3681 -.707 1.42; 0 0 1 0"
        ),
        matrix(
            ".04678 0 0 .4422 .1761; .04572 .00988 0 3.5446 -7.5922; .04369 .00111 0 -5.52 4.49;"
            " -.02179 0 0 0 0"
        ),
        np.vstack([2 * root * np.eye(4)[0], root * np.eye(4)[1], np.eye(4)[1]]),
        D,
        2,
        1,
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
