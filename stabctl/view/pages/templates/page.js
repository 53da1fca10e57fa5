"use strict";
// Tables that can be sorted, figures that can be enlarged, and the names of their parts.

const number = (text) => parseFloat(text.replace("−", "-"));

function compare(a, b, words) {
  return words ? a.localeCompare(b, "en", { numeric: true }) : number(a) - number(b);
}

function sort(table, head, column) {
  const body = table.tBodies[0], words = head.classList.contains("text");
  const before = head.getAttribute("aria-sort"), order = before === "ascending" ? "descending" : before ? null : "ascending";
  for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
  table.original ??= [...body.rows];
  const rows = [...table.original], sign = order === "descending" ? -1 : 1;
  const text = (row) => row.cells[column].textContent.trim();
  if (order) {
    head.setAttribute("aria-sort", order);
    const empty = (row) => !text(row) || (!words && isNaN(number(text(row))));
    rows.sort((a, b) => empty(a) - empty(b) || sign * compare(text(a), text(b), words));
  }
  body.append(...rows);
}

for (const table of document.querySelectorAll("table")) {
  if (!table.tHead || table.tHead.rows.length !== 1 || table.tBodies[0].rows.length < 3) continue;
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    if (!head.textContent.trim()) return;
    head.tabIndex = 0;
    head.title = "Sort by this column";
    head.onclick = () => sort(table, head, column);
    head.onkeydown = (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      head.onclick();
    };
  });
}

const tip = Object.assign(document.createElement("div"), { className: "tip", hidden: true });
document.body.append(tip);

function tipped(svg, event) { // the part under the pointer, or the nearest mark within 12 pixels
  const under = event.target.closest("[data-tip]");
  if (under) return under;
  let nearest = null, least = 12;
  for (const part of svg.querySelectorAll("use[data-tip], [data-tip] use")) {
    const box = part.getBoundingClientRect();
    const far = Math.hypot((box.left + box.right) / 2 - event.clientX, (box.top + box.bottom) / 2 - event.clientY);
    if (far < least) [nearest, least] = [part.closest("[data-tip]"), far];
  }
  return nearest;
}

function point(svg, event) {
  const part = tipped(svg, event);
  tip.hidden = !part;
  if (!part) return;
  tip.textContent = part.dataset.tip;
  const { offsetWidth: width, offsetHeight: height } = tip, wide = document.documentElement.clientWidth;
  tip.style.left = `${Math.max(4, Math.min(event.clientX + 12, wide - width - 4))}px`;
  tip.style.top = `${event.clientY - height - 10 < 4 ? event.clientY + 16 : event.clientY - height - 10}px`;
}

class Zoom { // of one figure: its view box
  constructor(svg) {
    const { x, y, width, height } = svg.viewBox.baseVal;
    Object.assign(this, { svg, whole: [x, y, width, height], view: [x, y, width, height], from: null });
    const button = (text, label, click) => {
      const made = Object.assign(document.createElement("button"), { type: "button", textContent: text, title: label, onclick: click });
      made.setAttribute("aria-label", label);
      return made;
    };
    const tools = Object.assign(document.createElement("div"), { className: "tools" });
    tools.append(button("+", "Zoom in", () => this.by(1.5)), button("−", "Zoom out", () => this.by(1 / 1.5)), button("↺", "Whole figure", () => this.by(0)));
    svg.after(tools);
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      this.by(Math.exp(-event.deltaY / 300), event);
    }, { passive: false });
    svg.addEventListener("pointerdown", (event) => {
      if (!this.zoomed) return;
      this.from = [event.clientX, event.clientY, ...this.view];
      svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointermove", (event) => this.from && this.drag(event));
    for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => (this.from = null));
  }

  get zoomed() {
    return this.view[2] < this.whole[2];
  }

  by(factor, event) { // about the pointer, or the middle
    const [x, y, width, height] = this.view, box = this.svg.getBoundingClientRect();
    const across = event ? (event.clientX - box.left) / box.width : 0.5, down = event ? (event.clientY - box.top) / box.height : 0.5;
    const share = factor ? Math.min(1, Math.max(1 / 20, width / factor / this.whole[2])) : 1;
    const wide = share * this.whole[2], high = share * this.whole[3];
    this.show(x + across * (width - wide), y + down * (height - high), wide, high);
  }

  drag(event) {
    const [left, top, x, y, width, height] = this.from, box = this.svg.getBoundingClientRect();
    this.show(x - ((event.clientX - left) / box.width) * width, y - ((event.clientY - top) / box.height) * height, width, height);
  }

  show(x, y, width, height) { // never beyond the figure
    const [left, top, wide, high] = this.whole;
    this.view = [Math.min(Math.max(x, left), left + wide - width), Math.min(Math.max(y, top), top + high - height), width, height];
    this.svg.setAttribute("viewBox", this.view.join(" "));
    this.svg.classList.toggle("zoomed", this.zoomed);
  }
}

for (const svg of document.querySelectorAll("svg")) {
  for (const title of svg.querySelectorAll("title")) {
    title.parentNode.dataset.tip = title.textContent;
    title.remove();
  }
  svg.addEventListener("pointermove", (event) => point(svg, event));
  svg.addEventListener("pointerdown", (event) => point(svg, event));
  svg.addEventListener("pointerleave", () => (tip.hidden = true));
  if (svg.closest("figure")) new Zoom(svg);
}
