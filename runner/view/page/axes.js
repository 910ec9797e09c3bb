// Colours of the page, short numbers, axes of plots.

const style = getComputedStyle(document.documentElement);
const colour = name => style.getPropertyValue("--" + name).trim();
const short = value =>
  typeof value !== "number"
    ? (value ?? "–")
    : Math.abs(value) < 1e6
      ? String(Number(value.toPrecision(4)))
      : value.toExponential(1);

/** Extremes of arrays of any length. */
const least = values => values.reduce((a, b) => Math.min(a, b));
const greatest = values => values.reduce((a, b) => Math.max(a, b));

/** Lines and numbers along two axes; `xs`, `ys` in pixels stand for `us`, `vs`. Titles say what is `across` and `up`. */
function axes(ctx, xs, ys, us, vs, height, { across = "", up = "" } = {}) {
  ctx.strokeStyle = colour("line");
  ctx.fillStyle = colour("muted");
  ctx.font = "11px system-ui, sans-serif";
  ctx.lineWidth = 1;
  ctx.beginPath();
  ctx.moveTo(xs[0], ys[1]);
  ctx.lineTo(xs[0], ys[0]);
  ctx.lineTo(xs[1], ys[0]);
  ctx.stroke();
  ctx.textAlign = "center";
  for (const u of ticks(us[0], us[1], 5))
    ctx.fillText(short(u), xs[0] + ((u - us[0]) / (us[1] - us[0] || 1)) * (xs[1] - xs[0]), ys[0] + 14);
  ctx.textAlign = "right";
  for (const v of ticks(vs[0], vs[1], 4))
    ctx.fillText(short(v), xs[0] - 4, ys[0] + ((v - vs[0]) / (vs[1] - vs[0] || 1)) * (ys[1] - ys[0]) + 4);
  ctx.textAlign = "center";
  ctx.font = "600 12px system-ui, sans-serif";
  if (across) ctx.fillText(across, (xs[0] + xs[1]) / 2, height - 5);
  if (!up) return;
  ctx.save();
  ctx.translate(12, (ys[0] + ys[1]) / 2);
  ctx.rotate(-Math.PI / 2);
  ctx.fillText(up, 0, 0);
  ctx.restore();
}
