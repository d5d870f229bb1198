"""The critical step of a puppet's springs: the longest fixed step at which they stay bounded.

``timestepping`` evaluates springs and their dampers at the start of the step, and ``variational``
solves for them by repeated steps of that kind:

    M (v+ - v) = -dt (K q + C v),   q+ = q + dt v+

which has an eigenvalue -1 where dt^2 K + 2 dt C reaches 4 M, and grows without bound beyond: at
dt = 2 / omega without damping. With b the motions of the springs' points relative to each other,
K = b^T k b and C = b^T c b, so that the largest eigenvalue of B^T M^-1 B must stay below 4, with
B = b^T sqrt(dt^2 k + 2 dt c). A spring counts in all three directions, because it turns in a run.

A taut string acts as a spring across its segments, with k = tension / length: light bodies on it
vibrate fast.

M, K and C are the matrices of inertia, stiffness and damping, omega the largest angular frequency;
k and c are the constants of single springs and dampers. In names, D stands for dynamic coordinates,
which move by the equations of motion, and K for driven ones: ends and lengths of strings, driven
joints. A link is a body on its joint.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.model.tree import WORLD, Link, Point, Role, link_inertia

_N_HALVINGS = 60
"""Number of bisections of the step: down to rounding."""
_MIN_SEGMENT = 1e-6
"""Length below which a segment has no direction [m]."""
_CHUNK_SIZE = 1024
"""Number of states evaluated together, which bounds the memory."""


def critical_step(
    marionette: CompiledPuppet, q_D: Array, q_K: Array, dt: float
) -> tuple[float, str] | None:
    """The critical step [s] and its spring; None where ``dt`` is below it at all configurations."""
    names, k, c = _springs(marionette)
    if not names:
        return None
    shape = np.broadcast_shapes(q_D.shape[:-1], q_K.shape[:-1])
    n = int(np.prod(shape))
    q_D, q_K = (
        np.broadcast_to(q, (*shape, q.shape[-1])).reshape(n, q.shape[-1]) for q in (q_D, q_K)
    )
    critical: tuple[float, str] | None = None
    for first in range(0, len(q_D), _CHUNK_SIZE):
        chunk = slice(first, first + _CHUNK_SIZE)
        W = _columns(marionette, q_D[chunk], q_K[chunk])
        W_products = np.einsum("nik,njk->nij", W, W)

        def largest(step: float, W_products: Array = W_products) -> tuple[float, int]:
            root = np.sqrt(step * step * k + 2.0 * step * c)
            eigenvalues, vectors = np.linalg.eigh(root[:, None] * W_products * root)
            worst = int(np.argmax(eigenvalues[:, -1]))
            return float(eigenvalues[worst, -1]), int(np.argmax(np.abs(vectors[worst, :, -1])))

        if not largest(dt)[0] > 4.0:
            continue
        stable_dt, unstable_dt = 0.0, dt
        for _ in range(_N_HALVINGS):
            middle = 0.5 * (stable_dt + unstable_dt)
            stable_dt, unstable_dt = (
                (stable_dt, middle) if largest(middle)[0] > 4.0 else (middle, unstable_dt)
            )
        dt, critical = stable_dt, (stable_dt, names[largest(unstable_dt)[1]])
    return critical


def _springs(marionette: CompiledPuppet) -> tuple[list[str], Array, Array]:
    """Name, stiffness and damping of every column: springs of joints, then other springs."""
    names: list[str] = []
    k: list[float] = []
    c: list[float] = []
    for link in marionette.tree.links:
        stiffness = marionette.number(link.stiffness)
        if link.role is Role.DYNAMIC and stiffness > 0.0:
            n = link.v.stop - link.v.start
            names += n * [link.joint]
            k += n * [stiffness]
            c += n * [0.0]
    for spring in marionette.tree.springs:
        names += 3 * [spring.name]
        k += 3 * [marionette.number(spring.stiffness)]
        c += 3 * [marionette.number(spring.damping)]
    return names, np.array(k), np.array(c)


def _columns(marionette: CompiledPuppet, q_D: Array, q_K: Array) -> Array:
    """Vectors F^-T b^T of every column at n states: (n, columns, n_vD), with M = F^T F."""
    tree, table, n = marionette.tree, marionette.coordinates, len(q_D)
    forces: list[Array] = []
    for link in tree.links:
        if link.role is Role.DYNAMIC and marionette.number(link.stiffness) > 0.0:
            forces += [np.tile(row, (n, 1)) for row in np.eye(table.n_vD)[link.v]]
    for spring in tree.springs:
        forces += [_forces_of_pair(marionette, q_D, q_K, spring.points, axis) for axis in np.eye(3)]
    return _times_inverse_factor(marionette, q_D, q_K, forces)


def critical_step_of_tensions(
    marionette: CompiledPuppet, q_D: Array, q_K: Array, tension: Array
) -> float:
    """Critical step 2 / omega of the fastest vibration of taut strings [s]; inf without one."""
    poses, (q_D, q_K) = marionette.poses(q_D, q_K), (q_D[None], q_K[None])
    forces, k = [], []
    for string, pull in zip(marionette.tree.strings, tension, strict=True):
        for ends in pairwise(string.points) if pull > 0.0 else ():
            vector = _position(marionette, poses, ends[1]) - _position(marionette, poses, ends[0])
            length = float(np.linalg.norm(vector))
            if ends[0].link == ends[1].link or length < _MIN_SEGMENT:
                continue
            for normal_direction in np.linalg.svd(vector[None])[2][1:]:
                forces.append(_forces_of_pair(marionette, q_D, q_K, ends, normal_direction))
                k.append(pull / length)
    if not forces:
        return np.inf
    scaled_forces = np.sqrt(k)[:, None] * _times_inverse_factor(marionette, q_D, q_K, forces)[0]
    max_omega = float(np.linalg.norm(scaled_forces, 2))
    return 2.0 / max_omega if max_omega > 0.0 else np.inf


def _times_inverse_factor(
    marionette: CompiledPuppet, q_D: Array, q_K: Array, forces: list[Array]
) -> Array:
    """Forces (n, n_vD) multiplied by F^-T: (n, len(forces), n_vD)."""
    table, n = marionette.coordinates, len(q_D)
    zeros_D, zeros_K = np.zeros((n, table.n_vD)), np.zeros((n, table.n_vK))
    at_rest = {"v_D": zeros_D, "u_D": zeros_D, "v_K": zeros_K, "acc_K": zeros_K, "p": marionette.p}
    L = marionette.library.evaluate("dynamics", q_D=q_D, q_K=q_K, **at_rest).L
    return marionette.library.evaluate(
        "solve_factor_transposed", L=L[:, None], x=np.stack(forces, axis=1)
    ).y


def _forces_of_pair(
    marionette: CompiledPuppet, q_D: Array, q_K: Array, ends: tuple[Point, Point], axis: Array
) -> Array:
    """Generalised forces (n, n_vD) of opposite unit forces on two points."""
    n, n_links = len(q_D), len(marionette.tree.links)
    poses = marionette.poses(q_D, q_K)
    wrench = np.zeros((n, n_links, 6))
    for point, sign in zip(ends, (1.0, -1.0), strict=True):
        if point.link == WORLD:
            continue
        local_position = np.array([marionette.number(x) for x in point.at])
        local_position = local_position - _centre(marionette, marionette.tree.links[point.link])
        lever_arm = poses[:, point.link, :, :3] @ local_position
        wrench[:, point.link, :3] += sign * axis
        wrench[:, point.link, 3:] += np.cross(lever_arm, sign * axis)
    return marionette.library.evaluate(
        "wrench_forces", q_D=q_D, q_K=q_K, wrench=wrench.swapaxes(1, 2), p=marionette.p
    ).u_D


def _position(marionette: CompiledPuppet, poses: Array, point: Point) -> Array:
    """Position (3,) of a point in the world [m]."""
    local_position = np.array([marionette.number(x) for x in point.at])
    return (
        local_position
        if point.link == WORLD
        else poses[point.link, :, :3] @ local_position + poses[point.link, :, 3]
    )


def _centre(marionette: CompiledPuppet, link: Link) -> Array:
    """Centre of mass (3,) in the link's frame; the origin of a massless link [m]."""
    mass, centre, _ = link_inertia(link, marionette.number)
    return centre if mass > 0.0 else np.zeros(3)
