// What a page offers beyond reading: contents that follow, filters, units, tables to sort and copy, figures to zoom.
// Without this script the page is whole. It fetches nothing, stores nothing and changes no number but by its unit.
"use strict";

const all = (selector, within = document) => [...within.querySelectorAll(selector)];
const tools = document.querySelector(".tools");

function make(tag, attributes = {}, ...inner) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...inner);
  return element;
}

function button(text, act, attributes = {}) {
  const made = make("button", { type: "button", class: "plain", ...attributes }, text);
  made.addEventListener("click", act);
  return made;
}

// ---- Numbers as the page writes them: a true minus sign, powers of ten in superscript -------------------------

const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const NUMBER = /[−-]?\d+(?:\.\d+)?(?:×10⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)?/g;

function lowered(power) {
  return Number([...power].map((c) => (c === "⁻" ? "-" : RAISED.indexOf(c))).join(""));
}

function parseNumber(text) {
  const [mantissa, power] = text.replace("−", "-").split("×10");
  return Number(mantissa) * 10 ** (power ? lowered(power) : 0);
}

/** Return a number in another unit, written so that its last digit says at least as much as it did. */
function convertNumber(text, exact, factor) {
  const [mantissa, power] = text.split("×10");
  const place = (power ? lowered(power) : 0) - (mantissa.split(".")[1] || "").length;
  const last = Math.floor(place + Math.log10(factor) + 1e-9), value = exact * factor;
  const exponent = value ? Math.floor(Math.log10(Math.abs(value))) : 0;
  let written = value.toFixed(Math.max(0, -last));
  if (exponent < -4 || exponent >= 6) {
    const raised = [...String(exponent)].map((c) => (c === "-" ? "⁻" : RAISED[c])).join("");
    written = `${(value / 10 ** exponent).toFixed(Math.max(0, exponent - last))}×10${raised}`;
  }
  return Number(written.split("×")[0]) ? written.replace("-", "−") : "0";
}

// ---- Units: numbers in tables and facts change, figures and sentences stay SI and say so ----------------------

const US = { m: [1 / 0.3048, "ft"], N: [1 / 4.4482216152605, "lbf"], kg: [1 / 14.593902937206, "slug"] };

const UNITS = new Set(["m", "N", "kg", "s", "rad", "deg", "rpm", "V", "A", "W", "Hz"]);

function inUs(unit) {
  const tokens = unit.match(/[A-Za-z°%√]+|⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+|-?\d+|[()/]/g) || [];
  if (!tokens.some((t) => US[t])) return null;
  let i = 0;
  const product = (sign) => {
    let factor = 1, over = false;
    for (; i < tokens.length && tokens[i] !== ")"; i++) {
      const token = tokens[i];
      if (token === "/") { over = true; continue; }
      const way = over ? -sign : sign;
      over = false;
      if (token === "(") { i++; factor *= product(way); continue; }
      const next = tokens[i + 1] || "";
      const power = /^-?\d+$/.test(next) ? Number(next) : /^⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+$/.test(next) ? lowered(next) : 1;
      if (US[token]) factor *= US[token][0] ** (way * power);
    }
    return factor;
  };
  return { factor: product(1), unit: unit.replace(/[A-Za-z]+/g, (word) => (US[word] ? US[word][1] : word)) };
}

const bracketed = (text) => (text.trim().match(/\(((?:[^()]|\([^()]*\))*)\)$/) || [])[1] || "";
const texts = (element) => {
  const walker = document.createTreeWalker(element, NodeFilter.SHOW_TEXT), found = [];
  while (walker.nextNode()) found.push(walker.currentNode);
  return found;
};
const conversions = new Map(); // of text nodes: text in SI, and in US units

function convert(node, change) {
  const [si, us] = conversions.get(node) || [node.data, node.data];
  if (change(us) !== us) conversions.set(node, [si, change(us)]);
}

function convertNumbers(element, factor) {
  for (const node of texts(element)) {
    const exact = node.parentElement.tagName === "DATA" ? Number(node.parentElement.value) : NaN;
    convert(node, (shown) => shown.replace(NUMBER, (text) =>
      convertNumber(text, Number.isNaN(exact) ? parseNumber(text) : exact, factor)));
    if (!Number.isNaN(exact)) node.parentElement.factor = factor;
  }
}

function convertUnit(element, from, to) {
  for (const node of texts(element)) convert(node, (shown) => shown.replace(from, to));
}

function findConversions() {
  for (const table of all("table")) {
    const heads = headsOf(table), rows = bodyRows(table);
    const unitColumn = heads.findIndex((head) => head && labelOf(head) === "Unit");
    for (const head of new Set(heads.filter(Boolean))) {
      const us = inUs(bracketed(head.textContent));
      if (!us) continue;
      convertUnit(head, `(${bracketed(head.textContent)})`, `(${us.unit})`);
      const column = heads.indexOf(head);
      for (const row of rows) for (let c = column; heads[c] === head; c++) {
        const cell = cellsOf(row)[c];
        if (cell) convertNumbers(cell, us.factor);
      }
    }
    if (unitColumn < 0) continue;
    for (const row of rows) {
      const cells = cellsOf(row), us = cells[unitColumn] && inUs(cells[unitColumn].textContent.trim());
      if (!us) continue;
      convertUnit(cells[unitColumn], cells[unitColumn].textContent.trim(), us.unit);
      new Set(cells.filter((_, c) => heads[c] && heads[c].classList.contains("si"))).forEach((cell) =>
        convertNumbers(cell, us.factor));
    }
  }
  // Elsewhere numbers that are followed by their unit and by nothing else, such as 6.1 to 21.3 m/s.
  for (const place of all("td, .facts dd")) {
    const parts = place.textContent.trim().match(/^([−\d](?:[^A-Za-z]|to |and )*) ([A-Za-z][A-Za-z\d ()/²³⁻¹√]*)$/);
    const us = parts && parts[2].match(/[A-Za-z]+/g).every((word) => UNITS.has(word)) && inUs(parts[2]);
    if (!us) continue;
    convertNumbers(place, us.factor);
    convertUnit(place, parts[2], us.unit);
  }
  for (const figure of all("figure"))
    if (all("svg text", figure).some((text) => inUs(bracketed(text.textContent))))
      figure.querySelector("figcaption").append(
        make("span", { class: "si-note", hidden: "" }, " The figure is in SI units: 1 m = 3.281 ft, 1 N = 0.2248 lbf, 1 kg = 0.06852 slug."));
}

function useUnits(system) {
  if (!document.documentElement.dataset.units) findConversions();
  document.documentElement.dataset.units = system;
  for (const [node, [si, us]] of conversions) node.data = system === "us" ? us : si;
  for (const note of all(".si-note")) note.hidden = system !== "us";
}

// ---- Tables: which head a cell stands below, sorting, copying, an address for every number ---------------------

const headCache = new Map();

/** Return by column the lowest head cell above it. */
function headsOf(table) {
  if (headCache.has(table)) return headCache.get(table);
  const grid = [];
  all("thead tr", table).forEach((row, r) => {
    let c = 0;
    for (const cell of row.cells) {
      while (grid[r] && grid[r][c]) c++;
      for (let i = r; i < r + cell.rowSpan; i++)
        for (let j = c; j < c + cell.colSpan; j++) (grid[i] = grid[i] || [])[j] = cell;
      c += cell.colSpan;
    }
  });
  const heads = grid.length ? grid[grid.length - 1] : [];
  headCache.set(table, heads);
  return heads;
}

function bodyRows(table) {
  return [...table.tBodies].flatMap((body) => [...body.rows]);
}

/** Return a row's cells by column; one that spans several stands at each. */
function cellsOf(row) {
  return [...row.cells].flatMap((cell) => Array(cell.colSpan).fill(cell));
}

/** Return what a head is about: without its unit, its note and marks of sorting. */
function labelOf(head) {
  if (!head) return "";
  const copy = head.cloneNode(true);
  all(".quiet", copy).forEach((quiet) => quiet.remove());
  return copy.textContent.replace(/\u00ad/g, "").replace(/\s*\([^)]*\)+\s*$/, "").replace(/\s+/g, " ").trim();
}

function sortValue(cell) {
  if (!cell) return null;
  const exact = cell.querySelector("data"), text = cell.textContent.replace(/\u00ad/g, "").trim();
  if (exact) return Number(exact.value);
  if (!text || text === "–") return null;
  const number = text.match(NUMBER);
  return number && text.startsWith(number[0]) ? parseNumber(number[0]) : text;
}

function sortBy(table, head) {
  const rows = bodyRows(table), column = headsOf(table).indexOf(head);
  rows.forEach((row, i) => { row.place ??= i; });
  const way = { ascending: "descending", descending: "" }[head.getAttribute("aria-sort")] ?? "ascending";
  all("th[aria-sort]", table).forEach((other) => other.removeAttribute("aria-sort"));
  if (way) head.setAttribute("aria-sort", way);
  const keys = new Map(rows.map((row) => [row, way ? sortValue(cellsOf(row)[column]) : row.place]));
  const last = (row) => (row.classList.contains("bias") ? 2 : keys.get(row) === null ? 1 : 0);
  rows.sort((one, other) => {
    const a = keys.get(one), b = keys.get(other);
    if (last(one) !== last(other)) return last(one) - last(other);
    const order = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
    return (way === "descending" ? -order : order) || one.place - other.place;
  });
  rows.forEach((row) => row.parentElement.append(row));
}

/** Return the shown part of a table as comma-separated values, numbers in full where the page knows them. */
function csvOf(table) {
  const us = document.documentElement.dataset.units === "us";
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text);
  const plain = (text) => text.replace(/\u00ad/g, "").replace(/[↑↓]/g, "").replace(/−/g, "-").replace(/×10(⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)/g, (_, p) => `e${lowered(p)}`).replace(/^–$/, "").replace(/\s+/g, " ").trim();
  const seen = (cell) => cell && !cell.classList.contains("filtered");
  const value = (cell) => {
    const copy = cell.cloneNode(true), shown = all("data", cell);
    all("br", copy).forEach((br) => br.replaceWith(" "));
    all("data", copy).forEach((data, i) => data.replaceWith(String(data.value * ((us && shown[i].factor) || 1))));
    return quoted(plain(copy.textContent));
  };
  const heads = headsOf(table);
  const first = heads.map((head, c) => {
    const over = groupsOf(table).find((group) => c >= group.from && c < group.from + group.span);
    return seen(head) && quoted([over, head].filter(Boolean).map((part) => plain(part.textContent)).join(" "));
  }).filter((name) => name !== false && name !== undefined);
  const rows = bodyRows(table).filter((row) => !row.classList.contains("filtered")).map((row) => cellsOf(row).filter(seen).map(value));
  return [first, ...rows].map((row) => row.join(",")).join("\n") + "\n";
}

const slug = (text) => text.toLowerCase().replace(/[^\p{L}\p{N}²]+/gu, "-").replace(/^-|-$/g, "");

/** Return the addresses of a table's cells, which hold as long as its heads do. */
function addresses(table) {
  const heads = headsOf(table), used = {}, found = new Map();
  const rows = bodyRows(table).map((row, i) => [row, row.place ?? i]).sort((a, b) => a[1] - b[1]);
  for (const [row] of rows) cellsOf(row).forEach((cell, c) => {
    const base = [table.id, slug(labelOf(row.cells[0])), slug(labelOf(heads[c])) || c].join("/");
    used[base] = (used[base] || 0) + 1;
    if (!found.has(cell)) found.set(cell, used[base] > 1 ? `${base}~${used[base]}` : base);
  });
  return found;
}

function pick(cell) {
  all(".found").forEach((other) => { other.classList.remove("found"); other.tabIndex = -1; });
  cell.classList.add("found");
  cell.tabIndex = 0;
  const table = cell.closest("table"), row = cell.parentElement;
  history.replaceState(null, "", `#${encodeURI(addresses(table).get(cell))}`);
  const exact = all("data", cell).map((data) => data.value).join(" / ");
  const where = [labelOf(row.cells[0]), labelOf(headsOf(table)[cellsOf(row).indexOf(cell)])].filter(Boolean).join(", ");
  say("cell", `${where}: ${exact ? `${exact} in full${document.documentElement.dataset.units === "us" ? ", SI" : ""}` : cell.textContent.trim()}`,
    button("Copy link", () => copy(location.href, "Link copied.")), button("Close", () => say("cell")));
}

function moveIn(event) {
  const cell = event.target.closest("td, tbody th");
  const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
  if (!cell || !(step || event.key === "Enter")) return;
  event.preventDefault();
  if (event.key === "Enter") { pick(cell); return; }
  const rows = bodyRows(cell.closest("table")).filter((row) => !row.classList.contains("filtered"));
  const row = rows[rows.indexOf(cell.parentElement) + step[0]];
  let to = row && row.cells[cell.cellIndex + step[1]];
  while (to && to.classList.contains("filtered")) to = row.cells[to.cellIndex + (step[1] || 1)];
  if (!to) return;
  cell.tabIndex = -1;
  to.tabIndex = 0;
  to.focus();
}

function prepareTables() {
  const counts = {};
  for (const table of all("table")) {
    const home = table.closest("section[id]")?.id || "table";
    counts[home] = (counts[home] || 0) + 1;
    table.id ||= `${home}.${counts[home]}`;
    const rows = bodyRows(table), heads = headsOf(table);
    if (!rows.length || !heads.length) continue;
    if (rows.length > 1 && rows.every((row) => [...row.cells].every((cell) => cell.rowSpan === 1)))
      for (const head of new Set(heads)) {
        if (!head || head.colSpan > 1 || !head.textContent.trim()) continue;
        const press = make("button", { type: "button", class: "sort", title: "Sort" }, ...head.childNodes);
        press.addEventListener("click", () => sortBy(table, head));
        head.replaceChildren(press);
      }
    rows[0].cells[0].tabIndex = 0;
    table.addEventListener("keydown", moveIn);
    table.addEventListener("click", (event) => {
      const cell = event.target.closest("td");
      if (cell && !event.target.closest("a, button") && !String(getSelection())) pick(cell);
    });
    if (!table.classList.contains("signs")) // lines to sign on
      table.after(button("Copy as CSV", () => copy(csvOf(table), "Table copied as CSV."), { class: "plain csv" }));
  }
}

// ---- What the page says back, at its lower edge ------------------------------------------------------------------

const bar = make("div", { class: "bar", role: "status", hidden: "" });
const said = new Map();

function say(about, text, ...buttons) {
  if (text) said.set(about, [text, ...buttons]); else said.delete(about);
  bar.replaceChildren(...[...said.values()].map((parts) => make("span", {}, ...parts.flatMap((part) => [part, " "]))));
  bar.hidden = !said.size;
}

let forgetting;
async function copy(text, done) {
  try {
    await navigator.clipboard.writeText(text);
  } catch { // an old browser, or a page that may not: copy from a field that nobody sees
    const field = make("textarea", { style: "position: fixed; opacity: 0" });
    field.value = text;
    document.body.append(field);
    field.select();
    if (!document.execCommand("copy")) done = "This browser does not let the page copy.";
    field.remove();
  }
  say("copied", done);
  clearTimeout(forgetting);
  forgetting = setTimeout(() => say("copied"), 2500);
}

// ---- Filter by response and condition -----------------------------------------------------------------------------

const KINDS = { response: "Only responses", condition: "Only conditions" };
const chosen = { response: new Set(), condition: new Set() };
/** Return the names that an element is marked with: a list, or one name as it is. */
function namesOf(element, kind) {
  const marked = element.dataset[kind] || "[]";
  try { return JSON.parse(marked).map(String); } catch { return [marked]; }
}

const known = { response: [], condition: [] };

function prepareFilter() {
  const filter = tools.querySelector(".filter");
  for (const kind of Object.keys(KINDS)) {
    known[kind] = [...new Set(all(`[data-${kind}]`).flatMap((element) => namesOf(element, kind)))];
    if (known[kind].length < 2) { known[kind] = []; continue; }
    const boxes = known[kind].map((name) => {
      const box = make("input", { type: "checkbox", name: kind, value: name });
      box.addEventListener("change", () => { chosen[kind][box.checked ? "add" : "delete"](name); applyFilter(); });
      return make("label", {}, box, ` ${name}`);
    });
    filter.append(make("fieldset", {}, make("legend", {}, KINDS[kind]), ...boxes));
    filter.hidden = false;
  }
}

function applyFilter() {
  const out = (kind, names) => chosen[kind].size > 0 && names.length > 0 && !names.some((name) => chosen[kind].has(name));
  const outByName = (name) => Object.keys(KINDS).some((kind) => known[kind].includes(name) && out(kind, [name]));
  for (const element of all("[data-response], [data-condition]")) {
    const hidden = Object.keys(KINDS).some((kind) => out(kind, namesOf(element, kind)));
    element.classList.toggle("filtered", hidden);
    if (element.tagName === "DETAILS" && !hidden && chosen.condition.size) element.open = true;
  }
  for (const table of all("table")) {
    const heads = headsOf(table), dropped = heads.map((head) => head && outByName(labelOf(head)));
    heads.forEach((head, c) => head && head.classList.toggle("filtered", Boolean(dropped[c])));
    for (const group of groupsOf(table)) {
      const left = heads.slice(group.from, group.from + group.span).filter((head) => !head.classList.contains("filtered")).length;
      group.classList.toggle("filtered", !left);
      if (left) group.colSpan = left;
    }
    for (const row of bodyRows(table)) {
      const marked = row.matches("[data-response], [data-condition]") && row.classList.contains("filtered");
      const hidden = marked || outByName(labelOf(row.cells[0]));
      row.classList.toggle("filtered", hidden);
      if (row.cells.length === heads.length)
        heads.forEach((_, c) => row.cells[c].classList.toggle("filtered", Boolean(dropped[c])));
    }
  }
  const hiddenOf = (selector) => all(selector).filter((element) => element.closest(".filtered")).length;
  const shown = Object.keys(KINDS).map((kind) => [...chosen[kind]].join(", ")).filter(Boolean).join(" at ");
  say("filter", shown && `Filtered: only ${shown}; ${hiddenOf("main figure")} figures and ${hiddenOf("tbody tr")} rows are hidden.`, button("Show all", clearFilter));
}

/** Return the heads that span several others, with the columns that they span. */
function groupsOf(table) {
  const heads = headsOf(table);
  table.groups ??= all("thead th", table).filter((head) => head.colSpan > 1 && !heads.includes(head));
  for (const group of table.groups) {
    group.span ??= group.colSpan;
    group.from ??= [...group.parentElement.cells].slice(0, group.cellIndex).reduce((sum, cell) => sum + cell.colSpan, 0);
  }
  return table.groups;
}

function clearFilter() {
  for (const kind of Object.keys(KINDS)) chosen[kind].clear();
  all("fieldset input", tools).forEach((box) => { box.checked = false; });
  applyFilter();
}

// ---- Figures: enlarge, save, link, and zoom where the axis is time -----------------------------------------------

const dialog = make("dialog", { "aria-label": "Enlarged figure" });
let standIn = null;

function enlarge(figure) {
  standIn = make("div", { style: `height: ${figure.offsetHeight}px` });
  figure.replaceWith(standIn);
  dialog.append(figure);
  dialog.showModal();
}

function shrink() {
  const figure = dialog.querySelector("figure");
  if (figure) standIn.replaceWith(figure);
}

function saveSvg(figure) {
  const svg = figure.querySelector("svg").cloneNode(true);
  const [, , width, height] = svg.getAttribute("viewBox").split(" ");
  const label = svg.getAttribute("aria-label");
  for (const [name, value] of Object.entries({ xmlns: "http://www.w3.org/2000/svg", width: `${width}pt`, height: `${height}pt`, "font-family": "Arial, Helvetica, sans-serif" })) svg.setAttribute(name, value);
  svg.removeAttribute("style");
  svg.removeAttribute("class");
  const part = (tag, attributes, text = "") => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.textContent = text;
    return element;
  };
  svg.prepend(part("title", {}, label), part("rect", { width, height, fill: "#ffffff" }));
  const file = URL.createObjectURL(new Blob([new XMLSerializer().serializeToString(svg)], { type: "image/svg+xml" }));
  const link = make("a", { href: file, download: `${figure.id.replace(/^figure-/, "") || "figure"}.svg` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(file), 10000);
}

/** Return a panel over time: its place, its span, and the lines in it as points. */
function panelOf(group) {
  const [from, to] = group.dataset.span.split(" ").map(Number);
  const clipped = all("[clip-path]", group).filter((element) => !element.closest(".x, .y"));
  const frame = document.getElementById((clipped[0] || group.querySelector("[clip-path]")).getAttribute("clip-path").slice(5, -1)).firstElementChild;
  const [left, top, width, height] = ["x", "y", "width", "height"].map((name) => Number(frame.getAttribute(name)));
  const lines = clipped.filter((element) => element.tagName === "path" && !/[cq]/.test(element.getAttribute("d")))
    .map((path) => ({ path, drawn: path.getAttribute("d"), parts: pointsOf(path.getAttribute("d")) }));
  const marks = clipped.flatMap((element) => (element.tagName === "use" ? [element] : all("use", element)))
    .map((mark) => ({ mark, x: Number(mark.getAttribute("x")) }));
  const label = group.querySelector(".x .tick text");
  return { group, from, to, left, top, width, height, lines, marks, label };
}

/** Return the points of path data that begin with M and go on with relative l, part by part. */
function pointsOf(data) {
  return data.split(/(?=M)/).map((part) => {
    const closed = part.endsWith("z"), numbers = part.match(/-?(?:\d+\.?\d*|\.\d+)/g).map(Number), points = [];
    for (let i = 0, x = 0, y = 0; i < numbers.length; i += 2) points.push([(x += numbers[i]), (y += numbers[i + 1])]);
    return { closed, points };
  });
}

function ticksBetween(low, high) {
  const rough = (high - low) / 5, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push([k * step, (k * step).toFixed(digits).replace("-", "−")]);
  return found;
}

/** Show of every panel the stretch from a to b, as shares of its whole span. */
function showStretch(svg, a, b) {
  svg.panels ??= all("g.time", svg).map(panelOf);
  const width = Math.min(1, Math.max(b - a, 1e-3));
  a = Math.min(Math.max(a, 0), 1 - width);
  const whole = width > 0.9999;
  svg.stretch = [a, a + width];
  svg.classList.toggle("zoomed", !whole);
  for (const panel of svg.panels) {
    const at = (x) => panel.left + (x - panel.left - a * panel.width) / width;
    for (const { path, drawn, parts } of panel.lines)
      path.setAttribute("d", whole ? drawn : parts.map(({ closed, points }) => `M${points.map(([x, y]) => `${at(x).toFixed(2)} ${y.toFixed(2)}`).join("L")}${closed ? "z" : ""}`).join(""));
    for (const { mark, x } of panel.marks) mark.setAttribute("x", whole ? x : at(x).toFixed(2));
    panel.group.querySelector(".zoomed-ticks")?.remove();
    for (const tick of all(".x .tick", panel.group))
      if (whole) tick.removeAttribute("display"); else tick.setAttribute("display", "none");
    if (!whole) panel.group.querySelector(".x").append(drawTicks(panel, at, a, width));
  }
}

function drawTicks(panel, at, a, width) {
  const svgPart = (tag, attributes) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  };
  const ticks = svgPart("g", { class: "zoomed-ticks" }), span = panel.to - panel.from, foot = panel.top + panel.height;
  for (const [time, text] of ticksBetween(panel.from + a * span, panel.from + (a + width) * span)) {
    const x = at(panel.left + ((time - panel.from) / span) * panel.width).toFixed(2);
    ticks.append(svgPart("path", { d: `M${x} ${panel.top}V${foot}`, stroke: "#e6e6e6", "stroke-width": 0.6 }));
    ticks.append(svgPart("path", { d: `M${x} ${foot}v2.5`, stroke: "#8c8c8c", "stroke-width": 0.6 }));
    if (!panel.label) continue;
    const label = svgPart("text", { x, y: panel.label.getAttribute("y"), "text-anchor": "middle" });
    label.textContent = text;
    ticks.append(label);
  }
  return ticks;
}

function zoomBy(svg, factor, about = 0.5) {
  const [a, b] = svg.stretch || [0, 1], width = (b - a) / factor, centre = a + about * (b - a);
  showStretch(svg, centre - about * width, centre + (1 - about) * width);
}

function panBy(svg, share) {
  const [a, b] = svg.stretch || [0, 1], step = share * (b - a);
  showStretch(svg, Math.max(0, a + step), Math.max(0, a + step) + (b - a));
}

/** Let a pointer choose a stretch, push what is zoomed, and a wheel with Ctrl zoom. */
function followPointer(svg) {
  const place = (event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  const panelAt = (p) => {
    svg.panels ??= all("g.time", svg).map(panelOf);
    return svg.panels.find((panel) => p.x >= panel.left && p.x <= panel.left + panel.width && p.y >= panel.top - 2 && p.y <= panel.top + panel.height + 2);
  };
  let start = null;
  svg.addEventListener("pointerdown", (event) => {
    const p = place(event), panel = panelAt(p);
    const pushing = event.shiftKey || event.pointerType === "touch";
    if (!panel || event.button || (event.pointerType === "touch" && !svg.classList.contains("zoomed"))) return;
    const band = document.createElementNS("http://www.w3.org/2000/svg", "rect");
    start = { p, panel, pushing, band, stretch: svg.stretch || [0, 1] };
    if (!pushing) svg.append(band);
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  svg.addEventListener("pointermove", (event) => {
    if (!start) return;
    const p = place(event), { panel, band, stretch: [a, b] } = start;
    if (start.pushing) {
      const from = Math.max(0, a - ((p.x - start.p.x) / panel.width) * (b - a));
      showStretch(svg, from, from + (b - a));
      return;
    }
    const [low, high] = [start.p.x, p.x].sort((x, y) => x - y);
    for (const [name, value] of Object.entries({ x: low, width: high - low, y: panel.top, height: panel.height, "fill-opacity": 0.15 })) band.setAttribute(name, value);
  });
  const finish = (event) => {
    if (!start) return;
    const { p: from, panel, pushing, band, stretch: [a, b] } = start, to = place(event);
    start = null;
    band.remove();
    if (pushing || event.type === "pointercancel" || Math.abs(to.x - from.x) < 4) return;
    const [low, high] = [from.x, to.x].map((x) => a + (Math.min(Math.max(x - panel.left, 0), panel.width) / panel.width) * (b - a)).sort((x, y) => x - y);
    showStretch(svg, low, high);
  };
  svg.addEventListener("pointerup", finish);
  svg.addEventListener("pointercancel", finish);
  svg.addEventListener("dblclick", () => showStretch(svg, 0, 1));
  svg.addEventListener("wheel", (event) => {
    const panel = event.ctrlKey && panelAt(place(event));
    if (!panel) return;
    event.preventDefault();
    zoomBy(svg, Math.exp(-event.deltaY / 300), (place(event).x - panel.left) / panel.width);
  }, { passive: false });
}

function prepareFigures() {
  for (const figure of all("figure")) {
    const svg = figure.querySelector("svg"), name = svg.getAttribute("aria-label");
    const link = make("a", { href: `#${figure.id}`, class: "plain" }, "Link");
    link.addEventListener("click", () => setTimeout(() => copy(location.href, "Link copied.")));
    const keys = make("div", { class: "keys", role: "group", "aria-label": name },
      button("Enlarge", () => enlarge(figure)), button("Save as SVG", () => saveSvg(figure)), link);
    if (svg.querySelector("g.time")) {
      const step = (text, label, act) => button(text, act, { "aria-label": label, title: label, class: "step" });
      keys.append(make("span", {}, "Time ", step("+", "Zoom in", () => zoomBy(svg, 2)), " ", step("−", "Zoom out", () => zoomBy(svg, 0.5)), " ",
        step("‹", "Earlier", () => panBy(svg, -0.5)), " ", step("›", "Later", () => panBy(svg, 0.5)), " ", step("All", "Whole span", () => showStretch(svg, 0, 1))));
      followPointer(svg);
    }
    figure.append(keys);
  }
  dialog.prepend(button("Close", () => dialog.close(), { class: "close", autofocus: "" }));
  dialog.addEventListener("close", shrink);
}

// ---- Sections: addresses, contents that follow the scroll, details, print ----------------------------------------

function prepareSections() {
  for (const heading of all("main h2, main h3, main h4, main h5, main details")) {
    const section = heading.closest("section[id]");
    if (!section) continue;
    const text = heading.tagName === "DETAILS" ? heading.firstElementChild.textContent : heading.textContent;
    const base = `${section.id}-${slug(text)}`;
    if (!heading.id && heading.tagName !== "H2") for (let n = 1; !heading.id; n++) {
      const id = n > 1 ? `${base}-${n}` : base;
      if (!document.getElementById(id)) heading.id = id;
    }
    if (heading.tagName === "DETAILS") heading.firstElementChild.after(hereLink(heading.id));
    else heading.append(hereLink(heading.id || section.id));
  }
  for (const wide of all("main .equation, main pre")) wide.tabIndex = 0; // keys scroll it
  for (const item of all(".findings li[id]")) item.append(hereLink(item.id));
}

function hereLink(id) {
  return make("a", { class: "here", href: `#${id}`, "aria-label": "Link to this place" }, "#");
}

function followScroll() {
  const links = all("nav a").map((link) => [link, document.getElementById(link.hash.slice(1))]).filter(([, target]) => target);
  const strip = document.querySelector("nav"), side = document.querySelector(".side");
  let waiting = false;
  const mark = () => {
    waiting = false;
    const edge = innerHeight * 0.3;
    let now = links[0];
    for (const one of links) if (one[1].getBoundingClientRect().top <= edge) now = one;
    if (scrollY + innerHeight >= document.documentElement.scrollHeight - 2) now = links[links.length - 1];
    for (const [link] of links) if (now && link === now[0]) link.setAttribute("aria-current", "true"); else link.removeAttribute("aria-current");
    if (now && strip.scrollWidth > strip.clientWidth) strip.scrollLeft = now[0].offsetLeft - strip.clientWidth / 3;
    if (now && side.scrollHeight > side.clientHeight) side.scrollTop = now[0].offsetTop - side.clientHeight / 3;
  };
  addEventListener("scroll", () => { if (!waiting) { waiting = true; requestAnimationFrame(mark); } }, { passive: true });
  mark();
}

/** Go where the address says: open what hides it, and pick the cell if it names one. */
function arrive() {
  const address = decodeURI(location.hash.slice(1));
  if (!address) return;
  const table = document.getElementById(address.split("/")[0]);
  const cell = address.includes("/") && table && [...addresses(table)].find(([, own]) => own === address)?.[0];
  const target = cell || document.getElementById(address);
  if (!target) return;
  for (let place = target; place; place = place.parentElement) if (place.tagName === "DETAILS") place.open = true;
  target.scrollIntoView({ block: cell ? "center" : "start" });
  if (cell) pick(cell);
}

function prepareDetails() {
  const press = tools.elements.details;
  press.addEventListener("click", () => {
    const open = press.textContent.startsWith("Open");
    all("main details").forEach((part) => { part.open = open; });
    press.textContent = open ? "Close all details" : "Open all details";
  });
  press.hidden = !document.querySelector("main details");
  let closed = [];
  addEventListener("beforeprint", () => { closed = all("main details:not([open])"); closed.forEach((part) => { part.open = true; }); });
  addEventListener("afterprint", () => closed.forEach((part) => { part.open = false; }));
}

tools.hidden = false;
tools.addEventListener("submit", (event) => event.preventDefault());
tools.elements.units.addEventListener("change", (event) => useUnits(event.target.value));
tools.elements.theme.addEventListener("change", (event) => { document.documentElement.dataset.theme = event.target.value; });
tools.elements.print.addEventListener("click", () => print());
prepareSections();
prepareTables();
prepareFilter();
prepareFigures();
prepareDetails();
document.body.append(bar, dialog);
followScroll();
addEventListener("hashchange", arrive);
arrive();
performance.mark("ready");
