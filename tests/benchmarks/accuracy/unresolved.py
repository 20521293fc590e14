#!/usr/bin/env python3
"""What planar elements miss of a loaded line that crosses them: the constants of common/contact/working_set.cpp (add_unresolved).

A periodic square of unit elements, plane stress, and a straight line through it. Nothing here knows trocar's solver or its benchmark.
  along, across   A line that closes on itself, loaded evenly, against its closed form -|d|/2 + d^2/(2 W): what the elements miss on the
                  line, over sum w |d| / (2 C), what their interpolation would miss, is 1 + this times sin^2 of twice the angle to the edges.
  end             A stuck line of 12 segments with the terms above and the jumps, against the same line on elements of a quarter of the
                  size: what has to be added to the compliance of both end segments so that the total forces agree, times the shear modulus.
Needs numpy and scipy; takes a minute.    unresolved.py [poisson's ratio, 0.48]
"""
import sys

import numpy as np
import scipy.optimize
import scipy.sparse
import scipy.sparse.linalg

nu = float(sys.argv[1]) if len(sys.argv) > 1 else 0.48
mu = 1.0
elasticity = 2 * (1 + nu) * mu / (1 - nu * nu) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
modulus = {"along": mu, "across": elasticity[0, 0]}
line_share = (1 / modulus["along"] + 1 / modulus["across"]) / (4 * np.pi)
jump, end_of_line, end_of_jump = 0.15, 1 / 6, 1 / 3  # as in working_set.cpp
edge = {"triangles": (2 + np.sqrt(2)) / 3, "quadrilaterals": 1.0}
gauss_at, gauss_weight = np.polynomial.legendre.leggauss(16)


def stiffness(corners):
    x = np.array(corners, float)
    if len(corners) == 3:
        b = np.array([x[1, 1] - x[2, 1], x[2, 1] - x[0, 1], x[0, 1] - x[1, 1]])
        g = np.array([x[2, 0] - x[1, 0], x[0, 0] - x[2, 0], x[1, 0] - x[0, 0]])
        return 0.5 * strain(b, g).T @ elasticity @ strain(b, g)
    k = np.zeros((8, 8))
    for s in (-1, 1):
        for t in (-1, 1):
            a, c = s / np.sqrt(3), t / np.sqrt(3)
            b = strain(0.5 * np.array([c - 1, 1 - c, 1 + c, -1 - c]), 0.5 * np.array([a - 1, -1 - a, 1 + a, 1 - a]))
            k += 0.25 * b.T @ elasticity @ b
    return k


def strain(dx, dy):
    b = np.zeros((3, 2 * len(dx)))
    b[0, 0::2], b[1, 1::2], b[2, 0::2], b[2, 1::2] = dx, dy, dy, dx
    return b


def shape(cells, x, y):
    i, j = int(np.floor(x)), int(np.floor(y))
    s, t = x - i, y - j
    if cells == "quadrilaterals":
        return [((i, j), (1 - s) * (1 - t)), ((i + 1, j), s * (1 - t)), ((i + 1, j + 1), s * t), ((i, j + 1), (1 - s) * t)]
    if s >= t:
        return [((i, j), 1 - s), ((i + 1, j), s - t), ((i + 1, j + 1), t)]
    return [((i, j), 1 - t), ((i + 1, j + 1), s), ((i, j + 1), t - s)]


def point_load(cells, n):
    """Displacement [of axis a, by a force along axis b, row, column] of a unit force at node (0, 0), balanced over the square, mean zero."""
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    elements = [square] if cells == "quadrilaterals" else [square[:3], [square[0], square[2], square[3]]]
    rows, columns, values = [], [], []
    for corners in elements:
        k = stiffness(corners)
        for j in range(n):
            for i in range(n):
                dof = [2 * ((j + b) % n * n + (i + a) % n) + m for a, b in corners for m in (0, 1)]
                rows += np.repeat(dof, len(dof)).tolist()
                columns += dof * len(dof)
                values += k.ravel().tolist()
    k = scipy.sparse.csc_matrix((values, (rows, columns)), shape=(2 * n * n,) * 2)
    factor = scipy.sparse.linalg.splu(k[2:, 2:].tocsc())
    u = np.zeros((2, 2, n, n))
    for b in (0, 1):
        f = np.zeros(2 * n * n)
        f[b::2] = -1.0 / n**2
        f[b] += 1.0
        x = np.concatenate([[0.0, 0.0], factor.solve(f[2:])])
        for a in (0, 1):
            u[a, b] = (x[a::2] - x[a::2].mean()).reshape(n, n)
    return u


class Line:
    """Means over pieces of a straight line, on a mesh whose elements are 1 / finer long."""

    def __init__(self, load, cells, start, tangent, finer=1):
        self.load, self.cells, self.start, self.tangent, self.finer = load, cells, np.array(start), tangent, finer

    def piece(self, begin, end, parts=8):
        weight = {}
        for k in range(parts):
            for at, w in zip(gauss_at, gauss_weight):
                z = begin + (k + 0.5 + 0.5 * at) / parts * (end - begin)
                for node, s in shape(self.cells, *((self.start + self.tangent * z) * self.finer)):
                    weight[node] = weight.get(node, 0.0) + s * w / (2 * parts)
        return np.array(list(weight)), np.array(list(weight.values()))

    def mean(self, one, other, direction):
        n = self.load.shape[2]
        difference = (one[0][:, None] - other[0][None, :]) % n
        g = sum(direction[a] * direction[b] * self.load[a, b][difference[..., 1], difference[..., 0]] for a in (0, 1) for b in (0, 1))
        return one[1] @ g @ other[1]

    def distance(self, piece):
        x = piece[0] - self.start * self.finer
        return piece[1] @ np.abs(self.tangent[0] * x[:, 1] - self.tangent[1] * x[:, 0])


def directions(tangent):
    return {"along": tangent, "across": np.array([-tangent[1], tangent[0]])}


def missed_ridge(cells, p, q, starts):
    """Along (p, q), which closes after n (p, q): windings lie W = n / |(p, q)| apart."""
    size = np.hypot(p, q)
    n = int(20 * size) + 1
    tangent = np.array([p, q]) / size
    load = point_load(cells, n)
    share = {name: [] for name in modulus}
    for start in starts:
        line = Line(load, cells, (start / q, 0.0), tangent)
        whole = line.piece(0.0, n * size, parts=4 * n * q)
        for name, direction in directions(tangent).items():
            # A force of 1 per length, which the square balances.
            exact = n / size / (12 * modulus[name])
            missed = exact - n * size * line.mean(whole, whole, direction)
            share[name].append(2 * modulus[name] * missed / line.distance(whole))
    askew = (2 * p * q / size**2) ** 2
    return {name: (np.mean(values) - 1) * askew for name, values in share.items()}, askew**2


def stuck_line(line, cells, count, length, name, ridge):
    askew = (2 * line.tangent[0] * line.tangent[1]) ** 2
    pieces = [line.piece(k * length / line.finer, (k + 1) * length / line.finer) for k in range(count)]
    direction, c = directions(line.tangent)[name], modulus[name]
    m = np.array([[line.mean(a, b, direction) for b in pieces] for a in pieces])
    m += np.diag([(1 + askew * ridge) * line.distance(p) / (2 * c * length) for p in pieces])
    share = jump * (edge[cells] / length) ** 2 / c
    m += share * (np.diag([1.0] + [2.0] * (count - 2) + [1.0]) - np.eye(count, k=1) - np.eye(count, k=-1))
    return m, -(end_of_line * line_share + end_of_jump * share)


def total_force(m, at_ends):
    m = m.copy()
    m[0, 0] += at_ends
    m[-1, -1] += at_ends
    return np.linalg.solve(m, np.ones(len(m))).sum()


def main():
    rng = np.random.default_rng(3)
    slopes = ((1, 5), (1, 3), (1, 2), (2, 3))
    ridge = {}
    for cells in edge:
        found = [missed_ridge(cells, s * p, q, (0.25,)) for p, q in slopes for s in (1, -1)]
        ridge[cells] = {name: sum(f[name] for f, _ in found) / sum(weight for _, weight in found) for name in modulus}
    n, finer, count = 40, 4, 12
    fine = point_load("quadrilaterals", n * finer)
    for cells, length in edge.items():
        coarse = point_load(cells, n)
        end = {name: [] for name in modulus}
        for angle in np.radians((-35, -25, -15, -8, 8, 15, 25, 35)):
            tangent = np.array([np.sin(angle), np.cos(angle)])
            for start in rng.random((4, 2)):
                for name in modulus:
                    m, known = stuck_line(Line(coarse, cells, start, tangent), cells, count, length, name, ridge[cells][name])
                    exact = total_force(*stuck_line(Line(fine, "quadrilaterals", start, tangent, finer), "quadrilaterals", count * finer,
                                                    length, name, ridge["quadrilaterals"][name]))
                    found = scipy.optimize.brentq(lambda x: total_force(m, x) - exact, -0.2 / modulus[name], 0.4 / modulus[name])
                    end[name].append((found - known) * mu)
        print(f"{cells}: along {ridge[cells]['along']:.2f}, across {ridge[cells]['across']:.2f}, more at the end "
              + ", ".join(f"{name} {np.mean(values):+.3f}" for name, values in end.items()))


main()
