"""Evidence of known pressures: exact nodal forces with independent noise."""

import numpy as np

from manytouch.estimation.mechanics.clusters.evidence import Combinations, Evidence
from manytouch.estimation.mechanics.clusters.patch_kernels import node_grid
from manytouch.geometry.spline.patch import SplinePatch

PATCH = SplinePatch(size_mm=(64.0, 48.0), elements=(16, 12))
NODE = np.arange(PATCH.node_count)
NOISE_MM2 = 2e-3


def evidence_of(theta: list[float], seed: int = 0) -> Evidence:
    """A likelihood around the nodal forces of a pressure with some parameters."""
    grid = NODE.reshape(PATCH.shape)
    along_x = grid if PATCH.is_x_slow else grid.T
    white = np.eye(len(NODE)) / NOISE_MM2
    evidence = Evidence(
        combinations=Combinations(
            white=white,
            white_of_mean=white,
            node=NODE,
            grid=node_grid(PATCH, np.pad(along_x, PATCH.dropped, constant_values=-1)),
        ),
        aim=np.zeros(len(NODE)),
        patch=PATCH,
    )
    noise = np.random.default_rng(seed).standard_normal(len(NODE))
    seen = evidence.nodal(np.array(theta)) / NOISE_MM2 + noise
    return Evidence(
        **{name: getattr(evidence, name) for name in Evidence.__slots__ if name != "aim"}, aim=seen
    )
