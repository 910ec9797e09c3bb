// How often each measure has which value.

const BINS = 24;

/** Counts of runs of each state in bins between two values; what lies beyond is in the last bin. */
function binned(column, runs, low, wide) {
  const bins = Array.from({ length: BINS }, () => Object.fromEntries(STATES.map(state => [state, 0])));
  for (const run of runs) {
    const value = column.of(run);
    if (typeof value === "number") bins[Math.min(BINS - 1, Math.floor((value - low) / wide))][run.state]++;
  }
  return bins;
}

function histogram(column) {
  const all = data.runs.map(column.of).filter(value => typeof value === "number");
  if (!all.length) return null;
  const low = least(all),
    high = Math.min(greatest(all), Math.max(column.most ?? Infinity, low)),
    wide = (high - low) / BINS || 1;
  const canvas = el("canvas", { role: "img" }),
    told = el("p", { class: "muted" });
  drawings.push(runs => {
    const sorted = Float64Array.from(runs.map(column.of).filter(value => typeof value === "number")).sort();
    const beyond = sorted.filter(value => value > high).length,
      called = `${beyond === 1 ? "is" : "are"} ${column.beyond || `beyond ${sized(column, high)}`}`;
    told.textContent = sorted.length
      ? `${many(sorted.length, "run")}, from ${sized(column, sorted[0])}` +
        (beyond ? `; ${beyond} ${called} (last bar)` : ` to ${sized(column, sorted.at(-1))}`) +
        (beyond * 2 > sorted.length ? "" : `, median ${sized(column, sorted[Math.floor(sorted.length / 2)])}`)
      : "no runs";
    canvas.setAttribute("aria-label", `${column.title}: ${told.textContent}`);
    drawBins(canvas, binned(column, runs, low, wide), [low, low + wide * BINS]);
  });
  return el("div", null, el("h3", null, column.title), canvas, told);
}

function drawBins(canvas, bins, range) {
  const { ctx, width, height } = fitted(canvas),
    most = Math.max(1, greatest(bins.map(bin => STATES.reduce((sum, state) => sum + bin[state], 0))));
  const step = (width - 46) / BINS,
    y = count => height - 18 - (count / most) * (height - 26);
  const colours = Object.fromEntries(STATES.map(state => [state, colour(state)]));
  ctx.clearRect(0, 0, width, height);
  bins.forEach((bin, i) => {
    let sum = 0;
    for (const state of STATES) {
      ctx.fillStyle = colours[state];
      ctx.fillRect(40 + i * step, y(sum + bin[state]), Math.max(1, step - 1), y(sum) - y(sum + bin[state]));
      sum += bin[state];
    }
  });
  axes(ctx, [40, width - 6], [y(0), y(most)], range, [0, most], height, { up: "runs" });
}

function distributions() {
  const found = Object.keys(data.measures)
    .map(id => histogram(columns.find(column => column.id === id)))
    .filter(Boolean);
  return found.length
    ? el("section", { class: "panel" }, el("h2", null, "Distributions"), el("div", { class: "histograms" }, ...found))
    : null;
}
