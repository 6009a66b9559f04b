"""OSC messages of our own, with all numbers of the contacts in their units.

Each reading is one bundle:

    /manytouch/frame    i frame, d time_s, s status, i number of contacts
    /manytouch/alive    i id, i id, ... of the contacts that are present
    /manytouch/contact  i id, s phase, f x, y, depth (mm or pitches), f normal force, shear x, shear y (N),
                        f torque (N mm), f area (mm²), then the standard deviations of x, y, depth and normal
                        force; one message per contact, also for those that just ended

Unknown numbers are NaN.
"""

from collections.abc import Sequence

from manytouch.sinks.publishers.udp import Message
from manytouch.values import Contact, Reading

STDS = ("x", "y", "depth", "normal_force")


def encode_osc(reading: Reading) -> Sequence[Sequence[Message]]:
    """The bundle of a reading."""
    touching = reading.contacts.touching
    return [
        [
            (
                "/manytouch/frame",
                [
                    ("i", reading.frame.index),
                    ("d", reading.frame.timestamp_ns * 1e-9),
                    ("s", str(reading.status)),
                    ("i", len(touching)),
                ],
            ),
            ("/manytouch/alive", [("i", contact.id) for contact in touching]),
            *(_contact(contact) for contact in reading.contacts.contacts),
        ]
    ]


def _contact(contact: Contact) -> Message:
    x_N, y_N, z_N = (float(each) for each in contact.force_N)
    numbers = (
        *(float(each) for each in contact.centre_mm),
        contact.depth_mm,
        -z_N,
        x_N,
        y_N,
        contact.torque_Nmm,
        contact.area_mm2,
        *(contact.std(name) for name in STDS),
    )
    return "/manytouch/contact", [
        ("i", contact.id),
        ("s", str(contact.phase)),
        *(("f", number) for number in numbers),
    ]
