"use strict";
// The clearing-time landscape: the color of each end of a line is the critical clearing time of a fault there.
const RUNS = 24; // of 10 s, that the clearing times of a line take

const landscape = {
  pairs: [], done: null, of: null, copy: null, // of the settings that it was started with
  stream: new Stream("landscape", (part) => landscape.told(part)),

  build() {
    this.said = element("p", { className: "soft", id: "landscape-text" });
    this.holds = element("p", { id: "landscape-for", className: "warning", role: "status" });
    this.need = element("p", { id: "landscape-required", role: "status" });
    this.scale = element("canvas");
    this.scale.setAttribute("role", "img");
    this.scale.style.height = "44px";
    this.scale.className = "plot";
    this.list = element("div", { className: "scroll tall", id: "landscape-list" });
    const again = element("button", { type: "button", id: "screen", textContent: "screen with these settings" });
    again.onclick = () => this.start();
    this.ending = element("button", { type: "button", id: "screen-stop", textContent: "stop", hidden: true });
    this.ending.onclick = () => this.stop();
    again.hidden = !!live.recorded;
    $("landscape").append(element("div", { className: "rows" }, again, this.ending), this.holds, this.need, this.said, this.scale, this.list);
    const { said, ...kept } = live.recorded?.results.landscape ?? {};
    Object.assign(this, kept);
    if (said) this.said.textContent = said;
  },

  open() {
    if (!this.said) this.build();
    diagram.lineColor = (name) => this.colors(name);
    diagram.overlay = { stale: () => this.stale, said: (name) => this.pairs.filter((p) => p[1] === name).map((p) => `; fault at ${p[0]}: ${this.cycles(p)}`).join("") + (this.stale ? ` with ${inWords(this.of)}` : "") };
    if (!this.pairs.length && !live.recorded && this.ending.hidden) this.offer();
    this.draw();
  },

  offer() { // start at once, unless it takes very long
    const minutes = (live.case.lines.length * RUNS * (live.run?.head.simulated_ms ?? 0)) / 60000;
    if (minutes < 10) return this.start();
    this.said.textContent = `A screen of all ${live.case.lines.length} lines takes about ${Math.round(minutes)} minutes here. The button starts it; results appear as they come.`;
  },

  kept() { // for a saved page
    const { pairs, of, copy } = this;
    return pairs.length ? { pairs, of, copy, said: this.said.textContent } : null;
  },

  get stale() {
    return !!this.of && !same(this.of, settings());
  },

  marked() { // the settings for which it holds, if they are no longer those of the page
    const { required } = live.state, short = this.pairs.filter((p) => this.value(p) < required).length;
    this.need.textContent = required && this.pairs.length ? `${short} of ${this.pairs.length} pairs are shorter than the ${required} cycles required.` : "";
    this.holds.textContent = this.stale ? `These are the clearing times for ${inWords(this.of)}${live.recorded ? "." : "; screen again."}` : "";
    gray(this.stale, this.scale, this.list);
    diagram.draw();
  },

  start() {
    this.pairs = [];
    this.copy = null;
    this.of = structuredClone(settings());
    this.list.replaceChildren();
    this.said.textContent = "";
    this.ending.hidden = this.done = false;
    this.stream.ask(live.state);
  },

  stop() {
    this.stream.stop();
    this.ending.hidden = true;
    this.said.textContent += ", stopped";
  },

  told(part) {
    if (part.error) return (this.ending.hidden = true), (this.said.textContent = part.error);
    if (part.copy) (this.copy = part.copy), copyable();
    if (part.pairs) this.pairs.push(...part.pairs);
    if (part.of) this.said.textContent = `${part.done} of ${part.of} faults`;
    if (part.remarks) (this.said.textContent = part.remarks.join(" ")), (this.done = this.ending.hidden = true);
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

  colors(name) { // of the two halves of a line
    return this.halves?.get(name) ?? [ink().line, ink().line];
  },

  painted() { // the colors of all lines
    const from = new Map(live.case.branches.map((b) => [b[0], String(live.case.buses[b[1]][0])]));
    this.halves = new Map();
    for (const p of this.pairs) {
      if (!this.halves.has(p[1])) this.halves.set(p[1], [ink().line, ink().line]);
      this.halves.get(p[1])[from.get(p[1]) === p[0] ? 0 : 1] = mixed(this.scaled, this.value(p));
    }
  },

  draw() {
    this.scaled = this.stops();
    this.painted();
    this.marked();
    if (!this.pairs.length) return;
    this.bar();
    const sorted = this.sorted().slice(0, 60);
    const head = ["fault at bus", "line opened", "critical (cycles)", "leaves first"].map((t, i) => element("th", { textContent: t, className: i < 2 ? "text" : "" }));
    const rows = sorted.map((p) => {
      const go = element("button", { type: "button", className: "row", textContent: p[0], title: `Take the fault at bus ${p[0]}, cleared by opening ${p[1]}` });
      const short = live.state.required > 0 && this.value(p) < live.state.required;
      const row = element("tr", { className: short ? "short" : "" }, element("td", { className: "text" }, go), element("td", { className: "text", textContent: p[1] }),
        element("td", { textContent: this.cycles(p).replace(" cycles", "") }), element("td", { textContent: p[4] ?? "" }));
      row.onclick = () => controls.fault(p[0], p[1]);
      return row;
    });
    this.list.replaceChildren(element("table", {}, element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...rows)));
  },

  sorted() { // the shortest first
    return [...this.pairs].sort((a, b) => this.value(a) - this.value(b));
  },

  bar() { // what the colors mean
    this.scale.setAttribute("aria-label", `Colors of critical clearing times from ${this.scaled[0][0]} to ${this.scaled.at(-1)[0]} cycles`);
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
