"""Spherical harmonics evaluated inside a graph, with the definition of 3DGS."""

from math import pi, sqrt

from ..graph import Tensor

_C0 = 0.5 * sqrt(1 / pi)
_C1 = sqrt(3 / (4 * pi))
_C2 = [0.5 * sqrt(15 / pi), 0.25 * sqrt(5 / pi), 0.25 * sqrt(15 / pi)]
_C3 = [0.25 * sqrt(35 / (2 * pi)), 0.5 * sqrt(105 / pi), 0.25 * sqrt(21 / (2 * pi)), 0.25 * sqrt(7 / pi)]


def basis(directions: Tensor, degree: int) -> Tensor:
    """Values (...,(degree+1)^2) of the harmonics in unit directions (...,3), with 3DGS's signs."""
    graph = directions.graph
    x, y, z = (directions.part(i, i + 1) for i in range(3))
    columns = [x * 0.0 + _C0]
    if degree > 0:
        columns += [y * -_C1, z * _C1, x * -_C1]
    if degree > 1:
        xx, yy, zz = x * x, y * y, z * z
        columns += [x * y * _C2[0], y * z * -_C2[0], zz * (3 * _C2[1]) - _C2[1], x * z * -_C2[0], (xx - yy) * _C2[2]]
    if degree > 2:
        five = zz * 5.0 - 1.0
        columns += [y * (xx * 3.0 - yy) * -_C3[0], x * y * z * _C3[1], y * five * -_C3[2]]
        columns += [z * (zz * 5.0 - 3.0) * _C3[3], x * five * -_C3[2]]
        columns += [z * (xx - yy) * (_C3[1] / 2), x * (xx - yy * 3.0) * -_C3[0]]
    return graph.concat(columns, -1)


def color(directions: Tensor, sh: Tensor) -> Tensor:
    """Colors (...,N,3), not negative, of harmonics (N,(d+1)^2,3) seen along unit directions (...,N,3)."""
    terms = sh.shape[1]
    degree = {1: 0, 4: 1, 9: 2, 16: 3}[terms]
    values = basis(directions, degree).reshape(*directions.shape[:-1], terms, 1) * sh
    return (values.sum(-2) + 0.5).unary("Relu")
