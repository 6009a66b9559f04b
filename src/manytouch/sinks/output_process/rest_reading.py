"""A reading of an untouched sheet, with which messages are made before there is a real one."""

import numpy as np

from manytouch.values import (
    ESTIMATES,
    Contact,
    Contacts,
    Detections,
    Frame,
    Layout,
    Phase,
    Reading,
    SheetSpline,
    Surface,
    TrackedGrid,
)

ELEMENTS = (4, 4)
NODES = 25
SIZE_PX = (16, 16)


def rest_reading(layout: Layout) -> Reading:
    """All markers are at rest and seen; one contact, of which nothing is known."""
    count = len(layout.rest_mm)
    low, high = layout.rest_mm[:, :2].min(axis=0), layout.rest_mm[:, :2].max(axis=0)
    width_mm, height_mm = (high - low + layout.pitch_mm).tolist()
    x_mm, y_mm = (0.5 * (low + high)).tolist()
    spline = SheetSpline(
        size_mm=(width_mm, height_mm),
        centre_mm=(x_mm, y_mm),
        elements=ELEMENTS,
        is_clamped=True,
        thickness_mm=1.0,
        poisson=0.45,
        coefficient_mm=np.zeros((NODES, 3)),
        force_over_E_mm2=np.zeros((NODES, 3)),
        young_MPa=1.0,
    )
    contact = Contact(
        id=0,
        phase=Phase.MOVE,
        centre_mm=0.5 * (low + high),
        centre_px=np.full(2, np.nan),
        depth_mm=0.0,
        force_N=np.zeros(3),
        torque_Nmm=np.nan,
        area_mm2=np.nan,
        covariance=np.full((len(ESTIMATES), len(ESTIMATES)), np.nan),
    )
    return Reading(
        frame=Frame(index=0, timestamp_ns=0, camera="", image=np.zeros(SIZE_PX, np.uint8)),
        detections=Detections(
            centre_px=np.zeros((0, 2)),
            covariance_px2=np.zeros((0, 2, 2)),
            area_px2=np.zeros(0),
            contrast=np.zeros(0),
        ),
        grid=TrackedGrid(
            position_px=np.zeros((count, 2)),
            covariance_px2=np.zeros((count, 2, 2)),
            is_seen=np.ones(count, bool),
            frames_unseen=np.zeros(count, np.int64),
        ),
        surface=Surface(
            position_mm=layout.rest_mm,
            displacement_mm=np.zeros((count, 3)),
            covariance_mm2=np.zeros((count, 3, 3)),
            spline=spline,
            layout=layout,
        ),
        contacts=Contacts(contacts=(contact,)),
        milliseconds=0.0,
    )
