"""The process of the simulated sensor that is pressed: `pressed_process` starts it."""

from dataclasses import replace
from io import BufferedReader, FileIO

from manytouch.child_process import pipes_to_parent, receive, refusal, send
from manytouch.errors import SourceError
from manytouch.sources.pressed.pressed_process import Loaded, NewFrame, SceneRequest
from manytouch.sources.pressed.pressed_source import PressedSource
from manytouch.sources.simulated import WIDTH_PX
from manytouch.values import Frame, Press, Release, Truth


def main() -> None:
    """Make the frames that are requested on standard input until it is closed."""
    requests, answers = pipes_to_parent()
    try:
        _serve(requests, answers)
    except BrokenPipeError:
        raise SystemExit(0) from None
    except Exception as error:  # noqa: BLE001 - the parent reports it
        send(answers, refusal(error, SourceError))
        raise SystemExit(1) from None


def _serve(requests: BufferedReader, answers: FileIO) -> None:
    opening = receive(requests)
    if not isinstance(opening, SceneRequest):
        return
    source = PressedSource(opening.scene, seconds=opening.seconds, width_px=opening.width_px or WIDTH_PX)
    send(
        answers,
        Loaded(name=source.name, fps=source.fps, frame_count=source.frame_count, sensor=source.sensor),
    )
    frames = iter(source)
    while (message := receive(requests)) is not None:
        if isinstance(message, Press | Release):
            source.press(message)
            continue
        frame = next(frames, None)
        send(answers, NewFrame() if frame is None else NewFrame(frame=frame, truth=_truth(source, frame)))


def _truth(source: PressedSource, frame: Frame) -> Truth | None:
    """Without the layout, which is that of the sensor."""
    truth = source.truth(frame.index)
    return None if truth is None else replace(truth, surface=replace(truth.surface, layout=None))


if __name__ == "__main__":
    main()
