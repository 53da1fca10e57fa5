"use strict";
// The one-line diagram: drawn on a canvas, moved with the mouse, and asked what is under it.
const FINE = 18, LARGE = 45; // pixels per unit below which symbols are simple, and beyond which zooming does not enlarge them

const diagram = {
  view: null, // { scale, x, y }: pixels per unit, offset
  voltage: null, angle: null, // of the instant shown
  lineColor: null, overlay: null, // of the view
  hovered: null, labels: [],

  fit() {
    const d = live.case.diagram, canvas = $("diagram");
    const all = [...d.buses, ...d.machines], pick = (i) => all.map((p) => p[i]);
    const [left, right, top, bottom] = [Math.min(...pick(0)), Math.max(...pick(0)), Math.min(...pick(1)), Math.max(...pick(1))];
    const wide = canvas.clientWidth, width = right - left + 0.6, height = bottom - top + 0.6, room = 80; // of names
    canvas.style.height = `${Math.max(220, Math.min((height / width) * (wide - room) + 50, 0.62 * innerHeight))}px`;
    const scale = Math.min((wide - room) / width, (canvas.clientHeight - 50) / height, 110);
    Object.assign(this, { least: Math.min(3, scale / 2), largest: Math.max(scale, LARGE) });
    this.view = { scale, x: canvas.clientWidth / 2 - (scale * (left + right)) / 2, y: canvas.clientHeight / 2 - (scale * (top + bottom)) / 2 };
    this.labels = placedLabels();
  },

  get size() { // of symbols, pixels per unit
    return Math.min(this.view.scale, this.largest);
  },

  at([x, y]) {
    return [this.view.x + this.view.scale * x, this.view.y + this.view.scale * y];
  },

  draw() {
    if (!live.case) return;
    if (!this.view) this.fit();
    const { context: c } = fitted($("diagram")), d = live.case.diagram, s = this.size;
    const voltage = this.voltage ?? d.voltage, at = (p) => this.at(p);
    const most = Math.max(...live.case.branches.map((b) => b[4]), 1);
    const opened = new Set(live.run?.head.opened ?? []);
    c.lineCap = "round";
    live.case.branches.forEach(([name, , , transformer, mva], k) => {
      const [from, to] = d.ends[k].map(at);
      const width = Math.max(s < FINE ? 0.4 : 1, s * (0.015 + 0.08 * Math.sqrt(mva / most)));
      const halves = this.lineColor?.(name);
      c.setLineDash(opened.has(name) ? [4, 4] : []);
      c.globalAlpha = halves && this.overlay?.stale?.() ? 0.25 : 1;
      for (const [half, [p, q]] of [[from, middleOf(from, to)], [middleOf(from, to), to]].entries()) {
        c.strokeStyle = halves ? halves[half] : name === this.hovered?.line ? ink().a : ink().soft;
        c.lineWidth = halves ? Math.max(s < FINE ? 1.5 : 2.5, 0.07 * s) : width;
        line(c, p, q);
      }
      c.setLineDash([]);
      c.globalAlpha = 1;
      if (transformer && s >= FINE) windings(c, from, to, Math.max(2, 0.085 * s), ink());
    });
    c.lineWidth = 1;
    c.strokeStyle = ink().ink;
    live.case.machines.forEach(([, bus], i) => line(c, at(d.buses[bus]), at(d.machines[i])));
    this.overlay?.under?.(c, at, s);
    machines(c, at, s, this.angle);
    storage(c, at, s);
    d.buses.forEach((p, i) => bus(c, at(p), Math.max(s < FINE ? 1.3 : 2, 0.09 * s), voltageColor(voltage[i]), this.hovered?.bus === i));
    this.overlay?.over?.(c, at, s);
    const place = faultPlace(live.state.fault);
    if (place && live.view !== "modes") flash(c, at(place), Math.max(9, 0.22 * s));
    drawLabels(c, this.labels, at, ink());
  },

  nearest(x, y) { // what is under a point: a bus, a machine or a line
    const d = live.case.diagram, s = this.view.scale, reach = Math.max(9, 0.16 * this.size), on = s < FINE ? 3 : reach;
    const close = (points, within) => {
      let best = within, k = -1;
      points.forEach((p, i) => {
        const far = Math.hypot(this.view.x + s * p[0] - x, this.view.y + s * p[1] - y);
        if (far < best) [best, k] = [far, i];
      });
      return k;
    };
    const point = (within) => {
      const machine = close(d.machines, within), bus = close(d.buses, within);
      if (machine >= 0 && bus < 0) return { machine };
      return bus >= 0 ? { bus } : null;
    };
    let best = reach, found = point(on);
    if (found) return found;
    live.case.branches.forEach(([name, , , transformer], k) => {
      const [a, b] = d.ends[k].map((p) => this.at(p)), far = away(a, b, [x, y]);
      if (far.distance < best) [best, found] = [far.distance, { line: name, along: far.along, row: k, transformer }];
    });
    return found ?? point(reach);
  },

  said(found) { // names and numbers
    const c = live.case, voltage = this.voltage ?? c.diagram.voltage;
    if (!found) return "";
    if (found.bus !== undefined) {
      const [number, name, kv] = c.buses[found.bus];
      const of = c.machines.filter((m) => m[1] === found.bus).map((m) => m[0]);
      return `bus ${number}${name ? ` (${name})` : ""}${kv ? `, ${kv} kV` : ""}: ${voltage[found.bus]?.toFixed(3)} pu` +
        (of.length ? `, machine ${of.join(", ")}` : "");
    }
    if (found.machine !== undefined) {
      const [name, , base] = c.machines[found.machine], angle = this.angle?.[found.machine];
      return `machine ${name}, ${base} MVA${Number.isFinite(angle) ? `: ${angle.toFixed(1)}° from the center of inertia` : ""}`;
    }
    const [name, , , transformer, mva] = c.branches[found.row];
    return `${transformer ? "transformer" : "line"} ${name}: ${mva.toFixed(0)} MVA before the fault` + (this.overlay?.said?.(name) ?? "");
  },

  show(time) { // voltages and angles of the frame at a time, s; null: of the power flow
    const frames = live.run?.arrays;
    if (!frames?.frame || time === null) {
      this.voltage = this.angle = null;
    } else {
      let k = 0;
      while (k < frames.frame.length - 1 && frames.frame[k + 1] <= time + 1e-6) k++;
      this.voltage = frames["frame.voltage"].map((v) => v[k]);
      this.angle = {};
      live.case.rotors.forEach((i, row) => (this.angle[i] = frames["frame.angle"][row][k]));
    }
    const last = frames?.frame?.at(-1);
    $("clock").textContent = time === null || last === undefined ? "" : time < last ? `${time.toFixed(2)} s` : `${last.toFixed(2)} s, end of the run`;
    this.draw();
  },
};

const middleOf = (a, b) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];

function away(a, b, [x, y]) { // distance of a point from a segment, and where along it
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]], square = dx * dx + dy * dy || 1;
  const along = Math.min(1, Math.max(0, ((x - a[0]) * dx + (y - a[1]) * dy) / square));
  return { along, distance: Math.hypot(a[0] + along * dx - x, a[1] + along * dy - y) };
}

function faultPlace(fault) { // where a fault 83 or 7-8@0.4 is
  const c = live.case, [what, share] = parted(String(fault ?? ""));
  const bus = c.buses.findIndex((b) => String(b[0]) === what);
  if (bus >= 0) return c.diagram.buses[bus];
  const row = c.branches.findIndex((b) => b[0] === what);
  if (row < 0) return null;
  const [a, b] = c.diagram.ends[row], f = share === undefined ? 0.5 : +share;
  return [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1])];
}
