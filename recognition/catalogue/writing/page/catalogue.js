// The page: filters, numbers by class and site, distributions, exposure, cards.

const COUNT = data.texts.file.length,
  AT_ONCE = 48,
  BINS = 30;
const every = Array.from({ length: COUNT }, (_, row) => row);
const name = (kind, row) => data.names[kind][data.coded[kind][row]] ?? "–";
const wanted = { class: "", site: "", trust: "", text: "", measure: "ego_speed", low: "", high: "", sort: "", playAll: false };
wanted.meets = null; // whether a row meets the question
const searched = every.map(row =>
  [data.texts.file[row], data.texts.why[row], data.texts.critical[row]].join(" ").toLowerCase());
const many = (count, one) => `${count.toLocaleString("en")} ${one}${count === 1 ? "" : "s"}`;
const link = path => path.split("/").map(encodeURIComponent).join("/");
let shown = every;

/** Whether a row meets all filters, but one. */
function meets(row, but) {
  for (const kind of ["class", "site", "trust"])
    if (kind !== but && wanted[kind] && name(kind, row) !== wanted[kind]) return false;
  if (wanted.meets && !wanted.meets(row)) return false;
  if (wanted.text && !searched[row].includes(wanted.text.toLowerCase())) return false;
  if (but === "measure" || (wanted.low === "" && wanted.high === "")) return true;
  const value = data.measures[wanted.measure][row];
  return value !== null && (wanted.low === "" || value >= +wanted.low) && (wanted.high === "" || value <= +wanted.high);
}

/** Rows in the order that was chosen; absent values last. */
function inOrder(rows) {
  if (!wanted.sort) return rows;
  const values = data.measures[wanted.sort.replace("-", "")],
    sign = wanted.sort.startsWith("-") ? -1 : 1;
  return [...rows].sort((a, b) => (values[a] === null) - (values[b] === null) || sign * (values[a] - values[b]) || a - b);
}

const set = (key, value) => {
  wanted[key] = value;
  update();
};
const choice = (title, key, options) => {
  const listed = options.map(([value, text]) => el("option", { value }, text)),
    change = event => set(key, event.target.value);
  return el("label", null, title, el("select", { id: `choose-${key}`, change }, ...listed));
};
const input = (title, key, type) =>
  el("label", null, title, el("input", { type, id: `choose-${key}`, step: "any", input: event => set(key, event.target.value) }));
const titled = measure => measure.replaceAll("_", " ") + (data.units[measure] ? ` (${data.units[measure]})` : "");
const measured = Object.keys(data.measures).filter(measure => data.measures[measure].some(value => value !== null));
const all = (text, values) => [["", text], ...values.map(value => [value, value])];

/** Columns for questions with their types, by the names of the index. */
const kinds = new Map([
  ...[...Object.keys(data.texts), ...Object.keys(data.names)].map(each => [each, "text"]),
  ...Object.keys(data.measures).map(each => [each, "number"]),
  ["partial", "truth"],
]);

/** A row's value in a column of the index. */
function valueOf(row, column) {
  if (column === "partial") return Boolean(data.partial[row]);
  const coded = data.coded[column];
  return coded ? data.names[column][coded[row]] : (data.texts[column] ?? data.measures[column])[row];
}

function filters() {
  const orders = measured.flatMap(each => [[each, `${titled(each)}, ascending`], [`-${each}`, `${titled(each)}, descending`]]);
  return el(
    "section",
    { class: "panel filters" },
    el(
      "div",
      { class: "choices" },
      choice("class", "class", all("all", data.names.class)),
      choice("site", "site", all("all", data.names.site)),
      choice("trust", "trust", all("all", data.names.trust)),
      choice("measure", "measure", measured.map(each => [each, titled(each)])),
      input("from", "low", "number"),
      input("to", "high", "number"),
      choice("order", "sort", [["", "by file"], ...orders]),
      input("text", "text", "search"),
      el("label", null, el("input", { type: "checkbox", change: event => set("playAll", event.target.checked) }), "play all"),
      ...questionBox(kinds, valueOf, "min_ttc < 2 and ego_speed between 80 km/h and 130 km/h", meets => set("meets", meets)),
    ),
    el("p", { id: "count", class: "muted", role: "status" }),
  );
}

/** Head of a table; titles from a number on stand above numbers. */
function header(titles, numbers) {
  const cells = titles.map((text, i) => el("th", { scope: "col", class: i >= numbers && "number" }, text));
  return el("thead", null, el("tr", null, ...cells));
}

/** Scenarios by class and site; a number chooses both. */
function counts() {
  const body = el("tbody"),
    sites = data.names.site;
  const table = el("table", { class: "counts" }, header(["class", "all", ...sites], 1), body);
  const draw = () => {
    const found = new Map();
    for (const row of every)
      if (meets(row, "class") || meets(row, "site"))
        for (const key of [`${name("class", row)}\n`, `${name("class", row)}\n${name("site", row)}`])
          found.set(key, (found.get(key) ?? 0) + 1);
    const cell = (title, site) => {
      const chosen = wanted.class === title && wanted.site === site,
        count = String(found.get(`${title}\n${site}`) ?? 0);
      const attributes = { class: chosen && "chosen", click: () => pick(title, site), "aria-label": `${count} ${title} ${site}` };
      return el("td", { class: "number" }, el("button", attributes, count));
    };
    const line = title => el("tr", null, el("th", { scope: "row" }, title), ...["", ...sites].map(site => cell(title, site)));
    body.replaceChildren(...data.names.class.map(line));
  };
  return { node: wide("Scenarios by class and site", table), draw };
}

function pick(title, site) {
  const same = wanted.class === title && wanted.site === site;
  for (const [key, value] of [["class", title], ["site", site]]) {
    wanted[key] = same ? "" : value;
    document.getElementById(`choose-${key}`).value = wanted[key];
  }
  update();
}

function drawHistogram(canvas, told) {
  const values = shown.map(row => data.measures[wanted.measure][row]).filter(value => value !== null);
  const { ctx, width, height } = fitted(canvas);
  ctx.clearRect(0, 0, width, height);
  told.textContent = values.length ? `${titled(wanted.measure)} of ${many(values.length, "scenario")}` : "no values";
  canvas.setAttribute("aria-label", told.textContent);
  if (!values.length) return;
  const low = least(values),
    high = greatest(values),
    wide = (high - low) / BINS || 1,
    bins = new Array(BINS).fill(0);
  for (const value of values) bins[Math.min(BINS - 1, Math.floor((value - low) / wide))]++;
  const most = greatest(bins),
    step = (width - 50) / BINS,
    y = count => height - 18 - (count / most) * (height - 26);
  ctx.fillStyle = colour("accent");
  bins.forEach((count, i) => ctx.fillRect(44 + i * step, y(count), Math.max(1, step - 1), y(0) - y(count)));
  axes(ctx, [44, width - 6], [y(0), y(most)], [low, low + wide * BINS], [0, most], height);
}

/** Rates with their intervals, of the classes and sites that are chosen. */
function exposure() {
  const body = el("tbody"),
    heads = ["site", "class", "events", "hours", "km", "per hour (95 %)", "per 1,000 km (95 %)"];
  const rate = (row, key) =>
    row[key] === null ? "–" : `${short(row[key])} (${short(row[`${key}_low`])} to ${short(row[`${key}_high`])})`;
  const line = row => {
    const rates = [rate(row, "per_hour"), rate(row, "per_1000_km")],
      numbers = [row.events, short(row.vehicle_hours), short(row.vehicle_km), ...rates];
    const cells = numbers.map(text => el("td", { class: "number" }, String(text)));
    return el("tr", null, el("td", null, row.site), el("td", null, row.class), ...cells);
  };
  /** One class: its sites. One site: its classes. Neither: the classes of all sites. */
  const draw = () => {
    const site = wanted.site || (wanted.class ? "" : data.everywhere);
    const rows = data.exposure.filter(row => (!site || row.site === site) && (!wanted.class || row.class === wanted.class));
    body.replaceChildren(...rows.map(line));
  };
  const named = heads.map((text, place) => el("th", { scope: "col", class: place < 2 ? "" : "number" }, text));
  return { node: wideTable("Exposure", named, body), draw };
}

/** Value of a measure with its unit; null where it is absent. */
function fact(measure, row) {
  const value = data.measures[measure][row];
  return value === null ? null : `${short(value)} ${data.units[measure]}`.trim();
}

function card(row) {
  const film = filmOf(row),
    canvas = el("canvas", { tabindex: 0, role: "img", "aria-label": `Film of ${name("class", row)}` }),
    file = data.texts.file[row],
    maneuver = data.texts.maneuver[row];
  const where = [name("site", row), data.texts.vehicle[row], fact("time", row) ?? "–", name("trust", row)].join(", ");
  const known = measured.filter(each => data.measures[each][row] !== null);
  const pair = [["ego", "ego_speed"], ["partner", "partner_speed"], ["gap", "gap"], ["THW", "pair_thw"], ["TTC", "pair_ttc"]];
  const facts = pair.map(([title, each]) => [title, fact(each, row)]).filter(([, value]) => value !== null);
  const node = el(
    "article",
    { class: "card" },
    canvas,
    el("h3", null, name("class", row), data.partial[row] ? " (partial)" : ""),
    el("p", { class: "muted" }, where),
    el("p", null, facts.map(([title, value]) => `${title} ${value}`).join(", ")),
    el(
      "p",
      { class: "links" },
      el("a", { href: link(file) }, "scenario"),
      maneuver ? el("a", { href: link(maneuver) }, "manoeuvre") : null,
      el("a", { href: link(file.replace(/\.xosc$/, ".openlabel.json")) }, "tags"),
    ),
    el(
      "details",
      null,
      el("summary", null, "why"),
      el("p", null, data.texts.why[row] ?? "–"),
      data.texts.critical[row] ? el("p", null, `critical: ${data.texts.critical[row]}`) : null,
      el("dl", null, ...known.flatMap(each => [el("dt", null, each.replaceAll("_", " ")), el("dd", null, fact(each, row))])),
    ),
  );
  if (film) {
    const [on, off] = [() => play(canvas, film), () => wanted.playAll || stop(canvas, film)];
    for (const kind of ["pointerenter", "focus"]) canvas.addEventListener(kind, on);
    for (const kind of ["pointerleave", "blur"]) canvas.addEventListener(kind, off);
    seen.observe(canvas);
    films.set(canvas, film);
  }
  return node;
}

/** Films by canvas; a film is drawn when its canvas comes into view, and plays there if all do. */
const films = new Map();
const seen = new IntersectionObserver(entries => {
  for (const { target, isIntersecting } of entries) {
    const film = films.get(target);
    if (!isIntersecting) playing.delete(target);
    else if (wanted.playAll) play(target, film);
    else if (!playing.has(target)) drawFilm(target, film, film.event);
  }
});

const cards = el("div", { class: "films" }),
  end = el("p", { class: "muted" });
function more() {
  const next = shown.slice(cards.childElementCount, cards.childElementCount + AT_ONCE);
  cards.append(...next.map(card));
  end.textContent = cards.childElementCount < shown.length ? "more below" : "";
  below.unobserve(end); // an observer tells changes only: where the end is still near, it is told again
  if (cards.childElementCount < shown.length) below.observe(end);
}
const below = new IntersectionObserver(entries => entries.some(entry => entry.isIntersecting) && more(), { rootMargin: "800px" });

const table = counts(),
  rates = exposure(),
  histogram = el("canvas", { id: "histogram", role: "img" }),
  told = el("p", { class: "muted" });

function update() {
  shown = inOrder(every.filter(row => meets(row)));
  document.getElementById("count").textContent = `${many(shown.length, "scenario")} of ${COUNT.toLocaleString("en")}`;
  table.draw();
  rates.draw();
  drawHistogram(histogram, told);
  seen.disconnect();
  films.clear();
  playing.clear();
  cards.replaceChildren();
  more();
}

const panel = (title, ...parts) => el("section", { class: "panel" }, el("h2", null, title), ...parts);
document.body.append(
  el(
    "main",
    { id: "page" },
    el("h1", null, "Catalogue of recorded scenarios"),
    filters(),
    panel("Scenarios by class and site", table.node),
    panel("Distribution", histogram, told),
    panel("Exposure: events of moving motor vehicles, exact Poisson intervals", rates.node),
    panel("Scenarios: ego blue, partner red; a film plays under the pointer, three times as fast", cards, end),
  ),
);
window.addEventListener("resize", () => drawHistogram(histogram, told));
update();
