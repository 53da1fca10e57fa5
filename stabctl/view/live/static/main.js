"use strict";
// The page: its views, what the mouse does on the diagram, copying and saving.
const VIEWS = { time: ["Time", null], modes: ["Modes", modes], landscape: ["Clearing times", landscape], theory: ["Theory", theory] };

function show(view) {
  live.view = view;
  diagram.overlay = diagram.lineColor = null;
  for (const [name, [, part]] of Object.entries(VIEWS)) {
    $(name).hidden = name !== view;
    $(`tab-${name}`).setAttribute("aria-pressed", name === view);
    if (name === view) part?.open();
  }
  $("controls").hidden = $("verdict").hidden = view === "modes";
  $("play-row").hidden = view !== "time";
  if (view === "time") time.draw();
  copyable();
  diagram.draw();
}

function mouse() {
  const canvas = $("diagram");
  let start = null;
  canvas.onpointerdown = (e) => (start = { x: e.offsetX, y: e.offsetY, at: { ...diagram.view }, moved: false });
  canvas.onpointerup = canvas.onpointerleave = (e) => {
    if (e.type === "pointerleave" && diagram.hovered) (diagram.hovered = null), diagram.draw();
    start = e.type === "pointerup" && start?.moved ? { done: true } : null;
  };
  canvas.onpointermove = (e) => {
    if (start?.at && e.buttons) {
      const [dx, dy] = [e.offsetX - start.x, e.offsetY - start.y];
      start.moved ||= Math.hypot(dx, dy) > 5;
      if (start.moved) Object.assign(diagram.view, { x: start.at.x + dx, y: start.at.y + dy }), diagram.draw();
      return;
    }
    const found = diagram.nearest(e.offsetX, e.offsetY), key = JSON.stringify(found ?? null, ["bus", "machine", "line"]);
    $("hover").textContent = diagram.said(found);
    if (key !== diagram.over) (diagram.over = key), (diagram.hovered = found), diagram.draw();
  };
  canvas.onclick = (e) => {
    const dragged = start?.done;
    start = null;
    const found = dragged || live.recorded ? null : diagram.nearest(e.offsetX, e.offsetY);
    if (found?.bus !== undefined) controls.fault(live.case.buses[found.bus][0]);
    else if (found?.machine !== undefined) controls.fault(live.case.buses[live.case.machines[found.machine][1]][0]);
    else if (found?.line) controls.fault(`${found.line}@${found.along.toFixed(2)}`);
  };
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    const { scale, x, y } = diagram.view, next = Math.min(400, Math.max(diagram.least, scale * Math.exp(-e.deltaY / 400)));
    const ratio = next / scale;
    diagram.view = { scale: next, x: e.offsetX - ratio * (e.offsetX - x), y: e.offsetY - ratio * (e.offsetY - y) };
    diagram.labels = placedLabels();
    diagram.draw();
  }, { passive: false });
  $("whole").onclick = () => (diagram.fit(), diagram.draw());
}

function lines() { // that reproduce what the view shows
  return { time: live.run?.head.copy, landscape: landscape.copy, modes: modes.found?.copy, theory: theory.found?.copy }[live.view] ?? {};
}

function copyable() {
  for (const kind of ["python", "shell"]) $(kind).disabled = !lines()[kind];
  $("save").disabled = !live.run;
}

async function copy(text) {
  if (!text) return;
  live.copied = text;
  try {
    await navigator.clipboard.writeText(text);
    $("timing").textContent = `copied: ${text}`;
  } catch {
    $("timing").textContent = text;
  }
}

async function save() {
  const results = { modes: modes.found, landscape: landscape.kept(), theory: theory.found ?? null, critical: critical.answer };
  $("save").disabled = true;
  const answer = await fetch("save", { method: "POST", body: JSON.stringify({ state: live.state, results }) });
  $("save").disabled = false;
  if (!answer.ok) return verdict(answer.status === 422 ? (await answer.json()).error : "The page could not be saved.", "wrong");
  const link = element("a", { href: URL.createObjectURL(await answer.blob()), download: `${live.case.name}_live.html` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function redraw() { // after a change of size or of light
  inks = null;
  if (!live.case) return;
  diagram.fit();
  time.built = "";
  show(live.view);
  critical.mark();
}

async function start() {
  live.case = live.recorded?.case ?? (await (await fetch("case")).json());
  const { name, title, fault } = live.case;
  document.title = `${name}: stabctl live`;
  $("name").textContent = name;
  $("name").title = title;
  for (const [view, [label]] of Object.entries(VIEWS)) {
    const tab = element("button", { type: "button", id: `tab-${view}`, textContent: label });
    tab.onclick = () => show(view);
    const known = { modes: "modes", theory: "theory", landscape: "landscape" }[view];
    tab.hidden = !!live.recorded && !!known && !live.recorded.results[known];
    $("tabs").append(tab);
  }
  live.state = { fault, trip: "", clear: 6, percent: 0, megawatts: {}, law: live.case.laws[0], deadband: 100, gain: 0.1, delay: 0, level: 100, compare: false, signals: ["speed"], ...live.recorded?.state };
  if (live.recorded) live.state.clear = live.recorded.clear;
  controls.build();
  mouse();
  show("time");
  $("play").onclick = () => time.play();
  for (const kind of ["python", "shell"]) $(kind).onclick = () => copy(lines()[kind]);
  $("save").onclick = save;
  $("save").hidden = !!live.recorded;
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("resize", redraw);
  change({});
  if (live.recorded?.results.critical) critical.told((critical.answer = null, live.recorded.results.critical));
}

start();
