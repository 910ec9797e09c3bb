// Elements, and numbers as text. Text from scenarios only ever becomes text nodes and attributes.

/** An element with attributes (functions become listeners) and children (elements or text). */
function el(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (typeof value === "function") node.addEventListener(name, value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter(child => child !== null && child !== undefined));
  return node;
}

/** A region that scrolls sideways by itself, for a table. */
const wide = (label, ...children) =>
  el("div", { class: "wide", tabindex: 0, role: "region", "aria-label": label }, ...children);

/** A table in such a region: cells of its head, and its body. On a narrow screen rows are cards, but for a kind of its own. */
function wideTable(label, heads, body, kind = "cards") {
  const table = el("table", { class: kind }, el("thead", null, el("tr", null, ...heads)), body);
  if (kind === "cards") {
    const titles = heads.filter(Boolean).map(head => head.textContent);
    const name = () => [...body.rows].forEach(row => nameCells(row, titles));
    name();
    new MutationObserver(name).observe(body, { childList: true });
  }
  return wide(label, table);
}

/** Give the cells of a row the titles of their columns, which a card shows. */
function nameCells(row, titles) {
  let column = 0;
  for (const cell of row.cells) {
    if (column || cell.tagName === "TD") cell.dataset.title = titles[column] ?? "";
    cell.classList.toggle("absent", cell.textContent === "–");
    column += cell.colSpan;
  }
}

/** A name that may break after each underscore, as names of parameters have no blanks. */
const breakable = name => name.split(/(?<=_)/).flatMap(part => [part, el("wbr", null)]);

/** What has ended a run, by its status. */
const ENDS = { completed: "stop trigger", collision: "collision", timeout: "time limit" };

const seconds = time => `${time.toFixed(2)} s`;

/** Round numbers within an interval, about as many as asked for. */
function ticks(low, high, count) {
  const rough = (high - low) / count || 1,
    power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map(n => n * power).find(n => n >= rough * 0.999),
    found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) found.push(i * step);
  return found;
}

/** Matches a canvas to its size on the screen; its context, set to CSS pixels. */
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1,
    width = canvas.clientWidth,
    height = canvas.clientHeight;
  const w = Math.round(width * ratio),
    h = Math.round(height * ratio);
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { ctx, width, height, ratio };
}
