// The report of a batch: verdicts, distributions, scatter, table.

const data = JSON.parse(document.getElementById("data").textContent);
const STATES = ["passed", "failed", "error"],
  PAGE = 200,
  BINS = 24;
const link = run => `${run.replay.split("/").map(encodeURIComponent).join("/")}#t=${run.moment}`;

/** What a run can be placed, sorted and counted by: a name, a title, the value of a run, and how many runs have one. */
const columns = [
  ...Object.entries(data.measures).map(([name, { label, unit, most }]) => ({
    id: name,
    title: unit ? `${label} (${unit})` : label,
    most,
    of: run => run.measures[name],
  })),
  { id: "end", title: "End (s)", of: run => run.end },
  ...data.parameters.map(name => ({ id: `p:${name}`, title: name, parameter: true, of: run => run.parameters[name] ?? null })),
];
for (const column of columns) column.numbers = data.runs.filter(run => typeof column.of(run) === "number").length;
const numeric = columns.filter(column => column.numbers).sort((a, b) => !a.parameter - !b.parameter || b.numbers - a.numbers);
const redraws = [];

// verdicts ------------------------------------------------------------------------------------

const counts = STATES.map(state => data.runs.filter(run => run.state === state).length);
const verdicts = el(
  "section",
  { class: "panel" },
  el("h2", null, `${data.runs.length} runs`),
  el(
    "div",
    { class: "share", role: "img", "aria-label": STATES.map((state, i) => `${counts[i]} ${state}`).join(", ") },
    ...STATES.map((state, i) =>
      el("i", { style: `width:${(100 * counts[i]) / Math.max(1, data.runs.length)}%;background:var(--${state})` }),
    ),
  ),
  el(
    "ul",
    { class: "legend" },
    ...STATES.map((state, i) => el("li", null, el("i", { style: `background:var(--${state})` }), `${counts[i]} ${state}`)),
  ),
  el(
    "details",
    null,
    el("summary", { class: "muted" }, "settings"),
    el("dl", null, ...Object.entries(data.settings).flatMap(([name, value]) => [el("dt", null, name), el("dd", null, value)])),
  ),
);

// distributions -------------------------------------------------------------------------------

function histogram(column) {
  const found = data.runs.flatMap(run => (typeof column.of(run) === "number" ? [[column.of(run), run.state]] : []));
  if (!found.length) return null;
  const values = found.map(([value]) => value),
    low = least(values),
    high = Math.min(greatest(values), Math.max(column.most ?? Infinity, low)),
    wide = (high - low) / BINS || 1;
  const bins = Array.from({ length: BINS }, () => ({ passed: 0, failed: 0, error: 0 }));
  for (const [value, state] of found) bins[Math.min(BINS - 1, Math.floor((value - low) / wide))][state]++;
  const sorted = [...values].sort((a, b) => a - b),
    median = sorted[Math.floor(sorted.length / 2)];
  const beyond = values.filter(value => value > high).length;
  const told =
    `${found.length} runs, from ${short(low)} to ${short(sorted.at(-1))}, median ${short(median)}` +
    (beyond ? `; ${beyond} beyond ${short(high)} are in the last bar` : "");
  const canvas = el("canvas", { role: "img", "aria-label": `${column.title}: ${told}` });
  redraws.push(() => {
    const { ctx, width, height } = fitted(canvas),
      most = greatest(bins.map(bin => bin.passed + bin.failed + bin.error));
    const step = (width - 36) / BINS,
      y = count => height - 18 - (count / most) * (height - 26);
    ctx.clearRect(0, 0, width, height);
    bins.forEach((bin, i) => {
      let sum = 0;
      for (const state of STATES) {
        ctx.fillStyle = colour(state);
        ctx.fillRect(30 + i * step, y(sum + bin[state]), Math.max(1, step - 1), y(sum) - y(sum + bin[state]));
        sum += bin[state];
      }
    });
    axes(ctx, [30, width - 6], [y(0), y(most)], [low, low + wide * BINS], [0, most], height);
  });
  return el("div", null, el("h3", null, column.title), canvas, el("p", { class: "muted" }, told));
}

const histograms = Object.keys(data.measures)
  .map(id => histogram(columns.find(column => column.id === id)))
  .filter(Boolean);
const distributions = histograms.length
  ? el("section", { class: "panel" }, el("h2", null, "Distributions"), el("div", { class: "histograms" }, ...histograms))
  : null;

// scatter -------------------------------------------------------------------------------------

function scatter() {
  if (numeric.length < 2) return null;
  const usual = numeric.filter(column => column.numbers > data.runs.length / 2);
  const first = usual[0] || numeric[0],
    second = usual.find(column => column !== first && !column.parameter) || numeric.find(column => column !== first);
  const choice = (title, chosen) => {
    const select = el(
      "select",
      { "aria-label": title, change: draw },
      ...numeric.map(column => el("option", { value: column.id, selected: column === chosen }, column.title)),
    );
    return [el("label", null, title, select), () => numeric.find(column => column.id === select.value)];
  };
  const [chooseX, x] = choice("Across", first),
    [chooseY, y] = choice("Up", second);
  const canvas = el("canvas", { role: "img", click: open, mousemove: point }),
    told = el("p", { class: "muted", "aria-live": "polite" });
  let places = [];

  function draw() {
    const { ctx, width, height } = fitted(canvas),
      there = data.runs.filter(run => [x(), y()].every(column => typeof column.of(run) === "number"));
    const range = column => {
      const values = there.map(column.of);
      if (!values.length) return [0, 1];
      const low = least(values),
        high = Math.min(greatest(values), Math.max(column.most ?? Infinity, low)),
        room = (high - low) * 0.05 || Math.abs(high) * 0.05 || 0.5;
      return [low - room, high + room];
    };
    const us = range(x()),
      vs = range(y()),
      xs = [46, width - 10],
      ys = [height - 22, 8];
    ctx.clearRect(0, 0, width, height);
    axes(ctx, xs, ys, us, vs, height);
    const at = (value, [from, to], [low, high]) => from + ((Math.min(value, high) - low) / (high - low)) * (to - from);
    places = apart(there.map(run => ({ run, x: at(x().of(run), xs, us), y: at(y().of(run), ys, vs) })));
    ctx.globalAlpha = places.length > 500 ? 0.55 : 0.9;
    for (const place of places) {
      ctx.fillStyle = colour(place.run.state);
      ctx.beginPath();
      if (place.run.state === "passed") ctx.arc(place.x, place.y, places.length > 500 ? 2.5 : 3.5, 0, 7);
      else ctx.rect(place.x - 3.5, place.y - 3.5, 7, 7);
      ctx.fill();
    }
    ctx.globalAlpha = 1;
    canvas.setAttribute("aria-label", `${places.length} runs, ${y().title} over ${x().title}`);
    told.textContent = `${places.length} runs; squares have failed. Point at one to see which it is, click to play it.`;
  }

  /** Runs in one place side by side, as the seeds of a sunflower. */
  function apart(found) {
    const taken = new Map();
    for (const place of found) {
      const key = `${Math.round(place.x)} ${Math.round(place.y)}`,
        number = taken.get(key) || 0;
      taken.set(key, number + 1);
      place.x += 3.4 * Math.sqrt(number) * Math.cos(number * 2.4);
      place.y += 3.4 * Math.sqrt(number) * Math.sin(number * 2.4);
    }
    return found;
  }

  function near(event) {
    const { left, top } = canvas.getBoundingClientRect(),
      away = place => Math.hypot(place.x - event.clientX + left, place.y - event.clientY + top);
    const best = places.reduce((a, b) => (a && away(a) <= away(b) ? a : b), null);
    return best && away(best) < 14 ? best.run : null;
  }

  function point(event) {
    const run = near(event);
    if (run)
      told.textContent =
        `${run.name}: ${run.state}, ${x().title} ${short(x().of(run))}, ${y().title} ${short(y().of(run))}` +
        (run.replay ? "" : " (no replay)");
  }

  function open(event) {
    const run = near(event);
    if (run && run.replay) location.href = link(run);
  }

  redraws.push(draw);
  return el(
    "section",
    { class: "panel scatter" },
    el("h2", null, "Parameters and measures"),
    el("div", { class: "choices" }, chooseX, chooseY),
    canvas,
    told,
  );
}

// table ---------------------------------------------------------------------------------------

function table() {
  const order = { by: null, down: false };
  let shown = PAGE;
  const search = el("input", { type: "search", "aria-label": "Find runs", placeholder: "find by name or reason", input: again });
  const state = el(
    "select",
    { "aria-label": "Verdict", change: again },
    el("option", { value: "" }, "all verdicts"),
    ...STATES.map(each => el("option", { value: each }, each)),
  );
  const sortable = [
    { title: "run", of: run => run.name },
    { title: "verdict", of: run => STATES.indexOf(run.state) },
    ...columns,
  ];
  const heads = sortable.map(column => {
    const head = el(
      "th",
      { scope: "col", class: columns.includes(column) ? "number" : null },
      el("button", { click: () => sort(column) }, column.title),
    );
    return { column, head };
  });
  const body = el("tbody"),
    more = el(
      "button",
      {
        click: () => {
          shown += PAGE * 5;
          fill();
        },
      },
      "Show more",
    ),
    told = el("span", { class: "muted", "aria-live": "polite" });

  function again() {
    shown = PAGE;
    fill();
  }

  function sort(column) {
    order.down = order.by === column && !order.down;
    order.by = column;
    for (const each of heads)
      each.head.setAttribute("aria-sort", each.column === column ? (order.down ? "descending" : "ascending") : "none");
    fill();
  }

  function compare(a, b) {
    const [u, v] = [order.by.of(a), order.by.of(b)],
      sign = order.down ? -1 : 1;
    if (u === v) return 0;
    if (u === null || v === null) return u === null ? 1 : -1; // what is not defined comes last, either way
    return (
      sign *
      (typeof u === "number" && typeof v === "number" ? u - v : String(u).localeCompare(String(v), "en", { numeric: true }))
    );
  }

  function fill() {
    const words = search.value.toLowerCase();
    const found = data.runs.filter(
      run => (!state.value || run.state === state.value) && `${run.name} ${run.message}`.toLowerCase().includes(words),
    );
    if (order.by) found.sort(compare);
    body.replaceChildren(...found.slice(0, shown).map(row));
    more.hidden = found.length <= shown;
    told.textContent = `${Math.min(shown, found.length)} of ${found.length} runs`;
  }

  function row(run) {
    const name = run.replay ? el("a", { href: link(run) }, run.name) : run.name;
    const why =
      run.message || (ENDS[run.status] ?? run.status);
    return el(
      "tr",
      null,
      el("td", { class: "name" }, name),
      el("td", null, el("span", { class: `badge ${run.state}` }, run.state)),
      el("td", { class: "why muted" }, why),
      ...columns.map(column => el("td", { class: "number" }, String(short(column.of(run))))),
    );
  }

  fill();
  return el(
    "section",
    { class: "panel" },
    el("h2", null, "Runs"),
    el("div", { class: "choices" }, search, state, told),
    el(
      "div",
      { class: "wide", tabindex: 0, role: "region", "aria-label": "Table of runs" },
      el(
        "table",
        null,
        el(
          "thead",
          null,
          el(
            "tr",
            null,
            ...heads.slice(0, 2).map(each => each.head),
            el("th", { scope: "col" }, "ended by"),
            ...heads.slice(2).map(each => each.head),
          ),
        ),
        body,
      ),
    ),
    more,
  );
}

document.body.append(
  el("main", { id: "page" }, ...[el("h1", null, data.title), verdicts, scatter(), distributions, table()].filter(Boolean)),
);
const redraw = () => redraws.forEach(draw => draw());
new ResizeObserver(redraw).observe(document.getElementById("page"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
redraw();
