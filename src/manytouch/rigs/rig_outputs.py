"""Outputs of the sensors of a rig: each has its own process, so that each has outputs of its own."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from urllib.parse import quote

from scipy.spatial.transform import Rotation

from manytouch.errors import SourceError
from manytouch.rigs.rig_file import Rig, RigSensor
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.registry import check_addresses

ROS = "ros2"


def with_outputs(rig: Rig, urls: Sequence[str]) -> Rig:
    """The rig with outputs for all sensors, and with the poses of its sensors in those of ROS 2.

    `ros2://hand` becomes `ros2://hand/index` and so on. Programs that get other outputs cannot distinguish
    the sensors by their messages: each sensor needs another address in the rig file.

    Args:
        rig: the sensors, with the outputs that the rig file states.
        urls: outputs of all sensors.

    Raises:
        ManytouchError: an address is wrong.
        SourceError: an output is not of ROS 2 and is for all sensors, or two sensors have the same.
    """
    for url in urls:
        address = parse_address(url)
        if address.scheme != ROS:
            sensor = rig.sensors[0].name
            raise SourceError(
                f"{address.text!r} would get the touches of all sensors without their names; only ros2:// is "
                "for a whole rig: give each sensor an address of its own in the rig file, such as "
                f"to = [{address.text!r}] below name = {sensor!r}"
            )
    sensors = tuple(
        replace(
            sensor,
            to=tuple(
                _with_pose(url, rig, sensor)
                for url in (*sensor.to, *(_of_sensor(url, rig, sensor) for url in urls))
            ),
        )
        for sensor in rig.sensors
    )
    all_urls = [url for sensor in sensors for url in sensor.to]
    check_addresses(all_urls)
    twice = [url for url, count in Counter(url.partition("?")[0] for url in all_urls).items() if count > 1]
    if twice:
        raise SourceError(
            f"several sensors send to {', '.join(parse_address(url).text for url in twice)}: each needs an "
            "address of its own"
        )
    return replace(rig, sensors=sensors)


def ros_name(text: str) -> str:
    """A name of a sensor or rig as ROS allows it, with letters, digits and _."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", text)
    return f"_{name}" if name[:1].isdigit() else name


def _of_sensor(url: str, rig: Rig, sensor: RigSensor) -> str:
    """The address for one sensor of an output for all."""
    base, mark, options = url.partition("?")
    scheme, _, name = base.partition("://")
    return f"{scheme}://{name.strip('/') or ros_name(rig.name)}/{ros_name(sensor.name)}{mark}{options}"


def _with_pose(url: str, rig: Rig, sensor: RigSensor) -> str:
    """An output of ROS 2 with the pose of the sensor in rig coordinates, unless it has one."""
    address = parse_address(url)
    if address.scheme != ROS or "parent" in address.options:
        return url
    turn = Rotation.from_matrix(sensor.rotation).as_rotvec()
    pose = ",".join(f"{float(value) + 0.0:.9g}" for value in (*sensor.translation_mm, *turn))
    return f"{url}{'&' if '?' in url else '?'}parent={quote(ros_name(rig.name))}&pose={quote(pose)}"
