"""Harmonics of 3DGS by the associated Legendre recurrence, independent of the polynomials in the package."""

from __future__ import annotations

from math import factorial, pi, sqrt

import numpy as np

from gaussian_exporter.arrays import Doubles


def legendre(l: int, m: int, z: Doubles) -> Doubles:  # noqa: E741
    """Associated Legendre function without the Condon-Shortley phase, divided by (1 - z^2)^(m/2)."""
    value = np.full_like(z, float(np.prod(np.arange(2 * m - 1, 0, -2)) if m else 1.0))
    if l == m:
        return value
    before, value = value, z * (2 * m + 1) * value
    for degree in range(m + 2, l + 1):
        before, value = value, ((2 * degree - 1) * z * value - (degree + m - 1) * before) / (degree - m)
    return value


def basis(directions: Doubles, degree: int) -> Doubles:
    """(N,(degree+1)^2), order l, m from -l to l, with the phase (-1)^m that 3DGS writes into its constants."""
    x, y, z = directions.T
    columns = []
    for l in range(degree + 1):  # noqa: E741
        for m in range(-l, l + 1):
            a = abs(m)
            norm = sqrt((2 * l + 1) / (4 * pi) * factorial(l - a) / factorial(l + a)) * (sqrt(2) if m else 1)
            power = (x + 1j * y) ** a
            columns.append((-1) ** a * norm * legendre(l, a, z) * (power.imag if m < 0 else power.real))
    return np.stack(columns, 1)
