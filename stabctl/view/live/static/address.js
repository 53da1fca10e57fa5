"use strict";
// The state in the address of the page: it can be shared and loaded again, and "back" undoes the last change.
const REST = 500; // ms   without a change, after which the state is one to come back to

const address = {
  timer: 0,

  written() { // what differs from the first state
    const parts = new URLSearchParams();
    for (const [name, value] of Object.entries(live.state)) if (!same(value, this.first[name])) parts.set(name, this.text(value));
    if (live.view !== "time") parts.set("view", live.view);
    return parts.size ? `#${parts}` : "";
  },

  text(value) {
    if (Array.isArray(value)) return value.join();
    return typeof value === "object" ? Object.entries(value).map((pair) => pair.join(":")).join() : String(value);
  },

  read(hash) { // the state that an address names; what cannot be read stays as it is at first
    const parts = new URLSearchParams(hash.slice(1)), state = structuredClone(this.first);
    for (const [name, first] of Object.entries(this.first)) {
      const value = this.value(name, first, parts.get(name));
      if (value !== undefined) state[name] = value;
    }
    return { state, view: VIEWS[parts.get("view")] && !$(`tab-${parts.get("view")}`).hidden ? parts.get("view") : "time" };
  },

  value(name, first, text) {
    if (text === null) return undefined;
    if (typeof first === "boolean") return text === "true";
    if (typeof first === "string") return { law: live.case.laws, store: live.case.stores }[name]?.includes(text) ?? true ? text : undefined;
    if (Array.isArray(first)) return SIGNALS.filter((s) => text.split(",").includes(s));
    const known = new Set(live.case.machines.map((m) => String(m[3]))), pairs = text.split(",").map((pair) => pair.split(":"));
    const limit = CONTROLS.find((c) => c.id === name) ?? { min: 0, max: 1e5 };
    const number = (t) => Math.min(limit.max, Math.max(limit.min, Number(t)));
    if (typeof first === "object") return Object.fromEntries(pairs.filter(([m, mw]) => known.has(m) && Number(mw) >= 0).map(([m, mw]) => [m, number(mw)]));
    return text.trim() && Number.isFinite(Number(text)) ? number(text) : undefined;
  },

  changed() { // called at every change of the state or the view
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.keep(), REST);
  },

  keep() {
    clearTimeout(this.timer);
    const now = this.written();
    if (now !== location.hash) history.pushState(null, "", now || location.pathname + location.search);
  },

  follow() { // "back", "forward", or an address that was edited
    clearTimeout(this.timer);
    const { state, view } = this.read(location.hash);
    live.state = state;
    if (view !== live.view) show(view);
    change({});
    clearTimeout(this.timer);
  },
};
