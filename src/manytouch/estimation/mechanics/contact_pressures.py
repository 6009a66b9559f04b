"""The pressure of the contacts on the nodes of the sheet."""

from dataclasses import replace

import numpy as np

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.force_nodes import ForceNodes
from manytouch.values import Contacts, Surface
from manytouch.values.arrays import read_only


def with_contact_pressures(
    surface: Surface, nodes: ForceNodes, clusters: Clusters, contacts: Contacts
) -> Surface:
    """The surface with nodal forces whose sum near each contact is the normal force of the contact.

    The forces of the inversion also balance errors of the model, with weak forces that pull or press next to
    a contact and along the clamp. The nodes of a contact that press have what is missing in the sum over its
    nodes and those nearest to it that are of no cluster, in proportion to their forces.

    Args:
        surface: of a frame.
        nodes: of the sheet.
        clusters: of the frame. A contact is that of the cluster that is nearest to it, if it is also the
            nearest to that cluster; others change nothing.
        contacts: of the frame.
    """
    spline, touching = surface.spline, contacts.touching
    if spline is None or not touching or len(clusters) == 0:
        return surface
    centre_mm = np.array([contact.centre_mm for contact in touching])
    away_mm = np.linalg.norm(clusters.centre_mm[:, None] - centre_mm, axis=2)
    of_cluster, of_contact = away_mm.argmin(axis=1), away_mm.argmin(axis=0)
    of_node = np.linalg.norm(nodes.place_mm[:, None] - centre_mm, axis=2).argmin(axis=1)
    force_mm2 = spline.force_over_E_mm2.copy()
    normal_mm2, label = -force_mm2[:, 2], clusters.label
    for number, contact in enumerate(touching):
        cluster = of_contact[number]
        own_mm2 = np.where(label == cluster, np.maximum(normal_mm2, 0.0), 0.0)
        if of_cluster[cluster] == number and own_mm2.any():
            is_around = ((label < 0) & (of_node == number)) | ((label == cluster) & (normal_mm2 < 0.0))
            wanted_mm2 = max(contact.normal_force_over_E_mm2 - normal_mm2[is_around].sum(), 0.0)
            force_mm2[:, 2] -= own_mm2 * (wanted_mm2 / own_mm2.sum() - 1.0)
    return replace(surface, spline=replace(spline, force_over_E_mm2=read_only(force_mm2)))
