"""Forces that the inversion finds for a while where a sheet was pressed.

A viscoelastic sheet that is released keeps a share of its deformation and creeps back from there (Y. C. Fung,
Biomechanics, 1993, chapter 2). The inversion explains the hollow that remains by about that share of the
forces that caused it. Nothing presses then.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.frame_interval import remaining
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.force_nodes import ForceNodes, largest_around, sum_around
from manytouch.values.arrays import Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptForces:
    """Widens the deviation of forces by what may remain of earlier ones, and leaves out what it explains.

    Attributes:
        share: standard deviation of what remains of a force when it is released, over that force. Gels keep
            .03 of a press, rubber up to .15 (ADR 50).
        least_stds: a contact has at least this many of these deviations.
        fade_s: time constant with which what may remain becomes smaller: a choice.
        growth: what remains of a press does not grow; it is at most this factor of the present forces near
            it, or of the least force of a contact.
        least_fade_s: the least such time constant, of frames whose forces show less than may remain: the
            inversion is behind a quick release.
    """

    share: float = 0.03
    least_stds: float = 2.0
    fade_s: float = 6.6
    growth: float = 2.0
    least_fade_s: float = 0.41

    def without_kept(
        self, nodes: ForceNodes, clusters: Clusters, earlier_mm2: Float64[np.ndarray, " nodes"]
    ) -> Clusters:
        """The clusters that earlier forces do not explain.

        Args:
            nodes: of the sheet.
            clusters: of this frame.
            earlier_mm2: (nodes,) normal forces over E of earlier frames, from `after`.
        """
        least_mm2 = self.least_stds * self.std_mm2(nodes, clusters, earlier_mm2)
        is_chosen = clusters.normal_mm2 >= least_mm2
        return clusters if is_chosen.all() else clusters.select(np.flatnonzero(is_chosen))

    def std_mm2(
        self, nodes: ForceNodes, clusters: Clusters, earlier_mm2: Float64[np.ndarray, " nodes"]
    ) -> Scalars:
        """Standard deviations (c,) of normal forces over E by what remains of released forces.

        The arguments are those of `without_kept`.
        """
        if len(clusters) == 0:
            return np.zeros(0)
        near = np.where(clusters.label < 0, largest_around(nodes, clusters.label), clusters.label)
        node = np.flatnonzero(near >= 0)
        former_mm2 = np.bincount(near[node], earlier_mm2[node], minlength=len(clusters))
        return np.asarray(self.share * np.maximum(former_mm2 - clusters.normal_mm2, 0.0))

    def after(
        self,
        nodes: ForceNodes,
        earlier_mm2: Float64[np.ndarray, " nodes"],
        normal_mm2: Float64[np.ndarray, " nodes"],
        *,
        elapsed_s: float,
    ) -> Float64[np.ndarray, " nodes"]:
        """The earlier forces (nodes,) of the next frame.

        Args:
            nodes: of the sheet.
            earlier_mm2: (nodes,) those of this frame.
            normal_mm2: (nodes,) nodal normal forces over E of this frame, positive in compression.
            elapsed_s: time since the frame before.
        """
        now_mm2 = np.maximum(normal_mm2, 0.0)
        kept_mm2 = np.maximum(remaining(elapsed_s, self.fade_s) * earlier_mm2, now_mm2)
        most_mm2 = self.growth * np.maximum(sum_around(nodes, now_mm2), nodes.least_force_mm2)
        may_mm2 = self.least_stds * self.share * sum_around(nodes, kept_mm2)
        excess = np.maximum(may_mm2 / most_mm2, 1.0)
        return read_only(kept_mm2 * np.maximum(1.0 / excess, remaining(elapsed_s, self.least_fade_s)))
