"""The lightest press that is found, by size, thickness and pretension of the sheet.

    python benchmarks/light_presses.py [--noise-px 0.01]

Sheets with E = 1 MPa fill a picture of 1280 x 960 px. A press is an even load on a square of one pitch, at
one of three places; its markers are those of the shell that the method itself has, with noise. The least
force is the first of a row of forces, each 1.25 times the one before, that is found at all places, within a
quarter of itself and half a pitch, in each of four frames after the one in which it begins.

least     that force, and the depth of the sheet under it in the middle
noise     standard deviation by noise of a force in the middle, if no other force is possible
false     contacts in 30 frames without a press
"""

import argparse
from itertools import product

import numpy as np

from manytouch.design.dimensions import light_lattice
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.geometry.camera import project
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.values import Camera, Contact, Sensor, Sheet, TrackedGrid
from manytouch.values.arrays import read_only

YOUNG_MPA = 1.0
POISSON = 0.47
WIDTH_PX, HEIGHT_PX = 1280, 960
PLACES = np.array([[0.0, 0.0], [0.22, -0.18], [-0.3, 0.25]])
RATIO, STEPS = 1.25, 40
FRAMES, REST_FRAMES = 4, 30
MOST_ERROR, MOST_OFF_PITCH = 0.25, 0.5


def skin(length_mm: float, thickness_mm: float, strain: float) -> Sensor:
    """A sheet with sides of this length and three quarters of it, in the whole picture.

    Args:
        length_mm: of the longer side.
        thickness_mm: of the sheet.
        strain: by which it is stretched.
    """
    pitch_mm = max(3.0, length_mm / 40.0)
    size_mm = np.array([length_mm, 0.75 * length_mm])
    camera = Camera(
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        fx_px=0.9 * WIDTH_PX,
        fy_px=0.9 * WIDTH_PX,
        cx_px=0.5 * (WIDTH_PX - 1),
        cy_px=0.5 * (HEIGHT_PX - 1),
        distortion=np.zeros(5),
        rotation_vector=np.zeros(3),
        translation_mm=np.array([0.0, 0.0, length_mm]),
    )
    return Sensor(
        name=f"{length_mm:g} mm",
        camera=camera,
        layout=light_lattice((size_mm[0], size_mm[1]), pitch_mm, 0.27 * pitch_mm, 0.0),
        sheet=Sheet(
            size_mm=size_mm,
            thickness_mm=thickness_mm,
            young_MPa=YOUNG_MPA,
            poisson=POISSON,
            pretension_N_per_mm=strain * YOUNG_MPA * thickness_mm / (1.0 - POISSON),
        ),
        centre_noise_px=0.01,
    )


def load_of(model: InversionModel, place_mm: np.ndarray, force_mm2: float) -> np.ndarray:
    """Nodal forces over E of a press on a square of one pitch."""
    corner_mm = 0.25 * model.pitch_mm * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    return model.patch.load(place_mm + corner_mm, np.tile([0.0, 0.0, -0.25 * force_mm2], (4, 1)))


class Trial:
    """The method on one sheet."""

    def __init__(self, sensor: Sensor, noise_px: float) -> None:
        self.estimator, self.noise_px = MechanicsEstimator(), noise_px
        self.start: MechanicsState = self.estimator.start(sensor)
        self.model = self.start.model
        assert sensor.layout is not None
        self.rest_px = project(sensor.camera, sensor.layout.rest_mm)

    def contacts(self, coefficient_mm: np.ndarray, frames: int) -> list[list[Contact]]:
        """Contacts in frames with this shape, after three at rest; those of the first one are left out."""
        at_rest = np.zeros_like(coefficient_mm)
        state, found = self.start, []
        for number in range(frames + 4):
            shape = at_rest if number < 3 else coefficient_mm
            state, _, contacts = self.estimator.step(state, self.grid(shape, number))
            found.append(list(contacts.touching))
        return found[4:]

    def grid(self, coefficient_mm: np.ndarray, seed: int) -> TrackedGrid:
        """Markers of the sheet with this shape, with noise."""
        centre_px = self.rest_px + self.model.dots.displacement_px(coefficient_mm)
        noise_px = np.random.default_rng(seed).normal(0.0, self.noise_px, centre_px.shape)
        return TrackedGrid(
            position_px=read_only(centre_px + noise_px),
            covariance_px2=read_only(np.tile(self.noise_px**2 * np.eye(2), (len(centre_px), 1, 1))),
            is_seen=read_only(np.ones(len(centre_px), dtype=np.bool_)),
            frames_unseen=read_only(np.zeros(len(centre_px), dtype=np.int64)),
        )

    def is_found(self, place_mm: np.ndarray, force_mm2: float) -> bool:
        """Whether all frames show one contact with about this centre and force."""
        shape = equilibrium(self.model.shell, load_of(self.model, place_mm, force_mm2)).coefficient_mm
        for touching in self.contacts(shape, FRAMES):
            if len(touching) != 1:
                return False
            (contact,) = touching
            off_mm = float(np.linalg.norm(contact.centre_mm - place_mm))
            error = abs(contact.normal_force_over_E_mm2 / force_mm2 - 1.0)
            if off_mm > MOST_OFF_PITCH * self.model.pitch_mm or error > MOST_ERROR:
                return False
        return True


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--noise-px", type=float, default=0.01, help="standard deviation of centres")
    noise_px = parser.parse_args().noise_px
    print("length  thickness  strain | noise mN  least mN  depth mm  least / noise | false")
    for strain, thickness_mm, length_mm in product((0.0, 0.01), (2.0, 4.0), (60.0, 120.0, 240.0)):
        trial = Trial(skin(length_mm, thickness_mm, strain), noise_px)
        model = trial.model
        noise_mm2 = model.nodes.force_noise_mm2(np.zeros((model.patch.node_count, 2)), noise_px)
        places_mm = PLACES * model.patch.size_mm
        row = (4.0 * noise_mm2 * RATIO**step for step in range(STEPS))
        least_mm2 = next(
            (force for force in row if all(trial.is_found(place_mm, force) for place_mm in places_mm)), np.nan
        )
        depth_mm = np.nan
        if np.isfinite(least_mm2):
            shape = equilibrium(model.shell, load_of(model, places_mm[0], least_mm2)).coefficient_mm
            depth_mm = -float(model.dots.displacement_mm(shape)[:, 2].min())
        at_rest = np.zeros((model.patch.node_count, 3))
        false = sum(len(touching) for touching in trial.contacts(at_rest, REST_FRAMES))
        mN = 1e3 * YOUNG_MPA
        print(
            f"{length_mm:4.0f} mm {thickness_mm:7.1f} mm {100.0 * strain:5.1f} % |{mN * noise_mm2:9.3f} "
            f"{mN * least_mm2:9.2f} {depth_mm:9.4f} {least_mm2 / noise_mm2:14.0f} |{false:5d}",
            flush=True,
        )


if __name__ == "__main__":
    main()
