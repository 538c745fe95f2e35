"""Sources of the methods of the study."""

from __future__ import annotations

REFERENCES: dict[str, str] = {
    "paper": (
        "A. Budiyono and H. Y. Sutarto, Linear Parameter Varying Model Identification for Control"
        " of Rotorcraft-based UAV."
    ),
    "gavrilets": (
        "V. Gavrilets, Dynamic Model for a Miniature Aerobatic Helicopter, Handbook of Unmanned"
        " Aerial Vehicles, Springer, 2015."
    ),
    "tischler": (
        "M. B. Tischler and R. K. Remple, Aircraft and Rotorcraft System Identification, 2nd ed.,"
        " AIAA, 2012."
    ),
    "klein": (
        "V. Klein and E. A. Morelli, Aircraft System Identification: Theory and Practice, AIAA,"
        " 2006."
    ),
    "bamieh": (
        "B. Bamieh and L. Giarré, Identification of linear parameter varying models, International"
        " Journal of Robust and Nonlinear Control 12, 2002."
    ),
    "ljung": "L. Ljung, System Identification: Theory for the User, 2nd ed., Prentice Hall, 1999.",
    "soderstrom": "T. Söderström and P. Stoica, System Identification, Prentice Hall, 1989.",
    "bjorck": "Å. Björck, Numerical Methods for Least Squares Problems, SIAM, 1996.",
    "vinnicombe": (
        "G. Vinnicombe, Uncertainty and Feedback: H-infinity Loop-shaping and the nu-gap Metric,"
        " Imperial College Press, 2001."
    ),
    "zhou": "K. Zhou, J. C. Doyle and K. Glover, Robust and Optimal Control, Prentice Hall, 1996.",
    "packard": (
        "A. Packard, Gain scheduling via linear fractional transformations, Systems and Control"
        " Letters 22, 1994."
    ),
    "apkarian-gahinet": (
        "P. Apkarian and P. Gahinet, A convex characterization of gain-scheduled H-infinity"
        " controllers, IEEE Transactions on Automatic Control 40, 1995."
    ),
    "wu": (
        "F. Wu, X. H. Yang, A. Packard and G. Becker, Induced L2-norm control for LPV systems with"
        " bounded parameter variation rates, International Journal of Robust and Nonlinear Control"
        " 6, 1996."
    ),
    "gahinet": (
        "P. Gahinet, P. Apkarian and M. Chilali, Affine parameter-dependent Lyapunov functions and"
        " real parametric uncertainty, IEEE Transactions on Automatic Control 41, 1996."
    ),
    "gahinet-apkarian": (
        "P. Gahinet and P. Apkarian, A linear matrix inequality approach to H-infinity control,"
        " International Journal of Robust and Nonlinear Control 4, 1994."
    ),
    "scherer": (
        "C. Scherer, P. Gahinet and M. Chilali, Multiobjective output-feedback control via LMI"
        " optimization, IEEE Transactions on Automatic Control 42, 1997."
    ),
    "apkarian-adams": (
        "P. Apkarian and R. J. Adams, Advanced gain-scheduling techniques for uncertain systems,"
        " IEEE Transactions on Control Systems Technology 6, 1998."
    ),
    "margaliot": (
        "M. Margaliot, Stability analysis of switched systems using variational principles,"
        " Automatica 42, 2006."
    ),
}
"""By key."""
