"use strict";
// The Theory view: one machine and the center of inertia of the others; equal areas, and the phase plane.
const theory = {
  machine: null,
  asking: null,

  build() {
    const choice = element("select", { id: "theory-machine", ariaLabel: "Machine" }, ...live.case.machines.map((m) => element("option", { value: m[3], textContent: `machine ${m[0]}` })));
    choice.onchange = () => ((this.machine = +choice.value), this.ask());
    this.areas = element("canvas");
    this.plane = element("canvas");
    for (const canvas of [this.areas, this.plane]) canvas.style.height = "300px";
    this.said = element("p", { className: "soft", id: "theory-text" });
    $("theory").append(
      element("div", { className: "rows" }, choice, element("span", { className: "soft", textContent: "against the center of inertia of the others, classical, without storage" })),
      this.said, element("h2", { textContent: "Equal areas" }), this.areas, element("h2", { textContent: "Phase plane" }), this.plane);
    this.first = new Plane(this.areas, "angle (deg)", "power (pu)");
    this.second = new Plane(this.plane, "angle (deg)", "speed deviation (Hz)");
    this.asking = new Asking("theory", (found, _, { level, clear }) => this.told({ ...found, level, clear }), (stale) => this.faded(stale));
    choice.hidden = !!live.recorded;
  },

  faded(stale) {
    gray(stale, this.areas, this.plane);
  },

  marked() {
    const { clear, level } = live.state;
    this.faded(!!live.recorded && !!this.found && !(this.found.clear === clear && this.found.level === level));
  },

  open() {
    if (!this.said) this.build();
    if (live.recorded) live.recorded.results.theory && this.told(live.recorded.results.theory);
    else this.draw(), this.ask();
  },

  ask() {
    this.asking?.ask({ level: live.state.level, machine: this.machine, clear: live.state.clear });
  },

  told(found) {
    if (found.error) {
      this.said.textContent = found.error;
      this.found = null;
      this.draw();
      return;
    }
    this.found = found;
    copyable();
    this.machine = found.machine;
    $("theory-machine").value = found.machine;
    const fault = `Three-phase fault at the terminal of machine ${found.name}, cleared after ${found.clear} cycles${found.level === 100 ? "" : `, load level ${found.level} %`}`;
    this.said.textContent = `${fault}. ${found.text} Critical clearing time of this fault in this theory: ${found.critical.toFixed(2)} cycles.`;
    this.areas.setAttribute("aria-label", `Equal areas: ${found.text}`);
    this.plane.setAttribute("aria-label", `Phase plane: the machine ${found.stable ? "returns" : "leaves"}`);
    this.marked();
    this.draw();
  },

  draw() {
    if (live.view !== "theory") return;
    if (!this.found) {
      for (const canvas of [this.areas, this.plane]) fitted(canvas); // empty
      return;
    }
    const { Pm, Pmax, Pfault, marks, separatrix, curve, cleared, stable, unstable } = this.found;
    const angles = Array.from({ length: 181 }, (_, k) => k), p = this.first;
    p.open([0, 180], [1.12 * Math.min(0, Pfault), 1.12 * Math.max(Pmax, Pm)]);
    const fill = (from, to, low, high, color) => {
      const xs = Array.from({ length: 61 }, (_, k) => from + ((to - from) * k) / 60), c = p.c;
      c.beginPath();
      xs.forEach((x) => c.lineTo(p.x(x), p.y(high(x))));
      [...xs].reverse().forEach((x) => c.lineTo(p.x(x), p.y(low(x))));
      c.globalAlpha = 0.35;
      c.fillStyle = color;
      c.fill();
      c.globalAlpha = 1;
    };
    const [start, clearing, stop] = marks, Pe = (x) => Pmax * Math.sin((x * Math.PI) / 180);
    fill(start, clearing, () => Pfault, () => Pm, ink().b);
    fill(clearing, stop, () => Pm, Pe, ink().c);
    p.curve(angles, angles.map(Pe), ink().ink, 2);
    p.curve([0, 180], [Pm, Pm], ink().a);
    for (const [name, from, to, y] of [["A1", start, clearing, (Pfault + Pm) / 2], ["A2", clearing, stop, 1.02 * Pm]]) {
      if (p.x(to) - p.x(from) > 24) p.text(name, p.x((from + to) / 2), p.y(y) - (name === "A2" ? 10 : 0), "center");
    }
    p.text("Pm", p.x(5), p.y(Pm) - 9, "left");
    const q = this.second, top = 1.25 * Math.max(...separatrix[1]), left = separatrix[0][0];
    q.open([left - 12, unstable + 45], [-top, top]);
    for (const side of [1, -1]) q.curve(separatrix[0], separatrix[1].map((v) => side * v), ink().soft, 1.5, [4, 4]);
    const color = stable ? ink().a : ink().b;
    q.curve(curve[0], curve[1], color, 1.3);
    q.curve(curve[0].slice(0, cleared + 1), curve[1].slice(0, cleared + 1), color, 3.5);
    q.dot(curve[0][cleared], curve[1][cleared], 5, color);
  },
};
