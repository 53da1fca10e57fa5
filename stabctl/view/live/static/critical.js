"use strict";
// The critical clearing time beside the slider: searched when the page is at rest, refined as one waits.
const critical = {
  key: null, answer: null, timer: 0,
  stream: new Stream("clearing", (part) => critical.told(part)),

  keyOf() { // what it depends on: everything but the clearing time and what is shown
    const { clear, signals, compare, required, ...rest } = live.state;
    return JSON.stringify(rest);
  },

  changed() { // called at every change of the state
    const key = this.keyOf();
    clearTimeout(this.timer);
    if (live.recorded || (key === this.key && this.answer?.resolution < 0.05)) return;
    this.stream.stop();
    if (key !== this.key) {
      this.answer = null;
      this.note("");
      this.mark();
    }
    this.timer = setTimeout(() => {
      this.key = key;
      this.stream.ask(live.state);
    }, 350);
  },

  told(part) {
    if (part.error) return this.note(part.error);
    if (part.text) {
      this.answer = part;
      const first = part.machine === null ? "" : `; machine ${part.machine} leaves first`;
      if (part.status === "found") this.note(`critical: ${+part.cycles.toFixed(3)} cycles${first}`);
      else this.note(part.status === "stable_at_limit" ? "stable up to 60 cycles" : "unstable however fast it is cleared");
      for (const [kind, name] of [["python", "copy Python"], ["shell", "copy command"]]) {
        const button = element("button", { type: "button", className: "link", textContent: name });
        button.onclick = () => copy(part.copy[kind]);
        button.disabled = !part.copy[kind];
        $("note-clear").append(" ", button);
      }
      live.critical = part;
    } else if (!this.answer) {
      this.note(part.high === null ? `critical: above ${part.low} cycles …` : `critical: ${part.low} to ${part.high} cycles …`);
    }
    this.mark();
  },

  note(text) {
    $("note-clear").textContent = text;
  },

  mark() { // on the track of the slider
    this.put("mark-clear", this.answer?.cycles);
    this.need();
  },

  need() { // what is required, and whether it is met
    const { required } = live.state, found = { unstable_at_zero: 0, stable_at_limit: 60 }[this.answer?.status] ?? this.answer?.cycles;
    this.put("mark-required", required || null);
    $("note-required").textContent = !required || found === undefined ? "" : found >= required ? "met by this fault" : `missed by this fault: ${+found.toFixed(3)} cycles`;
    $("note-required").classList.toggle("missed", found < required);
  },

  put(id, cycles) {
    const slider = $("clear"), mark = $(id);
    mark.hidden = cycles === undefined || cycles === null || cycles > +slider.max;
    if (!mark.hidden) mark.style.left = `calc(7px + (100% - 16px) * ${(cycles - slider.min) / (slider.max - slider.min)})`;
  },
};
