"use strict";
// What all parts of the page share: the case, the state, small tools.
const live = { case: null, state: {}, view: "time", run: null, recorded: window.RECORDED || null, timing: [], answers: 0 };

const $ = (id) => document.getElementById(id);

function element(kind, properties = {}, ...children) {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
}

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

let inks = null; // colors of the page as it is, light or dark
function parted(fault) { // a circuit and the position along it; its identifier may hold an @
  const at = fault.lastIndexOf("@");
  return at < 0 ? [fault] : [fault.slice(0, at), fault.slice(at + 1)];
}

function ink() {
  return (inks ??= Object.fromEntries(
    ["ink", "soft", "paper", "card", "line", "a", "b", "c", "d", "e", "many", "shade", "bad", "good", "font"].map((n) => [n, color(n)]),
  ));
}

// What results depend on besides the case and the fault: the load level, storage and its law.
function settings({ level, percent, megawatts, store, law, deadband, gain, delay } = live.state) {
  if (!equipped({ percent, megawatts })) return { level };
  const acting = tuned({ percent, megawatts, law }) ? { deadband, delay, ...(law === "feedback" && { gain }) } : {};
  return { level, ...(stored({ percent, megawatts }) && { percent, megawatts, store }), law, ...acting };
}

function inWords({ level, percent = 0, megawatts = {}, store, law, deadband, gain, delay }) {
  const own = Object.entries(megawatts).map(([m, mw]) => `, ${mw} MW at machine ${m}`).join("");
  const devices = law && !stored({ percent, megawatts }) ? "the case's own storage" : `${percent} % storage${own}`;
  const parts = [devices, store !== "ideal" && store, law, deadband !== undefined && `deadband ${deadband} mHz`,
    gain !== undefined && `gain ${gain} pu/(rad/s)`, delay && `delay ${delay} cycles`, `load level ${level} %`];
  return parts.filter(Boolean).join(", ");
}

const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);

function gray(stale, ...parts) { // what is shown belongs to other settings, or is being replaced
  for (const part of parts) part.classList.toggle("stale", stale);
}

const letters = (size) => `${size}px ${ink().font}`;

function mixed(stops, value) { // color between stops [value, "#rrggbb"]
  if (!Number.isFinite(value)) return ink().line;
  let k = 1;
  while (k < stops.length - 1 && value > stops[k][0]) k++;
  const [[low, from], [high, to]] = [stops[k - 1], stops[k]];
  const share = Math.min(1, Math.max(0, (value - low) / (high - low || 1)));
  const part = (text, i) => parseInt(text.slice(1 + 2 * i, 3 + 2 * i), 16);
  return `rgb(${[0, 1, 2].map((i) => Math.round(part(from, i) + share * (part(to, i) - part(from, i)))).join()})`;
}

const voltageColor = (v) => mixed(live.case.style.voltages, v);

function fitted(canvas) { // context in CSS pixels
  const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

function unpack(buffer) { // see packing.py
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  const arrays = {};
  for (const [name, columns, rows, middle, step] of head.arrays) {
    if (!columns && !step) {
      arrays[name] = new Float32Array(buffer, at, rows);
      at += 4 * rows;
      continue;
    }
    arrays[name] = [];
    for (let k = 0; k < columns; k++) {
      const numbers = new Int16Array(buffer, at, rows), values = new Array(rows);
      for (let i = 0; i < rows; i++) values[i] = numbers[i] === -32768 ? null : middle + step * numbers[i];
      arrays[name].push(values);
      at += 2 * rows;
    }
    at += -at & 3;
  }
  return { head, arrays };
}
