"""OSC and TUIO as clients of other authors receive them: python-osc and python-tuio."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest
import pythontuio

from manytouch.sinks.publishers.registry import open_outputs
from manytouch.values import Phase
from osc_receiver import Receiver
from waiting import wait_until

LOW, SIZE = (
    np.array([-15.0, -8.0]),
    np.array([30.0, 16.0]),
)  # of the markers of the sensor, half a pitch beyond


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    one = Receiver()
    yield one
    one.close()


@pytest.fixture
def pressed(reading_of, contact_of):
    """Readings of two contacts: both start, one moves, one ends."""

    def contact(number: int, phase: Phase, x_mm: float, force_N: float):
        return contact_of(
            number,
            phase,
            centre_mm=np.array([x_mm, -4.0]),
            force_N=np.array([0.5, -0.25, -force_N]),
            area_mm2=12.0,
            half_major_mm=3.0,
            half_minor_mm=2.0,
            orientation_rad=0.5,
        )

    return [
        reading_of(0, (contact(7, Phase.START, 0.0, 2.0), contact(9, Phase.START, 7.5, 5.0))),
        reading_of(1, (contact(7, Phase.MOVE, 3.0, 4.0), contact(9, Phase.END, 7.5, 5.0))),
    ]


def test_osc_has_every_number_of_the_contacts(receiver, pressed, session) -> None:
    (output,) = open_outputs([f"osc://127.0.0.1:{receiver.port}"], session)
    for reading in pressed:
        output.write(reading)
    output.close()
    wait_until(lambda: len(receiver.of("/manytouch/contact")) == 4)
    assert receiver.of("/manytouch/frame") == [(0, 0.0, "ok", 2), (1, 0.04, "ok", 1)]
    assert receiver.of("/manytouch/alive") == [(7, 9), (7,)]
    contact = receiver.of("/manytouch/contact")[2]
    assert contact[:2] == (7, "move")
    assert contact[2:8] == pytest.approx((3.0, -4.0, 1.5, 4.0, 0.5, -0.25))
    assert np.isnan(contact[8])  # the torque is unknown
    assert contact[9:13] == pytest.approx((12.0, 0.2, 0.3, 0.5), rel=1e-6)
    assert receiver.of("/manytouch/contact")[3][:2] == (9, "end")


def test_tuio_1_1_for_a_client_of_another_author(pressed, session, capsys) -> None:
    client = pythontuio.TuioClient(("127.0.0.1", 0))
    added, removed, cursors, bundles = [], [], {}, []

    class Listener(pythontuio.TuioListener):
        def add_tuio_cursor(self, cursor):
            added.append(cursor.session_id)

        def remove_tuio_cursor(self, cursor):
            removed.append(cursor.session_id)

        def refresh(self, time):
            cursors.update({each.session_id: (each.position, each.velocity) for each in client.cursors})
            bundles.append(time)

    client.add_listener(Listener())
    thread = threading.Thread(target=client.start, daemon=True)
    thread.start()
    wait_until(lambda: client.server_address[1] != 0)  # it has its port only once it is bound
    (output,) = open_outputs([f"tuio://127.0.0.1:{client.server_address[1]}"], session)
    for reading in pressed:
        output.write(reading)
    output.close()
    wait_until(lambda: len(bundles) == 4)  # of 2Dcur and 2Dblb, of two readings
    client.shutdown()
    thread.join()
    client.server_close()
    assert added == [7, 9]
    assert removed == [9]
    (x, y), (x_per_s, y_per_s) = cursors[7]
    assert (x, y) == pytest.approx((18.0 / 30.0, 4.0 / 16.0))
    assert (x_per_s, y_per_s) == pytest.approx((0.1 / 0.04, 0.0))
    assert [(blob.session_id, blob.dimension) for blob in client.blobs] == [
        (7, pytest.approx((6.0 / 30.0, 4.0 / 16.0)))
    ]


def test_tuio_1_1_has_the_pressure_in_the_third_coordinate(receiver, pressed, session) -> None:
    (output,) = open_outputs([f"tuio://127.0.0.1:{receiver.port}?force-N=8"], session)
    output.write(pressed[0])
    output.close()
    wait_until(lambda: receiver.of("/tuio/2Dblb")[-1:] == [("fseq", 1)])
    sets = [args for args in receiver.of("/tuio/25Dcur") if args[0] == "set"]
    assert [(args[1], args[4]) for args in sets] == [(7, 0.25), (9, 0.625)]
    assert receiver.of("/tuio/2Dcur")[:2] == [("source", "manytouch"), ("alive", 7, 9)]


def test_tuio_2_0_has_pressure_bounds_and_an_alive_set(receiver, pressed, session) -> None:
    (output,) = open_outputs([f"tuio://127.0.0.1:{receiver.port}?version=2.0"], session)
    for reading in pressed:
        output.write(reading)
    output.close()
    wait_until(lambda: len(receiver.of("/tuio2/alv")) == 2)
    frames = receiver.of("/tuio2/frm")
    assert [frame[0] for frame in frames] == [1, 2]
    assert (frames[0][2] >> 16, frames[0][2] & 0xFFFF) == (320, 240)
    assert receiver.of("/tuio2/alv") == [(7, 9), (7,)]
    pointer = receiver.of("/tuio2/ptr")[2]
    assert pointer[:3] == (7, 0, 0)
    assert pointer[3:11] == pytest.approx((0.6, 0.25, 0.5, 0.0, 0.1125, 0.4, 2.5, 0.0))
    bounds = receiver.of("/tuio2/bnd")[2]
    assert bounds[1:] == pytest.approx((0.6, 0.25, 0.5, 0.2, 0.25, 12.0 / 480.0))


def test_a_client_that_is_killed_and_started_again_receives_what_follows(pressed, session) -> None:
    first = Receiver()
    (output,) = open_outputs([f"osc://127.0.0.1:{first.port}"], session)
    output.write(pressed[0])
    wait_until(lambda: first.of("/manytouch/frame"))
    first.close()
    output.write(pressed[1])  # nobody listens
    wait_until(lambda: output.state.sent + output.state.dropped == 2)
    second = Receiver(first.port)
    for _ in range(200):
        output.write(pressed[1])
        if second.of("/manytouch/frame"):
            break
        threading.Event().wait(0.01)
    output.close()
    assert second.of("/manytouch/frame")
    second.close()
    assert output.state.problem is None
