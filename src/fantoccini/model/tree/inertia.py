"""Masses and inertias of links and joints as numbers, without symbolic derivation.

A link is a body on its joint. q_D and q_K are the dynamic and driven coordinates; a drive moves one
by a motor.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fantoccini.base import rotation
from fantoccini.model.tree.coordinates import Role
from fantoccini.model.tree.placement import Value, link_poses
from fantoccini.model.tree.structure import WORLD, Link, Tree


def link_inertia(link: Link, number: Value) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2], in body axes.

    The link's mass shares are summed; explicit mass, centre and inertia override the sum.

    Args:
        link: the link.
        number: function from a number of the file, or its parameter, to the value.
    """
    masses = np.array([number(share.amount) * share.volume for share in link.mass_shares])
    m, com, about_com = float(masses.sum()), np.zeros(3), np.zeros((3, 3))
    if m > 0:
        com = sum(k * share.unit.com for k, share in zip(masses, link.mass_shares, strict=True)) / m
        for k, share in zip(masses, link.mass_shares, strict=True):
            about_com = about_com + k * (
                share.unit.inertia + _unit_mass_inertia(share.unit.com - com)
            )
    if link.mass is not None:
        about_com = about_com * (number(link.mass) / m if m > 0 else 0.0)
        m = number(link.mass)
    if link.com is not None:
        com = np.array([number(x) for x in link.com])
    if link.inertia is not None:
        xx, yy, zz, xy, xz, yz = (number(x) for x in link.inertia)
        about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return m, com, about_com


def joint_inertias(
    tree: Tree, q_D: np.ndarray, q_K: np.ndarray, number: Value
) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Inertias of the dynamic joints, with the joints beyond them held and free.

    The inertias with free joints are the pivots when M is factored from the leaves to the root: M
    is singular if one of them is.

    Args:
        tree: the tree.
        q_D, q_K: (n_qD,) dynamic and (n_qK,) driven (kinematic) configuration, all finite.
        number: function from a number of the file, or its parameter, to the value.

    Yields:
        Index of the link, and (k, k) inertias for its joint's velocities: with the joints beyond
        it held, and with them free.
    """
    poses = link_poses(tree.links, q_D[None], q_K[None], number)[0]
    rotors = np.zeros(tree.coordinates.n_vD)
    for link in tree.links:
        if link.role is Role.DYNAMIC:
            rotors[link.v] = number(link.armature)
    for drive in tree.drives:
        rotors[drive.v] = drive.inertia(number)
    locked, unlocked = np.zeros((len(tree.links), 6, 6)), np.zeros((len(tree.links), 6, 6))
    for i in reversed(range(len(tree.links))):
        link, pose = tree.links[i], poses[i]
        spatial_inertia = _about_origin(*link_inertia(link, number), pose[:, :3])
        locked[i] += spatial_inertia
        unlocked[i] += spatial_inertia
        if link.role is Role.DYNAMIC:
            R_parent = np.eye(3) if link.parent == WORLD else poses[link.parent][:, :3]
            S = _motions(link, pose[:, :3], R_parent @ link.rotation)
            rotor = np.diag(rotors[link.v])
            D = S.T @ unlocked[i] @ S + rotor
            yield i, S.T @ locked[i] @ S + rotor, D
            F = unlocked[i] @ S
            unlocked[i] -= F @ np.linalg.pinv(D, hermitian=True) @ F.T
        if link.parent != WORLD:
            offset = pose[:, 3] - poses[link.parent][:, 3]
            locked[link.parent] += _about_new_origin(locked[i], offset)
            unlocked[link.parent] += _about_new_origin(unlocked[i], offset)


def _unit_mass_inertia(r: np.ndarray) -> np.ndarray:
    """r.r 1 - r r^T: inertia about the origin of a unit mass at r."""
    return r @ r * np.eye(3) - np.outer(r, r)


def _about_origin(m: float, com: np.ndarray, inertia: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(6, 6) inertia about a link's origin in the world's axes; rotation first."""
    c = R @ com
    rotational = R @ inertia @ R.T + m * _unit_mass_inertia(c)
    return np.block([[rotational, m * rotation.skew(c)], [m * rotation.skew(c).T, m * np.eye(3)]])


def _about_new_origin(inertia: np.ndarray, r: np.ndarray) -> np.ndarray:
    """(6, 6) inertia about a new origin; r points from it to the old one."""
    X = np.eye(6)
    X[3:, :3] = -rotation.skew(r)
    return X.T @ inertia @ X


def _motions(link: Link, R: np.ndarray, R_joint: np.ndarray) -> np.ndarray:
    """(6, k) twists of a link per joint velocity, about its origin in the world's axes."""
    turns, slides = np.zeros((6, 3)), np.zeros((6, 3))
    turns[:3], slides[3:] = R, R_joint
    match link.kind:
        case "free":
            return np.hstack([slides, turns])
        case "ball":
            return turns
        case "revolute":
            return turns @ link.axes
    return slides @ link.axes
