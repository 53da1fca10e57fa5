"use strict";
// Names on the diagram: each where it is free, or left out; hovering shows those.
const LETTERS = 11, LEAST = 24; // pixels, and pixels per unit below which there are no names

function placedLabels() {
  const s = diagram.view.scale, size = diagram.size;
  if (s < LEAST) return [];
  const c = $("diagram").getContext("2d"), d = live.case.diagram, cells = new Map(), found = [];
  const key = (x, y) => `${Math.floor(x / 60)},${Math.floor(y / 60)}`;
  const around = (box, act) => {
    for (let x = box[0]; x < box[2] + 60; x += 60) for (let y = box[1]; y < box[3] + 60; y += 60) {
      const k = key(Math.min(x, box[2]), Math.min(y, box[3]));
      if (act(k)) return true;
    }
    return false;
  };
  const take = (box) => around(box, (k) => void (cells.has(k) ? cells.get(k).push(box) : cells.set(k, [box])));
  const free = (box) => !around(box, (k) => (cells.get(k) ?? []).some((b) => b[0] < box[2] && box[0] < b[2] && b[1] < box[3] && box[1] < b[3]));
  const square = ([x, y], r) => [x - r, y - r, x + r, y + r];
  const pixels = (p) => p.map((v) => v * s);
  d.machines.forEach((p, i) => {
    take(square(pixels(p), 0.2 * size));
    take(square(pixels(d.storage[i]), 0.09 * size));
  });
  d.buses.forEach((p) => take(square(pixels(p), 0.1 * size)));
  for (const ends of d.ends) for (let f = 0.05; f < 1; f += 0.1) {
    const [a, b] = ends;
    take(square(pixels([a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1])]), 1));
  }
  c.font = letters(LETTERS);
  const put = (text, p, radius, soft) => {
    const [x, y] = pixels(p), width = c.measureText(text).width, r = radius * size + 3;
    for (const [u, v] of [[1, -1], [-1, -1], [1, 1], [-1, 1], [1, 0], [-1, 0], [0, -1], [0, 1]]) {
      const reach = u && v ? 0.75 * r : r;
      const left = x + u * reach + ((u - 1) * width) / 2, top = y + v * reach + ((v - 1) * LETTERS) / 2;
      const box = [left, top, left + width, top + LETTERS];
      if (!free(box)) continue;
      take(box);
      found.push({ text, at: p, dx: left - x, dy: top - y + LETTERS / 2, soft });
      return;
    }
  };
  live.case.machines.forEach(([name], i) => put(`G${name}`, d.machines[i], 0.19, false));
  live.case.buses.forEach(([number], i) => put(String(number), d.buses[i], 0.09, true));
  return found;
}

function drawLabels(c, labels, at, { ink: strong, soft, card }) {
  c.font = letters(LETTERS);
  c.textAlign = "left";
  c.textBaseline = "middle";
  c.lineWidth = 3;
  c.strokeStyle = card;
  for (const label of labels) {
    const [x, y] = at(label.at);
    c.strokeText(label.text, x + label.dx, y + label.dy);
    c.fillStyle = label.soft ? soft : strong;
    c.fillText(label.text, x + label.dx, y + label.dy);
  }
}
