"use strict";
// One chart of curves against time, drawn by uPlot; the fault is shaded, its clearing dotted.
const SIGNALS = ["speed", "angle", "voltage", "storage"];
const LEAST_RANGE = { speed: 0.02, angle: 2, voltage: 0.02, storage: 2 };

function chart(place, signal, title, names, height) {
  const axis = { stroke: () => ink().soft, grid: { stroke: () => ink().line, width: 1 }, ticks: { show: false }, font: letters(12) };
  const { colors, labels } = live.case.style, few = names.length <= 6;
  let lost = new Set();
  const own = (k) => [ink().a, ink().c, ink().d, colors[3], ink().e, ink().soft][k];
  const series = names.map((name, k) => ({
    label: name, points: { show: false }, spanGaps: false,
    stroke: () => (lost.has(k) ? ink().b : few ? own(k) : ink().many),
    width: few ? 1.5 : 1,
  }));
  const range = (u, low, high) => {
    const middle = (low + high) / 2 || 0, half = Math.max((0.55 * (high - low)) || 0, LEAST_RANGE[signal] / 2);
    return [middle - half, middle + half];
  };
  const plot = new uPlot(
    {
      width: Math.max(200, place.clientWidth), height, title,
      scales: { x: { time: false, range: () => [0, live.run?.head.until ?? 10] }, y: { range } },
      axes: [{ ...axis, size: 34, label: height > 220 ? labels.time : undefined, labelSize: 16, labelFont: letters(12) },
             { ...axis, size: 58, label: labels[signal], labelSize: 18, labelFont: letters(12) }],
      legend: { show: false },
      cursor: { sync: { key: "time" }, focus: { prox: 14 }, drag: { x: false, y: false }, points: { show: false } },
      focus: { alpha: 0.25 },
      series: [{}, ...series],
      hooks: {
        drawClear: [shaded],
        setCursor: [(u) => pointed(u)],
        setSeries: [(u, k) => named(k ? `${signal === "voltage" ? "bus of machine" : "machine"} ${names[k - 1]}` : "")],
      },
    },
    [[0], ...names.map(() => [null])],
    place,
  );
  return { plot, signal, setLost: (rows) => { lost = new Set(rows); series.forEach((_, k) => (plot.series[k + 1].width = lost.has(k) ? 2.5 : few ? 1.5 : 1)); } };
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
