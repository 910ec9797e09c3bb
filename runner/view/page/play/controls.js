// Playing, stepping, jumping from event to event, and the participant to follow.

const RATES = [0.1, 0.25, 0.5, 1, 2, 5, 10];
const THUMB = 8; // px by which the slider's ends lie inside of it

const button = (label, action, attributes, text) =>
  el("button", { "aria-label": label, title: label, click: action, ...attributes }, text);

/** Instants at which something is worth a line in the log, ascending: time and the gravest kind of what happens. */
function moments(runs) {
  const rank = kind => ["collision", "interventionStart"].indexOf(kind) + 1 || 3,
    found = new Map();
  for (const run of runs)
    for (const [time, kind] of run.events) {
      const key = Math.round(time * 1000);
      if (!found.has(key) || rank(kind) < rank(found.get(key).kind)) found.set(key, { time, kind });
    }
  return [...found.values()].sort((a, b) => a.time - b.time);
}

const TICKS = { collision: "collision", interventionStart: "intervention" };

/** The slider with a tick at each moment. */
function slider(end, found, seek) {
  const input = el("input", {
    type: "range",
    min: 0,
    max: end,
    step: "any",
    "aria-label": "Time in seconds",
    input: () => seek(Number(input.value)),
  });
  const marks = found.map(({ time, kind }) =>
    el("i", { class: TICKS[kind] ?? "event", style: `left:calc(${THUMB}px + (100% - ${2 * THUMB}px) * ${time / end})` }),
  );
  return { input, node: el("div", { class: "slider" }, el("div", { class: "ticks", "aria-hidden": "true" }, ...marks), input) };
}

/** A choice among options of a value and a text. */
function choice(label, options, chosen, change) {
  const select = el(
    "select",
    { "aria-label": label, change: () => change(select.value) },
    ...options.map(([value, text]) => el("option", { value, selected: value === chosen }, text)),
  );
  return select;
}
