"""The lightest press that is found, by size, thickness and pretension of the sheet.

    python benchmarks/light_presses.py [--noise-px 0.01] [--next-to-strong]

Sheets with E = 1 MPa fill a picture of 1280 x 960 px. A press is an even load on a square of one pitch, at
one of three places; its markers are those of the shell that the method itself has, with noise. The least
force is the first of a row of forces, each 1.25 times the one before, that is found at all places, within a
quarter of itself and half a pitch, in each of four frames after the one in which it begins.

least     that force, and the depth of the sheet under it in the middle
noise     standard deviation by noise of a force in the middle, if no other force is possible
false     contacts in 30 frames without a press

With --next-to-strong there is a strong press too, by which the sheet is 1.5 thicknesses deep. Stated are its
force and, for some distances, the least share of it that a second press may have: the last of a row of
shares, each smaller than the one before, that is found in the same way.
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
MN = 1e3 * YOUNG_MPA
"""Forces over E (mm^2) in millinewtons."""
POISSON = 0.47
WIDTH_PX, HEIGHT_PX = 1280, 960
PLACES = np.array([[0.0, 0.0], [0.22, -0.18], [-0.3, 0.25]])
RATIO, STEPS = 1.25, 40
FRAMES, REST_FRAMES = 4, 30
MOST_ERROR, MOST_OFF_PITCH = 0.25, 0.5
SKINS = tuple(product((0.0, 0.01), (2.0, 4.0), (60.0, 120.0, 240.0)))
"""Strain, thickness and length of each sheet, mm."""
DEEP_THICKNESSES, STRONG_PLACE = 1.5, np.array([-0.25, 0.0])
LEAST_STRONG_MM2, STRONG_GROWTH = 0.01, 1.3
DISTANCES_MM = (15.0, 30.0, 60.0)
SHARES = (0.3, 0.2, 0.14, 0.1, 0.07, 0.05, 0.035, 0.025, 0.018, 0.0125)


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

    def shape(self, *presses: tuple[np.ndarray, float]) -> np.ndarray:
        """Coefficients of the sheet under presses: place (mm) and normal force over E (mm^2) of each."""
        load = sum(load_of(self.model, place_mm, force_mm2) for place_mm, force_mm2 in presses)
        return equilibrium(self.model.shell, np.asarray(load)).coefficient_mm

    def depth_mm(self, shape: np.ndarray) -> float:
        """Largest depth of a marker."""
        return -float(self.model.dots.displacement_mm(shape)[:, 2].min())

    def is_found(self, *presses: tuple[np.ndarray, float]) -> bool:
        """Whether all frames show these contacts only, with about these centres and forces."""
        for touching in self.contacts(self.shape(*presses), FRAMES):
            if len(touching) != len(presses):
                return False
            for place_mm, force_mm2 in presses:
                off_mm = [float(np.linalg.norm(contact.centre_mm - place_mm)) for contact in touching]
                force = touching[int(np.argmin(off_mm))].normal_force_over_E_mm2
                is_off = min(off_mm) > MOST_OFF_PITCH * self.model.pitch_mm
                if is_off or abs(force / force_mm2 - 1.0) > MOST_ERROR:
                    return False
        return True


def lightest(noise_px: float) -> None:
    """Prints the table of single presses."""
    print("length  thickness  strain | noise mN  least mN  depth mm  least / noise | false")
    for strain, thickness_mm, length_mm in SKINS:
        trial = Trial(skin(length_mm, thickness_mm, strain), noise_px)
        model = trial.model
        noise_mm2 = model.nodes.force_noise_mm2(np.zeros((model.patch.node_count, 2)), noise_px)
        places_mm = PLACES * model.patch.size_mm
        row = (4.0 * noise_mm2 * RATIO**step for step in range(STEPS))
        least_mm2 = next(
            (force for force in row if all(trial.is_found((place_mm, force)) for place_mm in places_mm)),
            np.nan,
        )
        depth_mm = np.nan
        if np.isfinite(least_mm2):
            depth_mm = trial.depth_mm(trial.shape((places_mm[0], least_mm2)))
        at_rest = np.zeros((model.patch.node_count, 3))
        false = sum(len(touching) for touching in trial.contacts(at_rest, REST_FRAMES))
        print(
            f"{length_mm:4.0f} mm {thickness_mm:7.1f} mm {100.0 * strain:5.1f} % |{MN * noise_mm2:9.3f} "
            f"{MN * least_mm2:9.2f} {depth_mm:9.4f} {least_mm2 / noise_mm2:14.0f} |{false:5d}",
            flush=True,
        )


def next_to_strong(noise_px: float) -> None:
    """Prints the table of presses next to a strong one."""
    heads = "".join(f"{distance_mm:6.0f} mm" for distance_mm in DISTANCES_MM)
    print(f"length  thickness  strain | strong mN | least share at{heads}")
    for strain, thickness_mm, length_mm in SKINS:
        trial = Trial(skin(length_mm, thickness_mm, strain), noise_px)
        at_mm = STRONG_PLACE * trial.model.patch.size_mm
        strong = LEAST_STRONG_MM2
        while trial.depth_mm(trial.shape((at_mm, strong))) < DEEP_THICKNESSES * thickness_mm:
            strong *= STRONG_GROWTH
        row = ""
        for distance_mm in DISTANCES_MM:
            light_mm, found = at_mm + np.array([distance_mm, 0.0]), np.nan
            if light_mm[0] > 0.5 * length_mm - 3.0 * thickness_mm:
                row += f"{'-':>9}"
                continue
            for share in SHARES:
                if not trial.is_found((at_mm, strong), (light_mm, share * strong)):
                    break
                found = share
            row += f"{'none':>9}" if np.isnan(found) else f"{100.0 * found:7.1f} %"
        print(
            f"{length_mm:4.0f} mm {thickness_mm:7.1f} mm {100.0 * strain:5.1f} % |{MN * strong:10.0f} |"
            f"{' ' * 14}{row}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--noise-px", type=float, default=0.01, help="standard deviation of centres")
    parser.add_argument("--next-to-strong", action="store_true", help="presses next to a strong one")
    options = parser.parse_args()
    (next_to_strong if options.next_to_strong else lightest)(options.noise_px)


if __name__ == "__main__":
    main()
