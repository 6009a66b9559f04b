// The page: connects the websocket, the panes and the controls.

import { CameraPane } from "./camera.js";
import { DIVERGING, MAPS, styled, table } from "./colours.js";
import { Connection } from "./connection.js";
import { FlatMarks, FlatPane } from "./flat.js";
import { History } from "./history.js";
import { Marks } from "./marks.js";
import { fixed, inLength, length, lengthUnits, niceCeiling, niceStep, units } from "./numbers.js";
import { showContacts, showHealth, showMeasure } from "./panels.js";
import { Pointer } from "./pointer.js";
import { bindSettings, fillSettings, refreshParameters } from "./settings.js";
import { SurfacePane } from "./surface.js";
import { Tour } from "./tour.js";

const find = (id) => document.getElementById(id);
const LAYERS = { depth: "depth", strain: "largest strain", pressure: "pressure" };
const LIVE_CONTROLS = ["run", "tare", "untare", "record", "play", "seek", "speed", "method", "layer", "lift-all", "press-depth", "press-stay", "tare-yes"];
const DECAY = 0.995; // of the colour range from one update to the next

const state = {
  sceneInfo: null, health: null, update: null, measured: null, points: [], connected: false, ended: false,
  layer: "depth", map: "cividis", peak: 0, scale: "", holdRange: false, count: 0, paints: 0, isDirty: false, seeking: false,
};
const pane = surfacePane(find("scene"));
const marks = pane.isFlat ? new FlatMarks(pane) : new Marks(pane);
const camera = new CameraPane(find("camera"));
const history = new History(find("depth-plot"), find("force-plot"));
const connection = new Connection({ onMessage, onUpdate, onState: setConnected });
const send = (type, fields = {}) => connection.send({ type, ...fields });
const tour = new Tour();
const pointer = new Pointer(pane, { send, choose: choosePoint });

/** The surface in three dimensions; without WebGL a flat map, and a note. */
function surfacePane(stage) {
  try {
    return new SurfacePane(stage);
  } catch {
    stage.querySelectorAll(":scope > canvas, .labels").forEach((element) => element.remove());
    document.body.classList.add("flat");
    find("flat-note").hidden = false;
    return new FlatPane(stage);
  }
}

function onMessage(message) {
  const listeners = {
    scene_info: setSceneInfo, health: setHealth, note: ({ text }) => toast(text),
    parameters: ({ parameters }) => { state.parameters = parameters; fillSettings(state); },
    measurement: (found) => { state.measured = found; state.isDirty = true; },
    recent: (found) => { history.recall(found); state.isDirty = true; },
    end: () => { state.ended = true; showState(); enableControls(); },
  };
  listeners[message.kind]?.(message);
}

function onUpdate(update) {
  state.update = update;
  state.count++;
  state.ended = false;
  history.add(update.head);
  if (update.parts.image) camera.show(update.parts.image, () => { state.isDirty = true; });
  state.isDirty = true;
}

function setSceneInfo(sceneInfo) {
  state.sceneInfo = camera.sceneInfo = sceneInfo;
  history.take(sceneInfo);
  if (!lengthUnits(sceneInfo.unit).includes(units.length)) units.length = sceneInfo.unit;
  find("sensor").textContent = sceneInfo.sensor;
  const [wide, high] = sceneInfo.image_px;
  document.documentElement.style.setProperty("--picture", Math.min(Math.max(wide / high, 0.9), 2.2));
  document.body.classList.toggle("tall-picture", wide / high < 1.5);
  pane.build(sceneInfo);
  pane.recolour();
  fillSettings(state);
  state.isDirty = true;
}

function setHealth(health) {
  const before = state.health;
  state.health = health;
  document.body.classList.toggle("recording", health.recording !== null);
  find("record-label").textContent = health.recording ? "Stop recording" : "Record";
  find("record").title = health.recording ? `Recording ${health.recording} (R)` : "Start a recording (R)";
  const resume = health.frame_count === null ? "Resume" : "Play";
  find("run-label").textContent = health.is_running ? "Pause" : resume;
  document.querySelector("#run .glyph").className = `glyph ${health.is_running ? "pause" : "play"}`;
  find("mode").hidden = find("mode").querySelector("[data-mode=press]").hidden = !health.can_press;
  if (health.can_press) tour.begin();
  find("timeline").hidden = health.frame_count === null;
  find("untare").hidden = !health.can_untare;
  find("run").hidden = find("tare").hidden = find("record").hidden = health.frame_count !== null; // the timeline has Play
  if (health.frame_count !== null && !state.seeking) {
    find("seek").max = Math.max(health.frame_count - 1, 0);
    showFrame();
    find("play").textContent = health.is_running ? "Pause" : "Play";
  }
  const note = health.notes.at(-1);
  if (before && note && note !== before.notes.at(-1)) toast(note);
  if (!before || before.method !== health.method || before.methods.length !== health.methods.length) fillSettings(state);
  else if (find("settings").open) refreshParameters(state);
  showState();
  state.isDirty = true;
}

/** The frame that is drawn, or that was sought, on the timeline; its time once it is drawn. */
function showFrame() {
  const { health, update } = state, drawn = update?.head;
  if (health?.frame_count == null || state.seeking) return;
  const frame = (health.is_running ? drawn?.frame : null) ?? health.frame ?? 0, time_s = drawn?.frame === frame ? drawn.time_s : null;
  find("seek").value = frame;
  find("seek-label").textContent = `frame ${frame} of ${health.frame_count - 1}${time_s == null ? "" : `, ${fixed(time_s, 2)} s`}`;
}

function setConnected(is, reason = "") {
  Object.assign(state, { connected: is, reason });
  if (is) { state.ended = false; show(); if (state.points.length) sendPoints(); }
  showState();
  enableControls();
}

function showState() {
  const { health, connected, ended } = state, status = state.update?.head.status;
  const [kind, label] = !connected ? [ended ? "" : "bad", ended ? "session ended" : state.reason || "not connected, retrying"]
    : !health ? ["", "waiting"]
    : health.source !== "ok" ? ["bad", health.source]
    : !health.is_running && isAtEnd(health) ? ["", "at the end"]
    : !health.is_running ? ["warn", "paused"]
    : !state.update ? ["", health.frames ? "loading the picture" : "starting: preparing, compiling"]
    : status !== "ok" ? ["warn", status.replaceAll("_", " ")]
    : ["good", health.recording ? `recording ${health.recording}` : health.frame_count === null ? "live" : "playback"];
  find("state").className = `state ${kind}`;
  find("state-label").textContent = label;
}

const isAtEnd = ({ frame, frame_count }) => frame_count !== null && frame >= frame_count - 1;

function toast(text) {
  const box = find("toast");
  box.textContent = text; box.hidden = false;
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => { box.hidden = true; }, 4000);
}

// Drawing: at most once per frame of the display, and only when something has changed.

function paint() {
  requestAnimationFrame(paint);
  if (state.isDirty && state.sceneInfo) {
    state.isDirty = false;
    draw();
  }
  if (pane.render()) state.paints++;
}

function draw() {
  find("qualitative").hidden = !state.update?.head.is_qualitative;
  const { update, health } = state, head = update?.head, showComparison = find("show-comparison").checked;
  const name = head?.comparison?.name ?? "";
  find("comparison-toggle").hidden = !name;
  find("comparison-name").textContent = name;
  find("camera-empty").hidden = Boolean(camera.picture);
  const contacts = head?.contacts ?? [], others = name && showComparison ? head.comparison.contacts : [];
  if (update) drawSurface(update);
  marks.update(contacts, others, state.points, state.measured);
  camera.draw(update?.parts.markers, contacts, others);
  showContacts(contacts, others, { name, reach: pane.reach, head, pinned: history.pinned });
  showMeasure(state.points, state.measured);
  history.draw(showComparison, health?.frame_count != null);
  if (health) showHealth(health, head);
  showFrame();
  showState();
}

function drawSurface({ head, parts }) {
  for (const option of find("layer").options) option.disabled = option.value !== "depth" && option.value !== state.layer && !head.layers.includes(option.value);
  const value = parts[state.layer] ?? parts.depth, layer = parts[state.layer] ? state.layer : "depth";
  const isDifference = layer === "difference", percent = layer === "strain" ? 100 : 1;
  let most = 0;
  for (let i = 0; i < value.length; i++) if (value[i] > most || (isDifference && -value[i] > most)) most = Math.abs(value[i]);
  most *= percent;
  const least = layer === "strain" ? 1 : layer === "pressure" ? 1 : isDifference ? 0.1 : 0.5;
  state.peak = state.holdRange ? state.peak || most : Math.max(most, least, state.peak * DECAY);
  const high = niceCeiling(state.peak), low = isDifference ? -high : 0, contour = niceStep(high, 6);
  pane.update(parts.depth, percent === 1 ? value : value.map((v) => v * percent), low, high, contour, parts.support);
  const isLength = layer === "depth" || isDifference;
  const unit = isLength ? units.length : layer === "strain" ? "%" : "kPa";
  drawScale(isDifference ? DIVERGING : state.map, low, high, contour, `${isDifference ? `estimate − ${head.comparison.name}` : LAYERS[layer]} (${unit})`, isLength ? inLength : (v) => v);
}

function drawScale(map, low, high, step, title, convert) {
  const now = `${map} ${low} ${high} ${title}`;
  if (state.scale === now) return;
  if (state.scale.split(" ")[0] !== map) pane.setMap(map);
  state.scale = now;
  find("scale-title").textContent = title;
  const context = find("ramp").getContext("2d"), bytes = table(map), image = context.createImageData(1, 256);
  for (let i = 0; i < 256; i++) image.data.set(bytes.subarray(4 * (255 - i), 4 * (255 - i) + 4), 4 * i);
  context.putImageData(image, 0, 0);
  const ticks = [];
  const digits = Math.max(0, -Math.floor(Math.log10(convert(step)) + 1e-9));
  for (let at = Math.ceil(low / step) * step; at <= high * 1.0001; at += step) {
    const tick = document.createElement("span");
    tick.style.setProperty("--share", (at - low) / (high - low));
    tick.textContent = fixed(convert(at), digits);
    ticks.push(tick);
  }
  find("scale-ticks").replaceChildren(...ticks);
  find("scale").hidden = false;
}

// Actions of the user.

function show() { send("show", { layer: state.layer, image: true }); }
function sendPoints() { send("measure", { point_mm: state.points }); }

function choosePoint(point) {
  state.points = state.points.length === 1 ? [...state.points, point] : [point];
  state.measured = null;
  sendPoints();
  state.isDirty = true;
}

function clearPoints() { state.points = []; state.measured = null; sendPoints(); state.isDirty = true; }

function setLayer(layer) {
  if (find("layer").disabled || find("layer").querySelector(`[value=${layer}]`).disabled) return;
  state.layer = find("layer").value = layer;
  state.peak = 0; state.scale = "";
  show();
  state.isDirty = true;
}

function setMap(map) {
  state.map = find("map").value = map;
  localStorage.setItem("map", map);
  state.isDirty = true;
}

function setStretch(value) {
  pane.stretch = Math.min(Math.max(value, 1), 20);
  find("stretch").value = pane.stretch;
  find("stretch-label").textContent = `×${pane.stretch}`;
  state.isDirty = true;
}

function flipSide() {
  pane.setSide(-pane.side);
  find("side").textContent = pane.side > 0 ? "show finger side" : "show camera side";
  state.isDirty = true;
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  find("theme").title = `Use the ${theme === "dark" ? "light" : "dark"} theme (D)`;
  localStorage.setItem("theme", theme);
  pane.recolour();
  state.isDirty = true;
}

function flipTheme() { setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"); }
function flipRun() { send(state.health?.is_running ? "stop" : "start"); }
function flipRecord() { if (!find("record").hidden) send(state.health?.recording ? "stop_recording" : "record"); }
function flip(id) { const box = find(id); box.checked = !box.checked; box.dispatchEvent(new Event("change")); }
function seek(frame) { if (find("seek").disabled) return; find("seek").value = frame; send("seek", { frame: Math.max(0, Math.round(frame)) }); }

/** Tare at once if nothing touches the sheet; otherwise after a question. */
function requestTare() {
  if (find("tare").disabled || find("tare").hidden) return;
  const count = state.update?.head.contacts.length ?? 0;
  if (!count) { send("tare"); return; }
  find("tare-text").textContent = `${count === 1 ? "1 contact touches" : `${count} contacts touch`} the sheet now. Its present shape would become the rest position: `
    + "the contacts disappear, and later depths are measured from there. Undo tare restores the present rest position.";
  find("tare-question").showModal();
}

/** Follow one contact: only its history is plotted and saved; null: all. */
function pin(id) {
  history.pinned = id;
  find("unpin").hidden = id === null;
  find("plotted").textContent = id === null ? "last 20 s" : `contact #${id}, last 20 s`;
  state.isDirty = true;
}

function saveTable() {
  const blob = new Blob([history.log.csv(history.pinned, state.sceneInfo?.unit ?? "mm")], { type: "text/csv" });
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: history.pinned === null ? "contacts.csv" : `contact-${history.pinned}.csv` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function enlarge(name) {
  for (const card of document.querySelectorAll(".card")) {
    const isBig = name !== null && card.classList.contains(name) && !card.classList.contains("big");
    card.classList.toggle("big", isBig);
    const button = card.querySelector(".enlarge");
    button.textContent = isBig ? "×" : "⤢"; button.title = isBig ? "Reduce this pane (Esc)" : "Enlarge this pane";
  }
  state.isDirty = true;
}

function escape() {
  if (document.querySelector(".card.big")) enlarge(null);
  else if (history.pinned !== null) pin(null);
  else clearPoints();
}

/** What sends requests to the session is disabled while there is none. */
function enableControls() {
  const isOver = !state.connected || state.ended;
  for (const id of LIVE_CONTROLS) find(id).disabled = isOver;
  for (const input of find("parameters").querySelectorAll("input, select, button")) input.disabled = isOver;
  find("mode").querySelector("[data-mode=press]").disabled = isOver;
  pointer?.setOver(isOver);
}

function bind() {
  const click = { run: flipRun, tare: requestTare, untare: () => send("untare"), record: flipRecord, theme: flipTheme, side: flipSide, play: flipRun,
    home: () => pane.home(), "measure-clear": clearPoints, "lift-all": () => pointer.liftAll(),
    "tare-yes": () => { find("tare-question").close(); send("tare"); }, "tare-no": () => find("tare-question").close(),
    download: saveTable, unpin: () => pin(null),
    "settings-open": () => find("settings").showModal(), "help-open": () => find("help").showModal() };
  for (const [id, act] of Object.entries(click)) find(id).addEventListener("click", act);
  for (const close of document.querySelectorAll("dialog .close")) close.addEventListener("click", () => close.closest("dialog").close());
  for (const button of find("mode").children) button.addEventListener("click", () => pointer.setMode(button.dataset.mode));
  find("map").replaceChildren(...MAPS.map((name) => new Option(name, name)));
  const change = {
    layer: ({ value }) => setLayer(value), map: ({ value }) => setMap(value),
    "show-ids": ({ checked }) => { camera.options.ids = checked; }, "show-arrows": ({ checked }) => { camera.options.arrows = checked; },
    "arrow-gain": ({ value }) => { camera.options.gain = Number(value); }, "show-comparison": () => {},
    speed: ({ value }) => send("play", { speed: Number(value) }), seek: ({ value }) => { state.seeking = false; seek(Number(value)); },
  };
  for (const [id, act] of Object.entries(change)) find(id).addEventListener("change", ({ target }) => { act(target); state.isDirty = true; });
  find("stretch").addEventListener("input", ({ target }) => setStretch(Number(target.value)));
  find("seek").addEventListener("input", ({ target }) => { state.seeking = true; seek(Number(target.value)); });
  for (const button of document.querySelectorAll(".enlarge")) button.addEventListener("click", () => enlarge(button.dataset.pane));
  find("camera").addEventListener("dblclick", () => enlarge("camera"));
  find("camera").addEventListener("pointermove", () => { state.isDirty = true; });
  find("contacts").addEventListener("click", ({ target }) => {
    const id = target.closest("tr")?.dataset.id;
    if (id !== undefined) pin(Number(id) === history.pinned ? null : Number(id));
  });
  bindSettings(state, send, () => { state.scale = ""; state.isDirty = true; pointer.showDepth(); });
  addEventListener("keydown", onKey);
  addEventListener("resize", () => { state.isDirty = true; });
}

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
  const isByKeyboard = event.target.matches("button:focus-visible");
  if (isByKeyboard && event.key === " ") return;  // it presses the button
  const isOpen = document.querySelector("dialog[open]");
  if (isOpen && event.key !== "?") return;
  const step = (by) => state.health?.frame_count != null && seek((state.health.frame ?? 0) + by);
  const keys = {
    " ": flipRun, z: requestTare, r: flipRecord, i: () => flip("show-ids"), a: () => flip("show-arrows"), v: () => pane.home(),
    f: flipSide, c: () => setMap(MAPS[(MAPS.indexOf(state.map) + 1) % MAPS.length]), d: flipTheme, m: () => pointer.setMode(pointer.mode === "view" ? "press" : "view"),
    s: () => find("settings").showModal(), "?": () => (isOpen ? find("help").close() : find("help").showModal()), Escape: escape,
    "+": () => setStretch(pane.stretch + 1), "=": () => setStretch(pane.stretch + 1), "-": () => setStretch(pane.stretch - 1),
    1: () => setLayer("depth"), 2: () => setLayer("strain"), 3: () => setLayer("pressure"), 4: () => setLayer("difference"),
    ArrowLeft: () => step(-1), ArrowRight: () => step(1),
  };
  const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!act) return;
  event.preventDefault();
  if (event.target.tagName === "BUTTON" && !isByKeyboard) event.target.blur();
  act();
}

bind();
setTheme(localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
setMap(MAPS.includes(localStorage.getItem("map")) ? localStorage.getItem("map") : "cividis");
setStretch(5);
requestAnimationFrame(paint);

/** For the browser console and for tests: what is shown now, and where. */
window.manytouch = { state, pane, pointer, length, styled };
