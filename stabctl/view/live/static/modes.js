"use strict";
// The Modes view: eigenvalues, damping rays, shape on the diagram, participation, root locus while a gain moves.
const modes = {
  found: null, chosen: 0, trail: [], gain: "", factor: 1,
  asking: null,

  build() {
    this.canvas = element("canvas", { id: "map" });
    this.canvas.style.height = "340px";
    this.plane = new Plane(this.canvas, "real part (1/s)", "frequency (Hz)");
    const gains = element("select", { id: "gain-of", ariaLabel: "Gain of all machines" },
      ...live.case.gains.map((g) => element("option", { value: g, textContent: g })));
    const slider = element("input", { type: "range", id: "gain-factor", min: 0, max: 3, step: 0.05, value: 1 });
    const shown = element("output", { id: "gain-shown", textContent: "× 1" });
    const control = element("div", { className: "control" }, element("label", { htmlFor: "gain-factor" }, "gain of all machines ", shown), gains, slider);
    this.said = element("p", { className: "soft", id: "modes-text" });
    this.left = element("p", { className: "warning", id: "modes-left-out" });
    this.list = element("div", { className: "scroll tall" });
    this.shares = element("div");
    $("modes").append(this.canvas, control, this.said, this.left, this.list, this.shares);
    gains.onchange = () => ((this.trail = []), this.ask(gains.value, +slider.value));
    slider.oninput = () => {
      shown.textContent = `× ${(+slider.value).toFixed(2)}`;
      this.ask(gains.value, +slider.value);
    };
    control.hidden = !live.case.gains.length || live.recorded;
    this.canvas.onclick = (event) => this.click(event);
    this.asking = new Asking("modes", (found, _, { level }) => this.told({ ...found, level }), (stale) => this.faded(stale));
  },

  open() {
    if (!this.canvas) this.build();
    if (live.recorded) this.found ?? (live.recorded.results.modes && this.told(live.recorded.results.modes));
    else if (!this.found || this.found.level !== live.state.level) this.ask(this.gain || (live.case.gains[0] ?? ""), this.factor);
    this.marked();
    this.draw();
  },

  ask(gain, factor) {
    const { states } = live.case, many = states > 2000;
    if (many || !this.found) this.said.textContent = `computing the modes${many ? ` of 0.1 to 2.5 Hz, which takes a while with ${states} states` : ""} …`;
    this.asking.ask({ level: live.state.level, gain, factor });
  },

  faded(stale) {
    gray(stale, this.canvas, this.list, this.shares);
  },

  marked() {
    this.faded(!!live.recorded && !!this.found && this.found.level !== live.state.level);
    this.left.textContent = equipped(live.state) || live.case.controllers.length
      ? "Storage, its law and controllers are left out: these are the modes of the machines and their own controls." : "";
  },

  failed(text) { // no equilibrium with these settings, so nothing is shown
    this.found = null;
    this.said.textContent = text;
    this.list.replaceChildren();
    this.shares.replaceChildren();
    fitted(this.canvas);
    diagram.overlay = null;
    diagram.draw();
    copyable();
  },

  told(found) {
    if (found.error) return this.failed(found.error);
    const before = this.found?.modes[this.chosen];
    if (found.gain !== this.gain) this.trail = [];
    Object.assign(this, { found, gain: found.gain, factor: found.factor });
    this.trail.push(found.modes.map((m) => [m[0], m[1]]));
    if (this.trail.length > 80) this.trail.shift();
    const near = (m) => Math.hypot(m[0] - before[0], 6.28 * (m[1] - before[1]));
    const moving = found.modes.map((m, k) => k).filter((k) => found.modes[k][1] > 0);
    const least = (value) => (a, b) => (value(found.modes[b]) < value(found.modes[a]) ? b : a);
    if (before) this.chosen = found.modes.map((_, k) => k).reduce(least(near));
    else this.chosen = moving.length ? moving.reduce(least((m) => m[2])) : 0;
    this.said.textContent = found.text + (found.level === 100 ? "" : ` Load level ${found.level} %.`);
    copyable();
    this.fill();
    this.draw();
  },

  draw() {
    if (live.view !== "modes" || !this.found) return;
    const swings = this.found.modes.filter((m) => m[3]), all = [...(swings.length ? swings : this.found.modes), this.found.modes[this.chosen]];
    const left = Math.min(-1, 1.25 * Math.min(...all.map((m) => m[0]))), top = 1.2 * Math.max(0.5, ...all.map((m) => m[1]));
    const right = Math.max(-0.1 * left, ...this.found.modes.map((m) => 1.3 * m[0]));
    const one = this.found.modes[this.chosen];
    this.canvas.setAttribute("aria-label", `${this.found.modes.length} eigenvalues; chosen: ${one[4]}, ${one[1].toFixed(3)} Hz, damping ratio ${(100 * one[2]).toFixed(1)} %`);
    const c = this.plane.open([left, right], [0, top]), p = this.plane, gray = ink().soft;
    for (const ratio of [0.05, 0.1, 0.2]) {
      const slope = Math.sqrt(1 - ratio ** 2) / ratio / (2 * Math.PI), end = Math.max(left, -top / slope);
      p.curve([0, end], [0, -end * slope], gray, 1, [5, 4]);
      p.text(`${100 * ratio} %`, p.x(0.93 * end), p.y(-0.93 * end * slope), "center");
    }
    p.curve([0, 0], [0, top], gray, 1.2);
    for (const rows of this.trail.slice(0, -1)) for (const [x, y] of rows) p.dot(x, y, 1.5, ink().c);
    this.found.modes.forEach((m, k) => {
      const fill = m[0] > 1e-6 ? ink().b : m[3] ? ink().a : null;
      p.dot(m[0], m[1], k === this.chosen ? 8 : 5, fill, k === this.chosen ? ink().ink : fill ?? gray);
    });
    this.shape();
  },

  shape() { // arrows and groups on the diagram
    const mode = this.found.modes[this.chosen], colors = live.case.style.areas, places = live.case.diagram.machines;
    diagram.overlay = {
      under: (c, at, s) => this.found.areas.forEach((group, k) => group.forEach((i) => {
        c.globalAlpha = 0.3;
        c.fillStyle = colors[k % colors.length];
        c.beginPath();
        c.arc(...at(places[i]), Math.max(4, 0.34 * s), 0, 7);
        c.fill();
        c.globalAlpha = 1;
      })),
      over: (c, at, s) => {
        const lead = Math.max(...mode[6].map((m) => m[1]), 0), first = mode[6].find((m) => m[1] === lead)?.[2] ?? 0;
        const long = Math.max(0.95 * s, 22);
        for (const [i, size, angle] of mode[6]) {
          const turn = ((angle - first) * Math.PI) / 180, side = Math.cos(turn) >= 0;
          c.strokeStyle = c.fillStyle = side ? ink().a : ink().b;
          arrow(c, at(places[i]), [long * size * Math.cos(turn), -long * size * Math.sin(turn)], Math.max(s < FINE ? 1 : 2, 0.05 * s));
        }
      },
    };
    diagram.draw();
  },

  click({ offsetX, offsetY }) {
    const far = this.found.modes.map((m) => Math.hypot(this.plane.x(m[0]) - offsetX, this.plane.y(m[1]) - offsetY));
    const k = far.indexOf(Math.min(...far));
    if (far[k] < 20) this.choose(k);
  },

  choose(k) {
    this.chosen = k;
    this.fill();
    this.draw();
  },

  fill() { // the table of swing modes, and who takes part in the chosen one
    const rows = this.found.modes.map((m, k) => [k, m]).filter(([k, m]) => m[3] || k === this.chosen);
    const head = ["mode", "frequency (Hz)", "damping (%)"].map((t, i) => element("th", { textContent: t, className: i ? "" : "text" }));
    const body = rows.map(([k, m]) => {
      const row = element("tr", { className: k === this.chosen ? "chosen" : "" },
        element("td", { className: "text long" }, element("button", { type: "button", className: "row", textContent: m[4], ariaPressed: String(k === this.chosen) })),
        element("td", { textContent: m[1].toFixed(3) }), element("td", { textContent: (100 * m[2]).toFixed(1) }));
      row.onclick = () => this.choose(k);
      return row;
    });
    this.list.replaceChildren(element("table", {}, element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...body)));
    const shares = this.found.modes[this.chosen][5].slice(0, 6).map(([state, share]) => {
      const bar = element("span", { className: "bar" });
      bar.style.width = `${9 * share}rem`;
      return element("tr", {}, element("td", { className: "text", textContent: state }), element("td", { className: "text" }, bar, ` ${(100 * share).toFixed(0)} %`));
    });
    this.shares.replaceChildren(element("h2", { textContent: "Participation" }), element("table", {}, element("tbody", {}, ...shares)));
  },
};
