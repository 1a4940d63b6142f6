"""Closed forms of [PGV] that several entries need, transcribed once. Nothing of the package is used here.

There are p tethers of n nodes and m = 12 + 6 n p coordinates in the order of Eq. 4; i, j, k count from 1.
"""

import numpy as np

EYE = np.eye(3)


def node_boolean(i: int, j: int, n: int, p: int) -> np.ndarray:
    """Eq. 6: the blocks in the printed order."""
    widths = (12, 6 * n * (i - 1), 6 * (j - 1)), (6 * (n - j), 6 * n * (p - i))
    before, after = ([np.zeros((6, width)) for width in side] for side in widths)
    return np.hstack([*before, np.eye(6), *after])


def point_boolean(k: int, n: int, p: int) -> np.ndarray:
    """Eq. 7: the blocks in the printed order."""
    return np.hstack(
        [np.zeros((3, 3 * (k - 1))), EYE, np.zeros((3, 3 * (4 - k))), np.zeros((3, 6 * n * p))]
    )


def element_boolean(i: int, j: int, n: int, p: int) -> np.ndarray:
    """Eq. 8: the Boolean matrices of nodes j and j + 1, one above the other."""
    return np.vstack([node_boolean(i, j, n, p), node_boolean(i, j + 1, n, p)])


def hub_boolean(n: int, p: int) -> np.ndarray:
    """Eq. 10."""
    return np.hstack([point_boolean(k, n, p).T for k in (1, 2, 3, 4)]).T


def shape_matrix(x: float, length: float) -> np.ndarray:
    """S of Eq. 17-18."""
    xi = x / length
    s1 = 1 - 3 * xi**2 + 2 * xi**3
    s2 = length * (xi - 2 * xi**2 + xi**3)
    s3 = 3 * xi**2 - 2 * xi**3
    s4 = length * (-(xi**2) + xi**3)
    return np.hstack([s1 * EYE, s2 * EYE, s3 * EYE, s4 * EYE])


def cable_mass(line_density: float, length: float) -> np.ndarray:
    """Second member of Eq. 22, rho_t A_t times the integral of S^T S; four Gauss points are exact."""
    points, weights = np.polynomial.legendre.leggauss(4)
    shapes = [shape_matrix(0.5 * length * (1 + x), length) for x in points]
    return line_density * sum(0.5 * length * w * s.T @ s for w, s in zip(weights, shapes, strict=True))


def local_base(height: float, radius: float) -> np.ndarray:
    """Rows A, B, C, D in the body frame, origin at its centre: d(0)^B of Sec. 4.1."""
    return np.array([[-height / 2, 0, 0], [height / 2, 0, 0], [0, radius, 0], [0, 0, radius]])


def edges(points: np.ndarray) -> np.ndarray:
    """Columns r_AB, r_AC, r_AD of Eq. 42; also the matrix B of Eq. 134."""
    return (points[1:] - points[0]).T


def greek(height: float, radius: float) -> np.ndarray:
    """Columns alpha, beta, gamma of Eq. 133, solved in the body frame, where i_B, j_B, k_B are unit."""
    return np.linalg.solve(edges(local_base(height, radius)), EYE)


def hub_shape_matrix(x: np.ndarray, abc: np.ndarray) -> np.ndarray:
    """G of Eq. 131-132 at x, measured from r_1 = A along the body axes."""
    (alpha, beta, gamma), (x, y, z) = abc.T, x
    g1 = 1 - x * alpha.sum() - y * beta.sum() - z * gamma.sum()
    g2 = x * alpha[0] + y * beta[0] + z * gamma[0]
    g3 = x * alpha[1] + y * beta[1] + z * gamma[1]
    g4 = x * alpha[2] + y * beta[2] + z * gamma[2]
    return np.hstack([g1 * EYE, g2 * EYE, g3 * EYE, g4 * EYE])


def hub_mass(height: float, radius: float, density: float) -> np.ndarray:
    """Eq. 52: rho_r times the integral of G^T G over the cylinder, x measured from A.

    Two Gauss points along the axis and in the squared radius, four angles: exact for quadratics.
    """
    abc, total = greek(height, radius), np.zeros((12, 12))
    for s in np.polynomial.legendre.leggauss(2)[0]:
        for t in np.polynomial.legendre.leggauss(2)[0]:
            for angle in 0.5 * np.pi * np.arange(4) + 0.3:
                r = radius * np.sqrt(0.5 * (1 + t))
                x = np.array([0.5 * height * (1 + s), r * np.cos(angle), r * np.sin(angle)])
                g = hub_shape_matrix(x, abc)
                total += g.T @ g
    return density * np.pi * radius**2 * height * total / 16


def rigidity(points: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """C_r of Eq. 45, the cosines and lengths from the reference shape."""
    ab, ac, ad = edges(points).T
    ab0, ac0, ad0 = edges(reference).T
    l_ab, l_ac, l_ad = (np.linalg.norm(edge) for edge in (ab0, ac0, ad0))
    cos_bac, cos_bad = ab0 @ ac0 / (l_ab * l_ac), ab0 @ ad0 / (l_ab * l_ad)
    cos_dac = ad0 @ ac0 / (l_ad * l_ac)
    return np.array(
        [
            ab @ ab - l_ab**2,
            ac @ ac - l_ac**2,
            ad @ ad - l_ad**2,
            ac @ ab - cos_bac * l_ab * l_ac,
            ad @ ab - cos_bad * l_ab * l_ad,
            ad @ ac - cos_dac * l_ad * l_ac,
        ]
    )


def rigidity_jacobian(points: np.ndarray) -> np.ndarray:
    """C_r,d of Eq. 46 with every block a row vector; linear in the base points."""
    ab, ac, ad = edges(points).T
    o = np.zeros(3)
    rows = [
        (-2 * ab, 2 * ab, o, o),
        (-2 * ac, o, 2 * ac, o),
        (-2 * ad, o, o, 2 * ad),
        (-ab - ac, ac, ab, o),
        (-ab - ad, ad, o, ab),
        (-ac - ad, o, ad, ac),
    ]
    return np.array([np.concatenate(row) for row in rows])


def rigidity_curvature(lam: np.ndarray) -> np.ndarray:
    """Eq. 48: d(C_r,d^T lam)_i / d d_k = sum over j of (d C_r,d_ji / d d_k) lam_j, column by column."""
    columns = [rigidity_jacobian(unit.reshape(4, 3)).T @ lam for unit in np.eye(12)]
    return np.array(columns).T


def step_correction(step: float, rho: float) -> tuple[float, float]:
    """v' and mu' of the text after Eq. 15."""
    alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    mu = 1 / 2 + alpha_f - alpha_m
    nu = 1 / 4 * (mu + 1 / 2) ** 2
    return (1 - alpha_m) / (step**2 * nu * (1 - alpha_f)), mu / (step * nu)
