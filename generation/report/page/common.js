// What all parts of a search's report share: its data, numbers as text, elements of SVG.

const data = JSON.parse(document.getElementById("data").textContent);
const WHICH = { likeliest_failure: "likeliest failure", nearest_failure: "failure nearest to a recording" };
const FATES = {
  new: ["failed", "new"],
  "still-there": ["failed", "still there"],
  unknown: ["unknown", "run failed"],
  fixed: ["passed", "fixed"],
  "missed-before": ["plain", "missed before"],
  unlike: ["plain", "unlike"],
};
const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

/** A number with few digits; with a power of ten where it is small. Texts stay as they are. */
const figure = (value, digits = 2) => {
  if (typeof value === "string") return value;
  if (!value || Math.abs(value) >= 1e-4) return String(Number(value.toPrecision(digits)));
  const [left, power] = value.toExponential(digits - 1).split("e");
  return `${left}·10${[...power].map(c => RAISED[c]).join("")}`;
};
/** As many digits for each number of a group, so that they can be compared: 0.70, not 0.7. */
const even = value => (Math.abs(value) >= 1e-4 && Math.abs(value) < 10 ? value.toPrecision(2) : figure(value));
/** A value of a measure: three digits, and none beyond a hundredth. */
const plain = value => String(Number(Math.abs(value) < 0.1 ? value.toFixed(2) : value.toPrecision(3)));
const withUnit = (text, unit) => (unit ? `${text} ${unit}` : text);
const label = index => {
  const { name, unit } = data.measures[index];
  return unit ? `${name} (${unit})` : name;
};
const panel = (title, ...parts) => el("section", { class: "panel" }, el("h2", null, title), ...parts);
const note = (...parts) => el("p", { class: "muted note" }, ...parts);

/** An element of SVG with attributes and children. */
function svg(tag, attributes, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
  node.append(...children);
  return node;
}
