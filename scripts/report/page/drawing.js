// Elements, numbers in words, axes, and the time that all parts share.

const SVG = "http://www.w3.org/2000/svg";

function add(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name === "text") node.textContent = value;
    else if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...(children || []));
  return node;
}

const el = (tag, attributes, ...children) => add(document.createElement(tag), attributes, children);
const draw = (tag, attributes, ...children) => add(document.createElementNS(SVG, tag), attributes, children);

// In units of a picture's own: on a narrow screen as many as it has pixels beside margins, so that its words stay legible.
const pictureWidth = () => Math.min(1000, Math.max(280, window.innerWidth - 72));
const LETTER = 7.2; // the width of a digit in a picture's words
const LINE = 18; // the height of a line of words, with what is free above and below them

// A name of so many letters at most, without its middle: names often differ at their ends alone.
function shortened(text, most) {
  const letters = [...text];
  return letters.length > most ? [...letters.slice(0, (most - 1) >> 1), "…", ...letters.slice(letters.length - (most >> 1))].join("") : text;
}

let numbers = 0;
const newId = (stem) => `${stem}-${++numbers}`;
const key = (colour) => (colour === "ink" ? "--key: var(--ink)" : `--key: var(--c${colour % 8})`);

function shown(value) {
  if (value === null || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(2);
  return String(Number(value.toPrecision(4)));
}

// A time in s, which may be counted from 1970.
const timeText = (seconds) => String(Number(seconds.toPrecision(Math.abs(seconds) < 1e5 ? 5 : 11)));

// A length in the unit that suits it, from metres.
function length(metres) {
  const size = Math.abs(metres);
  if (!Number.isFinite(size)) return "–";
  if (size < 1e-3) return `${shown(metres * 1e6)} µm`;
  if (size < 0.1) return `${shown(metres * 1e3)} mm`;
  return size < 1e4 ? `${shown(metres)} m` : `${shown(metres / 1e3)} km`;
}

function linearTicks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= raw);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) ticks.push(k * step);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const most = Math.max(Math.abs(low), Math.abs(high));
  const far = most >= 1e11 || (most < 1e-3 && most > 0);
  const text = (value) => (far ? String(Number(value.toPrecision(2)).toExponential()) : value.toFixed(Math.min(digits, 9)));
  return ticks.map((value) => ({ value, text: text(value) }));
}

function logTicks(low, high) {
  if (high / low < 10) return linearTicks(low, high, 6);
  const ticks = [], from = Math.floor(Math.log10(low)), to = Math.ceil(Math.log10(high));
  const few = to - from <= 3, each = Math.ceil((to - from) / 8);
  for (let power = from; power <= to; power += 1) {
    for (const digit of few ? [1, 2, 5] : [1]) {
      const value = digit * 10 ** power;
      if (value < low * 0.999 || value > high * 1.001 || (power - from) % each) continue;
      ticks.push({ value, text: value >= 1e-3 && value < 1e5 ? String(Number(value.toPrecision(1))) : `${digit}e${power}` });
    }
  }
  return ticks;
}

// Where a value stands between two pixels, on a linear or logarithmic axis, and back.
function axisOf(low, high, from, to, log) {
  const f = log ? Math.log10 : (value) => value, back = log ? (value) => 10 ** value : (value) => value;
  const a = f(low), b = f(high);
  return {
    low, high, log,
    at: (value) => from + ((f(value) - a) / (b - a)) * (to - from),
    value: (pixel) => back(a + ((pixel - from) / (to - from)) * (b - a)),
    ticks: (count) => (log ? logTicks(low, high) : linearTicks(low, high, count)),
  };
}

// The ticks of a horizontal axis, at most `most` or so, whose words do not touch, and where each word has its middle.
function ticksBelow(axis, most, width) {
  const half = (text) => (text.length * LETTER) / 2;
  const placed = (count) => axis.ticks(count).map(({ value, text }) =>
    ({ value, text, x: axis.at(value), middle: Math.min(axis.at(value), width - half(text)) }));
  const fits = (one, next) => next.middle - half(next.text) >= one.middle + half(one.text) + 6;
  for (let count = most; count > 1; count -= 1) {
    const ticks = placed(count);
    if (ticks.every((one, k) => k === 0 || fits(ticks[k - 1], one))) return ticks;
  }
  return placed(1).reduce((kept, one) => (kept.length && !fits(kept[kept.length - 1], one) ? kept : [...kept, one]), []);
}

// The index of the value nearest to x in ascending numbers.
function nearest(values, x) {
  let low = 0, high = values.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle;
    else high = middle;
  }
  return Math.abs(values[high] - x) < Math.abs(values[low] - x) ? high : low;
}

// The time that scene and charts show.
const clock = {
  time: null,
  listeners: [],
  set(time) {
    this.time = time;
    for (const listener of this.listeners) listener(time);
  },
  follow(listener) {
    this.listeners.push(listener);
    if (this.time !== null) listener(this.time);
  },
};

function head(part, level) {
  return [el(`h${level}`, { text: part.title }), ...(part.about ? [el("p", { class: "about", text: part.about })] : [])];
}
