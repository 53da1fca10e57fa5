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
  $("play-row").hidden = $("pinned").hidden = view !== "time";
  if (view === "time") time.draw();
  copyable();
  diagram.draw();
  if (address.first) address.changed();
}

function mouse() {
  const canvas = $("diagram"), fingers = new Map();
  let start = null, apart = 0; // between two fingers
  const zoom = (factor, x, y) => {
    const { view } = diagram, next = Math.min(400, Math.max(diagram.least, view.scale * factor)), ratio = next / view.scale;
    diagram.view = { scale: next, x: x - ratio * (x - view.x), y: y - ratio * (y - view.y) };
    diagram.labels = placedLabels();
    diagram.draw();
  };
  const pinched = (e) => { // whether two fingers are on the diagram
    if (!fingers.has(e.pointerId)) return false;
    fingers.set(e.pointerId, [e.offsetX, e.offsetY]);
    if (fingers.size !== 2) return false;
    const [[a, b], [c, d]] = fingers.values(), far = Math.hypot(a - c, b - d);
    if (apart) zoom(far / apart, (a + c) / 2, (b + d) / 2);
    apart = far;
    start = { done: true };
    return true;
  };
  canvas.onpointercancel = (e) => fingers.delete(e.pointerId);
  canvas.onpointerdown = (e) => (e.pointerType === "touch" && fingers.set(e.pointerId, [e.offsetX, e.offsetY]), (apart = 0), start = { x: e.offsetX, y: e.offsetY, at: { ...diagram.view }, moved: false });
  canvas.onpointerup = canvas.onpointerleave = (e) => {
    fingers.delete(e.pointerId);
    if (e.type === "pointerleave" && diagram.hovered) (diagram.hovered = null), diagram.draw();
    start = e.type === "pointerup" && start?.moved ? { done: true } : null;
  };
  canvas.onpointermove = (e) => {
    if (pinched(e)) return;
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
    zoom(Math.exp(-e.deltaY / 400), e.offsetX, e.offsetY);
  }, { passive: false });
  $("whole").onclick = () => (diagram.fit(), diagram.draw());
}

function lines() { // that reproduce what the view shows
  return { time: live.run?.head.copy, landscape: landscape.copy, modes: modes.found?.copy, theory: theory.found?.copy }[live.view] ?? {};
}

function copyable() {
  for (const kind of ["python", "shell"]) $(kind).disabled = !lines()[kind];
  $("save").disabled = !live.run;
  $("pin").disabled = !live.run && !time.pinned;
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
  saveAs("live.html", await answer.blob());
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
  const { name, title, first } = live.case;
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
  live.state = { ...first, percent: 0, megawatts: {}, store: "ideal", deadband: 100, gain: 0.1, delay: 0, level: 100, compare: false, required: 0, signals: ["speed"], ...live.recorded?.state };
  if (live.recorded) live.state.clear = live.recorded.clear;
  controls.build();
  mouse();
  address.first = structuredClone(live.state);
  const given = address.read(location.hash);
  live.state = given.state;
  show(given.view);
  addEventListener("popstate", () => address.follow());
  $("play").onclick = () => time.play();
  $("pin").onclick = () => time.pin();
  for (const kind of ["python", "shell"]) $(kind).onclick = () => copy(lines()[kind]);
  $("save").onclick = save;
  $("save").hidden = !!live.recorded;
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("resize", redraw);
  change({});
  if (live.recorded?.results.critical) critical.told((critical.answer = null, live.recorded.results.critical));
}

start();
