"""Estimate every contact on a soft dotted sheet from the images of one camera: position, depth and force.

    import manytouch

    folder = manytouch.process("press.mp4", out="out")  # tables of all frames

    job = manytouch.prepare("press.mp4", whole_recording=True)  # or the same frame by frame
    for reading in job.readings():
        print(reading.contacts)

Importing this package imports nothing heavy: a name is loaded when it is first used.
`__init__.pyi` declares the types.
"""

import importlib

__version__ = "0.1.0"

_NAMES = {
    "manytouch.analysis.plots": ("plot_contacts", "plot_layout", "plot_surface"),
    "manytouch.analysis.read_results": ("Results", "read_results"),
    "manytouch.calibration": ("sensor_from_rest",),
    "manytouch.errors": (
        "ArgumentError",
        "ContactError",
        "LayoutError",
        "ManytouchError",
        "MissingExtraError",
        "OutputError",
        "SensorError",
        "SourceError",
    ),
    "manytouch.geometry.surface_sampling": ("sample",),
    "manytouch.pipeline": (
        "Detector",
        "Estimator",
        "Pipeline",
        "Sink",
        "Tracker",
    ),
    "manytouch.session": (
        "METHODS",
        "Observer",
        "pipeline_for",
        "prepare",
        "process",
        "run",
    ),
    "manytouch.session.stream": ("Stream", "stream"),
    "manytouch.simulation.contacts": ("Ball", "Patch", "PointForces", "simulate_contacts"),
    "manytouch.sources": (
        "Capabilities",
        "Source",
        "open_source",
    ),
    "manytouch.values": (
        "Camera",
        "Contact",
        "ContactShape",
        "Contacts",
        "Detections",
        "Frame",
        "Layout",
        "OutlineRing",
        "Phase",
        "Reading",
        "Roi",
        "Sensor",
        "Sheet",
        "SheetSpline",
        "Status",
        "Surface",
        "TrackedGrid",
        "Truth",
    ),
    "manytouch.values.sensor_file.read": ("known_sensors", "load_sensor"),
    "manytouch.values.sensor_file.write": ("save_sensor",),
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}

__all__ = list(_MODULE_OF)
__all__ += ["__version__"]


def __getattr__(name: str) -> object:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'manytouch' has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(_MODULE_OF[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
