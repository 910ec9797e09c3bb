// A scenario explored: parameters and systems are chosen here, the player beside them shows the run.

/** Ask the server; its answer, or an error with what it says. */
async function ask(what, values) {
  const answer = await fetch(what, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ row: data.row, ...values }),
  }).catch(() => {
    throw new Error("the command has ended: start it again");
  });
  if (!answer.ok)
    throw Object.assign(new Error((await answer.json()).error ?? answer.statusText), { status: answer.status });
  return answer;
}

const point = Object.fromEntries(data.parameters.map(({ name, value }) => [name, value]));
const asDeclared = { ...point };
let chosenSystems = [data.system];

const status = el("p", { class: "status", role: "status" });
const fault = el("p", { class: "fault", role: "alert" });

// the run of the point ------------------------------------------------------------------------

const SUPERSEDED = 409;
const PATIENCE = 400; // ms after which a newer point is sent although the one before is not answered
const film = { asked: 0, shown: 0, since: 0, waiting: false, ground: "" };

/** Play the point; while a run is awaited the newest point waits, and for long runs it takes their place. */
function renew() {
  const now = performance.now();
  if (film.asked > film.shown && now - film.since < PATIENCE) {
    if (!film.waiting) setTimeout(renewed, PATIENCE - (now - film.since) + 1);
    film.waiting = true;
    return;
  }
  playPoint();
}

function renewed() {
  if (!film.waiting) return;
  film.waiting = false;
  renew();
}

async function playPoint() {
  const number = ++film.asked,
    from = performance.now();
  film.since = from;
  film.waiting = false;
  if (number === 1) status.textContent = "the first run is prepared …";
  try {
    const found = await (await ask("film", { parameters: point, systems: chosenSystems, ground: film.ground })).json();
    if (number < film.shown) return;
    film.shown = number;
    if (found.error) tellFault(found.error);
    else {
      film.ground = found.ground;
      load(found.scene);
      tellFault("");
      if (number === 1 && !clock.time) seek(runs[0].account[0]?.[1] ?? 0); // the moment that the verdict is about
      const verdicts = runs.flatMap((run, i) => [
        sign(runs, i),
        el("span", { class: `badge ${run.verdict}` }, run.verdict),
        " ",
      ]);
      status.replaceChildren(
        ...verdicts.filter(Boolean),
        el("span", { class: "muted" }, `${Math.round(performance.now() - from)} ms`),
      );
    }
  } catch (error) {
    if (error.status === SUPERSEDED) return;
    film.shown = Math.max(film.shown, number);
    tellFault(error.message);
  }
  if (film.waiting && number === film.asked) renewed();
}

function tellFault(text) {
  fault.textContent = text;
  main.classList.toggle("stale", text !== "");
  if (text) status.textContent = "this point could not be played; the run before is shown";
}

// parameters ----------------------------------------------------------------------------------

const GRAINS = 200; // steps of a slider

/** A row of the panel: name, value, slider, and where the run begins to fail along it. */
function knob(parameter) {
  const { name, kind, low, high, choices, limited } = parameter,
    id = `p-${name}`,
    isNumber = kind === "number" || kind === "whole";
  const set = value => {
    point[name] = value;
    show();
    renew();
    placeOnMap();
  };
  const box = choices.length
    ? choice(
        name,
        choices.map(each => [each, each]),
        parameter.value,
        set,
      )
    : el("input", { id, type: "text", inputmode: isNumber ? "decimal" : null, change: () => set(box.value.trim()) });
  const slide = isNumber
    ? el("input", {
        type: "range",
        min: low,
        max: high,
        step: kind === "whole" ? 1 : "any",
        "aria-label": `${name}, slider`,
        input: () => set(textOf(parameter, Number(slide.value))),
        keydown: event => {
          const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
          if (!by || kind === "whole") return;
          event.preventDefault();
          const to = Number(slide.value) + (by * (high - low)) / GRAINS;
          set(textOf(parameter, Math.min(high, Math.max(low, to))));
        },
      })
    : null;
  const dots = el("div", { class: "dots", "aria-hidden": "true" }),
    told = el("p", { class: "told-border muted", role: "status" });
  const find = isNumber
    ? el("button", { class: "plain", click: () => findBorder(parameter, dots, told, set) }, "Where does it begin to fail?")
    : null;
  if (find) find.setAttribute("aria-label", `Where does it begin to fail along ${name}?`);
  const ends = isNumber
    ? el(
        "div",
        { class: "ends muted" },
        `${rounded(low)} to ${rounded(high)}${limited ? "" : " (no limits declared)"}`,
        find,
      )
    : null;
  const node = el(
    "div",
    { class: "knob" },
    el("label", { for: choices.length ? null : id }, ...name.split(/(?<=_)/).flatMap(part => [part, el("wbr", null)])),
    box,
    slide ? el("div", { class: "slide" }, slide, dots) : null,
    ends,
    told,
  );
  function show() {
    box.value = point[name];
    if (slide) slide.value = point[name];
    if (slide) slide.setAttribute("aria-valuetext", point[name]);
    node.classList.toggle("changed", point[name] !== asDeclared[name]);
  }
  show();
  return { name, node, show };
}

const rounded = value => String(Number(value.toPrecision(4)));
/** A number as the scenario's parameter takes it, in steps of the slider. */
function textOf({ kind, low, high }, value) {
  if (kind === "whole") return String(Math.round(value));
  const grain = 10 ** Math.floor(Math.log10((high - low) / GRAINS));
  return String(Number((Math.round(value / grain) * grain).toPrecision(6)));
}

function setPoint(values) {
  Object.assign(point, values);
  for (const each of knobs) each.show();
  placeOnMap();
  renew();
}

/** Scan and bisect along a parameter; a line about it, and a dot at each value that was played. */
async function findBorder(parameter, dots, told, set) {
  const { name, low, high } = parameter;
  told.textContent = "playing …";
  try {
    const found = await (await ask("border", { parameters: point, system: chosenSystems[0], parameter: name })).json();
    const share = value => Math.min(1, Math.max(0, (Number(value) - low) / (high - low || 1)));
    dots.replaceChildren(
      ...found.points.map(([value, state]) => el("i", { class: state, style: `left:${100 * share(value)}%` })),
    );
    if (!found.edge) {
      const all = found.points.every(([, state]) => state === "failed");
      const span = `${found.points.length} values from ${rounded(low)} to ${rounded(high)}`;
      told.textContent = `${all ? "fails" : "does not fail"} at all ${span}`;
      return;
    }
    const [holds, fails] = found.edge,
      more = found.borders > 1 ? ` (nearest of ${found.borders} borders)` : "",
      way = Number(fails) > Number(holds) ? "up" : "down";
    const go = el("button", { click: () => set(fails) }, "Show");
    go.setAttribute("aria-label", `Show the run at ${name} = ${fails}`);
    told.replaceChildren(`fails from ${fails} on ${way}wards, not at ${holds}${more}`, go);
  } catch (error) {
    told.textContent = error.message;
  }
}

const knobs = data.parameters.map(knob);
