"use strict";
// The clearing-time landscape: the color of each end of a line is the critical clearing time of a fault there.
const landscape = {
  pairs: [], done: null, key: null,
  stream: new Stream("landscape", (part) => landscape.told(part)),

  build() {
    this.said = element("p", { className: "soft", id: "landscape-text" });
    this.scale = element("canvas");
    this.scale.style.height = "44px";
    this.scale.className = "plot";
    this.list = element("div", { className: "scroll tall", id: "landscape-list" });
    const again = element("button", { type: "button", id: "screen", textContent: "screen with these settings" });
    again.onclick = () => this.start();
    again.hidden = !!live.recorded;
    $("landscape").append(element("div", { className: "rows" }, again), this.said, this.scale, this.list);
    if (live.recorded?.results.landscape) this.pairs = live.recorded.results.landscape;
  },

  open() {
    if (!this.said) this.build();
    diagram.lineColor = (name) => this.colors(name);
    diagram.overlay = { said: (name) => this.pairs.filter((p) => p[1] === name).map((p) => `; fault at ${p[0]}: ${this.cycles(p)}`).join("") };
    if (!this.pairs.length && !live.recorded) this.start();
    this.draw();
  },

  start() {
    this.pairs = [];
    this.list.replaceChildren();
    this.stream.ask(live.state);
  },

  told(part) {
    if (part.error) return verdict(part.error, "wrong");
    if (part.pairs) this.pairs.push(...part.pairs);
    if (part.of) this.said.textContent = `${part.done} of ${part.of} faults`;
    if (part.remarks) (this.said.textContent = part.remarks.join(" ")), (this.done = true);
    if (live.view === "landscape") this.draw();
  },

  value([, , cycles, status]) {
    return status === "unstable_at_zero" ? 0 : cycles ?? 60;
  },

  cycles(pair) {
    return { unstable_at_zero: "unstable at any", stable_at_limit: "60 cycles or more" }[pair[3]] ?? `${pair[2]} cycles`;
  },

  stops() {
    const values = this.pairs.map((p) => this.value(p)), colors = live.case.style.clearing;
    const low = Math.min(...values), high = Math.max(...values, low + 1);
    return colors.map((c, k) => [low + ((high - low) * k) / (colors.length - 1), c]);
  },

  colors(name) {
    const [, from] = live.case.branches.find((b) => b[0] === name), ends = [ink().line, ink().line];
    for (const p of this.pairs) if (p[1] === name) {
      ends[String(live.case.buses[from][0]) === p[0] ? 0 : 1] = mixed(this.scaled, this.value(p));
    }
    return ends;
  },

  draw() {
    this.scaled = this.stops();
    diagram.draw();
    if (!this.pairs.length) return;
    this.bar();
    const sorted = [...this.pairs].sort((a, b) => this.value(a) - this.value(b)).slice(0, 60);
    const head = ["fault at bus", "line opened", "critical (cycles)", "leaves first"].map((t, i) => element("th", { textContent: t, className: i < 2 ? "text" : "" }));
    const rows = sorted.map((p) => {
      const row = element("tr", {}, ...[p[0], p[1]].map((t) => element("td", { className: "text", textContent: t })),
        element("td", { textContent: this.cycles(p).replace(" cycles", "") }), element("td", { textContent: p[4] ?? "" }));
      row.onclick = () => controls.fault(p[0], p[1]);
      return row;
    });
    this.list.replaceChildren(element("table", {}, element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...rows)));
  },

  bar() { // what the colors mean
    const { context: c, width } = fitted(this.scale), [first, last] = [this.scaled[0][0], this.scaled.at(-1)[0]];
    for (let x = 8; x < width - 8; x++) {
      c.fillStyle = mixed(this.scaled, first + ((x - 8) / (width - 16)) * (last - first));
      c.fillRect(x, 6, 1.5, 12);
    }
    c.font = letters(12);
    c.fillStyle = ink().soft;
    c.textBaseline = "middle";
    for (const [text, x, align] of [[first, 8, "left"], [last, width - 8, "right"], [live.case.style.labels.clearing, width / 2, "center"]]) {
      c.textAlign = align;
      c.fillText(text, x, 32);
    }
  },
};
