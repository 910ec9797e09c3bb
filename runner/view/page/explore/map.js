// Verdicts around the point: a grid of two parameters, the cells nearest to the point first.

const SIGNS = { passed: "", failed: "✕", inconclusive: "?", error: "!" };
const COLUMNS = 13,
  ROWS = 9;
const ranged = data.parameters.filter(({ kind, choices }) => kind === "number" || kind === "whole" || choices.length > 1);
const map = { x: null, y: null, axes: [], cells: [], asked: 0 };
const mapNode = el("div", { class: "map" });
const mapTold = el("p", { class: "muted", role: "status" });
const axisChoice = (label, at) =>
  choice(
    label,
    ranged.map(({ name }) => [name, name]),
    ranged[at]?.name,
    () => mapNode.replaceChildren(),
  );
const mapX = axisChoice("Across", 0),
  mapY = axisChoice("Upwards", 1);

async function drawMap() {
  const asked = ++map.asked;
  mapTold.textContent = "playing …";
  try {
    const answer = await ask("map", {
      parameters: point,
      system: chosenSystems[0],
      x: mapX.value,
      y: mapY.value,
      columns: COLUMNS,
      rows: ROWS,
    });
    let count = 0;
    for await (const part of lines(answer)) {
      if (asked !== map.asked) return;
      if (part.error) throw new Error(part.error);
      if (part.x) grid(part.x, part.y);
      if (part.cell) {
        fillCell(part);
        mapTold.textContent = `${++count} of ${map.cells.length * map.cells[0].length} runs`;
      }
      if (part.done) mapTold.textContent = counted();
    }
  } catch (error) {
    if (asked === map.asked) mapTold.textContent = error.message;
  }
}

/** The JSON lines of an answer, as they come. */
async function* lines(answer) {
  const reader = answer.body.getReader(),
    decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    const parts = (rest + decoder.decode(value, { stream: true })).split("\n");
    rest = parts.pop();
    for (const part of parts) yield JSON.parse(part);
  }
}

/** An empty grid: the arrow keys go from cell to cell, Enter shows the run of one. */
function grid(x, y) {
  Object.assign(map, { x, y, axes: [mapX.value, mapY.value] });
  map.cells = x.map((across, i) =>
    y.map((up, j) =>
      el("button", {
        tabindex: -1,
        click: () => setPoint({ [map.axes[0]]: across, [map.axes[1]]: up }),
        keydown: event => goCell(event, i, j),
      }),
    ),
  );
  const rows = [...y.keys()]
    .reverse()
    .map(j => el("div", { role: "row", style: "display:contents" }, ...map.cells.map(column => column[j])));
  for (const cell of map.cells.flat()) cell.setAttribute("role", "gridcell");
  const cells = el(
    "div",
    {
      class: "cells",
      role: "grid",
      "aria-label": `Verdicts over ${map.axes.join(" and ")}`,
      style: `grid-template-columns:repeat(${x.length},minmax(0,1fr))`,
    },
    ...rows,
  );
  const range = texts => `${texts[0]} to ${texts.at(-1)}`;
  mapNode.replaceChildren(
    el("div", { class: "axis-y" }, `${map.axes[1]}: ${range(y)}`),
    cells,
    el("div", { class: "axis-x" }, `${map.axes[0]}: ${range(x)}`),
  );
  map.cells.forEach((column, i) => column.forEach((_, j) => nameCell(i, j, "not played yet")));
  placeOnMap();
}

function nameCell(i, j, told) {
  const text = `${map.axes[0]} ${map.x[i]}, ${map.axes[1]} ${map.y[j]}: ${told}`;
  map.cells[i][j].setAttribute("aria-label", text);
  map.cells[i][j].title = text;
}

function fillCell({ cell: [i, j], state, reason }) {
  map.cells[i][j].className = state + (map.cells[i][j].classList.contains("here") ? " here" : "");
  map.cells[i][j].textContent = SIGNS[state];
  nameCell(i, j, reason ? `${state}, ${reason}` : state);
}

function goCell(event, i, j) {
  const [across, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [];
  if (across === undefined) return;
  event.preventDefault();
  const next = map.cells[i + across]?.[j + up];
  if (!next) return;
  map.cells[i][j].tabIndex = -1;
  next.tabIndex = 0;
  next.focus();
}

/** Mark the cell that is nearest to the point. */
function placeOnMap() {
  if (!map.cells.length) return;
  const nearestTo = (texts, value) => {
    const numbers = texts.map(Number);
    if (numbers.some(Number.isNaN)) return Math.max(0, texts.indexOf(value));
    return numbers.reduce((best, each, n) => (Math.abs(each - value) < Math.abs(numbers[best] - value) ? n : best), 0);
  };
  const here = map.cells[nearestTo(map.x, point[map.axes[0]])][nearestTo(map.y, point[map.axes[1]])];
  for (const cell of map.cells.flat()) {
    cell.classList.toggle("here", cell === here);
    cell.tabIndex = cell === here ? 0 : -1;
  }
}

function counted() {
  const of = state => map.cells.flat().filter(cell => cell.classList.contains(state)).length;
  return Object.keys(SIGNS)
    .map(state => [of(state), state])
    .filter(([count]) => count)
    .map(([count, state]) => `${count} ${state}`)
    .join(", ");
}

const mapPanel =
  ranged.length > 1
    ? section(
        "Verdicts around the point",
        el("div", { class: "pick" }, el("span", null, "Across"), mapX, el("span", null, "Upwards"), mapY),
        el("p", { style: "margin-top:6px" }, button("Draw the map", drawMap, null, "Draw the map"), " ", mapTold),
        mapNode,
        el(
          "div",
          { class: "key muted" },
          "✕ failed",
          el("span", null, "? inconclusive"),
          el("span", null, "! error"),
          el("span", null, "frame: the point"),
        ),
      )
    : null;
if (ranged.length > 1) mapY.selectedIndex = 1;
