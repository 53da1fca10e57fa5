"use strict";
// A chart as a file: its picture, a drawing, or its numbers.
function saveAs(name, content, type) {
  const link = element("a", { href: URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type })), download: `${live.case.name}_${name}` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function csv({ plot, signal }) { // a column for every curve
  const [time, ...curves] = plot.data, cell = (v) => (v === null || v === undefined ? "" : +v.toPrecision(7));
  const head = ["time (s)", ...plot.series.slice(1).map((s) => `${live.case.style.labels[signal]} ${s.label}`)];
  const quoted = head.map((text) => `"${text.replaceAll('"', '""')}"`);
  return [quoted.join(), ...[...time].map((t, k) => [cell(t), ...curves.map((c) => cell(c[k]))].join())].join("\n") + "\n";
}

function png({ plot, signal }) { // on paper, not transparent
  const from = plot.ctx.canvas, canvas = element("canvas", { width: from.width, height: from.height }), c = canvas.getContext("2d");
  c.fillStyle = ink().paper;
  c.fillRect(0, 0, from.width, from.height);
  c.drawImage(from, 0, 0);
  canvas.toBlob((blob) => saveAs(`${signal}.png`, blob));
}

class Drawing { // what a Plane calls on a canvas, written as SVG
  constructor(width, height) {
    Object.assign(this, { width, height, parts: [], path: [], moves: [], lineWidth: 1, globalAlpha: 1, dash: [] });
  }

  beginPath() { this.path = []; }
  moveTo(x, y) { this.path.push(`M${x.toFixed(2)} ${y.toFixed(2)}`); }
  lineTo(x, y) { this.path.push(`${this.path.length ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`); }
  setLineDash(dash) { this.dash = dash; }
  rect() {}
  clip() {}
  strokeText() {}
  save() { this.moves.push(this.move ?? ""); }
  restore() { (this.move = this.moves.pop()), (this.dash = []); }
  translate(x, y) { this.move = `translate(${x} ${y})`; }
  rotate(angle) { this.move += ` rotate(${(180 * angle) / Math.PI})`; }

  stroke() {
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash}"` : "";
    this.parts.push(`<path d="${this.path.join("")}" fill="none" stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}"${dash}/>`);
  }

  fillText(text, x, y) {
    const anchor = { center: "middle", right: "end" }[this.textAlign] ?? "start", move = this.move ? ` transform="${this.move}"` : "";
    const plain = String(text).replace(/[&<]/g, (sign) => (sign === "&" ? "&amp;" : "&lt;"));
    this.parts.push(`<text x="${x}" y="${y}" text-anchor="${anchor}" dominant-baseline="middle" font-size="12" fill="${this.fillStyle}"${move}>${plain}</text>`);
  }

  get text() {
    const { width, height } = this;
    return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" height="${height}" font-family="sans-serif">\n` +
      `<rect width="${width}" height="${height}" fill="${ink().paper}"/>\n${this.parts.join("\n")}\n</svg>\n`;
  }
}

function svg({ plot, signal }) {
  const { labels } = live.case.style, drawing = new Drawing(plot.width, Math.max(plot.height, 240)), [time, ...curves] = plot.data;
  const plane = new Plane(element("canvas"), labels.time, labels[signal]), { x, y } = plot.scales;
  plane.space = () => ({ context: drawing, width: drawing.width, height: drawing.height });
  plane.open([x.min, x.max], [y.min, y.max]);
  curves.forEach((curve, k) => {
    const series = plot.series[k + 1], known = [...time.keys()].filter((i) => curve[i] !== null && curve[i] !== undefined);
    plane.curve(known.map((i) => time[i]), known.map((i) => curve[i]), series.stroke(plot, k + 1), series.width, series.dash ?? []);
  });
  return drawing.text;
}

function tools(made) { // the buttons of a chart
  const { signal } = made, what = { speed: "speeds", angle: "angles", voltage: "voltages", storage: "storage power" }[signal];
  const acts = { PNG: () => png(made), SVG: () => saveAs(`${signal}.svg`, svg(made), "image/svg+xml"), CSV: () => saveAs(`${signal}.csv`, csv(made), "text/csv") };
  const buttons = Object.entries(acts).map(([name, act]) => {
    const button = element("button", { type: "button", className: "link", textContent: name, title: `Save the ${what} as ${name}` });
    button.onclick = act;
    return button;
  });
  return element("div", { className: "tools" }, ...buttons);
}
