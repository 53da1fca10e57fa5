"use strict";
const LATE = 250; // ms   after which what is shown is gray until the answer comes

// Questions to the server: of each kind one is under way and at most one waits, the last one asked.
class Asking {
  constructor(path, told, late, read = (answer) => answer.json()) {
    Object.assign(this, { path, told, late, read, busy: false, waiting: null });
  }

  ask(message) {
    this.waiting = { message, since: performance.now() };
    if (!this.busy) this.send();
  }

  async send() {
    const { message, since } = this.waiting;
    this.waiting = null;
    this.busy = true;
    const slow = setTimeout(() => this.late(true), LATE);
    try {
      const answer = await fetch(this.path, { method: "POST", body: JSON.stringify(message) });
      if (!answer.ok) throw new Error();
      const found = await this.read(answer);
      if (!this.waiting) this.late(false);
      this.told(found, since, message);
    } catch {
      this.late(true);
      verdict("The simulator does not answer: start stabctl live again.", "wrong");
    }
    clearTimeout(slow);
    this.busy = false;
    if (this.waiting) this.send();
  }
}

class Stream { // an answer in lines of JSON; a new question ends the one before
  constructor(path, told) {
    Object.assign(this, { path, told, ending: null });
  }

  stop() {
    this.ending?.abort();
    this.ending = null;
  }

  async ask(message) {
    this.stop();
    const ending = (this.ending = new AbortController());
    try {
      const answer = await fetch(this.path, { method: "POST", body: JSON.stringify(message), signal: ending.signal });
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const { value, done } = await reader.read();
        if (done || ending !== this.ending) break;
        const lines = (rest + value).split("\n");
        rest = lines.pop();
        for (const line of lines) this.told(JSON.parse(line));
      }
    } catch {
      return; // ended by the page
    }
  }
}

function verdict(text, kind) {
  $("verdict").textContent = text;
  $("verdict").className = kind;
}
