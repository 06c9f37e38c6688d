"use strict";
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const columns = new Map(data.columns.map((column) => [column.name, column]));
const count = data.status.length;
const all = Array.from({ length: count }, (_, index) => index);
const complete = all.filter((index) => data.status[index] === "complete");
const VALUES_MAX = 12; // of an axis, in the sheet and as colours; more are put into bins
const BINS = 6, BARS = 24, LOG_FROM = 50, LISTED = 10, FLOW_MAX = 240;
const PALETTE = ["#3b7ddd", "#e07b00", "#159d74", "#c94f9b", "#8b6fd6", "#a38200", "#cf4a3c", "#5b8a9e"];
const RAMP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];

// ---- small things

const byId = (id) => document.getElementById(id);

function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  return fill(element, attributes, children);
}

function draw(name, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

function fill(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

function show(value) {
  if (value === null || value === undefined) return "none";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value) && Math.abs(value) < 1e6) return String(value);
  return String(Number(value.toPrecision(4))).replace("-", "−");
}

const isNumber = (value) => typeof value === "number";
const titleOf = (column) => (column.unit ? `${column.name} [${column.unit}]` : column.name);
const ofGroup = (group) => data.columns.filter((column) => column.group === group);
const distinct = (values) => [...new Set(values.filter((value) => value !== null))];

function ordered(values) {
  return values.every(isNumber) ? values.sort((a, b) => a - b) : values;
}

// ---- scales

function makeScale(values, from, to) {
  const numbers = values.filter(isNumber);
  let low = numbers.reduce((a, b) => Math.min(a, b), Infinity);
  let high = numbers.reduce((a, b) => Math.max(a, b), -Infinity);
  if (low === high) {
    const room = Math.abs(low) / 2 || 1;
    [low, high] = [low - room, high + room];
  }
  const isLog = low > 0 && high / low > LOG_FROM;
  const place = isLog ? Math.log : (value) => value;
  const back = isLog ? Math.exp : (value) => value;
  const [start, end] = [place(low), place(high)];
  const scale = (value) => from + ((place(value) - start) / (end - start)) * (to - from);
  scale.invert = (position) => back(start + ((position - from) / (to - from)) * (end - start));
  scale.ticks = isLog ? logTicks(low, high) : linearTicks(low, high);
  return scale;
}

function linearTicks(low, high) {
  const rough = (high - low) / 6;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= rough);
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) ticks.push(i * step);
  return ticks;
}

function logTicks(low, high) {
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) ticks.push(10 ** power);
  const inside = ticks.filter((tick) => tick >= low * 0.999 && tick <= high * 1.001);
  const step = Math.ceil(inside.length / 5);
  return inside.length > 1 ? inside.filter((_, i) => i % step === 0) : [low, high];
}

// ---- an axis as a few classes, each with the samples that are in it

function classesOf(name) {
  const column = columns.get(name);
  const found = column.grid ? [...column.grid] : ordered(distinct(column.values));
  const none = column.values.includes(null) ? [{ label: "none", has: (value) => value === null }] : [];
  if (found.length <= VALUES_MAX || !found.every(isNumber)) {
    return [...found.map((value) => ({ label: show(value), has: (other) => other === value })), ...none];
  }
  const numbers = column.values.filter(isNumber).sort((a, b) => a - b);
  const edges = Array.from({ length: BINS + 1 }, (_, i) => numbers[Math.round((i / BINS) * (numbers.length - 1))]);
  const bins = edges.slice(1).map((high, i) => ({
    label: `${show(edges[i])} to ${show(high)}`,
    has: (value) => isNumber(value) && value <= high && (i === 0 || value > edges[i]),
  }));
  return [...bins, ...none];
}

function select(label, options, chosen, onchange) {
  const box = make("select", { onchange: () => onchange(box.value) });
  for (const [value, text] of options) {
    const option = make("option", { value }, text);
    option.selected = value === chosen;
    box.append(option);
  }
  return make("label", {}, label, box);
}

// ---- pictures

function thumbnail(index) {
  return make("img", { src: data.thumbnails[index], alt: `sample ${index}`, loading: "lazy" });
}

function captionOf(index) {
  const parts = ofGroup("axis").map((column) => `${column.name} ${show(column.values[index])}`);
  return `sample ${index}${parts.length ? ": " : ""}${parts.join(", ")}`;
}

function cellOf(indices) {
  if (!indices.length) return make("span", { class: "cell" });
  const done = indices.filter((index) => data.status[index] === "complete");
  const pictured = done.filter((index) => index in data.thumbnails);
  const index = [...pictured, ...done, ...indices][0];
  const walk = [index, ...indices.filter((other) => other !== index)];
  const words = data.status[index] === "complete" ? `sample ${index}` : data.status[index];
  const what = index in data.thumbnails ? thumbnail(index) : words;
  const cell = make(
    "button",
    { type: "button", class: `cell ${data.status[index]}`, title: captionOf(index), onclick: () => open(index, walk) },
    what,
  );
  if (data.status[index] !== "complete") cell.setAttribute("aria-label", `${captionOf(index)}, ${data.status[index]}`);
  if (indices.length > 1) cell.append(make("span", { class: "more" }, `+${indices.length - 1}`));
  return cell;
}

const sheet = { rows: "", columns: "", kept: {} };

function startSheet() {
  const swept = ofGroup("axis").filter((column) => distinct(column.values).length > 1);
  const size = (column) => classesOf(column.name).length;
  const bySize = [...swept].sort((a, b) => size(b) - size(a));
  if (bySize.length > 1) {
    sheet.columns = bySize[0].name;
    sheet.rows = bySize[1].name;
  }
  drawControls(swept);
  drawSheet();
}

function drawControls(swept) {
  const names = swept.map((column) => [column.name, titleOf(column)]);
  const form = byId("sheet-controls");
  const redraw = () => { drawControls(swept); drawSheet(); };
  const choose = (edge, other) => (value) => {
    if (value && sheet[other] === value) sheet[other] = sheet[edge];
    sheet[edge] = value;
    redraw();
  };
  const kept = [...swept, { name: "split", unit: "" }].filter(({ name }) => name !== sheet.rows && name !== sheet.columns);
  const focused = document.activeElement?.closest("label")?.firstChild?.textContent;
  form.replaceChildren(
    select("Down", [["", "nothing"], ...names], sheet.rows, choose("rows", "columns")),
    select("Across", [["", "nothing"], ...names], sheet.columns, choose("columns", "rows")),
    ...kept.filter(({ name }) => distinct(columns.get(name).values).length > 1).map((column) => {
      const options = classesOf(column.name).map(({ label }, i) => [String(i), label]);
      return select(titleOf(column), [["", "all"], ...options], sheet.kept[column.name] ?? "", (value) => {
        sheet.kept[column.name] = value;
        redraw();
      });
    }),
  );
  // Drawn anew, the control that was used keeps the keyboard's focus.
  for (const label of form.children) if (label.firstChild.textContent === focused) label.lastChild.focus();
}

function drawSheet() {
  let chosen = all;
  for (const [name, value] of Object.entries(sheet.kept)) {
    if (value === "" || value === undefined || name === sheet.rows || name === sheet.columns) continue;
    const { has } = classesOf(name)[Number(value)];
    chosen = chosen.filter((index) => has(columns.get(name).values[index]));
  }
  const box = byId("sheet");
  box.style.setProperty("--aspect", `${data.width} / ${data.height}`);
  const note = byId("sheet-note");
  if (!sheet.rows && !sheet.columns) {
    const pictured = chosen.filter((index) => index in data.thumbnails || data.status[index] !== "complete");
    const shown = pictured.slice(0, FLOW_MAX);
    box.style.gridTemplateColumns = "repeat(auto-fill, minmax(min(30%, 8rem), 1fr))";
    box.replaceChildren(...shown.map((index) => cellOf([index])));
    note.textContent = `${shown.length} of ${chosen.length} samples.`;
    return;
  }
  const down = sheet.rows ? classesOf(sheet.rows) : [null];
  const across = sheet.columns ? classesOf(sheet.columns) : [null];
  const head = down[0] ? "minmax(2.2rem, max-content) " : "";
  box.style.gridTemplateColumns = `${head}repeat(${across.length}, minmax(0, 1fr))`;
  const cells = [];
  if (across[0]) {
    if (down[0]) cells.push(make("span"));
    for (const { label } of across) cells.push(make("span", { class: "head" }, `${sheet.columns} ${label}`));
  }
  for (const row of down) {
    if (row) cells.push(make("span", { class: "head row" }, `${sheet.rows} ${row.label}`));
    const inRow = row ? chosen.filter((index) => row.has(columns.get(sheet.rows).values[index])) : chosen;
    for (const column of across) {
      cells.push(cellOf(column ? inRow.filter((index) => column.has(columns.get(sheet.columns).values[index])) : inRow));
    }
  }
  box.replaceChildren(...cells);
  const several = chosen.length > down.length * across.length;
  note.textContent = several
    ? "Where several samples share a place, the first is shown with the number of others; opened, it leads to them."
    : "";
}

// ---- histograms

function bars(column, indices) {
  const values = indices.map((index) => column.values[index]).filter((value) => value !== null);
  const found = ordered(distinct(values));
  if (!found.length) return null;
  const counted = (members) => ({ total: members.length });
  if (column.category || found.length <= VALUES_MAX || !found.every(isNumber)) {
    return { bins: found.map((value) => ({ label: show(value), ...counted(values.filter((v) => v === value)) })) };
  }
  const scale = makeScale(found, 0, BARS);
  const bins = Array.from({ length: BARS }, (_, i) => ({
    label: `${show(scale.invert(i))} to ${show(scale.invert(i + 1))}`,
    total: 0,
  }));
  for (const value of values) bins[Math.min(BARS - 1, Math.floor(scale(value)))].total += 1;
  return { bins, scale, median: values.sort((a, b) => a - b)[Math.floor(values.length / 2)] };
}

function histogram(column, indices) {
  const found = bars(column, indices);
  if (!found) return null;
  const [width, height, left, bottom, top] = [300, 140, 8, 18, 16];
  const most = Math.max(...found.bins.map(({ total }) => total));
  const step = (width - 2 * left) / found.bins.length;
  const picture = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "img" });
  found.bins.forEach(({ label, total }, i) => {
    const tall = (total / most) * (height - bottom - top);
    const gap = found.scale ? 0.5 : Math.min(4, step / 6);
    picture.append(
      draw(
        "rect",
        { class: "bar", x: left + i * step + gap, y: height - bottom - tall, width: step - 2 * gap, height: tall },
        draw("title", {}, `${label}: ${total} samples`),
      ),
    );
    if (!found.scale && (found.bins.length < 8 || i % 2 === 0)) {
      picture.append(draw("text", { x: left + (i + 0.5) * step, y: height - 4, "text-anchor": "middle" }, label));
    }
  });
  picture.append(draw("line", { class: "axis", x1: left, x2: width - left, y1: height - bottom, y2: height - bottom }));
  picture.append(draw("line", { class: "grid", x1: left, x2: width - left, y1: top, y2: top }));
  picture.append(draw("text", { x: width - left, y: top - 4, "text-anchor": "end" }, most.toLocaleString("en")));
  for (const tick of found.scale ? found.scale.ticks : []) {
    const x = left + found.scale(tick) * step;
    picture.append(draw("text", { x, y: height - 4, "text-anchor": ends(x, width) }, show(tick)));
  }
  const summary = found.scale ? `median ${show(found.median)}` : `${found.bins.length} values`;
  const name = `${titleOf(column)}: ${summary}, from ${found.bins[0].label} to ${found.bins.at(-1).label}`;
  picture.setAttribute("aria-label", name);
  const about = column.about || summary;
  return make("figure", {}, make("figcaption", {}, make("b", {}, titleOf(column)), " ", make("span", {}, about)), picture);
}

const ends = (x, width) => (x < 20 ? "start" : x > width - 20 ? "end" : "middle");

function drawHistograms() {
  const statistics = ofGroup("statistic");
  for (const [id, listed, indices] of [
    ["charts-parameter", [...ofGroup("axis"), ...ofGroup("label")], all],
    ["charts-statistic", statistics.filter((column) => column.main), complete],
    ["charts-more", statistics.filter((column) => !column.main), complete],
    ["charts-cost", ofGroup("reached"), complete],
  ]) {
    const varied = listed.filter((column) => distinct(column.values).length > 1);
    const drawn = varied.map((column) => histogram(column, indices)).filter(Boolean);
    byId(id).replaceChildren(...(drawn.length ? drawn : [make("p", { class: "note" }, "Nothing that varies.")]));
  }
}

// ---- scatter of one number against another

const scatter = { x: "", y: "", colour: "", points: [], chosen: -1 };

function startScatter() {
  const numeric = data.columns.filter((column) => column.values.some(isNumber) && distinct(column.values).length > 1);
  const of = (group) => numeric.filter((column) => column.group === group).map((column) => column.name);
  if (numeric.length < 2) {
    byId("scatter").replaceChildren(make("p", { class: "note" }, "There are no two numbers that vary."));
    return;
  }
  const preferred = [...of("axis"), ...of("label"), ...of("statistic"), ...of("reached")];
  scatter.x = preferred[0];
  scatter.y = [...of("statistic"), ...preferred].find((name) => name !== scatter.x);
  const coloured = data.columns.filter((column) => distinct(column.values).length > 1);
  scatter.colour = ofGroup("axis").find((column) => column.name !== scatter.x && coloured.includes(column))?.name ?? "";
  const options = (list) => list.map((column) => [column.name, titleOf(column)]);
  const choose = (key) => (value) => { scatter[key] = value; drawScatter(); };
  byId("scatter-controls").replaceChildren(
    select("Across", options(numeric), scatter.x, choose("x")),
    select("Up", options(numeric), scatter.y, choose("y")),
    select("Colour", [["", "none"], ...options(coloured)], scatter.colour, choose("colour")),
  );
  byId("scatter").addEventListener("keydown", walkScatter);
  byId("scatter").addEventListener("click", (event) => {
    const index = event.target.dataset?.index;
    if (index !== undefined) open(Number(index), scatter.points.map((point) => point.index));
  });
  drawScatter();
}

function drawScatter() {
  const [x, y] = [columns.get(scatter.x), columns.get(scatter.y)];
  const indices = complete.filter((index) => isNumber(x.values[index]) && isNumber(y.values[index]));
  // As wide as it is shown, so that words keep their size on a narrow screen.
  const width = Math.max(280, Math.min(960, byId("scatter").clientWidth));
  const [height, left, right, top, bottom] = [Math.max(260, width * 0.5), 54, 12, 12, 40];
  const picture = draw("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
  if (!indices.length) {
    byId("scatter").replaceChildren(make("p", { class: "note" }, "No sample is there that has both."));
    return;
  }
  const across = makeScale(indices.map((index) => x.values[index]), left + 8, width - right - 8);
  const up = makeScale(indices.map((index) => y.values[index]), height - bottom - 8, top + 8);
  for (const tick of across.ticks) {
    const at = across(tick);
    picture.append(draw("line", { class: "grid", x1: at, x2: at, y1: top, y2: height - bottom }));
    picture.append(draw("text", { x: at, y: height - bottom + 15, "text-anchor": ends(at, width) }, show(tick)));
  }
  for (const tick of up.ticks) {
    const at = up(tick);
    picture.append(draw("line", { class: "grid", x1: left, x2: width - right, y1: at, y2: at }));
    picture.append(draw("text", { x: left - 6, y: at + 4, "text-anchor": "end" }, show(tick)));
  }
  picture.append(draw("text", { x: (left + width) / 2, y: height - 6, "text-anchor": "middle" }, titleOf(x)));
  picture.append(
    draw("text", { x: 12, y: height / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${height / 2})` }, titleOf(y)),
  );
  const colour = colourOf(scatter.colour, indices);
  const radius = indices.length > 2000 ? 2.2 : indices.length > 300 ? 3 : 4.5;
  scatter.chosen = -1;
  scatter.points = indices
    .map((index) => {
      const title = `${captionOf(index)}; ${y.name} ${show(y.values[index])}`;
      const circle = draw(
        "circle",
        { cx: across(x.values[index]), cy: up(y.values[index]), r: radius, fill: colour.of(index), "data-index": index },
        draw("title", {}, title),
      );
      return { index, circle, title };
    })
    .sort((a, b) => x.values[a.index] - x.values[b.index] || y.values[a.index] - y.values[b.index]);
  picture.append(...scatter.points.map((point) => point.circle));
  byId("scatter").replaceChildren(picture, ...colour.legend);
  byId("scatter-note").textContent = `${indices.length.toLocaleString("en")} samples.`;
}

function colourOf(name, indices) {
  if (!name) return { of: () => PALETTE[0], legend: [] };
  const column = columns.get(name);
  const found = ordered(distinct(indices.map((index) => column.values[index])));
  if (found.every(isNumber) && found.length > 1) {
    const scale = makeScale(found, 0, 1);
    const legend = make("p", { class: "legend" }, titleOf(column), make("span", {}, show(found[0]), rampBar(), show(found.at(-1))));
    return { of: (index) => (isNumber(column.values[index]) ? ramp(scale(column.values[index])) : "#888"), legend: [legend] };
  }
  const colours = new Map(found.map((value, i) => [value, PALETTE[i % PALETTE.length]]));
  const keys = found.slice(0, 2 * VALUES_MAX).map((value) =>
    make("span", {}, make("i", { style: `background: ${colours.get(value)}` }), show(value)));
  return {
    of: (index) => colours.get(column.values[index]) ?? "#888",
    legend: [make("p", { class: "legend" }, titleOf(column), ...keys)],
  };
}

function rampBar() {
  const stops = RAMP.map((_, i) => ramp(i / (RAMP.length - 1))).join(", ");
  return make("i", { class: "ramp", style: `background: linear-gradient(90deg, ${stops})` });
}

function ramp(share) {
  // Neither end is shown: the darkest is lost on a dark page, the brightest on a white one.
  const at = (0.12 + 0.78 * Math.min(1, Math.max(0, share))) * (RAMP.length - 1);
  const lower = Math.min(RAMP.length - 2, Math.floor(at));
  const mixed = RAMP[lower].map((value, i) => Math.round(value + (at - lower) * (RAMP[lower + 1][i] - value)));
  return `rgb(${mixed.join(" ")})`;
}

function walkScatter(event) {
  const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
  if (!scatter.points.length || (!step && event.key !== "Enter")) return;
  event.preventDefault();
  if (step) {
    scatter.points[scatter.chosen]?.circle.classList.remove("chosen");
    scatter.chosen = (scatter.chosen + step + scatter.points.length) % scatter.points.length;
    const { circle, title } = scatter.points[scatter.chosen];
    circle.classList.add("chosen");
    circle.parentNode.append(circle);
    byId("scatter-note").textContent = title;
  } else if (scatter.chosen >= 0) {
    open(scatter.points[scatter.chosen].index, scatter.points.map((point) => point.index));
  }
}

// ---- lists of samples

function sampleLink(index, walk) {
  const picture = index in data.thumbnails ? [thumbnail(index)] : [];
  return make("button", { type: "button", class: "sample-link", onclick: () => open(index, walk) }, ...picture, `sample ${index}`);
}

function table(heads, rows) {
  return make(
    "table",
    { class: "list" },
    make("thead", {}, make("tr", {}, ...heads.map((head) => make("th", { scope: "col" }, head)))),
    make("tbody", {}, ...rows.map((cells) => make("tr", {}, ...cells.map((cell) => make("td", {}, cell))))),
  );
}

function drawMost(id, name, title) {
  const column = columns.get(name);
  const indices = complete.filter((index) => isNumber(column?.values[index]));
  const most = indices.sort((a, b) => column.values[b] - column.values[a]).slice(0, LISTED);
  const rows = most.map((index) => [sampleLink(index, most), show(column.values[index]), sweptText(index)]);
  byId(id).replaceChildren(
    most.length ? table(["", title, "at"], rows) : make("p", { class: "note" }, "No sample is there."),
  );
}

function sweptText(index) {
  return ofGroup("axis").map((column) => `${column.name} ${show(column.values[index])}`).join(", ");
}

function attemptsOf(index) {
  const { attempts } = data.failures[index];
  return attempts === 1 ? "1 attempt" : `${attempts} attempts`;
}

function drawFailures() {
  const failed = all.filter((index) => data.status[index] === "failed");
  const rows = failed.map((index) => [
    sampleLink(index, failed), data.failures[index].reason, attemptsOf(index), sweptText(index),
  ]);
  byId("failure-list").replaceChildren(
    failed.length ? table(["", "reason", "after", "at"], rows) : make("p", { class: "note" }, "None."),
  );
}

// ---- one sample

const dialog = byId("sample");
let opened = 0, walked = [];

function open(index, walk) {
  [opened, walked] = [index, walk];
  drawSample();
  if (!dialog.open) dialog.showModal();
}

function step(by) {
  const at = walked.indexOf(opened) + by;
  if (at < 0 || at >= walked.length) return;
  opened = walked[at];
  drawSample();
}

function drawSample() {
  const at = walked.indexOf(opened);
  const place = walked.length > 1 ? ` (${at + 1} of ${walked.length})` : "";
  byId("sample-title").textContent = `Sample ${opened}${place}`;
  byId("previous").disabled = at <= 0;
  byId("next").disabled = at >= walked.length - 1;
  const words = data.command.replaceAll("{index}", opened).split(" ");
  const code = make("code", {}, ...words.flatMap((word) => [make("span", {}, word), " "]));
  const about = make(
    "div",
    {},
    make("h3", {}, "Render it again"),
    make("div", { class: "command" }, code, make("button", { type: "button", onclick: (event) => copy(code, event.target) }, "Copy")),
    ...stateOf(opened),
  );
  const parts = [make("div", { class: "about" }, ...pictureOf(opened), about)];
  parts.push(make("h3", {}, "Parameters"), valuesOf(["axis", "label"], data.constants));
  if (data.status[opened] === "complete") {
    parts.push(make("h3", {}, "Reached"), valuesOf(["reached"], []));
    if (ofGroup("statistic").length) {
      parts.push(make("details", {}, make("summary", {}, "Statistics of the image"), valuesOf(["statistic"], [])));
    }
  }
  byId("sample-body").replaceChildren(...parts);
}

function pictureOf(index) {
  if (!(index in data.thumbnails)) return [];
  const picture = thumbnail(index);
  picture.classList.add("picture");
  return [picture];
}

function stateOf(index) {
  if (data.status[index] === "failed") {
    return [make("h3", {}, `Failed after ${attemptsOf(index)}`), make("p", {}, data.failures[index].reason)];
  }
  if (data.status[index] === "missing") return [make("p", { class: "note" }, "This sample is not rendered yet.")];
  const folder = `data/${columns.get("split").values[index]}/${String(index).padStart(6, "0")}`;
  const files = data.base === null
    ? [make("span", { class: "path" }, folder)]
    : data.files.map((name) => make("a", { href: `${data.base}${folder}/${name}` }, `${folder}/${name}`));
  return [make("h3", {}, "Files"), ...files];
}

function valuesOf(groups, constants) {
  const rows = [
    ...groups.flatMap(ofGroup).map((column) => [titleOf(column), column.values[opened], column.about]),
    ...constants.map(({ name, value }) => [name, value, "the same in every sample"]),
  ];
  return make(
    "dl",
    { class: "values" },
    ...rows.map(([name, value, about]) =>
      make("div", about ? { title: about } : {}, make("dt", {}, name), make("dd", {}, show(value)))),
  );
}

async function copy(code, button) {
  getSelection().selectAllChildren(code);
  try {
    await navigator.clipboard.writeText(code.textContent.trim());
    button.textContent = "Copied";
  } catch {
    button.textContent = "Selected";  // where the browser keeps the clipboard from pages of the file system
  }
}

dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
dialog.addEventListener("keydown", (event) => {
  if (event.key === "ArrowLeft") step(-1);
  if (event.key === "ArrowRight") step(1);
});
byId("previous").addEventListener("click", () => step(-1));
byId("next").addEventListener("click", () => step(1));
byId("close").addEventListener("click", () => dialog.close());

startSheet();
drawHistograms();
startScatter();
drawMost("slowest", "render_seconds", "time [s]");
drawMost("noisiest", "standard_error", "relative error");
drawFailures();
let resized;
addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(() => scatter.x && drawScatter(), 150); });
})();
