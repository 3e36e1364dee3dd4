"""Modes by modal analysis, as mechanics has them: a linear elastic shell of triangles, stiffness and mass, 3p unknowns.

Membrane: constant strain triangles (plane stress) in each triangle's plane. Bending: the thin plate's energy of the change
in the discrete mean curvature (cotangent Laplacian), without rotations as unknowns, which holds the outline a
little against turning. Lumped mass. It is here for the time it takes.
"""

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array, kron
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from app.arrays import Array, Indices

YOUNG, POISSON, THICKNESS = 1.0, 0.3, 1.0
RIGID_MOTIONS = 6


def vibration_modes(rest: Array, faces: Indices, count: int) -> tuple[Array, Array]:
    """The `count` lowest vibration modes of a shell (3, p) beyond its rigid motions: ω² (count,), shapes (count, 3, p)."""
    K, M = shell(rest, faces)
    extent = float(np.ptp(rest, axis=1).max())
    shift = -10 * plate_stiffness() / (THICKNESS * extent**4)  # a little below all eigenvalues: K alone is singular
    factor = splu(
        csc_array(K - shift * M), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    solve = LinearOperator(K.shape, factor.solve, dtype=np.float64)
    start = np.cos(np.arange(K.shape[0]) ** 1.5)
    values, vectors = eigsh(K, k=count + RIGID_MOTIONS, M=M, sigma=shift, OPinv=solve, v0=start)
    order = np.argsort(values)[RIGID_MOTIONS:]
    return values[order], vectors[:, order].T.reshape(count, -1, 3).transpose(0, 2, 1)


def shell(rest: Array, faces: Indices) -> tuple[csc_array, csc_array]:
    """Stiffness and mass (3p, 3p) of a shell (3, p); unknowns x, y, z point by point."""
    p = rest.shape[1]
    corners = rest.T[faces]
    area = triangle_areas(corners)
    mass = np.bincount(faces.ravel(), np.repeat(area / 3, 3), p)
    laplacian = cotangent_laplacian(corners, area, faces, p)
    bending = kron(plate_stiffness() * laplacian.T @ diags_array(1 / mass) @ laplacian, np.eye(3))
    return csc_array(membrane(corners, area, faces, p) + bending), csc_array(diags_array(np.repeat(THICKNESS * mass, 3)))


def plate_stiffness() -> float:
    """Bending stiffness of a thin plate."""
    return YOUNG * THICKNESS**3 / (12 * (1 - POISSON**2))


def triangle_areas(corners: Array) -> Array:
    """(m,) of triangles (m, 3 corners, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(normal, axis=1) / 2)


def membrane(corners: Array, area: Array, faces: Indices, p: int) -> csc_array:
    """Stiffness (3p, 3p) against stretching and shearing within the triangles."""
    along = corners[:, 1] - corners[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.cross(along, corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    frame = np.stack([along, np.cross(normal, along)], axis=1)  # (m, 2, 3)
    flat = np.einsum("mac,mkc->mka", frame, corners)
    opposite = np.roll(flat, -1, axis=1) - np.roll(flat, 1, axis=1)  # k+1 minus k+2
    slope = np.stack([opposite[..., 1], -opposite[..., 0]], axis=-1) / (2 * area)[:, None, None]  # of the hat functions
    strain = np.zeros((len(faces), 3, 3, 2))  # ε_x, ε_y, γ of the displacements (corner, axis)
    strain[:, 0, :, 0] = strain[:, 2, :, 1] = slope[..., 0]
    strain[:, 1, :, 1] = strain[:, 2, :, 0] = slope[..., 1]
    B = np.einsum("mska,mac->mskc", strain, frame).reshape(-1, 3, 9)
    law = YOUNG / (1 - POISSON**2) * np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, (1 - POISSON) / 2]])
    local = THICKNESS * area[:, None, None] * (B.transpose(0, 2, 1) @ law @ B)
    unknowns = (3 * faces[:, :, None] + np.arange(3)).reshape(-1, 9)
    rows, columns = np.repeat(unknowns, 9, axis=1), np.tile(unknowns, (1, 9))
    return coo_array((local.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * p, 3 * p)).tocsc()


def cotangent_laplacian(corners: Array, area: Array, faces: Indices, p: int) -> csc_array:
    """(p, p) integrated Laplacian of functions on the surface."""
    rows, columns, values = [], [], []
    for k in range(3):
        i, j = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        a, b = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        half = (a * b).sum(axis=1) / (4 * area)  # half the cotangent at corner k
        rows += [i, j, i, j]
        columns += [j, i, i, j]
        values += [half, half, -half, -half]
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return coo_array(entries, shape=(p, p)).tocsc()
