"use strict";
// The sliders: each has a range, and how its value is written.
const CONTROLS = [
  { id: "clear", name: "clearing time", min: 0, max: 30, step: 0.125, say: (v) => `${v} cycles` },
  { id: "along", name: "fault along the line", min: 0, max: 100, step: 1, say: (v) => `${v} %`, when: (s) => s.fault.includes("@") },
  { id: "percent", name: "storage of every machine", min: 0, max: 20, step: 0.5, say: (v) => `${v} % of MVA` },
  { id: "own", name: "storage of", min: 0, max: 100, step: 1, say: (v) => `${v} MW` },
  { id: "deadband", name: "deadband", min: 0, max: 500, step: 10, say: (v) => `${v} mHz`, when: tuned },
  { id: "gain", name: "gain of the feedback", min: 0, max: 1, step: 0.01, say: (v) => `${v} pu/(rad/s)`, when: (s) => equipped(s) && s.law === "feedback" },
  { id: "delay", name: "communication delay of the law", min: 0, max: 30, step: 1, say: (v) => `${v} cycles, ${((1e3 * v) / live.case.hz).toFixed(0)} ms`, when: tuned },
  { id: "level", name: "load level", min: 50, max: 130, step: 1, say: (v) => `${v} %` },
];

function stored(state) {
  return state.percent > 0 || Object.values(state.megawatts).some((mw) => mw > 0);
}

function equipped(state) { // whether there is storage, of the page or of the case
  return stored(state) || live.case.storage.length > 0;
}

function tuned(state) { // whether the law has settings on the page
  return equipped(state) && !["idle", "file"].includes(state.law);
}

const controls = {
  build() {
    const place = element("input", { type: "text", id: "fault", autocomplete: "off" });
    place.setAttribute("list", "places");
    place.onchange = () => this.search(place.value);
    const named = live.case.buses.map(([number, name]) => element("option", { value: number, label: name ? `${number} ${name}` : `bus ${number}` }));
    const places = element("datalist", { id: "places" }, ...named, ...live.case.branches.map(([name]) => element("option", { value: name })));
    $("controls").append(element("div", { className: "control", id: "box-fault" }, element("label", { htmlFor: "fault" }, "fault at a bus or line"), place, places));
    for (const { id, name, min, max, step } of CONTROLS) {
      const slider = element("input", { type: "range", id, min, max, step });
      slider.oninput = () => this.moved(id, +slider.value);
      const box = element("div", { className: "control", id: `box-${id}` },
        element("label", { htmlFor: id }, element("span", { id: `name-${id}`, textContent: name }), element("output", { id: `value-${id}` })), slider);
      if (id === "clear") box.append(element("div", { className: "track" }, element("i", { id: "mark-clear", hidden: true }), element("i", { id: "mark-required", hidden: true })), element("div", { className: "note", id: "note-clear" }));
      if (id === "percent") box.append(element("div", { className: "note", id: "note-percent" }));
      if (id === "own") {
        const choice = element("select", { id: "machine", title: "Machine with a rating of its own", ariaLabel: "Machine with a rating of its own" },
          ...live.case.machines.map((m) => element("option", { value: m[3], textContent: `machine ${m[0]} (${m[2]} MVA)` })));
        choice.onchange = () => this.show();
        box.insertBefore(choice, slider);
        box.append(element("div", { className: "note", id: "note-own" }));
      }
      $("controls").append(box);
    }
    const required = element("input", { type: "number", id: "required", min: 0, max: 60, step: 0.125, placeholder: "none" });
    required.onchange = () => change({ required: Math.min(60, Math.max(0, +required.value || 0)) });
    const trip = element("select", { id: "trip" });
    trip.onchange = () => change({ trip: trip.value });
    const law = element("select", { id: "law" }, ...live.case.laws.map((l) => element("option", { value: l, textContent: l })));
    law.onchange = () => change({ law: law.value });
    const store = element("select", { id: "store" }, ...live.case.stores.map((m) => element("option", { value: m, textContent: m })));
    store.onchange = () => change({ store: store.value });
    const compare = element("input", { type: "checkbox", id: "compare" });
    compare.onchange = () => change({ compare: compare.checked });
    const row = (id, text, ...parts) => element("div", { className: "control", id: `box-${id}` }, element("label", { htmlFor: id }, text), ...parts);
    $("controls").append(row("trip", "line opened to clear the fault", trip), row("store", "model of the storage", store), row("law", "law of the storage", law), row("required", "required clearing time (cycles)", required, element("div", { className: "note", id: "note-required" })),
      element("div", { className: "control", id: "box-compare" }, element("label", { htmlFor: "compare" }, "without storage beside it", compare)));
    for (const signal of SIGNALS) {
      const chip = element("button", { type: "button", textContent: { speed: "speeds", angle: "angles", voltage: "voltages", storage: "storage power" }[signal], id: `signal-${signal}` });
      chip.onclick = () => this.signal(signal);
      $("signals").append(chip);
    }
    if (live.recorded) {
      const { runs } = live.recorded, [first, last] = [runs[0], runs.at(-1)];
      Object.assign($("clear"), { min: first[0], max: last[0], step: 0.0001 });
      Object.assign($("percent"), { min: first[1], max: last[1] });
      for (const part of $("controls").querySelectorAll("input, select")) part.disabled = !["clear", "percent"].includes(part.id);
      $("percent").disabled = first[1] === last[1];
      $("controls").classList.toggle("trial", first[1] !== last[1]);
      for (const part of $("signals").children) part.disabled = true;
    }
  },

  moved(id, value) {
    const { fault, megawatts } = live.state;
    if (id === "along") return change({ fault: `${parted(fault)[0]}@${value / 100}` });
    if (id === "own") return change({ megawatts: { ...megawatts, [$("machine").value]: value } });
    change({ [id]: value });
  },

  search(text) { // a bus by number or name, a line, or a point of one, as it is typed
    const wanted = text.trim(), [what, along] = parted(wanted), plain = (t) => String(t).trim().toLowerCase();
    const bus = live.case.buses.find((b) => String(b[0]) === wanted || (b[1] && plain(b[1]) === plain(wanted)));
    const line = live.case.branches.find((b) => plain(b[0]) === plain(what));
    if (bus) return this.fault(bus[0]);
    if (line && (along === undefined || (+along >= 0 && +along <= 1))) return this.fault(`${line[0]}@${along ?? 0.5}`);
    live.mistyped = true; // an answer that comes later does not replace this
    verdict(`There is no bus or line ${wanted} in ${live.case.name}; write 83, 7-8, or 7-8@0.4 for a point of a line.`, "wrong");
  },

  signal(name) {
    const now = live.state.signals;
    const signals = now.includes(name) ? now.filter((s) => s !== name) : [...now, name];
    if (signals.length) change({ signals: SIGNALS.filter((s) => signals.includes(s)) });
  },

  fault(place, trip = "") {
    change({ fault: String(place), trip });
  },

  own() { // the ratings that are not those of every machine, each with a button that takes it away
    const names = new Map(live.case.machines.map((m) => [String(m[3]), m[0]]));
    const buttons = Object.entries(live.state.megawatts).map(([m, mw]) => {
      const button = element("button", { type: "button", className: "link", textContent: `${names.get(m)}: ${mw} MW \u00d7`, title: `Machine ${names.get(m)} like the others again` });
      button.onclick = () => {
        const { [m]: gone, ...rest } = live.state.megawatts;
        change({ megawatts: rest });
      };
      return button;
    });
    $("note-own").replaceChildren(...(buttons.length ? ["of their own: ", ...buttons] : []));
  },

  show() { // the state on the sliders
    const s = live.state, own = +$("machine").value, machine = live.case.machines.find((m) => m[3] === own);
    $("own").max = Math.max(10, Math.round(machine[2] / 4));
    const values = { ...s, along: Math.round(100 * (+parted(s.fault)[1] || 0)), own: s.megawatts[own] ?? Math.round((s.percent * machine[2]) / 100) };
    this.own();
    const devices = live.case.storage.length, theirs = `the case's own ${devices === 1 ? "device" : `${devices} devices`}`;
    $("note-percent").textContent = devices ? (stored(s) ? `in place of ${theirs}` : `storage is ${theirs}`) : "";
    for (const { id, say, when } of CONTROLS) {
      $(id).value = values[id];
      $(`value-${id}`).textContent = say(values[id]);
      $(`box-${id}`).hidden = when ? !when(s) : false;
    }
    $("fault").value = s.fault;
    $("required").value = s.required || "";
    $("diagram").setAttribute("aria-label", `One-line diagram of ${live.case.name}; fault at ${s.fault}, chosen in the list "fault at a bus or line"`);
    critical.need();
    const bus = live.case.buses.findIndex((b) => String(b[0]) === s.fault);
    $("box-trip").hidden = bus < 0;
    if (bus >= 0) {
      const names = ["", ...live.case.branches.filter((b) => b[1] === bus || b[2] === bus).map((b) => b[0])];
      $("trip").replaceChildren(...names.map((n) => element("option", { value: n, textContent: n || "none" })));
      $("trip").value = s.trip;
    }
    $("box-law").hidden = $("box-compare").hidden = !equipped(s);
    $("box-store").hidden = !stored(s);
    $("law").value = s.law;
    $("store").value = s.store;
    $("compare").checked = s.compare;
    for (const signal of SIGNALS) $(`signal-${signal}`).setAttribute("aria-pressed", s.signals.includes(signal));
    $("signal-storage").disabled = !equipped(s) || !!live.recorded;
  },
};

function change(settings) { // a change of the state by the user
  live.mistyped = false;
  Object.assign(live.state, settings);
  if (!equipped(live.state)) live.state.signals = live.state.signals.filter((s) => s !== "storage");
  if (!live.state.signals.length) live.state.signals = ["speed"];
  controls.show();
  if (live.recorded) {
    replay();
  } else {
    running.ask({ ...live.state });
    critical.changed();
    if (live.view === "modes" && modes.found?.level !== live.state.level) modes.open();
    if (live.view === "theory") theory.ask();
  }
  VIEWS[live.view][1]?.marked();
  address.changed();
}

function replay() { // the recorded run nearest to the sliders, to that of storage first
  const far = (r) => 1e3 * Math.abs(r[1] - live.state.percent) + Math.abs(r[0] - live.state.clear);
  const [clear, percent, answer] = live.recorded.runs.reduce((a, b) => (far(b) < far(a) ? b : a));
  Object.assign(live.state, { clear, percent });
  controls.show();
  answered(Uint8Array.from(atob(answer), (c) => c.charCodeAt(0)).buffer);
}
