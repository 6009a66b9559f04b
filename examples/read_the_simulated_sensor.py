"""Read the simulated sensor under one slow press and compare the contact with the truth.

Run it: python examples/read_the_simulated_sensor.py
"""

import numpy as np

import manytouch


def main() -> float:
    """Print estimate and truth of the deepest frame; return the error of the position in mm."""
    source = manytouch.open_source("sim:one")
    pipeline = manytouch.pipeline_for("perimeter")
    deepest = None
    for reading in pipeline.run(source, source.sensor):
        for contact in reading.contacts.touching:
            if deepest is None or contact.depth_mm > deepest[1].depth_mm:
                deepest = reading.frame.index, contact
    if deepest is None:
        raise SystemExit("nothing touched the sheet")
    index, contact = deepest
    truth = source.truth(index).contacts.touching[0]
    print(f"frame {index}")
    print(f"  estimate {contact.centre_mm.round(2)} mm, deviation {contact.std('x'):.2f} mm")
    print(f"  truth    {truth.centre_mm.round(2)} mm")
    return float(np.linalg.norm(contact.centre_mm - truth.centre_mm))


if __name__ == "__main__":
    main()
