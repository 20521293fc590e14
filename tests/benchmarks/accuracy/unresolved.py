#!/usr/bin/env python3
"""What planar elements miss of a loaded line that crosses them: the constants of common/contact/unresolved.cpp.

A periodic square of unit elements, plane stress, and a straight line through it. Nothing here knows trocar's solver or its benchmark.
  ridge   A line that closes on itself, loaded evenly, against its closed form -|d|/2 + d^2/(2 W): what the elements miss on the line,
          over sum w |d| / (2 C), what their interpolation would miss, is 1 + this times sin^2 of twice the angle to the edges.
  end     A stuck line of 12 segments with the terms above and the jumps, against the same line on elements of a quarter of the size: what
          has to be added to the compliance of both end segments so that the total forces agree, times the shear modulus; all less so much
          per ridge of the end segments.
  excess  A stuck line of nodes, moved onto it from where it crosses edges, against the same line on elements of a quarter of the size: by
          how many edges it seems too long at each end; lateral: less, times that sin^2.
Needs numpy and scipy; takes a minute or two.    unresolved.py [poisson's ratio, 0.48]
"""
import sys

import numpy as np
import scipy.optimize
import scipy.sparse
import scipy.sparse.linalg

try:
    nu = float(sys.argv[1]) if len(sys.argv) > 1 else 0.48
except ValueError:
    nu = np.nan
if len(sys.argv) > 2 or not 0.0 <= nu <= 0.9:
    sys.exit(f"unresolved.py: {' '.join(sys.argv[1:])}: give one Poisson's ratio from 0 to 0.9, such as 0.48")
mu = 1.0
elasticity = 2 * (1 + nu) * mu / (1 - nu * nu) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
modulus = {"along": mu, "across": elasticity[0, 0]}
line_share = (1 / modulus["along"] + 1 / modulus["across"]) / (4 * np.pi)
jump, end_of_line, end_of_jump = 0.15, 1 / 6, 1 / 3  # as in unresolved.cpp
kinds = ("triangles", "quadrilaterals")
square = [(0, 0), (1, 0), (1, 1), (0, 1)]
gauss_at, gauss_weight = np.polynomial.legendre.leggauss(16)


def stiffness(corners):
    x = np.array(corners, float)
    if len(corners) == 3:
        b = np.array([x[1, 1] - x[2, 1], x[2, 1] - x[0, 1], x[0, 1] - x[1, 1]])
        g = np.array([x[2, 0] - x[1, 0], x[0, 0] - x[2, 0], x[1, 0] - x[0, 0]])
        twice_area = g[2] * b[1] - g[1] * b[2]
        return 0.5 / twice_area * strain(b, g).T @ elasticity @ strain(b, g)
    k = np.zeros((8, 8))
    for s in (-1, 1):
        for t in (-1, 1):
            a, c = s / np.sqrt(3), t / np.sqrt(3)
            local = 0.25 * np.array([[c - 1, 1 - c, 1 + c, -1 - c], [a - 1, -1 - a, 1 + a, 1 - a]])
            jacobian = local @ x
            b = strain(*np.linalg.solve(jacobian, local))
            k += np.linalg.det(jacobian) * b.T @ elasticity @ b
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


def elements_of(cells):
    return [square] if cells == "quadrilaterals" else [square[:3], [square[0], square[2], square[3]]]


def factor_of(cells, n, moved=()):
    """Of the periodic square without its first node, and each node's share of the area. moved: {(i, j): place}, the rest on the lattice."""
    place = {(i % n, j % n): np.array(x) - (i, j) for (i, j), x in dict(moved).items()}
    rows, columns, values, area = [], [], [], np.zeros(n * n)
    for corners in elements_of(cells):
        regular = stiffness(corners)
        for j in range(n):
            for i in range(n):
                nodes = [((i + a) % n, (j + b) % n) for a, b in corners]
                shifted = any(node in place for node in nodes)
                x = np.array([np.array(c, float) + place.get(node, 0.0) for c, node in zip(corners, nodes)])
                k = stiffness(x) if shifted else regular
                index = [b * n + a for a, b in nodes]
                dof = [2 * at + m for at in index for m in (0, 1)]
                rows.append(np.repeat(dof, len(dof)))
                columns.append(np.tile(dof, len(dof)))
                values.append(k.ravel())
                y = np.roll(x, -1, axis=0)
                area[index] += 0.5 * (x[:, 0] * y[:, 1] - y[:, 0] * x[:, 1]).sum() / len(index)
    k = scipy.sparse.csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(2 * n * n,) * 2)
    return scipy.sparse.linalg.splu(k[2:, 2:].tocsc()), area / area.sum()


def displacements(factor, share, node, axis):
    """Of all nodes, by a unit force at one node, balanced over the square, mean zero: 2 rows, a column a node."""
    f = np.zeros((len(share), 2))
    f[:, axis] -= share
    f[node, axis] += 1.0
    u = np.concatenate([[0.0, 0.0], factor.solve(f.ravel()[2:])]).reshape(-1, 2)
    return (u - share @ u).T


def point_load(cells, n):
    """Displacement [of axis a, by a force along axis b, row, column] of a unit force at node (0, 0)."""
    factor, share = factor_of(cells, n)
    return np.array([displacements(factor, share, 0, b) for b in (0, 1)]).transpose(1, 0, 2).reshape(2, 2, n, n)


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


def stuck_line(line, cells, count, name, ridge):
    """Compliances of `count` segments of an element each, what the working set adds to both ends, and the mean ridge there."""
    askew = (2 * line.tangent[0] * line.tangent[1]) ** 2
    pieces = [line.piece(k / line.finer, (k + 1) / line.finer) for k in range(count)]
    direction, c = directions(line.tangent)[name], modulus[name]
    m = np.array([[line.mean(a, b, direction) for b in pieces] for a in pieces])
    ridges = np.array([(1 + askew * ridge) * line.distance(p) / 2 for p in pieces])
    m += np.diag(ridges / c)
    share = jump / c
    m += share * (np.diag([1.0] + [2.0] * (count - 2) + [1.0]) - np.eye(count, k=1) - np.eye(count, k=-1))
    return m, -(end_of_line * line_share + end_of_jump * share), 0.5 * (ridges[0] + ridges[-1])


def total_force(m, at_ends=0.0):
    m = m.copy()
    m[0, 0] += at_ends
    m[-1, -1] += at_ends
    return np.linalg.solve(m, np.ones(len(m))).sum()


def find_ends(ridge, rng, n=40, finer=4, count=12):
    fine = point_load("quadrilaterals", n * finer)
    ends = {}
    for cells in kinds:
        coarse = point_load(cells, n)
        for name in modulus:
            equations, found, along_edges = [], [], []
            for angle in np.radians((-35, -25, -15, -8, 0, 0, 8, 15, 25, 35)):
                tangent = np.array([np.sin(angle), np.cos(angle)])
                for start in rng.random((4, 2)):
                    m, known, at_end = stuck_line(Line(coarse, cells, start, tangent), cells, count, name, ridge[cells][name])
                    line = Line(fine, "quadrilaterals", start, tangent, finer)
                    exact = total_force(stuck_line(line, "quadrilaterals", count * finer, name, ridge["quadrilaterals"][name])[0])
                    root = scipy.optimize.brentq(lambda x: total_force(m, x) - exact, -0.36 / modulus[name], 0.9 / modulus[name])
                    equations.append((1.0, -at_end))
                    found.append((root - known) * mu)
                    along_edges.append(angle == 0.0)
            equations, found = np.array(equations), np.array(found)
            ends[cells, name] = [np.linalg.lstsq(equations[rows], found[rows], rcond=None)[0] for rows in (slice(None), along_edges)]
    return ends


def crossings(cells, start, tangent, length):
    """Of a line with the edges of the lattice: how far along it, where, and the edge's two nodes."""
    families = [((1, 0), (0, 1)), ((0, 1), (1, 0))] + ([((-1, 1), (1, 1))] if cells == "triangles" else [])
    found = []
    for normal, along in families:  # edges lie on normal . x = whole number
        speed, at = np.dot(normal, tangent), np.dot(normal, start)
        if abs(speed) < 1e-9:
            continue
        first, last = sorted((at, at + speed * length))
        for k in range(int(np.ceil(first - 1e-9)), int(np.floor(last + 1e-9)) + 1):
            z = (k - at) / speed
            x = start + z * tangent
            step = np.dot(x, along) / np.dot(along, along) if along != (1, 1) else x[0]
            node = np.array([k, np.floor(step)]) if along == (0, 1) else np.array([np.floor(step), k]) if along == (1, 0) else (
                np.array([np.floor(step), np.floor(step) + k]))
            found.append((z, x, tuple(node.astype(int)), tuple((node + along).astype(int))))
    return sorted(found, key=lambda c: c[0])


def moved_nodes(cells, start, tangent, length):
    """[(how far along, node, where it is moved)]: the nearer end of every edge that is crossed, once."""
    line, used = [], set()
    for z, x, one, other in crossings(cells, start, tangent, length):
        node = one if np.linalg.norm(x - one) <= np.linalg.norm(x - other) else other
        if node not in used:
            used.add(node)
            line.append((z, node, x))
    return line


def node_compliance(cells, n, line, tangent):
    factor, share = factor_of(cells, n, {node: x for _, node, x in line})
    at = [j % n * n + i % n for _, (i, j), _ in line]
    g = np.array([[displacements(factor, share, node, b)[:, at] for b in (0, 1)] for node in at])  # by, axis of force, axis, of
    return {name: np.einsum("b,jbai,a->ij", d, g, d) for name, d in directions(tangent).items()}


def find_excess(rng, n=36, finer=4, length=10.5):
    excess = {cells: {name: [] for name in modulus} for cells in kinds}
    for cells in kinds:
        for degrees in (0, 8, 15, 22, 30) if cells == "quadrilaterals" else (-30, -15, 0, 15, 30):
            tangent = np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
            start = np.array([12.0 + (rng.random() if degrees else 0.0), 6.0])
            line = moved_nodes(cells, start, tangent, length)
            fine = None
            while fine is None:  # both lines from the same place to the same
                fine = moved_nodes(cells, start * finer, tangent, line[-1][0] * finer + 1e-6)
                if abs(fine[-1][0] - line[-1][0] * finer) > 1e-5:
                    line.pop()
                    fine = None
            coarse, exact = node_compliance(cells, n, line, tangent), node_compliance(cells, n * finer, fine, tangent)
            gaps = line[1][0] - line[0][0], line[-1][0] - line[-2][0]
            for name in modulus:
                inverse = np.linalg.inv(coarse[name])
                force = inverse.sum(axis=0)
                # What an end is worth per length: what it costs to let its last node go.
                worth = sum(force[end] ** 2 / inverse[end, end] / gap for end, gap in ((0, gaps[0]), (-1, gaps[1])))
                too_long = (total_force(coarse[name]) - total_force(exact[name])) / worth / (1 - 1 / finer)
                excess[cells][name].append(((2 * tangent[0] * tangent[1]) ** 2, too_long))
    return excess


def main():
    rng = np.random.default_rng(3)
    ridge = {}
    for cells in kinds:
        found = [missed_ridge(cells, s * p, q, (0.25,)) for p, q in ((1, 5), (1, 3), (1, 2), (2, 3)) for s in (1, -1)]
        ridge[cells] = {name: sum(f[name] for f, _ in found) / sum(weight for _, weight in found) for name in modulus}
    ends = find_ends(ridge, rng)
    excess = find_excess(rng)
    for cells in kinds:
        print(cells)
        for name in modulus:
            (whole, per_ridge), (straight, per_straight) = ends[cells, name]
            askew, too_long = np.array(excess[cells][name]).T
            all_of_it, less = np.linalg.lstsq(np.stack([np.ones_like(askew), -askew], 1), too_long, rcond=None)[0]
            print(f"  {name:<7} ridge {ridge[cells][name]:+.2f}, end {whole:+.3f} less {per_ridge:.2f} per ridge (along edges {straight:+.3f}"
                  f" less {per_straight:.2f}), excess {too_long.mean():.3f} (or {all_of_it:.3f} less {less:.3f} askew)")


main()
