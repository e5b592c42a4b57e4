"""Rigid alignment of many point sets at once: the rotation over SO(3) and the centroids.

The rotation is the eigenvector of Davenport's 4×4 matrix K for its greatest eigenvalue (Horn, J. Opt. Soc.
Am. A 4, 1987), found by Newton's method on K's characteristic polynomial (Theobald, Acta Cryst. A61, 2005). It is a
rotation by construction, never a reflection, also for three points and for coplanar ones, for which the plain
U Vᵀ of a singular value decomposition can be a reflection. If two eigenvalues nearly coincide (points nearly
collinear), the polynomial is ill-conditioned; these sets are solved by the singular value decomposition with det = +1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FEWEST_POINTS = 3  # that determine a rotation, if they are not in a line: two leave the turn about theirs free
ILL_CONDITIONED = 1e-2  # slope of the polynomial at its root below which the SVD is used, K scaled to ‖H‖ = 1
COLLINEAR = 1e-12  # s₂ ± s₃ at ‖H‖ = 1 below which the points count as collinear


@dataclass(frozen=True)
class Alignment:
    """Least-squares fit of p_A = R_A_B p_B + translation for n point sets.

    rotation (n, 3, 3) R_A_B; quaternion (n, 4), scalar first; centroid_a, centroid_b (n, 3) in m, in A and in B;
    spread (n,), m²: mean squared distance of the points from a line, a lower bound (at least 4/9 of it, unless noise
    outweighs the third singular value).
    """

    rotation: FloatArray
    quaternion: FloatArray
    centroid_a: FloatArray
    centroid_b: FloatArray
    spread: FloatArray

    @property
    def translation(self) -> FloatArray:
        """B's origin in A, (n, 3) in m."""
        return np.asarray(self.centroid_a - np.einsum("nij,nj->ni", self.rotation, self.centroid_b))


def align(points_A: FloatArray, points_B: FloatArray, weights: FloatArray) -> Alignment:
    """Weighted least-squares alignment of points_B (n, m, 3) or (m, 3) with points_A (n, m, 3), in m.

    weights (n, m) are >= 0; points of weight zero may be NaN. Each set needs a positive weight. The rotation is unique
    if three points are not collinear; then `spread` is positive.
    """
    shared = points_B.ndim == 2
    w = np.asfortranarray(weights)  # with the sets last in memory, so that einsum runs along them
    a = np.where(w[..., None] > 0, np.asfortranarray(points_A), 0.0)
    b = np.where((w.max(axis=0) if shared else w)[..., None] > 0, np.asfortranarray(points_B), 0.0)
    total = w.sum(axis=1)
    centroid_a = np.einsum("nm,nmi->ni", w, a) / total[:, None]
    centroid_b = (w @ b if shared else np.einsum("nm,nmi->ni", w, b)) / total[:, None]
    a -= centroid_a[:, None]
    a *= w[..., None]
    # Σ w (a − ā) is zero, so b may have any origin; one near the points keeps rounding small.
    b = b - (centroid_b.mean(axis=0) if shared else centroid_b[:, None])
    moments = np.moveaxis(b.T @ a.T, -1, 0) if shared else np.einsum("nmi,nmj->nij", a, b)
    quaternion, spread = rotation_from_moments(moments)
    rotation = matrix_from_quaternion(quaternion)
    return Alignment(rotation, quaternion, centroid_a, centroid_b, spread / total)


def rotation_from_moments(moments: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The rotation R_A_B that maximises tr(R_A_Bᵀ H), for H = Σ w a bᵀ (n, 3, 3), a and b centred.

    Returns the quaternions (n, 4), scalar first, and a lower bound (n,) of s₂ ± s₃, the sum of singular values that
    determines the rotation. Zero means undetermined; the rotation is then the identity.
    """
    norm = np.sqrt(np.einsum("nij,nij->n", moments, moments))
    ((xx, xy, xz), (yx, yy, yz), (zx, zy, zz)) = np.moveaxis(
        moments / np.where(norm > 0, norm, 1)[:, None, None], 0, -1
    )
    determinant = xx * (yy * zz - yz * zy) - xy * (yx * zz - yz * zx) + xz * (yx * zy - yy * zx)
    aa, bb, cc = xx * xx + yx * yx + zx * zx, xy * xy + yy * yy + zy * zy, xz * xz + yz * yz + zz * zz
    ab, ac, bc = xx * xy + yx * yy + zx * zy, xx * xz + yx * yz + zx * zz, xy * xz + yy * yz + zy * zz
    # λ⁴ − 2λ² − 8 det(H) λ + c₀: all coefficients are invariants of H, which is scaled to ‖H‖ = 1.
    c1 = -8 * determinant
    c0 = 2 * (aa * aa + bb * bb + cc * cc + 2 * (ab * ab + ac * ac + bc * bc)) - (aa + bb + cc) ** 2
    root = np.full(len(norm), np.sqrt(3.0))  # ≥ s₁ + s₂ + s₃: from above, Newton's method converges to the largest root
    for _ in range(30):
        slope = 4 * root * (root * root - 1) + c1
        value = ((root * root - 2) * root + c1) * root + c0
        step = np.where(slope > 1e-9, value / np.where(slope > 1e-9, slope, 1), 0)
        root -= step
        if np.abs(step).max(initial=0.0) < 1e-14:
            break
    slope = 4 * root * (root * root - 1) + c1
    quaternion = _null_vector(
        (xx + yy + zz - root, zy - yz, xz - zx, yx - xy, xx - yy - zz - root),
        (xy + yx, xz + zx, -xx + yy - zz - root, yz + zy, -xx - yy + zz - root),
    )
    spread = np.maximum(slope, 0) / (8 * root * root)
    ill_conditioned = np.nonzero(~(slope > ILL_CONDITIONED))[0]
    if ill_conditioned.size:
        quaternion[ill_conditioned], spread[ill_conditioned] = _by_singular_values(
            moments[ill_conditioned] / np.where(norm > 0, norm, 1)[ill_conditioned, None, None]
        )
    return quaternion, spread * norm


def _null_vector(upper: tuple[FloatArray, ...], lower: tuple[FloatArray, ...]) -> FloatArray:
    """Unit null vectors (n, 4) of symmetric singular matrices: the largest column of their adjugates."""
    m00, m01, m02, m03, m11 = upper
    m12, m13, m22, m23, m33 = lower
    # 2×2 minors of the last two and of the first two rows
    d01, d02, d03 = m02 * m13 - m12 * m03, m02 * m23 - m22 * m03, m02 * m33 - m23 * m03
    d12, d13, d23 = m12 * m23 - m22 * m13, m12 * m33 - m23 * m13, m22 * m33 - m23 * m23
    e01, e02, e03 = m00 * m11 - m01 * m01, m00 * m12 - m02 * m01, m00 * m13 - m03 * m01
    e12, e13 = m01 * m12 - m02 * m11, m01 * m13 - m03 * m11
    a00 = m11 * d23 - m12 * d13 + m13 * d12
    a01 = -m01 * d23 + m12 * d03 - m13 * d02
    a02 = m01 * d13 - m11 * d03 + m13 * d01
    a03 = -m01 * d12 + m11 * d02 - m12 * d01
    a11 = m00 * d23 - m02 * d03 + m03 * d02
    a12 = -m00 * d13 + m01 * d03 - m03 * d01
    a13 = m00 * d12 - m01 * d02 + m02 * d01
    a22 = m33 * e01 - m13 * e03 + m03 * e13
    a23 = -(m23 * e01 - m13 * e02 + m03 * e12)
    a33 = m22 * e01 - m12 * e02 + m02 * e12
    diagonal = np.stack([a00, a11, a22, a33])
    columns = np.array([[a00, a01, a02, a03], [a01, a11, a12, a13], [a02, a12, a22, a23], [a03, a13, a23, a33]])
    best = np.argmax(np.abs(diagonal), axis=0)
    vector = np.take_along_axis(columns, best[None, None, :], axis=0)[0].T
    length = np.sqrt(np.einsum("ni,ni->n", vector, vector))
    return np.where((length > 0)[:, None], vector / np.where(length > 0, length, 1)[:, None], [1.0, 0, 0, 0])


def _by_singular_values(moments: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`rotation_from_moments` by U diag(1, 1, det(U Vᵀ)) Vᵀ, for sets whose polynomial is ill-conditioned."""
    u, s, vt = np.linalg.svd(moments)
    sign = np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)
    spread = s[:, 1] + sign * s[:, 2]
    determined = spread > COLLINEAR
    u[:, :, 2] *= sign[:, None]
    quaternion = quaternion_from_matrix(u @ vt)
    quaternion[~determined] = [1.0, 0, 0, 0]
    return quaternion, np.where(determined, spread, 0.0)


def matrix_from_quaternion(quaternion: FloatArray) -> FloatArray:
    """Rotation matrices (n, 3, 3) of unit quaternions (n, 4), scalar first."""
    w, x, y, z = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix = np.empty((len(quaternion), 3, 3))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            matrix[:, i, j] = entry
    return matrix


def quaternion_from_matrix(matrix: FloatArray) -> FloatArray:
    """Unit quaternions (n, 4), scalar first, of rotation matrices (n, 3, 3): the largest column of 4 q qᵀ."""
    ((xx, xy, xz), (yx, yy, yz), (zx, zy, zz)) = np.moveaxis(matrix, 0, -1)
    outer = np.array(
        [
            [1 + xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz],
        ]
    )
    best = np.argmax(np.einsum("iin->in", outer), axis=0)
    vector = np.take_along_axis(outer, best[None, None, :], axis=0)[0].T
    return np.asarray(vector / np.linalg.norm(vector, axis=1, keepdims=True))


def quaternion_times_vector(q: FloatArray, v: FloatArray) -> FloatArray:
    """q ⊗ (0, v), quaternions (n, 4) scalar first, vectors (n, 3)."""
    return _times_vector(q.T, v.T).T


def rate_of_quaternion(q: FloatArray, slope: FloatArray) -> FloatArray:
    """ω = 2 q⁻¹ ⊗ q̇ (n, 3), rad/s in B, of unit quaternions R_C_B and their derivatives (n, 4), scalar first.

    What of q̇ is along q, as of a quaternion that was scaled to length 1, adds nothing.
    """
    (w, x, y, z), (dw, dx, dy, dz) = q.T, 2 * slope.T
    return np.stack(
        [
            w * dx - x * dw - y * dz + z * dy,
            w * dy - y * dw - z * dx + x * dz,
            w * dz - z * dw - x * dy + y * dx,
        ],
        axis=1,
    )


def running_products(quaternions: FloatArray) -> FloatArray:
    """The products (4, n) q₀, q₀ ⊗ q₁, q₀ ⊗ q₁ ⊗ q₂, … of quaternions (4, n), scalar first: by doubling."""
    found, apart = quaternions, 1
    while apart < found.shape[1]:
        p, q = found[:, :-apart], found[:, apart:]
        found, apart = np.hstack([found[:, :apart], q[0] * p + _times_vector(p, q[1:])]), 2 * apart
    return found


def _times_vector(q: FloatArray, v: FloatArray) -> FloatArray:
    """q ⊗ (0, v) of rows, quaternions (4, n) and vectors (3, n); numpy's cross product takes longer than all of it."""
    (w, x, y, z), (a, b, c) = q, v
    return np.array([-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a])
