"use strict";
// One chart of curves against time, drawn by uPlot; the fault is shaded, its clearing dotted.
const SIGNALS = ["speed", "angle", "voltage", "storage"];
const LEAST_RANGE = { speed: 0.02, angle: 2, voltage: 0.02, storage: 2 };

const NAMED = 5; // curves with a color and a name, if there are more than `FEW`
const FEW = 6;

function chart(place, signal, title, names, height, ghosts = 0) { // the last curves are those of a pinned run
  const axis = { stroke: () => ink().soft, grid: { stroke: () => ink().line, width: 1 }, ticks: { show: false }, font: letters(12) };
  const { colors, labels } = live.case.style, few = names.length <= FEW, low = height < 180; // no room for a label at the side
  if (low) title = title.trim() ? `${labels[signal]}, ${title}` : labels[signal];
  let lost = new Set(), matter = new Map(); // rows; row -> place among the colors
  const own = (k) => [ink().a, ink().c, ink().d, colors[3], ink().e, ink().soft][k];
  const stroke = (k) => (lost.has(k) ? ink().b : matter.has(k) ? own(matter.get(k)) : ink().many);
  const series = names.map((name, k) => ({ label: name, points: { show: false }, spanGaps: false, stroke: () => stroke(k), width: few ? 1.5 : 1 }));
  const pale = { points: { show: false }, spanGaps: false, stroke: () => ink().soft, width: 1, dash: [4, 3] };
  for (let k = 0; k < ghosts; k++) series.push({ ...pale, label: `${names[k]} (pinned)` });
  const range = (u, low, high) => {
    const middle = (low + high) / 2 || 0, half = Math.max((0.55 * (high - low)) || 0, LEAST_RANGE[signal] / 2);
    return [middle - half, middle + half];
  };
  const plot = new uPlot(
    {
      width: Math.max(200, place.clientWidth), height, title,
      padding: [null, 34, null, null], // room for names
      scales: { x: { time: false, range: () => [0, Math.max(live.run?.end ?? 10, time.pinned?.end ?? 0)] }, y: { range } },
      axes: [{ ...axis, size: 34, label: height > 220 ? labels.time : undefined, labelSize: 16, labelFont: letters(12) },
             { ...axis, size: 58, label: low ? undefined : labels[signal], labelSize: 18, labelFont: letters(12) }],
      legend: { show: false },
      cursor: { sync: { key: "time" }, focus: { prox: 14 }, drag: { x: false, y: false }, points: { show: false } },
      focus: { alpha: 0.25 },
      series: [{}, ...series],
      hooks: {
        drawClear: [shaded],
        draw: [(u) => labelled(u, [...new Set([...lost, ...matter.keys()])].map((k) => [k, names[k], stroke(k)]))],
        setCursor: [(u) => pointed(u)],
        setSeries: [(u, k) => named(k ? `${signal === "voltage" ? "bus of machine" : "machine"} ${series[k - 1].label}` : "")],
      },
    },
    [[0], ...series.map(() => [null])],
    place,
  );
  const set = (rows, curves) => { // the machines that have lost synchronism, and the curves of this run
    const all = [...names.keys()], moved = all.map((k) => Math.max(...curves[k]) - Math.min(...curves[k]));
    lost = new Set(rows);
    matter = new Map((few ? all : all.sort((a, b) => moved[b] - moved[a]).slice(0, NAMED)).map((k, i) => [k, i]));
    names.forEach((_, k) => (plot.series[k + 1].width = lost.has(k) ? 2.5 : matter.has(k) ? 1.5 : 1));
  };
  return { plot, signal, set };
}

function labelled(u, rows) { // names at the ends of curves, moved apart where they would overlap
  const scale = devicePixelRatio || 1, c = u.ctx, high = 13 * scale, placed = [];
  for (const [k, name, color] of rows) {
    const curve = u.data[k + 1];
    let last = curve.length - 1;
    while (last > 0 && (curve[last] === null || curve[last] === undefined)) last--;
    placed.push({ name, color, x: u.valToPos(u.data[0][last], "x", true), y: u.valToPos(curve[last], "y", true) });
  }
  placed.sort((a, b) => a.y - b.y);
  placed.forEach((one, i) => (one.y = Math.max(one.y, i ? placed[i - 1].y + high : u.bbox.top)));
  const over = (placed.at(-1)?.y ?? 0) - (u.bbox.top + u.bbox.height);
  for (let i = placed.length - 1, free = Infinity; over > 0 && i >= 0; free = placed[i--].y - high) placed[i].y = Math.min(placed[i].y, free, u.bbox.top + u.bbox.height);
  c.save();
  c.font = `${11 * scale}px ${ink().font}`;
  c.textAlign = "left";
  c.textBaseline = "middle";
  for (const { name, color, x, y } of placed) {
    c.fillStyle = color;
    c.fillText(name, x + 4 * scale, y);
  }
  c.restore();
}

function shaded(u) {
  const head = live.run?.head;
  if (!head) return;
  const [from, to] = [u.valToPos(head.at, "x", true), u.valToPos(head.cleared, "x", true)];
  const { top, height } = u.bbox;
  u.ctx.save();
  u.ctx.fillStyle = ink().shade;
  u.ctx.fillRect(from, top, Math.max(to - from, 1), height);
  u.ctx.strokeStyle = ink().soft;
  u.ctx.setLineDash([3, 4]);
  u.ctx.beginPath();
  u.ctx.moveTo(to, top);
  u.ctx.lineTo(to, top + height);
  u.ctx.stroke();
  u.ctx.restore();
}

function pointed(u) { // the diagram shows the instant under the cursor
  if (live.playing || !live.run || u.cursor.event?.type === undefined) return;
  const left = u.cursor.left;
  diagram.show(left >= 0 ? u.posToVal(left, "x") : null);
}

function named(text) {
  if (live.view === "time") $("hover").textContent = text;
}
