"""Electric factors of shapes: of the ellipsoid with the same volume and the same ratios of moments of inertia.

The table is printed by `benchmarks/contact_factors.py`, a boundary-integral solution of conducting ellipsoids that lie
on a grounded plane; a sphere's exact values are met within 2e-5, a flake of 1:10 within 1 %. In between it is linear in
the logarithms of the ratios, within 1 %; beyond its ends it is constant.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .mass import Array

HEIGHT = (0.1, 0.15, 0.22, 0.33, 0.5, 0.7, 1.0, 1.5, 2.2, 3.3, 5.0)  # c/sqrt(a b), c along the normal
SLENDERNESS = (1.0, 1.5, 2.2, 3.3, 5.0, 10.0)  # a/b
CHARGE = (  # over 4 pi eps0 r^2 E, r of the sphere of equal volume
    (1.7183, 1.7315, 1.7683, 1.8321, 1.9287, 2.1549),
    (1.5134, 1.5277, 1.5678, 1.6391, 1.7448, 2.0034),
    (1.3962, 1.4119, 1.4557, 1.5340, 1.6504, 1.9373),
    (1.3466, 1.3638, 1.4123, 1.4991, 1.6288, 1.9503),
    (1.3762, 1.3955, 1.4496, 1.5467, 1.6922, 2.0547),
    (1.4675, 1.4887, 1.5481, 1.6549, 1.8152, 2.2158),
    (1.6449, 1.6684, 1.7345, 1.8533, 2.0318, 2.4784),
    (1.9794, 2.0062, 2.0815, 2.2169, 2.4202, 2.9281),
    (2.4771, 2.5079, 2.5944, 2.7496, 2.9820, 3.5606),
    (3.2874, 3.3239, 3.4260, 3.6087, 3.8811, 4.5544),
    (4.5756, 4.6201, 4.7444, 4.9658, 5.2937, 6.0963),
)
FORCE = (  # over Q E
    (0.6343, 0.6382, 0.6317, 0.6534, 0.6447, 0.6491),
    (0.6614, 0.6625, 0.6665, 0.6728, 0.6794, 0.7026),
    (0.6953, 0.6963, 0.6990, 0.7036, 0.7096, 0.7217),
    (0.7338, 0.7344, 0.7360, 0.7386, 0.7421, 0.7492),
    (0.7732, 0.7733, 0.7735, 0.7739, 0.7745, 0.7759),
    (0.8033, 0.8029, 0.8021, 0.8008, 0.7992, 0.7966),
    (0.8321, 0.8315, 0.8299, 0.8272, 0.8238, 0.8170),
    (0.8602, 0.8594, 0.8573, 0.8538, 0.8492, 0.8395),
    (0.8820, 0.8812, 0.8791, 0.8754, 0.8703, 0.8594),
    (0.9005, 0.8998, 0.8979, 0.8944, 0.8896, 0.8784),
    (0.9154, 0.9148, 0.9131, 0.9102, 0.9058, 0.8969),
)


def semi_axes(moments: Array) -> Array:
    """Of the ellipsoid of equal volume whose moments of inertia have these ratios, over its diameter: (3,)."""
    square = np.maximum(moments.sum() - 2.0 * moments, 1e-4 * moments.max())  # m_k = m (a_i^2 + a_j^2)/5
    axes = np.sqrt(square)
    return np.asarray(0.5 * axes / np.cbrt(axes.prod()))


def depolarization(axes: Array) -> Array:
    """Factors N of an ellipsoid, (3,), which sum to 1: the field inside is E/(1 + (eps_r - 1) N) along each axis."""
    from scipy.special import elliprd

    square = axes**2
    others = [(1, 2), (2, 0), (0, 1)]
    return np.array([axes.prod() / 3.0 * elliprd(square[i], square[j], square[k]) for k, (i, j) in enumerate(others)])


def contact_factors(axes: Array) -> Array:
    """Charge over 4 pi eps0 r^2 E and force over Q E of a conductor on the drum, axis k along the normal: (2, 3)."""
    factors = np.empty((2, 3))
    for k in range(3):
        others = np.delete(axes, k)
        height, slender = axes[k] / np.sqrt(others.prod()), others.max() / others.min()
        for row, table in enumerate((CHARGE, FORCE)):
            along = [np.interp(np.log(height), np.log(HEIGHT), column) for column in np.log(table).T]
            factors[row, k] = np.exp(np.interp(np.log(slender), np.log(SLENDERNESS), along))
    return factors


def electric_factors(moments: Array) -> dict[str, Any]:
    """What the engine takes of a shape that is no sphere."""
    axes = semi_axes(moments)
    charge, force = contact_factors(axes)
    return {
        "contact_charge": charge,
        "contact_force": force,
        "semi_axes": axes,
        "depolarization": depolarization(axes),
    }
