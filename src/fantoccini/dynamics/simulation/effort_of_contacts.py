"""Contribution of contacts to the force on every driven coordinate.

Driven coordinates q_K are ends and lengths of strings and driven joints; the effort is the force
that the hand exerts on them. In names, D stands for dynamic coordinates, which move by the
equations of motion. A link is a body on its joint. A twist is a velocity of a link, linear and
angular; a screw is the twist per unit of one joint velocity.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.model.tree import WORLD, Role
from fantoccini.motion import ContactPoints


def contact_effort(
    marionette: CompiledPuppet, contact: ContactPoints, q_D: Array, q_K: Array
) -> Array:
    """Force (T, n_vK) on driven coordinates from contacts: -sum of s_k . (f, r x f).

    s_k is the screw that a unit of driven velocity k gives a link that is touched at r, f the force
    on that link.

    Args:
        marionette: the puppet.
        contact: contact points at the T samples.
        q_D, q_K: (T, n_qD) dynamic and (T, n_qK) driven (kinematic) configurations.
    """
    out = np.zeros((len(q_D), marionette.coordinates.n_vK))
    contacts = marionette.contacts
    if not len(contact) or contacts is None or not out.shape[1]:
        return out
    links = contacts.solids["link"][contacts.pairs]
    screws = marionette.library.evaluate("screws", q_D=q_D, q_K=q_K, p=marionette.p).screw_K
    wrench = np.hstack([contact.force, np.cross(contact.point, contact.force)])
    for side, sign in ((0, 1.0), (1, -1.0)):
        touched_links = links[contact.pair, side]
        for link in set(touched_links.tolist()) - {WORLD}:
            links_above = (marionette.tree.links[i] for i in marionette.tree.ancestors(link))
            driven_indices = [
                k for w in links_above if w.role is Role.DRIVEN for k in range(w.v.start, w.v.stop)
            ]
            at_link = np.flatnonzero(touched_links == link)
            for k in driven_indices:
                generalised_force = np.einsum(
                    "nc,nc->n", screws[contact.sample[at_link], :, k], wrench[at_link]
                )
                np.add.at(out[:, k], contact.sample[at_link], -sign * generalised_force)
    return out
