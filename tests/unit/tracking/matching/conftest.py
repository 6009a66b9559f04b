"""A lattice whose nodes are displaced smoothly at random, with some of its dots known."""

from dataclasses import dataclass

import numpy as np
import pytest

from flat_sensor import rectangle_px
from manytouch.tracking.lattice_graph import LatticeGraph, build_lattice_graph
from manytouch.tracking.matching.match_frame import WorkspacePool
from manytouch.tracking.matching.records import Assignment, DotArrays, Workspace

PITCH = 40.0


@dataclass
class Scene:
    """A graph; dots in random order, one for each marker and some false ones; the true dot of each node."""

    graph: LatticeGraph
    dots: DotArrays
    true_dot: np.ndarray
    workspace: Workspace
    chance: np.random.Generator

    def assignment(self, share: float) -> Assignment:
        """The true dots of a random share of the markers."""
        arrays, number = self.graph.arrays, len(self.dots.centre_px)
        is_known = (self.true_dot >= 0) & (self.chance.random(len(self.true_dot)) < share)
        dot = np.where(is_known, self.true_dot, -1)
        displacement = self.chance.normal(0.0, 1e3, arrays.rest_px.shape)  # to be overwritten
        displacement[is_known] = self.dots.centre_px[dot[is_known]] - arrays.rest_px[is_known]
        is_used = np.zeros(max(number, 1), dtype=bool)
        is_used[dot[is_known]] = True
        return Assignment(dot, displacement, is_used)


def make_scene(seed: int, *, rows: int = 8, columns: int = 11, roughness: float = 0.0) -> Scene:
    """A scene whose displacements are quadratic, plus `roughness` pitches of noise."""
    chance = np.random.default_rng(seed)
    rest = rectangle_px(rows, columns, (PITCH, PITCH), (100.0, 100.0))
    graph = build_lattice_graph(rest, np.zeros(len(rest), dtype=bool))
    x, y = ((rest - rest.mean(axis=0)) / np.ptp(rest, axis=0)).T
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    field = terms @ chance.normal(0.0, 0.25 * PITCH, (6, 2))
    centre = rest + field + roughness * PITCH * chance.standard_normal(rest.shape)
    false = chance.uniform(rest.min(axis=0), rest.max(axis=0), (4, 2))
    centre = np.concatenate([centre, false])
    order = chance.permutation(len(centre))
    true_dot = np.full(len(graph.arrays.rest_px), -1)
    true_dot[: len(rest)] = np.argsort(order)[: len(rest)]
    dots = DotArrays(
        centre_px=centre[order],
        covariance_px2=np.tile(4e-4 * np.eye(2), (len(centre), 1, 1)),
        area_px2=chance.uniform(150.0, 250.0, len(centre)),
        contrast=chance.uniform(40.0, 80.0, len(centre)),
    )
    workspace = WorkspacePool(len(graph.arrays.rest_px)).get(len(centre))
    return Scene(graph, dots, true_dot, workspace, chance)


@pytest.fixture(params=range(3))
def scene(request: pytest.FixtureRequest) -> Scene:
    return make_scene(request.param, roughness=0.005 * request.param)
