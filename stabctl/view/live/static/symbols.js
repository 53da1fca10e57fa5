"use strict";
// The symbols of the diagram.
function line(c, [a, b], [x, y]) {
  c.beginPath();
  c.moveTo(a, b);
  c.lineTo(x, y);
  c.stroke();
}

function bus(c, [x, y], radius, fill, marked) {
  c.beginPath();
  c.arc(x, y, radius, 0, 7);
  c.fillStyle = fill;
  c.fill();
  if (radius < 2 && !marked) return;
  c.lineWidth = marked ? 3 : 1;
  c.strokeStyle = ink().ink;
  c.stroke();
}

function windings(c, a, b, radius, { card, soft }) {
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1, middle = middleOf(a, b);
  c.lineWidth = 1;
  c.strokeStyle = soft;
  c.fillStyle = card;
  for (const side of [-0.7, 0.7]) {
    c.beginPath();
    c.arc(middle[0] + (side * radius * (b[0] - a[0])) / length, middle[1] + (side * radius * (b[1] - a[1])) / length, radius, 0, 7);
    c.fill();
    c.stroke();
  }
}

function machines(c, at, s, angles) { // circles; the hand is the rotor angle from the center of inertia
  const radius = Math.max(s < FINE ? 2.6 : 4, 0.19 * s), lost = new Set((live.run?.head.runs[""]?.lost ?? []).map((r) => live.case.rotors[r]));
  live.case.diagram.machines.forEach((p, i) => {
    const [x, y] = at(p), out = angles && lost.has(i);
    c.beginPath();
    c.arc(x, y, radius, 0, 7);
    c.fillStyle = ink().card;
    c.fill();
    c.lineWidth = out || diagram.hovered?.machine === i ? 2.5 : 1.2;
    c.strokeStyle = out ? ink().b : ink().ink;
    c.stroke();
    const angle = angles?.[i];
    if (Number.isFinite(angle)) {
      const turn = (angle * Math.PI) / 180;
      line(c, [x, y], [x + radius * Math.sin(turn), y - radius * Math.cos(turn)]);
    } else if (radius >= 4) {
      c.beginPath();
      c.arc(x - radius * 0.28, y, radius * 0.28, Math.PI, 0);
      c.arc(x + radius * 0.28, y, radius * 0.28, Math.PI, 0, true);
      c.stroke();
    }
  });
}

function storage(c, at, s) { // squares beside the machines with storage
  const side = Math.max(s < FINE ? 3 : 4, 0.17 * s), { percent, megawatts = {} } = live.state;
  live.case.machines.forEach(([, , , machine], i) => {
    if (stored({ percent, megawatts }) ? !(megawatts[machine] ?? percent) : !live.case.storage.includes(machine)) return;
    const [x, y] = at(live.case.diagram.storage[i]);
    c.fillStyle = live.case.style.colors[2];
    c.fillRect(x - side / 2, y - side / 2, side, side);
    c.lineWidth = 1;
    c.strokeStyle = ink().ink;
    c.strokeRect(x - side / 2, y - side / 2, side, side);
  });
}

function flash(c, [x, y], size) {
  c.beginPath();
  for (const [a, b] of [[0.25, -1], [-0.55, 0.1], [-0.08, 0.1], [-0.25, 1], [0.55, -0.2], [0.1, -0.2]]) {
    c.lineTo(x + size * a, y + size * b);
  }
  c.closePath();
  c.fillStyle = ink().bad;
  c.fill();
  c.lineWidth = 1.5;
  c.strokeStyle = ink().paper;
  c.stroke();
}

function arrow(c, [x, y], [dx, dy], width) {
  const length = Math.hypot(dx, dy) || 1, head = Math.min(length * 0.45, 3.5 * width), [u, v] = [dx / length, dy / length];
  c.lineWidth = width;
  line(c, [x, y], [x + dx - head * u, y + dy - head * v]);
  c.beginPath();
  c.moveTo(x + dx, y + dy);
  c.lineTo(x + dx - head * u - 0.5 * head * v, y + dy - head * v + 0.5 * head * u);
  c.lineTo(x + dx - head * u + 0.5 * head * v, y + dy - head * v - 0.5 * head * u);
  c.fill();
}
