// Questions to the rows of a page, in the language of `xosc-list --where`. A condition becomes a function; nothing is executed.
// As there, an absent value (null) meets `is null` alone: and, or, not are those of three values.

const PIECE = new RegExp(
  "(?<number>[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d+)?(?:\\s*(?:km/h|mph|m/s)(?!\\w))?)" +
    "|(?<text>'(?:[^']|'')*'|\"(?:[^\"]|\"\")*\")|(?<name>[\\p{L}_][\\p{L}\\p{N}_]*)" +
    "|(?<sign>[=<>!]=|<>|[=<>(),])",
  "uy",
);
const WORDS = new Set(["and", "or", "not", "between", "in", "is", "null", "like", "true", "false"]);
const SPEEDS = { "km/h": 1 / 3.6, mph: 0.44704, "m/s": 1 }; // m/s
const MOST_ASKED = 2000; // characters
const DEEPEST = 50; // brackets in each other
const EQUAL = "=".repeat(2), // the sign, which the scripts' own comparisons are not to use
  UNEQUAL = "!".concat("=");
const same = (a, b) => a === b,
  differs = (a, b) => a !== b;
const COMPARED = {
  "=": same, [EQUAL]: same, [UNEQUAL]: differs, "<>": differs,
  "<": (a, b) => a < b, "<=": (a, b) => a <= b, ">": (a, b) => a > b, ">=": (a, b) => a >= b,
};

const inverse = value => (value === null ? null : !value);
const bothHold = (a, b) => (a === false || b === false ? false : a === null || b === null ? null : true);
const eitherHolds = (a, b) => inverse(bothHold(inverse(a), inverse(b)));
const unquoted = text => text.slice(1, -1).replaceAll(text[0] + text[0], text[0]);

function refused(token, why) {
  return new SyntaxError(`position ${token.at} (${token.text}): ${why}`);
}

/** A number in m/s where it is a speed. */
function amount(text) {
  const unit = Object.keys(SPEEDS).find(each => text.endsWith(each)) ?? "";
  return Number(text.slice(0, text.length - unit.length)) * (SPEEDS[unit] ?? 1);
}

/** A text with % and _ as in SQL, as an expression. */
function pattern(text) {
  const parts = [...text].map(sign => ({ "%": ".*", _: "." })[sign] ?? sign.replace(/[\\^$.*+?()[\]{}|/]/, "\\$&"));
  return new RegExp(`^${parts.join("")}$`, "su");
}

function pieces(text, kinds) {
  if (text.length > MOST_ASKED) throw new SyntaxError(`a condition has at most ${MOST_ASKED} characters, not ${text.length}`);
  const found = [];
  for (let at = 0; at < text.length; ) {
    if (/\s/.test(text[at])) {
      at++;
      continue;
    }
    PIECE.lastIndex = at;
    const groups = PIECE.exec(text)?.groups;
    if (!groups) {
      const open = "'\"".includes(text[at]);
      const token = { text: text.slice(at, at + 12), at: at + 1 };
      throw refused(token, open ? "this text has no closing quote" : "this is no part of a condition");
    }
    const [kind, piece] = Object.entries(groups).find(([, value]) => value !== undefined);
    const word = kind === "name" && WORDS.has(piece.toLowerCase()) && !kinds.has(piece);
    found.push({ kind: word ? "word" : kind, text: word ? piece.toLowerCase() : piece, at: at + 1 });
    at = PIECE.lastIndex;
  }
  return [...found, { kind: "end", text: "the end", at: text.length + 1 }];
}

/**
 * The function of a row that a condition states: true, false, or null where a value is absent.
 * `kinds` has the type of each column (number, text, truth), `value` gives a row's value in one.
 */
function condition(text, kinds, value) {
  const tokens = pieces(text, kinds);
  let next = 0,
    depth = 0;
  const take = (kind, ...texts) => {
    const token = tokens[next];
    if (token.kind !== kind || (texts.length && !texts.includes(token.text))) return null;
    next++;
    return token;
  };
  const need = (kind, piece) => {
    if (!take(kind, piece)) throw refused(tokens[next], `'${piece}' is expected`);
  };

  function joined(word, part, how) {
    let found = part();
    while (take("word", word)) {
      const [one, other] = [found, part()];
      found = row => how(one(row), other(row));
    }
    return found;
  }
  const any = () => joined("or", all, eitherHolds);
  const all = () => joined("and", negated, bothHold);

  function negated() {
    let inverted = false;
    while (take("word", "not")) inverted = !inverted;
    const found = one();
    return inverted ? row => inverse(found(row)) : found;
  }

  function one() {
    const bracket = take("sign", "(");
    if (!bracket) return comparison(operand());
    if (++depth > DEEPEST) throw refused(bracket, `more than ${DEEPEST} brackets in each other`);
    const found = any();
    need("sign", ")");
    depth--;
    return found;
  }

  function comparison(left) {
    const sign = take("sign", ...Object.keys(COMPARED));
    if (sign) return compared(left, sign, operand());
    if (take("word", "is")) {
      const inverted = take("word", "not");
      need("word", "null");
      return row => (left.of(row) === null) !== Boolean(inverted);
    }
    const inverted = take("word", "not"),
      at = tokens[next];
    const found = ranged(left, at);
    if (!found && left.type === "truth" && !inverted) return left.of;
    if (!found) throw refused(at, `a comparison is expected: =, ${UNEQUAL}, <, <=, >, >=, between, in, like, is null`);
    return inverted ? row => inverse(found(row)) : found;
  }

  function ranged(left, at) {
    if (take("word", "between")) {
      const low = compared(left, { ...at, text: ">=" }, operand());
      need("word", "and");
      const high = compared(left, { ...at, text: "<=" }, operand());
      return row => bothHold(low(row), high(row));
    }
    if (take("word", "in")) return listed(left);
    return take("word", "like") ? alike(left, at) : null;
  }

  function listed(left) {
    need("sign", "(");
    const equals = { text: "=", at: tokens[next].at },
      found = [compared(left, equals, operand())];
    while (take("sign", ",")) found.push(compared(left, equals, operand()));
    need("sign", ")");
    return row => found.map(each => each(row)).reduce(eitherHolds);
  }

  function alike(left, at) {
    const told = take("text");
    if (left.type !== "text" || !told)
      throw refused(told ? at : tokens[next], "'like' compares a column of texts with a text: site like 'US-101%'");
    const expected = pattern(unquoted(told.text));
    return row => (left.of(row) === null ? null : expected.test(left.of(row)));
  }

  function compared(left, sign, right) {
    if (left.type !== right.type) throw refused(right.token, `${left.token.text} is a ${left.type}, this is a ${right.type}`);
    if (left.type === "truth" && /[<>]/.test(sign.text) && sign.text !== "<>")
      throw refused(sign, `${left.token.text} is true or false and has no order`);
    return row => {
      const [a, b] = [left.of(row), right.of(row)];
      return a === null || b === null ? null : COMPARED[sign.text](a, b);
    };
  }

  function operand() {
    const token = tokens[next];
    if (token.kind !== "end") next++;
    const fixed = (type, known) => ({ type, token, of: () => known });
    if (token.kind === "number") return fixed("number", amount(token.text));
    if (token.kind === "text") return fixed("text", unquoted(token.text));
    if (token.kind === "word" && ["true", "false"].includes(token.text)) return fixed("truth", token.text === "true");
    if (token.kind !== "name") throw refused(token, "a column, a number or a text in quotes is expected");
    if (!kinds.has(token.text)) throw refused(token, `there is no such column; columns: ${[...kinds.keys()].join(", ")}`);
    return { type: kinds.get(token.text), token, of: row => value(row, token.text) ?? null };
  }

  const found = any();
  if (tokens[next].kind !== "end") throw refused(tokens[next], "'and', 'or' or the end is expected");
  return found;
}

/** The type of a column by its values. */
const kindOf = values => {
  const there = values.filter(each => each !== null && each !== undefined);
  if (there.every(each => typeof each === "number")) return "number";
  return there.every(each => typeof each === "boolean") ? "truth" : "text";
};

/**
 * A box for questions. `ask` is called with a function that says whether a row meets the condition, or null for all rows; a
 * condition that is not understood leaves the rows as they are, and says why once it is complete (Enter, or leaving the box).
 */
function questionBox(kinds, value, example, ask) {
  const told = el("p", { class: "fault", role: "alert" });
  const asked = complete => {
    try {
      const meets = box.value.trim() ? condition(box.value, kinds, value) : null;
      told.textContent = "";
      ask(meets && (row => meets(row) === true));
    } catch (error) {
      if (!(error instanceof SyntaxError)) throw error;
      told.textContent = complete ? error.message : "";
    }
  };
  const box = el("input", {
    type: "search",
    class: "question",
    "aria-label": "Question",
    placeholder: example,
    title: `A condition, as of xosc-list --where. Columns: ${[...kinds.keys()].join(", ")}`,
    input: () => asked(false),
    change: () => asked(true),
  });
  return [box, told];
}
