"use strict";
// The Time view: curves of the signals chosen, without and with control side by side, played back.
const time = {
  charts: [], built: "", pinned: null,

  clear() {
    for (const { plot } of this.charts) plot.destroy();
    Object.assign(this, { charts: [], built: "" });
    $("charts").replaceChildren();
  },

  build() { // the charts that the state asks for
    const { signals, compare } = live.state, both = compare && "bare." in live.run.head.runs;
    const key = [signals, both, live.run.arrays.storage?.length ?? 0, this.pinned?.number, $("charts").clientWidth].join();
    if (key === this.built) return;
    this.clear();
    this.built = key;
    const wide = both && $("charts").clientWidth > 700, share = innerWidth < 1000 ? 0.3 : innerWidth < 1700 ? 0.5 : 0.64;
    const height = Math.max(innerWidth < 1000 ? 140 : 190, (share * innerHeight) / signals.length); // on a phone the sliders stay in sight
    const machines = live.case.machines.map((m) => m[0]), rotors = live.case.rotors.map((i) => machines[i]);
    $("charts").style.display = wide ? "grid" : "block";
    $("charts").style.gridTemplateColumns = wide ? "minmax(0,1fr) minmax(0,1fr)" : "";
    for (const signal of signals) for (const prefix of both ? ["bare.", ""] : [""]) {
      if (!live.run.arrays[prefix + signal]?.length) continue;
      const place = element("div", { className: "chart" });
      $("charts").append(place);
      const title = both ? (prefix ? "without storage" : "with storage") : " ";
      const ghosts = this.pinned?.arrays[prefix + signal]?.length ?? 0, names = signal === "speed" || signal === "angle" ? rotors : machines;
      const made = chart(place, signal, title, names, height, ghosts);
      place.append(tools(made));
      place.setAttribute("role", "group");
      place.setAttribute("aria-label", `${live.case.style.labels[signal]} over time${both ? `, ${title}` : ""}`);
      this.charts.push({ ...made, prefix, ghosts });
    }
  },

  draw() {
    if (!live.run) return;
    this.build();
    const { arrays, head } = live.run;
    for (const { plot, signal, prefix, ghosts, set } of this.charts) {
      const curves = arrays[prefix + signal];
      if (!curves) continue;
      const rotors = signal === "speed" || signal === "angle", lost = head.runs[prefix]?.lost ?? [];
      set(rotors ? lost : lost.map((r) => live.case.rotors[r]), curves);
      const mine = [arrays[`${prefix}time`], ...curves], past = this.pinned?.arrays;
      plot.setData(ghosts ? uPlot.join([mine, [past[`${prefix}time`], ...past[prefix + signal]]]) : mine);
    }
  },

  pin() { // keep this run as dashed curves, or let it go
    const { clear, fault, trip } = live.state;
    this.pinned = this.pinned ? null : { ...live.run, number: live.answers, of: structuredClone({ fault, trip, clear, ...settings() }) };
    $("pin").textContent = this.pinned ? "unpin" : "pin";
    this.compared();
    this.draw();
  },

  compared() { // what is different from the pinned run, in words
    if (!this.pinned) return void ($("pinned").textContent = "");
    const { clear, fault, trip } = live.state, words = (s) => [`fault ${s.fault}${s.trip ? `, ${s.trip} opened` : ""}`, `${s.clear} cycles`, ...inWords(s).split(", ")];
    const [then, now] = [words(this.pinned.of), words({ fault, trip, clear, ...settings() })];
    const was = then.filter((w) => !now.includes(w)), is = now.filter((w) => !then.includes(w));
    const change = was.length + is.length ? `${was.join(", ") || "the same"}; now ${is.join(", ") || "without it"}` : "these settings";
    $("pinned").textContent = `Pinned, dashed: ${change}. It said: ${this.pinned.head.runs[""].message}`;
  },

  play() {
    if (live.playing) return this.stop();
    const begun = performance.now(), last = live.run?.arrays.frame?.at(-1) ?? 0;
    $("play").textContent = "stop";
    const step = (now) => {
      if (!live.playing) return;
      const t = (now - begun) / 1000;
      if (t > last) return this.stop();
      diagram.show(t);
      for (const { plot } of this.charts) plot.setCursor({ left: plot.valToPos(t, "x"), top: 10 }, false);
      live.playing = requestAnimationFrame(step);
    };
    live.playing = requestAnimationFrame(step);
  },

  stop() {
    cancelAnimationFrame(live.playing);
    live.playing = 0;
    $("play").textContent = "play";
    diagram.show(null);
  },
};

const running = new Asking(
  "run",
  (buffer, since) => {
    answered(buffer);
    requestAnimationFrame(() => setTimeout(() => drawn(since)));
  },
  (stale) => gray(stale, $("charts"), $("diagram"), $("verdict")),
  (answer) => answer.arrayBuffer(),
);

function answered(buffer) {
  const run = unpack(buffer);
  if (run.head.error) return failed(run.head.error);
  const ends = Object.entries(run.arrays).filter(([name]) => /^(bare\.)?time$/.test(name)).map(([, t]) => t.at(-1));
  live.run = { ...run, end: Math.max(...ends) };
  live.answers++;
  time.compared();
  const { stable, message } = run.head.runs[""], other = run.head.runs["bare."];
  if (!live.mistyped) verdict(message + (other ? ` Without storage: ${other.message}` : ""), stable ? "good" : "bad");
  copyable();
  if (live.view === "time") time.draw();
  diagram.show(live.playing ? 0 : null);
}

function failed(text) { // there is no run with these settings, so none is shown
  live.run = null;
  time.stop();
  time.clear();
  $("timing").textContent = "";
  verdict(text, "wrong");
  copyable();
  diagram.show(null);
}

function drawn(since) { // what the time from the event to the picture was made of
  const head = live.run?.head;
  if (!head) return;
  live.timing.push({ total: performance.now() - since, simulated: head.simulated_ms, server: head.server_ms });
  if (live.timing.length > 500) live.timing.shift();
  const { total } = live.timing.at(-1);
  $("timing").textContent = `from the slider to the picture ${total.toFixed(0)} ms, of which ${head.simulated_ms.toFixed(0)} ms simulation`;
}
