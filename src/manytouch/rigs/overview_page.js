// Table and tiles of the sensors of a rig; a tile is the viewer of a sensor below its name in the rig, loaded again only when it has restarted.
"use strict";

const table = document.getElementById("sensors");
const tiles = document.getElementById("tiles");
const frames = new Map();

function cell(content) {
  const made = document.createElement("td");
  made.append(content);
  return made;
}

function link(sensor) {
  if (!sensor.viewer) return sensor.name;
  const made = document.createElement("a");
  made.href = sensor.viewer;
  made.target = "_blank";
  made.textContent = sensor.name;
  return made;
}

function row(sensor) {
  const made = document.createElement("tr");
  const numbers = [sensor.state, sensor.fps, sensor.frames, sensor.dropped, sensor.restarts];
  made.append(cell(link(sensor)), ...numbers.map((value) => cell(String(value))));
  return made;
}

function tile(sensor) {
  let frame = frames.get(sensor.name);
  if (!frame) {
    frame = document.createElement("iframe");
    frame.title = `viewer of ${sensor.name}`;
    frames.set(sensor.name, frame);
    const made = document.createElement("section");
    made.append(document.createElement("h2"), frame);
    tiles.append(made);
  }
  const wanted = sensor.viewer || "about:blank", whole = frame.parentElement;
  if (frame.getAttribute("src") !== wanted) frame.setAttribute("src", wanted);
  whole.hidden = !sensor.viewer;
  const small = document.createElement("small");
  small.textContent = sensor.sensor_name ?? "";
  whole.firstElementChild.replaceChildren(sensor.name, " ", small);
}

async function update() {
  try {
    const sensors = await (await fetch("/states")).json();
    table.replaceChildren(...sensors.map(row));
    sensors.forEach(tile);
  } catch {
    document.body.classList.add("over");
  }
}

update();
setInterval(update, 2000);
