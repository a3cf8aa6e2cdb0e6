"""Charge and force of conducting ellipsoids that lie on a grounded plane in a field, by a boundary-integral method.

Prints the table of `cesim/shapes/electric.py`: `python benchmarks/contact_factors.py`. It takes some minutes.

The surface charge of an ellipsoid with semi-axes a, b, c is sigma = g h, where h is the distance of the tangent plane
from its centre; h dS = abc dOmega on the unit sphere, and g = 1 makes its potential constant,
4 pi abc R_F(a^2, b^2, c^2) in units of 1/(4 pi eps0). So the singular part of the potential is taken out:

    sum_j w_j abc (g_j - g_i)/|r_i - r_j| + 4 pi abc R_F g_i - (the same of the image in the plane) = E z_i,

on a product rule of Gauss and of equal angles. Two symmetries leave a quarter of the unknowns. A sphere's exact values
are met within 2e-5, a flake of 1:10 within 1 %.
"""

import numpy as np
from scipy.special import elliprf

HEIGHTS = (0.1, 0.15, 0.22, 0.33, 0.5, 0.7, 1.0, 1.5, 2.2, 3.3, 5.0)  # c/sqrt(a b), c along the normal
SLENDERNESS = (1.0, 1.5, 2.2, 3.3, 5.0, 10.0)  # a/b


def factors_once(height, slender, polar, around):
    """(k_Q, F/(Q E)) with polar x around points on a quarter of the surface."""
    r = height ** (-1.0 / 3.0)  # sqrt(a b) of the ellipsoid whose volume is that of the unit sphere
    semi = np.array([r * np.sqrt(slender), r / np.sqrt(slender), height * r])
    mu, weight = np.polynomial.legendre.leggauss(polar)
    angle = 0.5 * np.pi * (np.arange(around) + 0.5) / around
    z, phi = np.meshgrid(mu, angle, indexing="ij")
    unit = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], -1).reshape(-1, 3)
    w = (np.repeat(weight, around) * 0.5 * np.pi / around) * semi.prod()  # abc dOmega
    x = unit * semi
    n, c = len(x), semi[2]
    matrix, own = np.zeros((n, n)), np.zeros(n)
    for sx in (1, -1):
        for sy in (1, -1):
            other = x * [sx, sy, 1]
            d = np.linalg.norm(x[:, None] - other[None], axis=2)
            near = np.divide(w[None], d, out=np.zeros((n, n)), where=d > 0)
            own += near.sum(axis=1)
            image = other * [1, 1, -1] - [0, 0, 2 * c]
            matrix += near - w[None] / np.linalg.norm(x[:, None] - image[None], axis=2)
    matrix[np.diag_indices(n)] += 4 * np.pi * semi.prod() * elliprf(*semi**2) - own
    g = np.linalg.solve(matrix, x[:, 2] + c)
    charge = 4 * (w * g).sum()
    h2 = 1.0 / ((x / semi**2) ** 2).sum(axis=1)
    force = 2 * np.pi * 4 * (w * g**2 * h2 * x[:, 2] / c**2).sum()
    return np.array([charge, force / charge])


def factors(height, slender):
    """(k_Q, F/(Q E)) at a resolution that the two faces of a flake, which nearly touch, call for."""
    polar = 48 if height > 0.4 else 84
    return factors_once(height, slender, polar, polar // 2)


if __name__ == "__main__":
    TABLE = {(height, slender): factors(height, slender) for height in HEIGHTS for slender in SLENDERNESS}
    for which, name in enumerate(("CHARGE", "FORCE")):
        print(f"{name} = (")
        for height in HEIGHTS:
            row = [TABLE[height, slender][which] for slender in SLENDERNESS]
            print(f"    ({', '.join(f'{value:.4f}' for value in row)}),")
        print(")")
