"""A Gymnasium environment in which a MuJoCo body presses the sheet: push with a given force, by touch alone.

    pip install manytouch gymnasium mujoco
    python examples/press_with_mujoco.py

A finger with a ball at its end is moved by three position servos in MuJoCo. The sheet is not part of the
MuJoCo model: `manytouch.simulate_contacts` computes its markers and the force on the ball, which acts on the
body in the next steps. Observed are the displacements of all markers, the position given to the servos,
and the requested force. An action is a velocity of that position; the reward is the negative error of the
normal force.
"""

from typing import Any, ClassVar

import gymnasium
import mujoco
import numpy as np

import manytouch
from manytouch.simulation.demo_sensor import demo_sensor

RADIUS_MM = 6.0
REACH_MM = np.array(
    [35.0, 20.0, 8.0]
)  # of the finger, from the middle of the sheet, z around the touched face
DEEPEST_MM = 6.0
STEP_MM = 0.5  # by which a component of an action of 1 moves the servos in a step
CONTROL_S, SUBSTEPS = 0.01, 5
EPISODE_STEPS = 200
NEWTONS_PER_MM = 0.016  # about, of the depths of all markers of the demo sheet together
SCENE = f"""
<mujoco>
  <option timestep="{CONTROL_S / SUBSTEPS}" integrator="implicitfast"/>
  <default>
    <joint type="slide" damping="60" armature="0.05"/>
    <position kp="4000"/>
  </default>
  <worldbody>
    <light pos="0 0 0.4"/>
    <geom name="sheet" type="box" size="0.06 0.04 0.0015" pos="0 0 -0.0015" rgba="0.2 0.2 0.2 1"
          contype="0" conaffinity="0"/>
    <body name="finger" pos="0 0 {1e-3 * RADIUS_MM}" gravcomp="1">
      <joint name="x" axis="1 0 0"/>
      <joint name="y" axis="0 1 0"/>
      <joint name="z" axis="0 0 1"/>
      <geom type="sphere" size="{1e-3 * RADIUS_MM}" mass="0.05" rgba="0.8 0.5 0.3 1"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.05" size="0.004" mass="0.1" rgba="0.8 0.5 0.3 1"/>
    </body>
  </worldbody>
  <actuator>
    <position joint="x"/>
    <position joint="y"/>
    <position joint="z"/>
  </actuator>
</mujoco>
"""


class PressEnv(gymnasium.Env):
    """Press the sheet with a requested normal force; MuJoCo's frame is the sheet frame, in m."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": round(1.0 / CONTROL_S)}

    def __init__(self, sensor: manytouch.Sensor | None = None, render_mode: str | None = None) -> None:
        self.sensor = demo_sensor(1280) if sensor is None else sensor
        assert self.sensor.layout is not None
        self.render_mode = render_mode
        self.model = mujoco.MjModel.from_xml_string(SCENE)
        self.data = mujoco.MjData(self.model)
        self._finger = self.model.body("finger").id
        markers = len(self.sensor.layout.rest_mm)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = gymnasium.spaces.Dict(
            {
                "markers_mm": gymnasium.spaces.Box(-30.0, 30.0, (markers, 3), np.float32),
                "servo_mm": gymnasium.spaces.Box(-40.0, 40.0, (3,), np.float32),
                "wanted_N": gymnasium.spaces.Box(0.0, 10.0, (1,), np.float32),
            }
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict]:
        """The finger is 2 mm above a random place."""
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        self._wanted_N = float(self.np_random.uniform(1.0, 6.0))
        self._servo_mm = np.append(self.np_random.uniform(-0.8, 0.8, 2) * REACH_MM[:2], 2.0)
        self._steps = 0
        self.data.qpos[:] = self.data.ctrl[:] = 1e-3 * self._servo_mm
        mujoco.mj_forward(self.model, self.data)
        self._touch()
        return self._observation(), self._info()

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict]:
        """Move the servos, then let body and sheet act on each other for 10 ms."""
        self._servo_mm = np.clip(self._servo_mm + STEP_MM * np.clip(action, -1.0, 1.0), -REACH_MM, REACH_MM)
        self.data.ctrl[:] = 1e-3 * self._servo_mm
        self.data.xfrc_applied[self._finger, :3] = -self._force_N
        mujoco.mj_step(self.model, self.data, SUBSTEPS)
        self._touch()
        self._steps += 1
        reward = -abs(self._normal_N - self._wanted_N)
        return self._observation(), reward, False, self._steps >= EPISODE_STEPS, self._info()

    def render(self) -> np.ndarray:
        """What the camera under the sheet sees, (h, w, 3)."""
        image = manytouch.simulate_contacts(self.sensor, [self._ball], output="image", seed=self._steps)
        return np.repeat(image[:, :, None], 3, axis=2)

    @property
    def _normal_N(self) -> float:
        return -float(self._force_N[2])

    def _touch(self) -> None:
        """Markers, and the force of the ball on the sheet, at the present pose of the body."""
        x_mm, y_mm, z_mm = (1e3 * self.data.qpos).tolist()
        depth_mm = min(-z_mm, DEEPEST_MM)
        self._ball = manytouch.Ball(x_mm=x_mm, y_mm=y_mm, depth_mm=depth_mm, radius_mm=RADIUS_MM)
        reading = manytouch.simulate_contacts(self.sensor, [self._ball], output="reading")
        self._markers_mm = reading.surface.displacement_mm.astype(np.float32)
        forces_N = [contact.force_N for contact in reading.contacts.touching]
        self._force_N = np.sum(forces_N, axis=0) if forces_N else np.zeros(3)

    def _observation(self) -> dict[str, np.ndarray]:
        return {
            "markers_mm": self._markers_mm,
            "servo_mm": self._servo_mm.astype(np.float32),
            "wanted_N": np.array([self._wanted_N], dtype=np.float32),
        }

    def _info(self) -> dict[str, float]:
        return {"normal_force_N": self._normal_N, "depth_mm": self._ball.depth_mm}


def press_by_touch(observation: dict[str, np.ndarray]) -> np.ndarray:
    """A simple controller: deeper until the markers have moved as far as by the requested force."""
    depths_mm = -observation["markers_mm"][:, 2]
    missing_N = float(observation["wanted_N"][0]) - NEWTONS_PER_MM * float(depths_mm.sum())
    return np.array([0.0, 0.0, np.clip(-0.3 * missing_N, -1.0, 1.0)], dtype=np.float32)


def main() -> float:
    """Episodes of the controller; the mean error of the normal force at their ends, in N."""
    env, errors_N = PressEnv(), []
    for seed in range(3):
        observation, info = env.reset(seed=seed)
        for _ in range(80):
            observation, _, _, _, info = env.step(press_by_touch(observation))
        wanted_N = float(observation["wanted_N"][0])
        errors_N.append(abs(info["normal_force_N"] - wanted_N))
        pressed_N, depth_mm = info["normal_force_N"], info["depth_mm"]
        print(f"requested {wanted_N:.2f} N, pressed {pressed_N:.2f} N, {depth_mm:.2f} mm deep")
    return float(np.mean(errors_N))


if __name__ == "__main__":
    main()
