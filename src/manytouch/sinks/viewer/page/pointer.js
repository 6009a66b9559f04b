// Mouse, pen and touch on the surface: rotate and measure, or press the simulated sheet.

import { THREE } from "./three.js";
import { length, units } from "./numbers.js";

const STILL_PX = 5;
const HINTS = {
  view: "drag to rotate · wheel to zoom · right drag to pan · click to measure",
  press: "press and drag with the mouse or your fingers · wheel changes the depth · Ctrl + wheel zooms · right drag to rotate",
};

const FLAT_HINTS = { view: "click to measure", press: "press and drag · wheel changes the depth" };
const MEASURE_HINT = /( · )?click to measure/;

export class Pointer {
  constructor(pane, { send, choose }) {
    Object.assign(this, { pane, send, choose, mode: "view", isOver: false, down: null, fingers: new Map(), last: 0, stayed: [] });
    const canvas = pane.renderer.domElement, find = (id) => document.getElementById(id);
    Object.assign(this, { tools: find("press-tools"), depth: find("press-depth"), stay: find("press-stay"), hint: find("hint") });
    // In the capture phase on the stage, so that a press does not rotate the view as well.
    pane.stage.addEventListener("pointerdown", (event) => event.target === canvas && this.onDown(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.onMove(event));
    for (const kind of ["pointerup", "pointercancel"]) addEventListener(kind, (event) => this.onUp(event));
    pane.stage.addEventListener("wheel", (event) => this.onWheel(event), { capture: true, passive: false });
    this.depth.addEventListener("input", () => this.showDepth());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    addEventListener("pagehide", () => this.liftAll());
    this.setMode("view");
  }

  setMode(mode) {
    const button = document.querySelector(`[data-mode=${mode}]`);
    if (button.hidden || button.disabled) return;
    this.mode = mode;
    for (const other of button.parentElement.children) other.classList.toggle("on", other === button);
    this.tools.hidden = mode !== "press";
    this.pane.stage.classList.toggle("press", mode === "press");
    this.showHint();
    const { controls } = this.pane;
    controls.mouseButtons = mode === "press" ? { LEFT: null, MIDDLE: THREE.MOUSE.PAN, RIGHT: THREE.MOUSE.ROTATE }
      : { LEFT: THREE.MOUSE.ROTATE, MIDDLE: THREE.MOUSE.DOLLY, RIGHT: THREE.MOUSE.PAN };
    this.showDepth();
  }

  /** After the end the view can still be turned; there is no session that measures or is pressed. */
  setOver(isOver) {
    this.isOver = isOver;
    if (isOver && this.mode === "press") this.setMode("view");
    this.showHint();
  }

  showHint() {
    const hint = (this.pane.isFlat ? FLAT_HINTS : HINTS)[this.mode];
    this.hint.textContent = this.isOver ? hint.replace(MEASURE_HINT, "") : hint;
  }

  showDepth() { document.getElementById("press-depth-label").textContent = `${length(Number(this.depth.value))} ${units.length}`; }

  onDown(event) {
    if (event.button !== 0) return;
    if (this.mode === "view") { this.down = event.isPrimary ? [event.clientX, event.clientY] : null; return; }
    const place = this.pane.pick(event);
    if (!place) return;
    event.stopPropagation();
    this.pane.renderer.domElement.setPointerCapture(event.pointerId);
    const finger = this.last = (this.last + 1) % 1000;
    this.fingers.set(event.pointerId, { finger, place });
    this.press(finger, place);
  }

  onMove(event) {
    const held = this.fingers.get(event.pointerId);
    if (!held) return;
    const place = this.pane.pick(event);
    if (!place) return;
    held.place = place;
    this.press(held.finger, place);
  }

  onUp(event) {
    const held = this.fingers.get(event.pointerId);
    if (held) {
      this.fingers.delete(event.pointerId);
      if (this.stay.checked) this.stayed.push(held.finger); else this.send("release", { finger: held.finger });
    }
    if (!this.down || this.mode !== "view" || this.isOver || event.type !== "pointerup") return;
    const [x, y] = this.down;
    this.down = null;
    if (Math.hypot(event.clientX - x, event.clientY - y) > STILL_PX || event.target !== this.pane.renderer.domElement) return;
    const place = this.pane.pick(event);
    if (place) this.choose(place);
  }

  onWheel(event) {
    if (this.mode !== "press" || event.ctrlKey) return;
    event.preventDefault(); event.stopPropagation();
    this.depth.value = Number(this.depth.value) - Math.sign(event.deltaY) * 0.2;
    this.showDepth();
    for (const { finger, place } of this.fingers.values()) this.press(finger, place);
  }

  press(finger, [x_mm, y_mm]) { this.send("press", { finger, x_mm, y_mm, depth_mm: Number(this.depth.value) }); }

  liftAll() {
    for (const finger of [...this.stayed, ...[...this.fingers.values()].map((held) => held.finger)]) this.send("release", { finger });
    this.stayed = []; this.fingers.clear();
  }
}
