"""The camera image annotated with markers, displacements and contacts."""

import math
from pathlib import Path

import cv2
import numpy as np

from manytouch.geometry.camera import mm_per_px
from manytouch.sinks.clear_forces import is_clear
from manytouch.sinks.contact_outlines import outlines_px
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.sensor_description import layout_of, pitch_px, rest_px
from manytouch.sinks.pictures import drawing
from manytouch.sinks.pictures.label_layout import Rectangle, place_label
from manytouch.sinks.pictures.video_file import VideoFile
from manytouch.values import Contact, Reading, Sensor
from manytouch.values.arrays import Points2
from manytouch.values.display.text import with_std

LONG_SIDE_PX = 1000
LEAST_LONG_SIDE_PX = 640  # more would leave a video too few bits per pixel
ARROW_SCALE = 3
SMALLEST_ARROW_PX = 4.0
SHEAR_SHARE_PER_N, LARGEST_SHEAR_SHARE = 0.03, 0.15
"""Length of the arrow of a shear force over the long side of the picture."""
LEAST_SHEAR_N = 0.05
ASSUMED_FPS = 25.0


class Annotator:
    """Annotates readings of one sensor; small images are enlarged to keep text legible.

    Attributes:
        zoom: integer magnification of the camera image.
    """

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._layout = layout_of(sensor)
        self._rest_px = rest_px(sensor)
        camera = sensor.camera
        self.zoom = _zoom(max(camera.width_px, camera.height_px))
        self._pitch = float(np.nanmin(pitch_px(sensor))) * self.zoom
        self._long_side = max(camera.width_px, camera.height_px) * self.zoom
        self._text_px = max(12.0, 0.014 * self._long_side)
        self._arrow_px = max(2, round(self._long_side / 600))  # a video halves the resolution of colour
        self._contact_px = max(2, round(self._long_side / 500))
        self._bar = round(2.2 * self._text_px)
        self._last: np.ndarray | None = None
        self._white: float | None = None

    def __call__(self, reading: Reading) -> np.ndarray:
        """The annotated picture, (h, w, 3) uint8 in B, G, R, of the same even size for every reading."""
        picture = self._ground(reading)
        self._draw_markers(picture, reading)
        self._draw_arrows(picture, reading)
        self._draw_contacts(picture, reading)
        return self._framed(picture, reading)

    def _ground(self, reading: Reading) -> np.ndarray:
        camera = self._sensor.camera
        size = (camera.width_px * self.zoom, camera.height_px * self.zoom)
        image = reading.frame.image
        if image is None:
            blank = np.full((size[1], size[0], 3), 40, np.uint8)
            return blank if self._last is None else self._last // 2
        if self._white is None:
            self._white = float(np.percentile(image, 99.9))
        ground = drawing.eight_bit_colour(image, self._white)
        if (ground.shape[1], ground.shape[0]) != size:
            ground = np.asarray(cv2.resize(ground, size, interpolation=cv2.INTER_CUBIC))
        self._last = ground
        return ground.copy()

    def _place(self, position_px: Points2) -> Points2:
        """From pixels of the camera image to those of the enlarged one; pixel centres are integers."""
        return (position_px + 0.5) * self.zoom - 0.5

    def _draw_markers(self, picture: np.ndarray, reading: Reading) -> None:
        seen = reading.grid.is_seen
        place = self._place(np.where(seen[:, None], reading.grid.position_px, self._rest_px))
        radius_px = self._layout.radius_mm / mm_per_px(self._sensor.camera) * self.zoom
        height = float(np.clip(0.17 * self._pitch, 8.0, self._text_px))
        width = int(np.clip(self._pitch / 40, 1, 3))
        widest = drawing.text_size(str(len(place) - 1), height)[0]
        every = max(1, int(np.ceil(1.15 * widest / self._pitch)))
        for marker in np.flatnonzero(~self._layout.is_missing):
            centre = (place[marker, 0], place[marker, 1])
            if not seen[marker]:
                drawing.cross(picture, centre, max(3.0, 0.08 * self._pitch), drawing.WHITE)
                continue
            radius = max(float(radius_px[marker]), 2.0)
            drawing.disc_outline(picture, centre, radius, drawing.SKY, width)
            if marker % every == 0:
                half = drawing.text_size(str(marker), height)[0] / 2
                left = (centre[0] - half, centre[1] + radius + width + height + 3)
                drawing.write_text(picture, str(marker), left, height, drawing.WHITE)

    def _draw_arrows(self, picture: np.ndarray, reading: Reading) -> None:
        """Displacements since rest in the image, as the viewer draws them."""
        seen = reading.grid.is_seen
        begin = self._place(reading.grid.position_px[seen])
        moved = begin - self._place(self._rest_px[seen])
        end = begin + ARROW_SCALE * moved
        width = self._arrow_px
        for index in np.flatnonzero(np.hypot(*moved.T) * ARROW_SCALE >= SMALLEST_ARROW_PX):
            drawing.arrow(picture, tuple(begin[index]), tuple(end[index]), drawing.YELLOW, width)

    def _draw_contacts(self, picture: np.ndarray, reading: Reading) -> None:
        width = self._contact_px
        occupied: list[Rectangle] = []
        outlines = outlines_px(self._sensor, reading.surface, reading.contacts.touching)
        for contact in reading.contacts.touching:
            if not np.isfinite(contact.centre_px).all():
                continue
            x, y = self._place(contact.centre_px[None])[0]
            rings = [self._place(ring_px) for ring_px in outlines.get(contact.id, ())]
            radius = self._radius_of(contact)
            for ring in rings:
                drawing.polygon(picture, ring, drawing.VERMILION, max(1, width // 2))
                radius = max(radius, float(np.linalg.norm(ring - (x, y), axis=1).max()))
            if not rings:
                drawing.disc_outline(picture, (x, y), radius, drawing.VERMILION, width)
            drawing.cross(picture, (x, y), 1.5 * width + 2, drawing.VERMILION, width)
            self._draw_shear(picture, contact, (float(x), float(y)), width)
            self._label(picture, contact, (float(x), float(y), radius), occupied)

    def _draw_shear(self, picture: np.ndarray, contact: Contact, place: drawing.Position, width: int) -> None:
        """The direction and size of a shear force; y of the sheet points down in the image."""
        size_N = float(np.hypot(*contact.force_N[:2]))
        std_N = max(contact.std("shear_x"), contact.std("shear_y"))
        if not size_N >= LEAST_SHEAR_N or size_N < std_N:  # also where it is not known
            return
        length = min(SHEAR_SHARE_PER_N * size_N, LARGEST_SHEAR_SHARE) * self._long_side
        end = np.array(place) + contact.force_N[:2] * (length / size_N)
        drawing.arrow(picture, place, (float(end[0]), float(end[1])), drawing.VERMILION, width)

    def _radius_of(self, contact: Contact) -> float:
        """Radius of a circle as large as a contact, in px of the drawn picture; half a pitch if not known."""
        radius = np.sqrt(contact.area_mm2 / np.pi) / mm_per_px(self._sensor.camera) * self.zoom
        return float(radius) if radius > 0 else 0.5 * self._pitch

    def _label(
        self,
        picture: np.ndarray,
        contact: Contact,
        circle: tuple[float, float, float],
        occupied: list[Rectangle],
    ) -> None:
        begin, force = f"#{contact.id}  {self.depth_text(contact)}", force_text(contact)
        height = 1.1 * self._text_px
        size = (drawing.text_size(begin + force, height)[0] + height, 2.0 * height)
        label = place_label(circle, size, (picture.shape[1], picture.shape[0]), occupied)
        occupied.append(label)
        drawing.plate(picture, (label.left, label.top), size)
        baseline = (label.left + height / 2, label.top + 1.5 * height)
        is_deep = is_clear(contact.depth_mm, contact.std("depth"))
        is_strong = is_clear(float(contact.force_N[2]), contact.std("normal_force"))
        for text, is_bright in ((begin, is_deep), (force, is_strong)):
            colour = drawing.WHITE if is_bright else drawing.GREY
            drawing.write_text(picture, text, baseline, height, colour, outline=False)
            baseline = (baseline[0] + drawing.text_size(text, height)[0], baseline[1])

    def depth_text(self, contact: Contact) -> str:
        """Depth and its deviation in the sensor's unit."""
        if not np.isfinite(contact.depth_mm):
            return "depth unknown"
        return f"{with_std(contact.depth_mm, contact.std('depth'))} {self._sensor.length_unit}"

    def _framed(self, picture: np.ndarray, reading: Reading) -> np.ndarray:
        """Add a line of facts above and a legend below; the size becomes even."""
        height, width = picture.shape[:2]
        whole = np.full((height + 2 * self._bar, width, 3), 24, np.uint8)
        whole[self._bar : self._bar + height] = picture
        present = int((~self._layout.is_missing).sum())
        contacts = len(reading.contacts.touching)
        facts = "   ".join(
            (
                f"frame {reading.frame.index}",
                f"{reading.frame.timestamp_ns * 1e-9:.2f} s",
                reading.status,
                f"{int(reading.grid.is_seen.sum())} of {present} markers",
                f"{contacts} contact" + ("" if contacts == 1 else "s"),
            )
        )
        baseline = 0.5 * (self._bar + self._text_px)
        drawing.write_text(whole, facts, (self._text_px, baseline), self._fit(facts, width), drawing.WHITE)
        self._legend(whole, height + self._bar + baseline, width)
        return np.pad(whole, ((0, whole.shape[0] % 2), (0, whole.shape[1] % 2), (0, 0)))

    def _fit(self, text: str, width: int) -> float:
        return min(
            self._text_px,
            self._text_px * (width - 2 * self._text_px) / drawing.text_size(text, self._text_px)[0],
        )

    def _legend(self, whole: np.ndarray, baseline: float, width: int) -> None:
        bar_px = _round_number(0.4 * self._pitch / self.zoom / ARROW_SCALE)
        sheet = self._sensor.sheet
        has_forces = sheet is not None and sheet.young_MPa is not None
        entries = ["marker", "not seen", f"displacement {bar_px:g} px (arrows x{ARROW_SCALE})", "contact"]
        entries += ["shear force 1 N"] if has_forces else []
        size = self._fit("oo".join(entries) + "oo" * 2 * len(entries), width)
        x, middle = self._text_px, baseline - 0.5 * size
        for index, entry in enumerate(entries):
            begin = (x, middle)
            if index == 0:
                drawing.disc_outline(whole, (x + size / 2, middle), size / 2, drawing.SKY)
            elif index == 1:
                drawing.cross(whole, (x + size / 2, middle), size / 2, drawing.WHITE)
            elif index == 2:
                length = bar_px * ARROW_SCALE * self.zoom
                drawing.arrow(whole, begin, (x + length, middle), drawing.YELLOW, self._arrow_px)
                x += length - size
            elif index == 3:
                drawing.disc_outline(whole, (x + size / 2, middle), 0.7 * size, drawing.VERMILION, 2)
            else:
                length = SHEAR_SHARE_PER_N * self._long_side
                drawing.arrow(whole, begin, (x + length, middle), drawing.VERMILION, self._contact_px)
                x += length - size
            x += 1.7 * size
            drawing.write_text(whole, entry, (x, baseline), size, drawing.WHITE)
            x += drawing.text_size(entry, size)[0] + 2 * size


class AnnotatedPictures:
    """annotated.mp4, or a folder `annotated` of PNG files when the input is single pictures."""

    def __init__(
        self,
        folder: Path,
        sensor: Sensor,
        *,
        as_video: bool,
        fps: float | None,
        most_bits_per_s: float | None = None,
    ) -> None:
        """Create the video or the folder.

        Args:
            folder: it goes into.
            sensor: of the readings.
            as_video: whether it is a video.
            fps: of the input; None: not known.
            most_bits_per_s: bit rate of the video at most; None: no limit.
        """
        self._draw = Annotator(sensor)
        self._path = folder / "annotated"
        self._video: VideoFile | None = None
        if as_video:
            self._video = VideoFile(folder / "annotated.mp4", fps or ASSUMED_FPS, most_bits_per_s)
        else:
            with output_errors(self._path):
                self._path.mkdir(parents=True)

    def write(self, reading: Reading) -> None:
        """Add a frame."""
        picture = self._draw(reading)
        if self._video is None:
            write_png(self._path / f"{reading.frame.index:06d}.png", picture)
        else:
            self._video.write(picture)

    def close(self) -> None:
        """Complete the video or the folder; a video without frames is left out.

        Raises:
            OutputError: the video cannot be completed.
        """
        if self._video is not None:
            self._video.close()


def force_text(contact: Contact) -> str:
    """Normal force and its deviation with two spaces in front; empty if it is not known."""
    force_N = contact.normal_force_N
    return f"  {with_std(force_N, contact.std('normal_force'))} N" if np.isfinite(force_N) else ""


def write_png(path: Path, picture: np.ndarray) -> None:
    """Write an image, also to paths that OpenCV does not support (non-ASCII on Windows).

    Raises:
        OutputError: the file cannot be written.
    """
    _, encoded = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 3])
    with output_errors(path):
        path.write_bytes(encoded.tobytes())


def _zoom(long_side_px: int) -> int:
    """Doubles small images; more only where the result would be smaller than `LEAST_LONG_SIDE_PX`."""
    doubled = max(1, min(2, round(LONG_SIDE_PX / long_side_px)))
    return max(doubled, math.ceil(LEAST_LONG_SIDE_PX / long_side_px))


def _round_number(value: float) -> float:
    """1, 2 or 5 times a power of ten, not above the value."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-6)))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))
