"use strict";
// Axes on a canvas for points and curves that are no functions of time.
class Plane {
  constructor(canvas, xLabel, yLabel) {
    Object.assign(this, { canvas, xLabel, yLabel });
    canvas.className = "plot";
    canvas.setAttribute("role", "img");
  }

  space() {
    return fitted(this.canvas);
  }

  open([left, right], [bottom, top]) {
    const { context: c, width, height } = this.space();
    const box = { left: 56, right: width - 14, top: 12, bottom: height - 40 };
    Object.assign(this, { c, box, range: { left, right, bottom, top } });
    c.font = letters(12);
    c.lineWidth = 1;
    for (const [value, x] of this.ticks(left, right, 80, true)) {
      c.strokeStyle = ink().line;
      line(c, [x, box.top], [x, box.bottom]);
      this.text(value, x, box.bottom + 14, "center");
    }
    for (const [value, y] of this.ticks(bottom, top, 45, false)) {
      c.strokeStyle = ink().line;
      line(c, [box.left, y], [box.right, y]);
      this.text(value, box.left - 6, y, "right");
    }
    this.text(this.xLabel, (box.left + box.right) / 2, height - 9, "center");
    c.save();
    c.translate(12, (box.top + box.bottom) / 2);
    c.rotate(-Math.PI / 2);
    this.text(this.yLabel, 0, 0, "center");
    c.restore();
    return c;
  }

  ticks(low, high, apart, across) {
    const { box } = this, length = across ? box.right - box.left : box.bottom - box.top;
    const rough = ((high - low) * apart) / length, power = 10 ** Math.floor(Math.log10(rough));
    const degrees = (across ? this.xLabel : this.yLabel).includes("(deg)");
    const step = power * (degrees ? [1, 1.5, 3, 4.5, 9, 10] : [1, 2, 5, 10]).find((m) => m * power >= rough), found = [];
    for (let v = Math.ceil(low / step) * step; v <= high + step * 1e-6; v += step) {
      const value = Math.abs(v) < step * 1e-6 ? 0 : v;
      found.push([+value.toPrecision(6), across ? this.x(value) : this.y(value)]);
    }
    return found;
  }

  x(v) {
    return this.box.left + ((v - this.range.left) / (this.range.right - this.range.left)) * (this.box.right - this.box.left);
  }

  y(v) {
    return this.box.bottom - ((v - this.range.bottom) / (this.range.top - this.range.bottom)) * (this.box.bottom - this.box.top);
  }

  text(text, x, y, align) {
    this.c.textAlign = align;
    this.c.textBaseline = "middle";
    this.c.fillStyle = ink().soft;
    this.c.strokeStyle = ink().card;
    this.c.lineWidth = 4;
    this.c.strokeText(text, x, y);
    this.c.lineWidth = 1;
    this.c.fillText(text, x, y);
  }

  curve(xs, ys, stroke, width = 1.5, dash = []) {
    const { c, box } = this;
    c.save();
    c.beginPath();
    c.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
    c.clip();
    c.beginPath();
    xs.forEach((x, k) => c.lineTo(this.x(x), this.y(ys[k])));
    c.strokeStyle = stroke;
    c.lineWidth = width;
    c.setLineDash(dash);
    c.stroke();
    c.restore();
  }

  dot(x, y, radius, fill, stroke) {
    const { c, box } = this, [u, v] = [this.x(x), this.y(y)];
    if (u < box.left - 1 || u > box.right + 1 || v < box.top - 1 || v > box.bottom + 1) return;
    c.beginPath();
    c.arc(u, v, radius, 0, 7);
    if (fill) (c.fillStyle = fill), c.fill();
    if (stroke) (c.strokeStyle = stroke), (c.lineWidth = 1.3), c.stroke();
  }
}
