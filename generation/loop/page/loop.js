// The page of a loop: how it went, what was recognised, what was generated, where in parameter space, what is valid.

const data = JSON.parse(document.getElementById("data").textContent);
const STATES = ["known", "discovered", "unknown"];
const sum = numbers => numbers.reduce((a, b) => a + b, 0);
const many = (count, one, several = `${one}s`) => `${count.toLocaleString("en")} ${count === 1 ? one : several}`;
const link = path => { const [file, hash] = path.split("#"); return file.split("/").map(encodeURIComponent).join("/") + (hash ? `#${hash}` : ""); };
const redraws = [];

const badge = (kind, text) => el("span", { class: `badge ${kind}` }, text);
const play = (path, name) => path ? el("a", { class: "play", href: link(path), "aria-label": `Play ${name}` }, "▶ Play") : el("span", { class: "muted" }, "no replay");
const FILES = { scenario: ".xosc", manoeuvre: "manoeuvre", road: ".xodr", tags: "tags" };
const files = (each, name) => el("td", { class: "files" }, ...Object.entries(each).map(([kind, path]) => el("a", { href: link(path), "aria-label": `${kind} of ${name}` }, FILES[kind])));

/** A table in a region of its own that scrolls; columns are [title, class]. */
function table(label, columns, rows) {
  const head = el("tr", null, ...columns.map(([title, kind]) => el("th", { scope: "col", class: kind }, title)));
  return el("div", { class: "wide", tabindex: 0, role: "region", "aria-label": label }, el("table", null, el("thead", null, head), el("tbody", null, ...rows)));
}
const number = value => el("td", { class: "number" }, String(short(value)));

// how it went ---------------------------------------------------------------------------------

const scenarios = state => sum(data.classes.filter(each => each.state === state).map(each => each.count));
const done = data.searches.filter(search => !search.error), last = Math.max(1, ...done.map(search => search.round));
const rounds = Array.from({ length: last }, (_, i) => done.filter(search => search.round === i + 1));
const cases = done.flatMap(search => search.cases), total = (searches, key) => sum(searches.map(search => search[key]));
const avoidable = each => each.verdict === "collision" && each.careful === "avoids a collision";

function flow() {
  const step = (title, count, told) => el("li", null, el("h3", null, title), el("strong", null, count.toLocaleString("en")), el("p", null, told));
  const unread = Object.keys(data.unread).length, found = sum(data.classes.map(each => each.count)), steps = [];
  if (data.recordings) {
    steps.push(step("Recordings", data.recordings, unread ? `${unread} could not be read` : "all read"));
    steps.push(step("Scenarios recognised", found, STATES.map(state => `${scenarios(state)} ${state}`).join(", ")));
  }
  if (data.scenarios.length) steps.push(step("Runs of your scenarios", data.scenarios.length, `${data.scenarios.filter(run => run.state === "failed").length} failed`));
  steps.push(step("Runs searched", total(done, "calls"), `${many(new Set(done.map(search => search.target)).size, "logical scenario")}, ${many(last, "round")}`));
  steps.push(step("Collisions", total(done, "collisions"), `${total(done, "new")} of them unlike each other`));
  steps.push(step("Edge cases written", cases.length, `${cases.filter(each => each.verdict === "collision").length} collisions, ${cases.filter(avoidable).length} of them a careful driver avoids`));
  steps.push(step("Files checked", data.checked.files, data.checked.problems.length ? many(data.checked.problems.length, "problem") : "all valid"));
  const back = rounds.slice(1).map((searches, i) => el("p", { class: "loop" }, `Round ${i + 2} started from ${many(total(rounds[i], "failed"), "failure")} of round ${i + 1} (${many(total(rounds[i], "distinct"), "collision")} unlike each other among them) and found ${many(total(searches, "new"), "collision")} unlike all of those, with as many runs.`));
  return el("section", { class: "panel" }, el("h2", null, "The loop"), el("p", { class: "muted" }, `System under test: ${data.settings.sut}. Recordings become scenarios, scenarios become edge cases, and what it fails at is where the next round of search begins.`),
    el("ol", { class: "flow" }, ...steps), ...back, settings());
}

function settings() {
  const told = Object.entries(data.settings).flatMap(([name, value]) => [el("dt", null, name), el("dd", null, value)]);
  const reports = data.reports.map(each => el("li", null, el("a", { href: link(each.file) }, each.title)));
  return el("details", null, el("summary", { class: "muted" }, "settings and reports of all runs"), el("dl", null, ...told), el("ul", null, ...reports));
}

// recognised ----------------------------------------------------------------------------------

function recognised() {
  if (!data.recordings) return null;
  const groups = STATES.flatMap(state => data.classes.filter(each => each.state === state).map(group));
  const none = STATES.filter(state => !scenarios(state)).map(state => el("p", { class: "muted" }, `No ${state} scenarios.`));
  return el("section", { class: "panel" }, el("h2", null, "Recognised in the recordings"),
    el("p", { class: "muted" }, "Known: one of the classes that the model has learnt. Unknown: unlike all of them. Discovered: unknown, but frequent and alike, so that the model has taken it for a class of its own, which has no name yet."),
    ...groups, ...none, el("p", null, "All of them: ", el("a", { href: link(data.catalogue) }, data.catalogue)));
}

function group(each) {
  const votes = each.state === "known" ? "confidence" : "votes for the nearest known class";
  const sure = each.rows.map(row => row.confidence).filter(value => value !== null), range = sure.length ? `${votes} ${short(least(sure))} to ${short(greatest(sure))}` : "";
  const shown = each.rows.length < each.count ? `${each.rows.length} shown` : "";
  const columns = [["replay", null], [votes, null], ["vehicle", null], ["recording", null], ["time (s)", "number"], ["participants", "number"], ["least TTC (s)", "number"], ["least distance (m)", "number"], [each.state === "known" ? "rules say" : "nearest known class", null], ["files", null]];
  return el("details", { class: "group", open: each.state === "discovered" },
    el("summary", null, el("span", { class: "count" }, String(each.count)), el("h3", null, each.title), badge(each.state, each.state), el("span", { class: "muted" }, [range, shown].filter(Boolean).join(", "))),
    table(each.title, columns, each.rows.map(row => recorded(row, each.state))));
}

function recorded(row, state) {
  const sure = row.confidence === null ? "–" : el("span", { class: "sure" }, el("i", { style: `--share:${100 * row.confidence}%` }), row.confidence.toFixed(2));
  const says = state === "known" ? row.rule_class : row.model_class;
  return el("tr", null, el("td", null, play(row.play, row.name)), el("td", null, sure), el("td", null, row.vehicle), el("td", null, row.recording), number(row.time), number(row.participants),
    number(row.measures.min_ttc), number(row.measures.min_distance), el("td", { class: "muted" }, says && says !== "unknown" ? says : "–"), files(row.files, row.name));
}

// generated -----------------------------------------------------------------------------------

function generated() {
  const failed = data.searches.filter(search => search.error);
  const refused = [...data.refused.map(({ title, reason }) => [title, reason]), ...failed.map(search => [`${search.title}, round ${search.round}`, search.error])];
  const why = refused.length ? el("details", { class: "group" }, el("summary", null, el("h3", null, `Not varied: ${many(refused.length, "class", "classes")}`)), el("dl", null, ...refused.flatMap(([title, reason]) => [el("dt", null, title), el("dd", null, reason)]))) : null;
  return el("section", { class: "panel" }, el("h2", null, "Edge cases generated"),
    el("p", { class: "muted" }, "Log-likelihood: how likely recorded traffic makes the parameters; higher is more plausible. R_risk: share of time in which RSS distances are violated. The careful driver is the competent and careful human of UN R157: a collision that it avoids is one that the system should have avoided."),
    ...done.map(search => searched(search)), why);
}

function searched(search) {
  const columns = [["replay", null], ["verdict", null], ["careful driver", null], ["log-likelihood", "number"], ["R_risk", "number"], ["recognised in the run", null], ["files", null], ["parameters", null]];
  const told = `${many(search.calls, "run")}, ${many(search.collisions, "collision")}, ${search.new} new and unlike each other; density of ${search.prior}`;
  return el("details", { class: "group", open: search.cases.length > 0 && search === done[0] },
    el("summary", null, el("span", { class: "count" }, String(search.cases.length)), el("h3", null, search.title), badge("plain", `round ${search.round}`), el("span", { class: "muted" }, told)),
    search.cases.length ? table(`${search.title}, round ${search.round}`, columns, search.cases.map(each => edge(each))) : el("p", { class: "muted" }, "No run was critical."),
    el("p", { class: "muted" }, `Scenario ${search.scenario}; kept as they are: ${Object.entries(search.pinned).map(([name, value]) => `${name} ${value}`).join(", ") || "no parameters"}.`));
}

function edge(each) {
  const verdict = badge(each.verdict === "collision" ? "failed" : "unknown", each.verdict === "collision" ? "collision" : "RSS violated");
  const careful = avoidable(each) ? badge("avoidable", "avoids it") : el("span", { class: "muted" }, each.careful === "collision" ? "collides too" : each.careful);
  const seen = each.recognised.length ? each.recognised.map(({ title, file }, i) => el("span", null, i ? ", " : "", el("a", { href: link(file) }, title))) : ["–"];
  const theta = Object.entries(each.theta).map(([name, value]) => `${name} ${short(value)}`).join(", ");
  return el("tr", null, el("td", null, play(each.play, each.name)), el("td", null, verdict), el("td", null, careful), number(each.likelihood), number(each.risk), el("td", null, ...seen), files(each.files, each.name), el("td", { class: "theta muted" }, theta));
}

// parameter space -----------------------------------------------------------------------------

function space() {
  if (!done.length) return null;
  const targets = [...new Map(done.map(search => [search.target, search])).values()];
  const select = (title, options) => { const chosen = el("select", { "aria-label": title }, ...options); return [el("label", null, title, chosen), chosen]; };
  const [forTarget, target] = select("Class", targets.map(each => el("option", { value: each.target }, each.title)));
  const [forX, x] = select("Across", []), [forY, y] = select("Up", []);
  const canvas = el("canvas", { role: "img", click: open, mousemove: point }), told = el("p", { class: "muted", "aria-live": "polite" });
  const roundColour = round => colour(round === 1 ? "bad" : "second");
  let places = [];

  function choose() {
    const { parameters } = targets.find(each => each.target === target.value);
    [[x, 0], [y, 1]].forEach(([which, first]) => which.replaceChildren(...parameters.map((each, i) => el("option", { value: i, selected: i === first }, each.name))));
    draw();
  }

  function draw() {
    const searches = done.filter(search => search.target === target.value), [{ parameters, real }] = searches;
    const { ctx, width, height } = fitted(canvas), [u, v] = [Number(x.value), Number(y.value)], xs = [46, width - 10], ys = [height - 22, 8];
    const range = i => { const { low, high } = parameters[i], room = (high - low) * 0.03; return [low - room, high + room]; };
    const us = range(u), vs = range(v), at = (value, [from, to], [low, high]) => from + (value - low) / (high - low) * (to - from);
    const dot = (theta, shape) => { const place = [at(theta[u], xs, us), at(theta[v], ys, vs)]; ctx.beginPath(); shape(...place); return place; };
    ctx.clearRect(0, 0, width, height);
    axes(ctx, xs, ys, us, vs, height);
    ctx.fillStyle = colour("accent");
    ctx.globalAlpha = 0.3;
    for (const search of searches) for (const theta of search.tried) { dot(theta, (a, b) => ctx.arc(a, b, 1.8, 0, 7)); ctx.fill(); }
    ctx.globalAlpha = 0.8;
    ctx.strokeStyle = colour("muted");
    for (const theta of real) { dot(theta, (a, b) => ctx.arc(a, b, 3, 0, 7)); ctx.stroke(); }
    ctx.globalAlpha = 1;
    places = searches.flatMap(search => search.cases.map(each => {
      ctx.fillStyle = roundColour(search.round);
      const [a, b] = dot(parameters.map(({ name }) => each.theta[name]), (p, q) => ctx.rect(p - 4.5, q - 4.5, 9, 9));
      ctx.fill();
      return { each, round: search.round, a, b };
    }));
    const words = `${parameters[v].name} over ${parameters[u].name}: ${many(real.length, "recorded manoeuvre")}, ${many(sum(searches.map(search => search.tried.length)), "run")} of the search, ${many(places.length, "edge case")}`;
    canvas.setAttribute("aria-label", words);
    told.textContent = `${words}. Point at an edge case to see which it is, click to play it; the tables above list them all.`;
  }

  function near(event) {
    const { left, top } = canvas.getBoundingClientRect(), away = ({ a, b }) => Math.hypot(a - event.clientX + left, b - event.clientY + top);
    const best = places.reduce((p, q) => (p && away(p) <= away(q) ? p : q), null);
    return best && away(best) < 14 ? best : null;
  }

  function point(event) {
    const found = near(event);
    if (found) told.textContent = `${found.each.name}, round ${found.round}: ${found.each.verdict}, log-likelihood ${short(found.each.likelihood)}`;
  }

  function open(event) {
    const found = near(event);
    if (found?.each.play) location.href = link(found.each.play);
  }

  target.addEventListener("change", choose);
  for (const which of [x, y]) which.addEventListener("change", draw);
  redraws.push(draw);
  const key = [el("li", null, el("i", { class: "ring" }), "recorded"), el("li", null, el("i", { style: "background:var(--accent)" }), "runs of the search"),
    ...rounds.map((_, i) => el("li", null, el("i", { class: "square", style: `background:var(--${i ? "second" : "bad"})` }), `edge cases, round ${i + 1}`))];
  const section = el("section", { class: "panel space" }, el("h2", null, "Parameter space: recorded and generated"), el("div", { class: "choices" }, forTarget, forX, forY), canvas, el("ul", { class: "legend" }, ...key), told);
  queueMicrotask(choose);
  return section;
}

// the user's scenarios, and what is not as it should be ---------------------------------------

function own() {
  if (!data.scenarios.length) return null;
  const columns = [["replay", null], ["scenario", null], ["verdict", null], ["why", null], ["end (s)", "number"], ["least TTC (s)", "number"], ["least distance (m)", "number"]];
  const rows = data.scenarios.map(run => el("tr", null, el("td", null, play(run.play, run.name)), el("td", null, run.name), el("td", null, badge(run.state, run.state)), el("td", { class: "muted" }, run.message || "–"), number(run.end), number(run.measures.min_ttc), number(run.measures.min_distance)));
  return el("section", { class: "panel" }, el("h2", null, "Your scenarios"), table("Your scenarios", columns, rows));
}

function problems() {
  const unread = Object.entries(data.unread).map(([name, error]) => `${name}: ${error}`), listed = [...unread, ...data.checked.problems];
  if (!listed.length) return null;
  return el("section", { class: "panel" }, el("h2", null, "Problems"), el("ul", null, ...listed.map(each => el("li", null, each))));
}

document.body.append(el("main", { id: "page" }, ...[el("h1", null, `${data.title}: from recordings to edge cases`), flow(), problems(), recognised(), generated(), space(), own()].filter(Boolean)));
const redraw = () => redraws.forEach(draw => draw());
new ResizeObserver(redraw).observe(document.getElementById("page"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
