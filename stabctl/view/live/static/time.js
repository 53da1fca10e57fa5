"use strict";
// The Time view: curves of the signals chosen, without and with control side by side, played back.
const time = {
  charts: [], built: "",

  build() { // the charts that the state asks for
    const { signals, compare } = live.state, both = compare && "bare." in live.run.head.runs;
    const key = [signals, both, live.run.arrays.storage?.length ?? 0, $("charts").clientWidth].join();
    if (key === this.built) return;
    this.built = key;
    for (const { plot } of this.charts) plot.destroy();
    const wide = both && $("charts").clientWidth > 700, height = Math.max(190, Math.min(420, (0.62 * innerHeight) / signals.length));
    const machines = live.case.machines.map((m) => m[0]), rotors = live.case.rotors.map((i) => machines[i]);
    $("charts").replaceChildren();
    $("charts").style.display = wide ? "grid" : "block";
    $("charts").style.gridTemplateColumns = wide ? "minmax(0,1fr) minmax(0,1fr)" : "";
    this.charts = [];
    for (const signal of signals) for (const prefix of both ? ["bare.", ""] : [""]) {
      if (!live.run.arrays[prefix + signal]?.length) continue;
      const place = element("div", { className: "chart" });
      $("charts").append(place);
      const title = both ? (prefix ? "without storage" : "with storage") : " ";
      const made = chart(place, signal, title, signal === "speed" || signal === "angle" ? rotors : machines, height);
      this.charts.push({ ...made, prefix });
    }
  },

  draw() {
    if (!live.run) return;
    this.build();
    const { arrays, head } = live.run;
    for (const { plot, signal, prefix, setLost } of this.charts) {
      const curves = arrays[prefix + signal];
      if (!curves) continue;
      const rotors = signal === "speed" || signal === "angle", lost = head.runs[prefix]?.lost ?? [];
      setLost(rotors ? lost : lost.map((r) => live.case.rotors[r]));
      plot.setData([arrays[`${prefix}time`], ...curves]);
    }
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
  live.run = run;
  live.answers++;
  const { stable, message } = run.head.runs[""], other = run.head.runs["bare."];
  verdict(message + (other ? ` Without storage: ${other.message}` : ""), stable ? "good" : "bad");
  copyable();
  if (live.view === "time") time.draw();
  diagram.show(live.playing ? 0 : null);
}

function failed(text) { // there is no run with these settings, so none is shown
  live.run = null;
  time.stop();
  for (const { plot } of time.charts) plot.destroy();
  Object.assign(time, { charts: [], built: "" });
  $("charts").replaceChildren();
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
