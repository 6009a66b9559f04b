// Table and tiles of the sensors of a rig; a tile is the viewer of a sensor, loaded again only when it has restarted.
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
    tiles.append(frame);
  }
  const wanted = sensor.viewer || "about:blank";
  if (frame.getAttribute("src") !== wanted) frame.setAttribute("src", wanted);
  frame.hidden = !sensor.viewer;
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
