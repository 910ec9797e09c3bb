// Any two parameters or measures against each other, each run where it truly is.

const MARK = 4; // half the size of a run's mark, px
const NUMBERED = 1000; // marks up to which those of several runs bear their number
const EDGE = { left: 62, right: 14, top: 12, bottom: 40 }; // px around the plot

function scatter() {
  if (numeric.length < 2) return null;
  const usual = numeric.filter(column => column.numbers > data.runs.length / 2);
  const first = usual[0] || numeric[0],
    second = usual.find(column => column !== first && !column.parameter) || numeric.find(column => column !== first);
  const axis = { x: first, y: second };
  const choose = (label, which) =>
    choice(
      label,
      numeric.map(column => [column.id, column.title]),
      id => {
        axis[which] = numeric.find(column => column.id === id);
        refresh();
      },
      axis[which].id,
    );
  const canvas = el("canvas", { role: "img", click: open, mousemove: point }),
    told = el("p", { class: "muted", "aria-live": "polite" });
  let places = [];

  /** Bounds of an axis, over all runs, so that filters do not move it. */
  function range(column) {
    const values = data.runs.map(column.of).filter(value => typeof value === "number"),
      low = least(values),
      high = Math.min(greatest(values), Math.max(column.most ?? Infinity, low)),
      room = (high - low) * 0.05 || Math.abs(high) * 0.05 || 0.5;
    return { low: low - room, high: high + room, most: high };
  }

  function draw(runs) {
    const { ctx, width, height } = fitted(canvas),
      [us, vs] = [range(axis.x), range(axis.y)],
      [xs, ys] = [
        [EDGE.left, width - EDGE.right],
        [height - EDGE.bottom, EDGE.top],
      ];
    const at = (value, [from, to], { low, high, most }) => from + ((Math.min(value, most) - low) / (high - low)) * (to - from);
    const there = runs.filter(run => [axis.x, axis.y].every(column => typeof column.of(run) === "number"));
    places = marks(there.map(run => ({ run, x: at(axis.x.of(run), xs, us), y: at(axis.y.of(run), ys, vs) })));
    ctx.clearRect(0, 0, width, height);
    axes(ctx, xs, ys, [us.low, us.high], [vs.low, vs.high], height, { across: axis.x.title, up: axis.y.title });
    const colours = Object.fromEntries([...STATES, "muted"].map(name => [name, colour(name)])); // to look one up is slow
    ctx.font = "10px system-ui, sans-serif";
    ctx.textAlign = "left";
    const numbered = places.length <= NUMBERED;
    for (const place of places) mark(ctx, place, colours, numbered);
    const beyond = there.filter(run => axis.x.of(run) > us.most || axis.y.of(run) > vs.most).length;
    canvas.setAttribute("aria-label", `${many(there.length, "run")}, ${axis.y.title} over ${axis.x.title}`);
    const counted = numbered ? ", a number counts runs in one place" : "";
    told.textContent =
      `${many(there.length, "run")}; squares have not passed${counted}. ` +
      (beyond ? `${beyond} beyond the edge, drawn at it. ` : "") +
      "Point at one to see which it is, click to play it.";
  }

  /** Runs in the same place as one mark, failures on top of what passed. */
  function marks(found) {
    const taken = new Map();
    for (const { run, x, y } of found) {
      const key = `${Math.round(x)} ${Math.round(y)}`;
      if (!taken.has(key)) taken.set(key, { x, y, runs: [] });
      taken.get(key).runs.push(run);
    }
    for (const { runs } of taken.values()) runs.sort((a, b) => STATES.indexOf(a.state) - STATES.indexOf(b.state));
    return [...taken.values()].sort((a, b) => STATES.indexOf(b.runs[0].state) - STATES.indexOf(a.runs[0].state));
  }

  function mark(ctx, { x, y, runs }, colours, numbered) {
    const bad = runs.some(run => run.state !== "passed"),
      good = runs.some(run => run.state === "passed");
    if (good) {
      ctx.fillStyle = colours.passed;
      ctx.beginPath();
      ctx.arc(x, y, bad ? MARK * 1.7 : MARK, 0, 7); // a ring around failures where others passed
      ctx.fill();
    }
    if (bad) {
      ctx.fillStyle = colours[runs[0].state];
      ctx.fillRect(x - MARK, y - MARK, 2 * MARK, 2 * MARK);
    }
    if (runs.length === 1 || !numbered) return;
    ctx.fillStyle = colours.muted;
    ctx.fillText(String(runs.length), x + MARK + 3, y - MARK);
  }

  function near(event) {
    const { left, top } = canvas.getBoundingClientRect(),
      away = place => Math.hypot(place.x - event.clientX + left, place.y - event.clientY + top);
    const best = places.reduce((a, b) => (a && away(a) <= away(b) ? a : b), null);
    return best && away(best) < 14 ? best.runs : null;
  }

  function point(event) {
    const runs = near(event);
    if (!runs) return;
    const text = run =>
      `${run.name}: ${run.state}, ${axis.x.title} ${shown(axis.x, run)}, ${axis.y.title} ${shown(axis.y, run)}` +
      (run.replay ? "" : " (no replay)");
    told.textContent = text(runs[0]) + (runs.length > 1 ? `; and ${many(runs.length - 1, "more run")} here` : "");
  }

  function open(event) {
    const found = (near(event) ?? []).find(run => run.replay);
    if (found) location.href = link(found);
  }

  drawings.push(draw);
  return el(
    "section",
    { class: "panel scatter" },
    el("h2", null, "Parameters and measures"),
    el("div", { class: "choices" }, choose("Across", "x"), choose("Up", "y")),
    canvas,
    told,
  );
}
